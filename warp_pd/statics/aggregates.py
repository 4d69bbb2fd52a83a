"""Multigrid by smoothed aggregation, for sheets without a lattice.

PyAMG joins neighbouring points to aggregates, each with the six rigid motions of its present position (Vanek, Mandel
and Brezina, Computing 56 (1996) 179-196). The sweeps on the sheet itself run on the device, as those of lattices do;
the coarser levels are PyAMG's, on the host.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..device.fields import Array, assign, doubles
from .level import Level
from .multigrid import FEW_ITERATIONS, FEW_SAFETY, SWEEPS, Smoother

# Aggregates on the coarsest level at most, which is factorised.
MAX_COARSEST = 300
# Cycles of a solve up to which the next tangent keeps the aggregates; setting them up costs as much as ten cycles.
KEPT_CYCLES = 12
# All couplings count as strong: they reach two horizons, and an aggregate becomes a family. Weights by row sums need no
# estimate of the largest eigenvalue, which takes longer than everything else.
OPTIONS: dict[str, Any] = {
    "strength": ("symmetric", {"theta": 0.0}), "smooth": ("jacobi", {"weighting": "local"}),
    "improve_candidates": None, "coarse_solver": "splu", "max_coarse": MAX_COARSEST,
}  # fmt: skip


class Aggregates:
    """The V-cycle of one level."""

    def __init__(self, level: Level) -> None:
        self.level, self._smoother = level, Smoother(level)
        self._smoother.add_down(level.context.stage("down", "every V-cycle, downwards"))
        self._smoother.add_up(level.context.stage("up", "every V-cycle, upwards"))
        # Laws that coarsen store their tangent in blocks.
        self._sparse: Any = level.tangent.sparse()
        self._points = in_space(level.context.sheet.points)
        self._coarse: Any = None
        self._cycles = 0

    def prepare(self, keep: bool = False) -> bool:
        """Set up the aggregates for the present tangent; return whether they are usable.

        With `keep` those of an earlier tangent stay if its solve took few cycles.
        """
        if keep and self.usable and self._cycles <= KEPT_CYCLES:
            self._cycles = 0
            return True
        self._cycles = 0
        from pyamg import smoothed_aggregation_solver
        from pyamg.multilevel import MultilevelSolver

        level, self._coarse = self.level, None
        motions = rigid_motions(self._points + doubles(level.displacement))
        motions[~self._sparse.free] = 0.0
        levels = smoothed_aggregation_solver(self._sparse.whole(), motions, **OPTIONS).levels
        self._down, self._up = levels[0].R, levels[0].P
        coarse = MultilevelSolver(levels[1:], coarse_solver=OPTIONS["coarse_solver"])
        try:
            coarse.coarse_solver(levels[-1].A, np.zeros(levels[-1].A.shape[0]))
        except RuntimeError:
            return False
        self._coarse = coarse
        self._smoother.tune(self._smoother.largest_eigenvalue(FEW_ITERATIONS, FEW_SAFETY))
        return True

    @property
    def usable(self) -> bool:
        """Whether the coarsest level could be factorised."""
        return self._coarse is not None

    def sides(self, index: int) -> tuple[Array, Array]:
        """Right-hand side and solution of the V-cycle, (N,) vec3."""
        return self._smoother.right_side, self._smoother.solution

    def cycle(self, finest: int) -> None:
        """Run one V-cycle."""
        self._cycles += 1
        level, smoother = self.level, self._smoother
        level.run("down")
        # The image of the solution has the sign of the force: right-hand side minus K x.
        left = doubles(smoother.right_side) - level.image.numpy()
        found = self._up @ self._coarse.solve(self._down @ left.ravel(), tol=1e-30, maxiter=1)
        assign(smoother.solution, smoother.solution.numpy() + found.reshape(-1, 3))
        level.run("up")

    def products_per_cycle(self, finest: int) -> int:
        """Number of stiffness products of one V-cycle."""
        return 2 * SWEEPS


def in_space(points: np.ndarray) -> np.ndarray:
    """Points in space, shape (N, 3), of a sheet that may be flat."""
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


def rigid_motions(points: np.ndarray) -> np.ndarray:
    """Translations along and rotations about the three axes, of order one, shape (3 N, 6)."""
    x = points - points.mean(axis=0)
    axes = np.eye(3)
    turned = np.cross(axes[None], (x / np.abs(x).max())[:, None])
    moved = np.broadcast_to(axes, turned.shape)
    return np.concatenate([moved, turned], axis=1).transpose(0, 2, 1).reshape(-1, 6)
