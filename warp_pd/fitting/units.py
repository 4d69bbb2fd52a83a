"""Units in the headers of data files."""

from __future__ import annotations

from ..device.checks import InputError

# Factor to SI and dimension of each unit.
UNITS: dict[str, tuple[float, str]] = {
    "1": (1.0, "ratio"), "-": (1.0, "ratio"), "%": (0.01, "ratio"),
    "m": (1.0, "length"), "mm": (1e-3, "length"), "cm": (1e-2, "length"), "um": (1e-6, "length"),
    "µm": (1e-6, "length"), "in": (0.0254, "length"),
    "Pa": (1.0, "pressure"), "kPa": (1e3, "pressure"), "MPa": (1e6, "pressure"), "GPa": (1e9, "pressure"),
    "bar": (1e5, "pressure"), "mbar": (1e2, "pressure"), "psi": (6894.757293168, "pressure"),
    "mmHg": (133.322387415, "pressure"), "kg/cm^2": (98066.5, "pressure"), "N/mm^2": (1e6, "pressure"),
    "N": (1.0, "force"), "mN": (1e-3, "force"), "kN": (1e3, "force"), "gf": (9.80665e-3, "force"),
    "kgf": (9.80665, "force"), "lbf": (4.4482216152605, "force"),
    "s": (1.0, "time"), "ms": (1e-3, "time"), "min": (60.0, "time"), "h": (3600.0, "time"),
    "m^3": (1.0, "volume"), "l": (1e-3, "volume"), "ml": (1e-6, "volume"), "mm^3": (1e-9, "volume"),
    "J": (1.0, "energy"), "mJ": (1e-3, "energy"), "J/m^2": (1.0, "energy per area"),
    "kJ/m^2": (1e3, "energy per area"), "N/mm": (1e3, "energy per area"),
    "m/s": (1.0, "velocity"), "mm/s": (1e-3, "velocity"), "mm/min": (1e-3 / 60.0, "velocity"),
    "Hz": (1.0, "frequency"), "degrees": (1.0, "angle"), "deg": (1.0, "angle"),
}  # fmt: skip
# What the names of arguments of scenes say of their dimension; what is not listed is not checked.
DIMENSIONS = {
    "pressure": "pressure", "stretch": "ratio", "prestretch": "ratio", "strain": "ratio", "time": "time",
    "travel": "length", "extension": "length", "thickness": "length", "depth": "length", "force": "force",
    "mu": "pressure", "bulk": "pressure", "load_factor": "ratio",
}  # fmt: skip


def factor_and_dimension(column: str, unit: str) -> tuple[float, str]:
    """Factor to SI, and dimension.

    Raises:
        InputError: for a unit that is not known.
    """
    if unit not in UNITS:
        raise InputError(f"column {column!r}: unit [{unit}] is not known: expected one of {', '.join(UNITS)}")
    return UNITS[unit]


def dimension_of(unit: str) -> str | None:
    """Dimension of the SI unit of a measure; None for one that is not known."""
    return UNITS[unit][1] if unit in UNITS else None
