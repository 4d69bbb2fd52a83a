"""What solvers that step share: times of frames, drift and kick, repeated frames, the stable step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, count, numbers
from ..device.clock import Schedule
from ..device.fields import Array, Stored, assign, copy, doubles, to_host
from ..device.launches import Stage
from ..interfaces import System
from ..kernels.effects import Kernel
from ..kernels.integrate import integration
from ..kernels.stable_step import PowerIteration, power_iteration
from ..kernels.threads import WARP
from ..step import Phase


class FramesInTime:
    """Base class of solvers with the attributes `duration` [s], `frames` (their number or times [s]), `damping`."""

    duration: float
    frames: int | Sequence[float]
    damping: float

    dynamic: ClassVar[bool] = True
    default_ramp: ClassVar[Schedule | None] = None

    def check_frames(self) -> None:
        """Check the number or times of the frames."""
        if isinstance(self.frames, Sequence):
            times = numbers("frames", self.frames)
            if times.size == 0 or not (np.diff(times, prepend=0.0) > 0.0).all() or times[-1] != self.duration:
                raise InputError(
                    f"frames = {list(self.frames)!r}: expected increasing times greater than 0, the last one equal to "
                    "the duration, "
                    f"{self.duration!r}"
                )
        else:
            count("frames", self.frames, 1)

    @property
    def frame_count(self) -> int:
        """Number of frames after the first one."""
        return len(self.frames) if isinstance(self.frames, Sequence) else self.frames

    @property
    def equal_frames(self) -> bool:
        """Whether the frames are equally spaced."""
        return self.frame_count == 1 or not isinstance(self.frames, Sequence)

    @property
    def mass_damping(self) -> float | None:
        """The damping, unless it is zero [1/s]."""
        return self.damping if self.damping > 0.0 else None

    def frame_time(self, index: int) -> float:
        """Time of a frame [s]; frame 0 is at time 0."""
        if isinstance(self.frames, Sequence):
            return float(self.frames[index - 1]) if index > 0 else 0.0
        return self.duration * index / self.frames


SOLVER = "solver"


def add_motion(phase: Phase, stage: Stage, context: Context, inertia: Array) -> None:
    """Add the pointwise stages of drift and kick in their phases; `inertia`: mass or fictitious mass [kg], (N,)."""
    if phase not in (Phase.DRIFT, Phase.KICK):
        return
    state = context.state
    kernels = integration(context.options)
    stage.pointwise(
        SOLVER, kernels.drift if phase is Phase.DRIFT else kernels.kick, context.sheet.size,
        mass=inertia, held_mask=state.held_mask, step=state.step, damping=state.damping, force=state.force,
        external=state.external, displacement=state.displacement, velocity=state.velocity, work=state.work,
        dissipated=state.dissipated,
    )  # fmt: skip


# Number of sound frames after which a step that was halved is doubled.
SOUND_FRAMES = 8
RETRIES = "retries"


class Snapshot:
    """A copy, on the device, of what a restart file keeps, and of what else a step changes."""

    def __init__(self, context: Context, owner: str, step: Stage | None = None) -> None:
        """Allocate the copies of the arrays that there are by now."""
        self._pairs = []
        for stored in [stored for stored in context.fields if _changes(step, stored)]:
            name, array = f"{stored.name}_before", stored.array
            kept = context.array(name, owner, array.dtype, shape=array.shape, per=stored.field.per)
            self._pairs.append((array, kept))

    def of(self, array: Array) -> Array:
        """The copy of an array."""
        return next(kept for own, kept in self._pairs if own is array)

    def keep(self) -> None:
        """Copy the state."""
        for array, kept in self._pairs:
            copy(kept, array)

    def restore(self) -> None:
        """Return to the copied state."""
        for array, kept in self._pairs:
            copy(array, kept)


class Retries:
    """The state at the last frame, and how often the step is halved.

    The estimate of the stable step follows the sheet as it stiffens, but some stiffening comes and goes within a few
    steps: torn edges that are pressed together, folds, a slack sheet that becomes taut, the lock of a material.

    Attributes:
        halvings: Number of times that the step is halved now.
        strict: Whether a frame in which the energy balance changes much is computed again.
    """

    def __init__(self, context: Context, step: Stage, most: int) -> None:
        """Allocate a copy of the state, unless `most`, the largest number of halvings, is 0."""
        self.halvings, self.strict, self._most, self._sound = 0, most > 0, most, 0
        self._snapshots = [Snapshot(context, RETRIES, step)] if most > 0 else []

    @property
    def left(self) -> bool:
        """Whether the step can be halved once more."""
        return self.halvings < self._most

    def keep(self) -> None:
        """Copy the state at a sound frame; after several, double a step that was halved."""
        if self.halvings > 0:
            self._sound += 1
            if self._sound > SOUND_FRAMES:
                self.halvings, self._sound = self.halvings - 1, 0
        for snapshot in self._snapshots:
            snapshot.keep()

    def halve(self) -> None:
        """Return to the copied state, with half the step."""
        self.halvings, self._sound = self.halvings + 1, 0
        for snapshot in self._snapshots:
            snapshot.restore()

    def give_up(self) -> None:
        """Be strict no longer: something else than the step changes the energy balance."""
        self.halvings, self._sound, self.strict = 0, 0, False

    def host_state(self) -> list[int]:
        """The halvings, the sound frames since, and whether to be strict, for a restart."""
        return [self.halvings, self._sound, int(self.strict)]

    def restore(self, state: Sequence[int]) -> None:
        """Restore the result of `host_state`."""
        self.halvings, self._sound, self.strict = state[0], state[1], bool(state[2])


def _changes(step: Stage | None, stored: Stored) -> bool:
    """Whether a field is part of the state, or changes in a step in a way that matters to the next one."""
    own = step is not None and not stored.field.intermediate and step.writes(stored.array)
    return stored.field.restart or own


# The trial displacement strains the worst bond by about this much: far above float32 round-off in the
# force, far below what would change the tangent.
TRIAL_STRAIN = 2e-3
# Iterations between two looks at the estimate.
CHECKED_EVERY = 5
STABLE = "stable step"


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
        self.direction = context.array("direction", STABLE, types.vec3, shape=n, restart=True, halo=True)
        self._earlier = context.array("earlier_direction", STABLE, types.vec3, shape=n)
        self._squared = context.array("squared_frequency", STABLE, wp.float64, shape=2, per="once")
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
            context.array(name, STABLE, vec3, shape=n) for name in ("trial", "force_plus", "response")
        )
        sums = context.array("sums", STABLE, wp.float64, shape=(4, context.own_blocks), per="block")
        scale, momentum = (context.array(name, STABLE, real, shape=1, per="once") for name in ("scale", "momentum"))
        reach = context.array("reach", STABLE, real, np.array([TRIAL_STRAIN * context.whole.spacing]), per="once")
        self._reach, self._response = reach, response
        state = context.state
        for sign, force in ((1.0, plus), (-1.0, response)):
            stage.launch(
                STABLE, kernels.trial, n,
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
            stage, STABLE, kernels.respond, arrays, {"sums": sums}, ["response"], self._lanes, reach=reach
        )  # fmt: skip
        everything = context.few_blocks(stage, sums, "sums_of_all", STABLE, maxima=1)
        stage.launch(
            STABLE, kernels.summarise, self._lanes, sums=everything, scale=scale, momentum=momentum,
            squared_frequency=self._squared,
        )  # fmt: skip
        stage.launch(
            STABLE, kernels.renew, n, response=response, scale=scale, momentum=momentum,
            earlier=self._earlier, direction=direction,
        )  # fmt: skip

    def respond(self, motion: np.ndarray, reach: float) -> np.ndarray:
        """M^-1 K v for a motion v, shape (N, 3), by displacements of up to `reach` [m]; zero in held components."""
        size = float(np.abs(motion).max())
        kept = [(array, to_host(array)) for array in (self.direction, self._reach)]
        assign(self.direction, motion / size)
        assign(self._reach, np.array([reach]))
        self.context.sequence("estimate").run()
        for array, values in kept:
            assign(array, values)
        return size * doubles(self._response)

    def disturb(self) -> None:
        """Add noise to the last direction, other noise in each estimate."""
        self._estimates += 1
        assign(self._seed, np.array([self._estimates]))
        self.context.sequence("noise").run()

    def _add_noise(self, stage: Stage, kernel: Kernel) -> None:
        """Add the launch that disturbs the direction; drawn on the host, noise took longer than the iterations."""
        context, partition = self.context, self.context.partition
        self._seed = context.array("seed", STABLE, wp.int32, shape=1, per="once")
        numbers = None
        if partition is not None:
            numbers = context.array("numbers", STABLE, wp.int32, partition.points.astype(np.int32))
        stage.launch(
            STABLE, kernel, context.sheet.size, held_mask=context.state.held_mask, numbers=numbers, seed=self._seed,
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
