"""Interfaces between the parts of a simulation: protocols of parts, laws and solvers; frames.

Supports, loads, contact, rupture, force laws, solvers and writers implement the protocols.

A scene lists parts, which are small frozen dataclasses. Each part is built on a device and then adds its launches,
phase by phase (warp_pd/step.py). To write your own part, inherit from its protocol; optional methods have defaults. See
docs/write-your-own-part.md.
"""

from typing import TYPE_CHECKING

from ..device.lazy import lazy

if TYPE_CHECKING:
    from .built_part import BuiltPart, Columns, History, StepLimit
    from .frame import FrameReport, Writer
    from .law import BuiltLaw, Law
    from .part import (
        HELD,
        SLOPE,
        BuiltContact,
        BuiltLoad,
        BuiltRupture,
        Constraint,
        Contact,
        Load,
        Part,
        Rupture,
        Turn,
    )
    from .solver import BuiltSolver, DivergedError, FrameSink, Solver, System, UnbalancedError
else:
    __getattr__ = lazy(__name__)

__all__ = [
    "HELD",
    "SLOPE",
    "BuiltContact",
    "BuiltLaw",
    "BuiltLoad",
    "BuiltPart",
    "BuiltRupture",
    "BuiltSolver",
    "Columns",
    "Constraint",
    "Contact",
    "DivergedError",
    "FrameReport",
    "FrameSink",
    "History",
    "Law",
    "Load",
    "Part",
    "Rupture",
    "Solver",
    "StepLimit",
    "System",
    "Turn",
    "UnbalancedError",
    "Writer",
]
