"""The stable step of central differences, 2 / omega_max, by power iteration on the current state."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..loads import BoundaryForce

if TYPE_CHECKING:
    from ..simulation import Built

BLOCK = 256
# The trial displacement strains the worst bond by about this much: far above float32 round-off in the
# force, far below what would change the tangent.
TRIAL_STRAIN = 2e-3


class StableStep:
    """Estimates the largest natural frequency of the sheet as it is, supports included.

    One iteration applies M^-1 K to a direction by a central difference of the force. Its growth is a lower
    bound of omega_max^2 that rises towards it; the direction is kept, so that later estimates start near
    the answer, plus some noise, so that they can find a mode that is new.
    """

    def __init__(self, built: Built) -> None:
        import warp as wp

        from ..kernels.integrate import power_iteration

        self.built = built
        w, t, n = built.workspace, built.types, built.simulation.sheet.size
        owner = "stable step"
        self._noise = np.random.default_rng(0)
        self.direction = w.array("direction", owner, t.vec3, self._random())
        trial = w.array("trial", owner, t.vec3, shape=n)
        plus = w.array("force_plus", owner, t.vec3, shape=n)
        minus = w.array("force_minus", owner, t.vec3, shape=n)
        response = w.array("response", owner, t.vec3, shape=n)
        blocks = -(-n // BLOCK)
        sums = w.array("sums", owner, wp.float64, shape=(4, blocks))
        scale = w.array("scale", owner, t.real, shape=1)
        reach = TRIAL_STRAIN * built.simulation.sheet.spacing
        self._reach = w.array("reach", owner, t.real, np.array([reach]))
        self._squared = w.array("squared_frequency", owner, wp.float64, shape=2)
        self._trial, respond, summarise, renew = power_iteration(t.bits, w.module)
        for sign, force in ((1.0, plus), (-1.0, minus)):
            w.launch(
                "estimate", owner, self._trial, n,
                displacement=built.state.displacement, direction=self.direction, reach=self._reach, sign=sign,
                out=trial,
            )  # fmt: skip
            built.force.add_force("estimate", trial, force)
            # A boundary force is a stiffness too.
            for load in built.simulation.loads:
                if isinstance(load, BoundaryForce):
                    built.add_boundary_force("estimate", load, trial, force)
        w.launch(
            "estimate", owner, respond, blocks,
            mass=built.inertia, held_mask=built.held_mask, plus=plus, minus=minus, reach=self._reach,
            direction=self.direction, block=BLOCK, response=response, sums=sums,
        )  # fmt: skip
        w.launch("estimate", owner, summarise, 1, sums=sums, scale=scale, squared_frequency=self._squared)
        w.launch("estimate", owner, renew, n, response=response, scale=scale, direction=self.direction)
        self._sequence: Any = None

    def _random(self) -> np.ndarray:
        n, held = self.built.simulation.sheet.size, self.built.held
        noise = self._noise.uniform(-1.0, 1.0, (n, 3))
        for c in range(3):
            noise[(held & ((1 << c) | 8)) != 0, c] = 0.0
        return noise

    def noise_state(self) -> dict[str, Any]:
        """State of the generator of the noise, for a restart."""
        return dict(self._noise.bit_generator.state)

    def restore_noise(self, state: dict[str, Any]) -> None:
        """Put back what `noise_state` gave."""
        self._noise.bit_generator.state = state

    def omega(self, iterations: int, settle: float = 2e-3) -> float:
        """Estimate of omega_max [rad/s], at least two iterations, at most `iterations`.

        Ends early when ten iterations changed it by less than the share `settle`. Zero if nothing resists.
        """
        if self._sequence is None:
            self._sequence = self.built.workspace.sequence("estimate")
        old = self.direction.numpy().astype(np.float64)
        self.direction.assign((old + 0.05 * self._random()).astype(self.direction.numpy().dtype))
        before = 0.0
        for k in range(1, iterations + 1):
            self._sequence.run()
            if k % 10 == 0 or k == iterations:
                squared = float(self._squared.numpy()[1])
                if not np.isfinite(squared):
                    return float("nan")
                if abs(squared - before) <= settle * squared:
                    break
                before = squared
        return float(np.sqrt(squared))
