"""Solvers: how displacements follow from forces. See interfaces.py for what a solver has to offer."""

from .explicit import Explicit
from .newton import Newton
from .relaxation import Relaxation

Solver = Explicit | Relaxation | Newton

__all__ = ["Explicit", "Newton", "Relaxation", "Solver"]
