"""Small out-of-plane imperfections of a flat sheet, so that it can buckle."""

from __future__ import annotations

import numpy as np

from ..device.checks import not_negative
from ..geometry.sheet import Sheet


def rough_surface(sheet: Sheet, roughness: float, seed: int, flat: np.ndarray | None = None) -> np.ndarray:
    """An initial displacement with random bumps out of plane.

    Args:
        sheet: The sheet.
        roughness: Maximum height of the bumps in spacings [-].
        seed: Seed of the random numbers.
        flat: Points without bumps, such as those in grips.

    Returns:
        Displacement [m], shape (N, 3).

    Raises:
        InputError: if the roughness is negative.
    """
    bumps = np.zeros((sheet.size, 3))
    height = not_negative("roughness", roughness) * (sheet.spacing if sheet.spacings is None else sheet.spacings)
    bumps[:, 2] = height * np.random.default_rng(seed).uniform(-1.0, 1.0, sheet.size)
    if sheet.frames is not None:
        bumps = bumps[:, 2:] * sheet.normals
    if flat is not None:
        bumps[flat] = 0.0
    return bumps
