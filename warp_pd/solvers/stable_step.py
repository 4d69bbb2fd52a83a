"""The stable step of central differences, 2 / omega_max, by power iteration at the current state."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..device.fields import Array, assign
from ..device.launches import Stage
from ..interfaces import System
from ..kernels.effects import Kernel
from ..kernels.stable_step import PowerIteration, power_iteration
from ..kernels.threads import WARP

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
    direction, plus some noise so that they can find new modes; the first starts from noise alone.
    """

    def __init__(self, system: System, inertia: Array) -> None:
        """Add the stage "estimate"; `inertia` is the true or fictitious mass, (N,)."""
        self.context = context = system.context
        types, n = context.types, context.sheet.size
        self._estimates = 0
        self.direction = context.array("direction", OWNER, types.vec3, shape=n, restart=True, halo=True)
        self._earlier = context.array("earlier_direction", OWNER, types.vec3, shape=n)
        self._squared = context.array("squared_frequency", OWNER, wp.float64, shape=2, per="once")
        self._lanes = WARP if context.device.is_cuda else 1
        kernels = power_iteration(types.bits, self._lanes)
        self._add_noise(context.stage("noise", "each estimate of the stable step"), kernels.disturb)
        stage = context.stage("estimate", "each iteration of the stable step")
        self._add_iteration(stage, system, inertia, kernels)

    def _add_iteration(self, stage: Stage, system: System, inertia: Array, kernels: PowerIteration) -> None:
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
        state = context.state
        for sign, force in ((1.0, plus), (-1.0, response)):
            stage.launch(
                OWNER, kernels.trial, n,
                displacement=state.displacement, direction=direction, reach=reach, sign=sign, out=trial,
            )  # fmt: skip
            with stage.one_launch():
                system.law.add_force(stage, trial, force)
                system.external.add_following(stage, trial, force)
        arrays = {
            "mass": inertia, "held_mask": state.held_mask, "plus": plus, "direction": direction,
            "response": response,
        }  # fmt: skip
        context.launch_on_blocks(
            stage, OWNER, kernels.respond, arrays, {"sums": sums}, ["response"], self._lanes, reach=reach
        )  # fmt: skip
        everything = context.few_blocks(stage, sums, "sums_of_all", OWNER, maxima=1)
        stage.launch(
            OWNER, kernels.summarise, self._lanes, sums=everything, scale=scale, momentum=momentum,
            squared_frequency=self._squared,
        )  # fmt: skip
        stage.launch(
            OWNER, kernels.renew, n, response=response, scale=scale, momentum=momentum,
            earlier=self._earlier, direction=direction,
        )  # fmt: skip

    def disturb(self) -> None:
        """Add noise to the last direction, other noise in each estimate."""
        self._estimates += 1
        assign(self._seed, np.array([self._estimates]))
        self.context.sequence("noise").run()

    def _add_noise(self, stage: Stage, kernel: Kernel) -> None:
        """Add the launch that disturbs the direction; drawn on the host, noise took longer than the iterations."""
        context, partition = self.context, self.context.partition
        self._seed = context.array("seed", OWNER, wp.int32, shape=1, per="once")
        numbers = None
        if partition is not None:
            numbers = context.array("numbers", OWNER, wp.int32, partition.points.astype(np.int32))
        stage.launch(
            OWNER, kernel, context.sheet.size, held_mask=context.state.held_mask, numbers=numbers, seed=self._seed,
            earlier=self._earlier, direction=self.direction,
        )  # fmt: skip

    def host_state(self) -> int:
        """Number of estimates so far, for a restart."""
        return self._estimates

    def restore(self, state: int) -> None:
        """Restore the result of `host_state`."""
        self._estimates = state

    def omega(self, iterations: int, accuracy: float = 2e-3) -> float:
        """Estimate omega_max [rad/s] in at least two and at most `iterations` iterations.

        It ends early when five iterations changed the estimate by less than the fraction `accuracy`. The result is zero
        without stiffness.
        """
        self.disturb()
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
