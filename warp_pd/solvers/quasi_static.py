"""Rest under load: explicit steps with adaptive damping, until the residual is small."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..checks import count, positive
from .stable_step import BLOCK, StableStep

if TYPE_CHECKING:
    from ..runner import Recorder
    from ..simulation import Built

CHECK_EVERY = 50


@dataclass(frozen=True)
class QuasiStatic:
    """Dynamic relaxation: at every step, the damping is critical for the motion that is left.

    Schedules run in a load time from 0 to 1 (`duration`), over the first `ramp_steps` steps.

    Attributes:
        tolerance: Norm of the unbalanced force over the norm of loads and reactions at which the sheet is at
            rest; by default 1e-6 in float64 and 1e-4 in float32, whose round-off allows no better.
        ramp_steps: Steps over which the load time goes from 0 to its end.
        most_steps: Steps after which the run gives up, with status "not converged".
        safety: dt over the estimated stable step.
    """

    tolerance: float | None = None
    ramp_steps: int = 1
    most_steps: int = 200_000
    safety: float = 0.9
    duration: float = 1.0
    precision: int = 64
    damping = 0.0
    adaptive_damping = True
    frame_count = 1

    def __post_init__(self) -> None:
        if self.tolerance is not None:
            positive("tolerance", self.tolerance)
        positive("duration", self.duration)
        positive("safety", self.safety)
        count("ramp_steps", self.ramp_steps, 1)
        count("most_steps", self.most_steps, 1)

    def add_before_kick(self, built: Built) -> None:
        """Add the launches that set the damping of this step."""
        import warp as wp

        from ..kernels.integrate import adaptive_damping

        w, n, state = built.workspace, built.simulation.sheet.size, built.state
        measure_motion, set_damping = adaptive_damping(built.types.bits, w.module)
        blocks = -(-n // BLOCK)
        sums = w.array("motion_sums", "QuasiStatic", wp.float64, shape=(2, blocks))
        previous = w.array("previous_force", "QuasiStatic", built.types.vec3, shape=n)
        w.launch(
            "step", "QuasiStatic", measure_motion, blocks,
            mass=built.mass, held_mask=built.held_mask, velocity=state.velocity, force=state.force, block=BLOCK,
            previous=previous, sums=sums,
        )  # fmt: skip
        w.launch("step", "QuasiStatic", set_damping, 1, sums=sums, step=built.step, damping=built.damping)

    def add(self, built: Built) -> None:
        """Add the residual and the stable step."""
        import warp as wp

        w, n, state = built.workspace, built.simulation.sheet.size, built.state
        built.stable_step = StableStep(built)
        built.unbalanced = w.array("unbalanced", "QuasiStatic", wp.float64, shape=n)
        built.reaction = w.array("reaction", "QuasiStatic", wp.float64, shape=n)
        w.launch(
            "residual", "QuasiStatic", built.integration.residual, n,
            held_mask=built.held_mask, force=state.force, external=state.external,
            unbalanced=built.unbalanced, reaction=built.reaction,
        )  # fmt: skip

    def march(self, built: Built, recorder: Recorder) -> str:
        """Run to rest; hands the last state to the recorder as frame 1; returns the final status."""
        if recorder.frame_index >= 1:
            return "finished"
        steps, residual_launches = built.workspace.sequence("step", repeat=10), built.workspace.sequence("residual")
        tolerance = self.tolerance or (1e-6 if built.types.bits == 64 else 1e-4)
        done, residual, dt = 0, math.inf, 0.0
        while done < self.most_steps:
            if done % (6 * CHECK_EVERY) == 0 or done < self.ramp_steps:
                dt = self._set_step(built, recorder, 60 if done == 0 else 10)
            for _ in range(CHECK_EVERY // 10):
                steps.run()
            done += CHECK_EVERY
            residual_launches.run()
            residual = self._residual(built)
            recorder.progress(done, residual, tolerance)
            if not math.isfinite(residual) or (residual <= tolerance and done >= self.ramp_steps):
                break
        recorder.residual = residual
        recorder.frame(1, self.duration, done, dt)
        return "finished" if residual <= tolerance else "not converged"

    def _residual(self, built: Built) -> float:
        unbalanced, reaction = float(built.unbalanced.numpy().sum()), float(built.reaction.numpy().sum())
        if unbalanced == 0.0:
            return 0.0
        return math.sqrt(unbalanced / reaction) if reaction > 0.0 else math.inf

    def _set_step(self, built: Built, recorder: Recorder, iterations: int) -> float:
        omega = built.stable_step.omega(iterations)
        recorder.stable_dt = 2.0 / omega if omega > 0.0 else math.inf
        dt = self.safety * recorder.stable_dt
        built.step.assign(np.array([dt], dtype=built.step.numpy().dtype))
        if built.advance is not None:
            built.advance.assign(np.array([self.duration / self.ramp_steps, self.duration]))
        return dt
