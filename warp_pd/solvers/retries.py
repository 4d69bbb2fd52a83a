"""Frames in which a run diverges are computed again with a shorter step."""

from __future__ import annotations

from collections.abc import Sequence

import warp as wp

from ..context import Context
from ..device.fields import Array, Stored
from ..device.launches import Stage

# Number of sound frames after which a step that was halved is doubled.
SOUND_FRAMES = 8
OWNER = "retries"


class Snapshot:
    """A copy, on the device, of what a restart file keeps, and of what else a step changes."""

    def __init__(self, context: Context, owner: str, step: Stage | None = None) -> None:
        """Allocate the copies of the arrays that there are by now."""
        self._pairs = []
        for stored in [stored for stored in context.fields if _changes(step, stored)]:
            name, array = f"{stored.name}_before", stored.array
            copy = context.array(name, owner, array.dtype, shape=array.shape, per=stored.field.per)
            self._pairs.append((array, copy))

    def of(self, array: Array) -> Array:
        """The copy of an array."""
        return next(copy for own, copy in self._pairs if own is array)

    def keep(self) -> None:
        """Copy the state."""
        for array, copy in self._pairs:
            wp.copy(copy, array)

    def restore(self) -> None:
        """Return to the copied state."""
        for array, copy in self._pairs:
            wp.copy(array, copy)


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
        self._snapshots = [Snapshot(context, OWNER, step)] if most > 0 else []

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
