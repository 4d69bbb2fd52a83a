"""Arc-length continuation: follows a path of equilibria through load maxima and snap-backs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..device.checks import below_one, count, one_of, positive
from ..device.schedules import Schedule
from ..interfaces import BuiltLaw, BuiltSolver, FrameSink, History, System
from ..interfaces.context import Context
from .newton import NOT_DONE, PRECONDITIONERS
from .path import Path

# Load factors up to which loads without a schedule go on in a straight line, either way.
FARTHEST = 10.0


@dataclass(frozen=True)
class ArcLength:
    """Arc-length continuation of static equilibrium, also where the load must decrease.

    The load factor s is an unknown in addition to the displacement: schedules are evaluated at the time s * duration,
    and loads without a schedule are multiplied by s, also for s < 0. The path begins at s = 0 and ends at s = 1 or -1,
    or, with a note, after `most_steps`. Every point of the path is a frame with the time s * duration, so frame times
    decrease where the load does. In the history, the column `load_factor` is s, and `unstable` is the number of
    negative eigenvalues of the tangent.

    The first point is found by Newton's method. From there each step moves along the tangent of the path, and Newton's
    method corrects it in the normal plane (Riks, J. Appl. Mech. 39 (1972) 1060-1065; Keller 1977). The step length is
    the root mean square of the displacement of all points. It is adapted to the number of corrector steps and to the
    error of the predicted load factor; a step that fails, or turns by more than 60 degrees, is halved.

    Stability follows from the signs of the pivots of the factorised tangent and, with displacement-dependent loads,
    from the lowest eigenvalues of K x = mu K0 x, where K0 excludes these loads. The summary (`solve`: `found`) and the
    notes report limit points, where the load turns, and bifurcations, where another eigenvalue changes sign. At a
    bifurcation the path continues on the same branch.

    Attributes:
        increment: Maximum change of the load factor in a step, and the load factor of the first point.
        tolerance: As for `Newton`.
        most_steps: Maximum number of points of the path.
        most_iterations: Number of corrector steps after which a step counts as failed.
        most_cuts: Maximum number of times that one step is halved.
        modes: Number of lowest eigenvalues to compute at every point; with 0 only limit points are found.
        preconditioner: As for `Newton`; "auto" is a sparse factorisation on the host up to 20 000 points, because the
            tangent has negative eigenvalues beyond a limit point. Without a factorisation stability is unknown.
    """

    increment: float = 0.1
    tolerance: float | None = None
    most_steps: int = 200
    most_iterations: int = 12
    most_cuts: int = 10
    modes: int = 3
    preconditioner: str = "auto"
    duration: float = 1.0
    precision: int = 64

    dynamic: ClassVar[bool] = False
    steps_explicitly: ClassVar[bool] = False
    equal_frames: ClassVar[bool] = False
    mass_damping: ClassVar[float | None] = None
    stiffness: ClassVar[str] = "tangent"

    def __post_init__(self) -> None:
        below_one("increment", self.increment)
        if self.tolerance is not None:
            below_one("tolerance", self.tolerance)
        positive("duration", self.duration)
        count("most_steps", self.most_steps, 1)
        count("most_iterations", self.most_iterations, 1)
        count("most_cuts", self.most_cuts, 0)
        count("modes", self.modes, 0)
        one_of("preconditioner", self.preconditioner, PRECONDITIONERS)

    @property
    def frame_count(self) -> int:
        """Maximum number of frames after the first, one per point."""
        return self.most_steps

    @property
    def default_ramp(self) -> Schedule:
        """Loads without a schedule are proportional to the load factor."""
        ends = np.array([-FARTHEST, FARTHEST])
        return Schedule(ends * self.duration, np.repeat(ends[:, None], 3, axis=1))

    def build(self, context: Context, law: BuiltLaw) -> BuiltSolver:
        """Build the solver on a device.

        Raises:
            InputError: if the law has no tangent.
        """
        return BuiltArcLength(self, context, law)


class BuiltArcLength(BuiltSolver):
    """Arc-length continuation on a device; it adds no launches to time steps."""

    label = "solver = ArcLength"
    turns = True
    path: Path

    def __init__(self, solver: ArcLength, context: Context, law: BuiltLaw) -> None:
        self.solver = solver
        self.tangent = law.tangent(context, True)

    def prepare(self, system: System) -> None:
        """Compose residual and tangent.

        Raises:
            InputError: for parts that static solvers do not support.
        """
        system.refuse_phases("ArcLength", NOT_DONE)
        self.path = Path(self.solver, system, self.tangent)

    def run(self, sink: FrameSink) -> str:
        """Follow the path, recording each point as a frame; return the final status."""
        return self.path.run(sink)

    def column_names(self) -> Sequence[str]:
        """Load factor, and number of negative eigenvalues if the tangent is factorised."""
        return ("load_factor", "unstable")

    def columns(self, totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """Load factor and number of negative eigenvalues [-], NaN if unknown."""
        state = self.path.state
        row = {"load_factor": state.factor}
        if self.solver.modes and self.path.preconditioner == "direct":
            unknown = state.step > 0 and state.negative is None
            row["unstable"] = np.nan if unknown else float(state.negative or 0)
        return row

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes on limit points, bifurcations, and a path that ended early."""
        state, said = self.path.state, []
        for found in state.found:
            where = (
                f"at load factor {found['load_factor']:.5g}, between steps {found['steps'][0]} and {found['steps'][1]}"
            )
            if found["kind"] == "bifurcation":
                number = found["eigenvalues"]
                what = (
                    "an eigenvalue of the tangent changes its" if number == 1 else f"{number} eigenvalues change their"
                )
                said.append(f"ArcLength: a bifurcation {where}: {what} sign while the load does not turn")
            else:
                said.append(f"ArcLength: a limit point {where}: a {found['kind']} of the load")
        if state.step == self.solver.most_steps and abs(state.factor) < 1.0:
            said.append(
                f"ArcLength: the path is followed for most_steps = {state.step}, to load factor {state.factor:.4g}"
            )
        return said

    def host_state(self) -> dict[str, Any]:
        """The state of the path."""
        return self.path.host_state()

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore the result of `host_state`."""
        self.path.restore(state)
