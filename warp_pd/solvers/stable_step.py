"""The stable step of central differences, 2 / omega_max, by power iteration on the current state."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import warp as wp

from ..device.fields import Array
from ..interfaces import System
from ..kernels.integrate import RIGID
from ..kernels.stable_step import power_iteration

BLOCK = 256
# The trial displacement strains the worst bond by about this much: far above float32 round-off in the
# force, far below what would change the tangent.
TRIAL_STRAIN = 2e-3
# Iterations between two looks at the estimate.
CHECKED_EVERY = 5
OWNER = "stable step"


class StableStep:
    """Estimates the largest natural frequency of the sheet as it is, supports and loads included.

    One iteration applies M^-1 K to a direction by a central difference of the force. Its growth is a lower bound of
    omega_max^2 that rises towards it, four times as fast with momentum as without. The direction is kept, so that
    later estimates start near the answer, plus some noise, so that they can find a mode that is new.
    """

    def __init__(self, system: System, inertia: Array) -> None:
        """Add the stage "estimate".

        Args:
            system: The sheet with its law and parts.
            inertia: What resists acceleration, (N,).
        """
        self.context = context = system.context
        state, types, n = context.state, context.types, context.sheet.size
        self._noise = np.random.default_rng(0)
        self.direction = context.array("direction", OWNER, types.vec3, self._random(), restart=True, halo=True)
        trial = context.array("trial", OWNER, types.vec3, shape=n)
        plus = context.array("force_plus", OWNER, types.vec3, shape=n)
        response = context.array("response", OWNER, types.vec3, shape=n)
        self._earlier = context.array("earlier_direction", OWNER, types.vec3, shape=n)
        sums = context.array("sums", OWNER, wp.float64, shape=(4, context.own_blocks), per="block")
        scale = context.array("scale", OWNER, types.real, shape=1, per="once")
        momentum = context.array("momentum", OWNER, types.real, shape=1, per="once")
        reach = context.array(
            "reach", OWNER, types.real, np.array([TRIAL_STRAIN * context.whole.spacing]), per="once"
        )  # fmt: skip
        self._squared = context.array("squared_frequency", OWNER, wp.float64, shape=2, per="once")
        kernels = power_iteration(types.bits, context.module)
        stage = context.stage("estimate", "each iteration of the stable step")
        for sign, force in ((1.0, plus), (-1.0, response)):
            stage.launch(
                OWNER, kernels.trial, n,
                displacement=state.displacement, direction=self.direction, reach=reach, sign=sign, out=trial,
            )  # fmt: skip
            system.law.add_force(stage, trial, force)
            system.external.add_following(stage, trial, force)
        arrays = {
            "mass": inertia, "held_mask": state.held_mask, "plus": plus, "direction": self.direction,
            "response": response,
        }  # fmt: skip
        context.launch_on_blocks(
            stage, OWNER, kernels.respond, arrays, {"sums": sums}, ["response"], reach=reach, block=BLOCK
        )
        everything = context.all_blocks(stage, sums, "sums_of_all", OWNER)
        stage.launch(
            OWNER, kernels.summarise, 1, sums=everything, scale=scale, momentum=momentum,
            squared_frequency=self._squared,
        )  # fmt: skip
        stage.launch(
            OWNER, kernels.renew, n, response=response, scale=scale, momentum=momentum, earlier=self._earlier,
            direction=self.direction,
        )  # fmt: skip

    def _random(self) -> np.ndarray:
        held, share = self.context.held, self.context.share
        noise = self._noise_at(None if share is None else share.points)
        for c in range(3):
            noise[(held & ((1 << c) | RIGID)) != 0, c] = 0.0
        return noise

    def _noise_at(self, points: np.ndarray | None) -> np.ndarray:
        """Random numbers from -1 to 1 of all points or some, shape (n, 3); those of a point are the same."""
        size = self.context.whole.size
        if points is None:
            return self._noise.uniform(-1.0, 1.0, (size, 3))
        # The generator takes one step for a number.
        begin, end = int(points.min()), int(points.max()) + 1
        steps = self._noise.bit_generator
        assert isinstance(steps, np.random.PCG64)
        steps.advance(3 * begin)
        found = self._noise.uniform(-1.0, 1.0, (end - begin, 3))
        steps.advance(3 * (size - end))
        return np.asarray(found[points - begin])

    def host_state(self) -> dict[str, Any]:
        """State of the generator of the noise, for a restart."""
        return dict(self._noise.bit_generator.state)

    def restore(self, state: Mapping[str, Any]) -> None:
        """Put back what `host_state` gave."""
        self._noise.bit_generator.state = state

    def omega(self, iterations: int, settle: float = 2e-3) -> float:
        """Estimate of omega_max [rad/s], at least two iterations, at most `iterations`.

        Ends early when five iterations changed it by less than the share `settle`. Zero if nothing resists.
        """
        old = self.direction.numpy().astype(np.float64)
        self.direction.assign((old + 0.05 * self._random()).astype(self.direction.numpy().dtype))
        self._earlier.zero_()
        sequence = self.context.sequence("estimate")
        before = squared = 0.0
        for k in range(1, iterations + 1):
            sequence.run()
            if k % CHECKED_EVERY == 0 or k == iterations:
                squared = float(self._squared.numpy()[1])
                if not np.isfinite(squared):
                    return float("nan")
                if abs(squared - before) <= settle * squared:
                    break
                before = squared
        return float(np.sqrt(squared))
