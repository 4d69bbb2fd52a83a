"""Solvers, which compute displacements from forces; interfaces/solver.py defines their interface."""

from typing import TYPE_CHECKING

from ..device.lazy import lazy

if TYPE_CHECKING:
    from .any import Solver
else:
    __getattr__ = lazy(__name__, {"any": "Solver"})

__all__ = ["Solver"]
