"""Version of the package, for it and for what it imports."""

__version__ = "1.0.0"
