"""The stable step of central differences, 2 / omega_max, by power iteration at the current state."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import warp as wp

from ..device.fields import Array
from ..device.launches import Stage
from ..interfaces import System
from ..kernels.integrate import RIGID
from ..kernels.stable_step import power_iteration, shorten

BLOCK = 256
# Blocks up to which one thread sums all of them up: 4.2 million points.
MANY_BLOCKS = 2**14
# Blocks that a thread sums up then.
GROUP = 256
# The trial displacement strains the worst bond by about this much: far above float32 round-off in the
# force, far below what would change the tangent.
TRIAL_STRAIN = 2e-3
# Iterations between two looks at the estimate.
CHECKED_EVERY = 5
OWNER = "stable step"


class StableStep:
    """Estimates the largest natural frequency of the sheet in its current state, including supports and loads.

    One iteration applies M^-1 K to a direction by a central difference of the force. Its growth is a lower bound of
    omega_max^2 that rises towards it, four times as fast with momentum as without. Later estimates start from the last
    direction, plus some noise so that they can find new modes.
    """

    def __init__(self, system: System, inertia: Array) -> None:
        """Add the stage "estimate"; `inertia` is the true or fictitious mass, (N,)."""
        self.context = context = system.context
        types, n = context.types, context.sheet.size
        self._noise = np.random.default_rng(0)
        self.direction = context.array(
            "direction", OWNER, types.vec3, self._with_noise(1.0, None), restart=True, halo=True
        )
        self._earlier = context.array("earlier_direction", OWNER, types.vec3, shape=n)
        self._squared = context.array("squared_frequency", OWNER, wp.float64, shape=2, per="once")
        stage = context.stage("estimate", "each iteration of the stable step")
        self._add_iteration(stage, system, inertia)

    def _add_iteration(self, stage: Stage, system: System, inertia: Array) -> None:
        """Add the launches of one iteration: forces on both sides of the state, the response, the next direction."""
        context, direction, n = self.context, self.direction, self.context.sheet.size
        vec3, real = context.types.vec3, context.types.real
        # A displacement, the forces at it and at its negative, which becomes the response; sums of blocks of points;
        # 1 / largest response, fraction of the earlier direction, length of the displacement [m].
        trial, plus, response = (
            context.array(name, OWNER, vec3, shape=n) for name in ("trial", "force_plus", "response")
        )
        sums = context.array("sums", OWNER, wp.float64, shape=(4, context.own_blocks), per="block")
        scale, momentum = (context.array(name, OWNER, real, shape=1, per="once") for name in ("scale", "momentum"))
        reach = context.array("reach", OWNER, real, np.array([TRIAL_STRAIN * context.whole.spacing]), per="once")
        state, kernels = context.state, power_iteration(context.types.bits)
        for sign, force in ((1.0, plus), (-1.0, response)):
            stage.launch(
                OWNER, kernels.trial, n,
                displacement=state.displacement, direction=direction, reach=reach, sign=sign, out=trial,
            )  # fmt: skip
            system.law.add_force(stage, trial, force)
            system.external.add_following(stage, trial, force)
        arrays = {
            "mass": inertia, "held_mask": state.held_mask, "plus": plus, "direction": direction,
            "response": response,
        }  # fmt: skip
        context.launch_on_blocks(
            stage, OWNER, kernels.respond, arrays, {"sums": sums}, ["response"], reach=reach,
            block=BLOCK,
        )  # fmt: skip
        everything = self._in_groups(stage, context.all_blocks(stage, sums, "sums_of_all", OWNER))
        stage.launch(
            OWNER, kernels.summarise, 1, sums=everything, scale=scale, momentum=momentum,
            squared_frequency=self._squared,
        )  # fmt: skip
        stage.launch(
            OWNER, kernels.renew, n, response=response, scale=scale, momentum=momentum,
            earlier=self._earlier, direction=direction,
        )  # fmt: skip

    def _in_groups(self, stage: Stage, sums: Array) -> Array:
        """Add sums over groups of blocks if a single thread would take too long for all blocks."""
        if sums.shape[1] <= MANY_BLOCKS:
            return sums
        groups = -(-sums.shape[1] // GROUP)
        shorter = self.context.array("sums_of_groups", OWNER, wp.float64, shape=(4, groups), per="table")
        stage.launch(OWNER, shorten, groups, sums=sums, group=GROUP, shorter=shorter)
        return shorter

    def _with_noise(self, fraction: float, old: np.ndarray | None) -> np.ndarray:
        """`old` plus a fraction of noise for the local points, shape (n, 3), without noise in held components."""
        held, noise = self.context.held, self._draw()
        for c in range(3):
            noise[(held & ((1 << c) | RIGID)) != 0, c] = 0.0
        if old is not None:
            noise = old.astype(np.float64) + fraction * noise
        return noise.astype(wp.dtype_to_numpy(self.context.types.real))

    def _draw(self) -> np.ndarray:
        """Random numbers from -1 to 1 for the local points, shape (n, 3), the same on any number of processes."""
        partition, size = self.context.partition, self.context.whole.size
        begin, end = (0, size) if partition is None else (int(partition.points.min()), int(partition.points.max()) + 1)
        # The generator takes one step for a number.
        steps = np.random.PCG64()
        steps.state = self._noise.bit_generator.state  # type: ignore[assignment]
        steps.advance(3 * begin)
        drawn = np.random.Generator(steps).uniform(-1.0, 1.0, (end - begin, 3))
        self._noise.bit_generator.advance(3 * size)  # type: ignore[attr-defined]
        return drawn if partition is None else drawn[partition.points - begin]

    def host_state(self) -> dict[str, Any]:
        """State of the random generator, for a restart."""
        return dict(self._noise.bit_generator.state)

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore the result of `host_state`."""
        self._noise.bit_generator.state = state

    def omega(self, iterations: int, accuracy: float = 2e-3) -> float:
        """Estimate omega_max [rad/s] in at least two and at most `iterations` iterations.

        It ends early when five iterations changed the estimate by less than the fraction `accuracy`. The result is zero
        without stiffness.
        """
        self.direction.assign(self._with_noise(0.05, self.direction.numpy()))
        self._earlier.zero_()
        sequence = self.context.sequence("estimate")
        before = squared = 0.0
        for k in range(1, iterations + 1):
            sequence.run()
            if k % CHECKED_EVERY == 0 or k == iterations:
                squared = float(self._squared.numpy()[1])
                if not np.isfinite(squared):
                    return float("nan")
                if abs(squared - before) <= accuracy * squared:
                    break
                before = squared
        return float(np.sqrt(squared))
