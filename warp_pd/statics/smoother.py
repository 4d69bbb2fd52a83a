"""Chebyshev sweeps of block Jacobi over the points of a level, the smoother of multigrid."""

from __future__ import annotations

import math

import numpy as np

from ..device.fields import assign
from ..device.launches import Stage
from .level import OWNER, Level

# Sweeps before and after the coarse correction, and the ratio of the largest to the smallest eigenvalue of D^-1 K
# that they smooth.
SWEEPS = 2
SPECTRUM_RATIO = 5.0
# Steps of the power iteration and safety factor of its result; fewer steps on a large sheet, where each is expensive.
POWER_ITERATIONS, SAFETY = 12, 1.1
FEW_ITERATIONS, FEW_SAFETY = 6, 1.3


class Smoother:
    """The sweeps of one level.

    Attributes:
        right_side: Right-hand side of the V-cycle, (N,) vec3.
        solution: Its solution, (N,) vec3.
    """

    def __init__(self, level: Level) -> None:
        self.level = level
        context, t, n = level.context, level.context.types, level.points
        self.right_side = context.array("right_side", OWNER, t.vec3, shape=n)
        self.solution = context.array("correction", OWNER, t.vec3, shape=n)
        self._omegas = context.array("sweep_factors", OWNER, t.real, shape=SWEEPS, per="once")

    def add_down(self, stage: Stage) -> None:
        """Add the sweeps from zero, and the product of the solution into `image`."""
        for sweep in range(SWEEPS):
            self._sweep(stage, sweep, fresh=sweep == 0)
        self.level.add_product(stage, self.solution, self.level.image, following=False)

    def add_up(self, stage: Stage) -> None:
        """Add the sweeps after the coarse correction, in reverse order."""
        for sweep in reversed(range(SWEEPS)):
            self._sweep(stage, sweep, fresh=False)

    def _sweep(self, stage: Stage, sweep: int, fresh: bool) -> None:
        level = self.level
        if not fresh:
            level.add_product(stage, self.solution, level.image, following=False)
        stage.launch(
            OWNER, level.kernels.smooth, level.points,
            inverse_blocks=level.tangent.inverse_blocks, right_side=self.right_side, image=level.image,
            omegas=self._omegas, sweep=sweep, fresh=int(fresh), solution=self.solution,
        )  # fmt: skip

    def largest_eigenvalue(self, iterations: int = POWER_ITERATIONS, safety: float = SAFETY) -> float:
        """Estimated bound on the eigenvalues of D^-1 K, by power iteration."""
        level = self.level
        blocks = level.tangent.inverse_blocks.numpy().astype(np.float64)
        v = np.random.default_rng(0).normal(size=(level.points, 3))
        v /= math.sqrt(v.size)
        largest = 1.0
        for _ in range(iterations):
            assign(level.vector, v)
            level.run("product")
            v = np.einsum("iab,ib->ia", blocks, level.image.numpy().astype(np.float64))
            largest = math.sqrt(float(np.einsum("ic,ic->", v, v)))
            v /= largest
        return safety * largest

    def tune(self, largest: float) -> None:
        """Set the sweeps for the largest eigenvalue of D^-1 K."""
        angles = np.cos(np.pi * (2.0 * np.arange(SWEEPS) + 1.0) / (2.0 * SWEEPS))
        middle, half = 0.5 * largest * (1.0 + 1.0 / SPECTRUM_RATIO), 0.5 * largest * (1.0 - 1.0 / SPECTRUM_RATIO)
        assign(self._omegas, 1.0 / (middle + half * angles))
