"""Which bonds stay in the sheet."""

from __future__ import annotations

import numpy as np

from ..shapes.triangulation import crosses
from ..sheet import Sheet
from .surface_paths import apart_along


def severed(sheet: Sheet, pairs: np.ndarray) -> np.ndarray:
    """Which pairs of points, shape (B, 2), share no bond although they are near each other; bool, shape (B,)."""
    if sheet.frames is not None:
        return apart_along(sheet, pairs)
    lost = np.zeros(len(pairs), bool)
    for segment in sheet.cuts:
        lost |= crosses(sheet.points[pairs[:, 0]], sheet.points[pairs[:, 1]], segment)
    return lost
