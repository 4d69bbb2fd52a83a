"""Solvers: how displacements follow from forces.

A solver is a frozen dataclass with these attributes and methods:
    duration, frame_count, precision, damping, adaptive_damping
    in_time             whether its steps are steps in time: then work and losses are summed up
    steps_explicitly    whether it needs the launches of an explicit step
    check(simulation)                       refuse parts that do not go with it
    inertia(built)                          what resists acceleration in an explicit step, (N,)
    add(built), add_before_kick(built)      add its arrays and launches
    march(built, recorder) -> status        run to the end, handing frames to the recorder
"""

from .explicit import Explicit
from .newton import Newton
from .relaxation import Relaxation

Solver = Explicit | Relaxation | Newton

__all__ = ["Explicit", "Newton", "Relaxation", "Solver"]
