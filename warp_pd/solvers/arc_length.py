"""Arc-length continuation: follows a path of equilibria through load maxima and snap-backs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.schedules import Schedule
from ..interfaces import BuiltLaw, BuiltSolver
from ..interfaces.context import Context
from .newton_settings import PathSettings
from .path import BuiltArcLength

# Load factors up to which loads without a schedule go on in a straight line, either way.
FARTHEST = 10.0


@dataclass(frozen=True, kw_only=True)
class ArcLength(PathSettings):
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
    notes report limit points, where the load turns, and bifurcations, where another eigenvalue changes sign. Both
    are points of the path. At a bifurcation the path continues on the same branch, or along the eigenvector (`switch`),
    corrected in the plane normal to it.

    Attributes:
        increment: Maximum change of the load factor in a step, and the load factor of the first point.
        tolerance: As for `Newton`.
        most_steps: Maximum number of points of the path.
        most_iterations: Number of corrector steps after which a step counts as failed.
        most_cuts: Maximum number of times that one step is halved.
        modes: Number of lowest eigenvalues to compute at every point; with 0 only limit points are found.
        switch: Number of the bifurcation, from 1, at which the path takes the other branch; 0 to stay on its branch.
        preconditioner: As for `Newton`; "auto" is a sparse factorisation on the host up to 20 000 points, because the
            tangent has negative eigenvalues beyond a limit point. Without a factorisation stability is unknown.
    """

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
        """Build the solver on a device."""
        return BuiltArcLength(self, context, law)
