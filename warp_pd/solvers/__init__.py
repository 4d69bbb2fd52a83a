"""Solvers, which compute displacements from forces; interfaces/solver.py defines their interface."""

from typing import TYPE_CHECKING

from ..device.lazy import lazy

if TYPE_CHECKING:
    from .any import Solver
    from .arc_length import ArcLength
    from .explicit import Explicit
    from .newton import Newton
    from .relaxation import Relaxation
else:
    __getattr__ = lazy(
        __name__,
        {
            "any": "Solver",
            "arc_length": "ArcLength",
            "explicit": "Explicit",
            "newton": "Newton",
            "relaxation": "Relaxation",
        },
    )

__all__ = ["ArcLength", "Explicit", "Newton", "Relaxation", "Solver"]
