"""Checks that the state of a run is sound, and names the likely cause if it is not."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..interfaces import DivergedError, UnbalancedError
from ..interfaces.frame import format_time
from .built import Built

# Energy out of nowhere, over the largest energy or work so far, at which a run counts as diverged.
MAX_GAIN = 0.5
# A step so much shorter than the stable one is not why a run diverged.
SHORT = 1.0 / 16.0
# Mean square of a motion that moves nothing, over the square of the size of the sheet; angle of a large turn.
NOTHING, LARGE_TURN = 1e-12, 0.5
# Change of the energy balance between two frames, over the same, above which the steps are too long; and the change
# above which they are if the balance is off by more than MAX_CHANGE already, and becomes worse.
MAX_CHANGE, MAX_DRIFT = 0.01, 0.001


class Soundness:
    """Checks the state of a run at its frames.

    Attributes:
        stable_dt: Latest stable step [s], or None.
        last_time: Time of the last sound frame [s]; None before the first.
    """

    def __init__(self, built: Built) -> None:
        self.built = built
        self.stable_dt: float | None = None
        self.last_time: float | None = None

    def require_finite(self, index: int, now: float, dt: float, totals: Mapping[str, float]) -> None:
        """Raise DivergedError if the state is NaN or Inf, or a point moves more than a horizon in a step."""
        built = self.built
        bad = built.checks.first_not_finite()
        if bad is None and np.isfinite(totals.get("strain", 0.0)):
            # Implicit steps have no stable step, and may be long.
            if self.stable_dt is not None:
                self._require_slow(index, now, dt)
            return
        sheet = built.context.whole
        where = "the strain energy" if bad is None else f"point {bad} at {sheet.points[bad].tolist()}"
        last, load_duration = self.last_time or 0.0, built.simulation.load_duration
        if index == 0:
            between = "is NaN or Inf at the start"
        elif load_duration is None:
            between = f"became NaN or Inf between t = {last:.6g} s and t = {now:.6g} s (frame {index})"
        else:
            between = f"became NaN or Inf beyond {format_time(last, load_duration)}"
        raise DivergedError(f"diverged: {where} {between}; likely cause: {self.cause(dt, now)}")

    def _require_slow(self, index: int, now: float, dt: float) -> None:
        built = self.built
        if built.checks.top_speed() * dt > built.law.families.horizon:
            speed = np.linalg.norm(built.to_numpy(built.state.velocity), axis=1)
            fastest = int(speed.argmax())
            when = format_time(now, built.simulation.load_duration)
            raise DivergedError(
                f"diverged: point {fastest} moves more than a horizon in one step at {when} "
                f"(|v| = {speed[fastest]:.4g} m/s, frame {index}); likely cause: {self.cause(dt, now)}"
            )

    def require_no_gain(self, row: Mapping[str, float], index: int, dt: float) -> None:
        """Raise DivergedError if the sheet has more energy than was ever put in."""
        if row.get("balance_error", 0.0) > MAX_GAIN:
            raise DivergedError(
                f"diverged: at t = {row['time']:.6g} s (frame {index}) the sheet has more energy than was ever put "
                f"in, balance error {100.0 * row['balance_error']:.0f} %; likely cause: {self.cause(dt, row['time'])}"
            )

    def require_balance(self, gain: float, error: float, index: int) -> None:
        """Raise UnbalancedError if `gain`, the energy gained since the last frame over the largest, is not small.

        `error` is the energy gained since the start, over the same.
        """
        drifts = abs(error) > MAX_CHANGE and abs(gain) > MAX_DRIFT and gain * error > 0.0
        if abs(gain) > MAX_CHANGE or drifts:
            raise UnbalancedError(f"the energy balance changes by {100.0 * gain:+.2g} % in frame {index}")

    def cause(self, dt: float, now: float) -> str:
        """Likely cause of divergence at time `now` [s] with the step dt [s]."""
        if self.last_time is None:
            return "the initial displacement strains the sheet more than its material allows"
        if self.built.simulation.load_duration is not None:
            ramp = getattr(self.built.simulation.solver, "ramp_steps", None)
            slower = "" if ramp is None else f", or more ramp_steps, over which a load step is applied (here {ramp})"
            return (
                "no equilibrium near the last good load step, or the load rose faster than the solver followed; "
                f"try a smaller load, or more load_steps{slower}"
            )
        if self.stable_dt is not None and dt > self.stable_dt * (1.0 + 1e-9):
            return f"the step {dt:.4g} s is above the stable step {self.stable_dt:.4g} s"
        if self.stable_dt is not None:
            # Nothing passes more than a horizon in a stable step.
            wave = self.built.law.families.horizon / self.stable_dt
            at = self.built.context.clamped_positions
            speed = max((c.top_speed(at[c.points], now) for c in self.built.constraints), default=0.0)
            if speed > wave:
                return (
                    f"supports move points at {speed:.4g} m/s, faster than any wave in this sheet (below {wave:.4g} "
                    "m/s); "
                    "try a slower motion"
                )
        if self.stable_dt is not None and dt <= SHORT * self.stable_dt and self._pressed_apart():
            return (
                "a load that follows the sheet pulls what is left of it apart without end; let it fall after the burst "
                "(ramp), take an EnclosedGas with a leak, or end the run before"
            )
        # Half the step; where nothing resisted so far no step was unstable.
        return self.built.law.likely_cause(max(0.5 * dt / (self.stable_dt or dt), 0.01))

    def _pressed_apart(self) -> bool:
        """Whether the sheet is torn and loaded by forces that depend on its displacement."""
        rupture = self.built.rupture
        return rupture is not None and bool(self.built.external.following) and not rupture.intact_faces.numpy().all()


def free_motions(built: Built) -> int:
    """Number of rigid-body motions that the supports leave free, 0 to 6; a turn is free if it may be large.

    Of the sheet where it starts: its pieces may be placed, and flat ones arched.
    """
    at = built.context.given.positions + built.simulation.initial("initial_displacement")
    at = at - at.mean(axis=0)
    at = at / max(float(np.abs(at).max()), 1e-300)
    held = np.zeros(at.shape, bool)
    for constraint in built.constraints:
        held[constraint.points] |= [bool(constraint.components & (1 << c)) for c in range(3)]
    shift = np.broadcast_to(np.eye(3)[:, None], (3, *at.shape))
    modes = np.concatenate([shift, np.cross(np.eye(3)[:, None], at[None])]).reshape(6, -1)
    free = _unmoved(modes[:, held.ravel()])
    # Points on a line do not notice a turn about it.
    unseen = _unmoved(modes)
    free = free - unseen @ (unseen.T @ free)
    free = np.linalg.svd(free, full_matrices=False)[0][:, : free.shape[1] - unseen.shape[1]]
    # Free translations first: what is left of each other motion turns the sheet.
    combined = np.linalg.svd(free[3:])[2].T if free.shape[1] else np.zeros((0, 0))
    motions = [free @ combined[:, k] for k in range(free.shape[1])]
    return sum(_stays_free(motion[:3], motion[3:], at, held) for motion in motions)


def _unmoved(modes: np.ndarray) -> np.ndarray:
    """Combinations of six motions, one a column, that move none of the components; `modes` has shape (6, K)."""
    values, vectors = np.linalg.eigh(modes @ modes.T / max(modes.shape[1], 1))
    return np.asarray(vectors[:, values < NOTHING])


def _stays_free(shift: np.ndarray, turn: np.ndarray, at: np.ndarray, held: np.ndarray) -> bool:
    """Whether a motion that moves no held component if it is small moves none if it is large."""
    size = float(np.linalg.norm(turn))
    if size < 1e-6 * float(np.linalg.norm(shift)):
        return True
    axis = turn / size
    foot = np.cross(axis, shift) / size
    along = float(shift @ axis) / size
    arm = at - foot
    across = np.cross(axis, arm)
    moved = (
        np.sin(LARGE_TURN) * across + (1.0 - np.cos(LARGE_TURN)) * np.cross(axis, across) + along * LARGE_TURN * axis
    )
    return float(np.abs(moved[held]).max(initial=0.0)) < 1e-6
