"""Whether a sheet with a crack reaches the strength of its damage field before the crack moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..context import Context
from .field_constants import FieldConstants

# Damage below which a point starts intact; mean damage of these points from which a note says that the sheet softens
# before its crack moves; severed points from which a crack has moved; and G / Gc below which a strip as high as the
# sheet reaches its strength too early, and which a remedy aims at.
SOFT, MUCH_SOFT, MOVED, EARLY, LATE = 0.02, 0.15, 4, 0.72, 1.25


class EarlySoftening:
    """The damage of what starts intact, until a crack moves.

    Args:
        owner: Name of the part.
        context: The sheet.
        constants: Constants of the damage field.
        at_start: Damage at the start, (N,).
        severed_at: Damage above which a point is severed and was not at the start, (N,).
    """

    def __init__(
        self, owner: str, context: Context, constants: FieldConstants, at_start: np.ndarray, severed_at: np.ndarray
    ) -> None:
        self._points, self._constants, self._severed_at = context.whole.points, constants, severed_at
        self._intact = at_start < SOFT
        self._cracked = bool(at_start.any() and self._intact.any())
        # Mean damage of what starts intact, and whether a crack has moved.
        self._seen = context.array("softened", owner, wp.float64, shape=2, per="once", restart=True)

    def look(self, damage: np.ndarray) -> None:
        """Keep the mean damage of what starts intact, and whether a crack has moved, until one has."""
        softened, moves = self._seen.numpy()
        if moves or not self._cracked:
            return
        if np.count_nonzero(damage > self._severed_at) >= MOVED:
            self._seen.assign([softened, 1.0])
        else:
            self._seen.assign([float(damage[self._intact].mean(dtype=np.float64)), 0.0])

    def expected(self) -> Sequence[str]:
        """Whether a flat sheet with a crack may reach its strength before the crack moves."""
        height, constants = self._height(), self._constants
        if not self._cracked or constants.strong or height is None:
            return ()
        reached = constants.reached(height)
        if reached >= EARLY:
            return ()
        return [
            f"the length of the damage field is {constants.length:.3g} m, and the sheet {height:.3g} m wide: between "
            f"clamps that far apart all of it softens at {reached:.2g} Gc, before a crack moves; "
            f"{constants.remedy(self._longest())}"
        ]

    def found(self) -> Sequence[str]:
        """Whether the sheet has softened before its crack moved."""
        softened, moves = self._seen.numpy()
        if softened <= MUCH_SOFT or self._constants.strong:
            return ()
        when = "when its crack began to move" if moves else "and no crack has moved"
        return [
            f"intact material had a mean damage of {softened:.2g} {when}: the load is that of a strength of "
            f"{self._constants.limit:.3g} J/m^3, and lower than that of the crack; "
            f"{self._constants.remedy(self._longest())}"
        ]

    def _height(self) -> float | None:
        """Smaller extent of a flat sheet [m]; None of a curved one."""
        return float(np.ptp(self._points, axis=0).min()) if self._points.shape[1] == 2 else None

    def _longest(self) -> float:
        """Length with which a sheet as high as this one tears by its crack, at most half of the present one [m]."""
        height = self._height()
        most = 1.0 if height is None else self._constants.reached(height) / LATE
        return self._constants.length * min(most, 0.5)
