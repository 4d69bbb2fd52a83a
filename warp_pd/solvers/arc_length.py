"""Arc-length continuation: a path of equilibria through maxima of the load and snap-backs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..device.schedules import Schedule
from ..interfaces import BuiltLaw, BuiltSolver, History, System
from ..interfaces.context import Context
from .newton import NOT_DONE
from .newton_settings import PathSettings
from .path import Path
from .static_system import BuiltStatic

# Load factors up to which loads without a schedule go on in a straight line, either way.
FARTHEST = 10.0


@dataclass(frozen=True, kw_only=True)
class ArcLength(PathSettings):
    """Follows static equilibrium along its path, wherever the load has to fall for that.

    Besides the displacement the load factor s is unknown: schedules are taken at the time s duration, loads without a
    schedule times s, also for s below 0. The path begins at s = 0 and ends at s = 1 or -1, or after `most_steps`, with
    a note. Every point is a frame, whose time is s duration; so the times of frames fall where the load does. Column
    `load_factor` of the history is s, and `unstable` the number of negative eigenvalues of the tangent.

    The first point is found by Newton's method. From there each step goes a length along the tangent of the path, and
    Newton's method corrects it on the plane across (Riks, J. Appl. Mech. 39 (1972) 1060-1065; Keller 1977). The length
    is the root mean square of the displacement of all points. It follows the number of corrector steps, and by how
    much the straight line missed the load factor; a step that fails, or turns by more than 60 degrees, is halved.

    Stability: signs of the pivots of the factorised tangent and, with loads that follow the displacement, lowest
    eigenvalues of K x = mu K0 x, K0 without these loads. The summary (`solve`: `found`) and notes name limit points,
    where the load turns, and bifurcations, where the sign of another eigenvalue changes; both are points of the path.
    At a bifurcation the path goes straight on, or along the eigenvector (`switch`), corrected on the plane across it.

    Attributes:
        increment: Largest change of the load factor in a step, and the load factor of the first point.
        tolerance: As of `Newton`.
        most_steps: Number of points.
        most_iterations: Corrector steps after which a step has failed.
        most_cuts: Number of times that one step is halved.
        modes: Number of lowest eigenvalues to find at every point; 0 finds limit points alone.
        switch: Number of the bifurcation at which the path takes the other branch, from 1; 0: it goes straight on.
        preconditioner: As of `Newton`; "auto" is a sparse factorisation on the host up to 20 000 points, since beyond a
            limit point the tangent has negative eigenvalues. Without a factorisation nothing is said of stability.
    """

    @property
    def frame_count(self) -> int:
        """One per point, at most."""
        return self.most_steps

    @property
    def default_ramp(self) -> Schedule:
        """Loads without a schedule are proportional to the load factor."""
        ends = np.array([-FARTHEST, FARTHEST])
        return Schedule(ends * self.duration, np.repeat(ends[:, None], 3, axis=1))

    def build(self, context: Context, law: BuiltLaw) -> BuiltSolver:
        """The solver on a device.

        Raises:
            InputError: for a law without a tangent.
        """
        return BuiltArcLength(self, context, law)


class BuiltArcLength(BuiltStatic):
    """Arc-length continuation on a device: adds nothing to a step in time."""

    label = "solver = ArcLength"
    turns = True
    search: Path

    def __init__(self, solver: ArcLength, context: Context, law: BuiltLaw) -> None:
        self.solver = solver
        self.tangent = law.tangent(context, True)

    def prepare(self, system: System) -> None:
        """Compose residual and tangent.

        Raises:
            InputError: for parts that static solvers do not know.
        """
        system.refuse_phases("ArcLength", NOT_DONE)
        self.search = Path(self.solver, system, self.tangent)

    def column_names(self) -> Sequence[str]:
        """Load factor, and number of negative eigenvalues if the tangent is factorised."""
        return ("load_factor", "unstable")

    def columns(self, totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """The same [-]; a number of eigenvalues that was not found is NaN."""
        state = self.search.state
        row = {"load_factor": state.factor}
        if self.solver.modes and self.search.preconditioner == "direct":
            unknown = state.step > 0 and state.negative is None
            row["unstable"] = np.nan if unknown else float(state.negative or 0)
        return row

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Limit points and bifurcations, and a path that was left before its end."""
        state, said = self.search.state, []
        for found in state.found:
            where = f"at load factor {found['load_factor']:.5g}, step {found['step']}"
            if found["kind"] == "bifurcation":
                number = found["eigenvalues"]
                what = (
                    "an eigenvalue of the tangent changes its" if number == 1 else f"{number} eigenvalues change their"
                )
                then = "; the path goes on along the other branch" if found["switched"] else ""
                said.append(f"ArcLength: a bifurcation {where}: {what} sign while the load does not turn{then}")
            else:
                said.append(f"ArcLength: a limit point {where}: a {found['kind']} of the load")
        if state.step == self.solver.most_steps and abs(state.factor) < 1.0:
            said.append(
                f"ArcLength: the path is followed for most_steps = {state.step}, to load factor {state.factor:.4g}"
            )
        return said
