"""Solvers: how displacements follow from forces."""

from .explicit import Explicit
from .quasi_static import QuasiStatic

Solver = Explicit | QuasiStatic

__all__ = ["Explicit", "QuasiStatic", "Solver"]
