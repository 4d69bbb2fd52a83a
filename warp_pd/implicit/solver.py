"""Implicit time steps: settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import ClassVar

from ..context import Context
from ..device.checks import InputError, below_one, count, not_negative, one_of, positive
from ..device.clock import Schedule
from ..interfaces import BuiltLaw, BuiltSolver
from ..solvers.stepping import FramesInTime
from ..statics.newton_settings import NewtonSettings


@dataclass(frozen=True)
class Implicit(FramesInTime, NewtonSettings):
    """Implicit time steps: generalised alpha (Chung and Hulbert 1993), each step solved as `Newton` does.

    Steps may be as long as the motion allows, since no wave limits them. The method takes the forces, tangents and
    internal variables of every law as they are, and damps what its steps do not resolve; energy-momentum methods need
    a stress of their own between two displacements, with an unsymmetric tangent, and damp nothing.

    Steps end at the knots of all schedules and at frames. Where Newton's method fails, a step is halved.

    Attributes:
        duration: Simulated time [s].
        frames: Number of equally spaced frames after the first one; or their increasing times [s], the last one equal
            to the duration.
        steps: Number of equal steps, or more where knots and frames divide them.
        tolerance: Error of the displacement in a step, over its largest so far (root mean squares), to which steps are
            adapted instead; 1e-4 is a good value.
        inertia: Whether the sheet has inertia. Without it and damping every step ends in equilibrium, for slow
            processes, and the run begins with that under the loads at time 0.
        radius: Spectral radius of the steps for the highest frequencies: 1 conserves, 0 damps in one step. By default
            0.8, and 0 with contact, which takes no other, and in a sheet that can tear: steps seldom resolve what its
            bonds release.
        damping: Mass damping c [1/s]: a force -c m v on every point.
        residual: Relative residual of a step; by default 1e-6 in float64 and 1e-4 in float32.
        history_every: Time between rows of `Result.fine_history` [s], recorded at the next step; None for none.
        most_iterations: Number of Newton steps after which a time step counts as failed.
        most_cuts: How many times a time step is halved at most.
        preconditioner: As for `Newton`.
    """

    duration: float
    frames: int | Sequence[float] = 100
    _: KW_ONLY
    steps: int | None = None
    inertia: bool = True
    radius: float | None = None
    damping: float = 0.0
    residual: float | None = None
    history_every: float | None = None
    most_cuts: int = 10

    dynamic: ClassVar[bool] = True
    steps_explicitly: ClassVar[bool] = False
    default_ramp: ClassVar[Schedule | None] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_frames()
        if (self.steps is None) == (self.tolerance is None):
            raise InputError(f"steps = {self.steps!r}, tolerance = {self.tolerance!r}: expected one of them")
        if self.steps is not None:
            count("steps", self.steps, 1)
        one_of("inertia", self.inertia, (True, False))
        if self.radius is not None and not 0.0 <= not_negative("radius", self.radius) <= 1.0:
            raise InputError(f"radius = {self.radius!r}: expected a number from 0 to 1")
        not_negative("damping", self.damping)
        if self.residual is not None:
            below_one("residual", self.residual)
        if self.history_every is not None:
            positive("history_every", self.history_every)

    def build(self, context: Context, law: BuiltLaw) -> BuiltSolver:
        """Build the solver on a device."""
        from .steps import BuiltImplicit

        return BuiltImplicit(self, context, law)
