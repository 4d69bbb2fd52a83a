"""How far points lie off the plane of their neighbours: what shows a corner that folded or fluttered away."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .checks import point_indices
from .families import unpack

if TYPE_CHECKING:
    from .built import Built
    from .frame import Frame

# Least ratio of the middle to the largest principal moment of members that determine a plane.
COLLINEAR = 1e-10


def distance_from_local_plane(built: Built, frame: Frame, points: Any) -> np.ndarray:
    """Distance of points from the plane fitted through the deformed positions of their family members.

    The plane is that of least squared distances of the members, all alike, the point itself left out. On a
    smooth surface the distance is about its curvature times a share of the horizon squared. Where bonds can
    break, the members are those whose bonds stand now, which fits the newest frame alone.

    Args:
        built: The simulation.
        frame: Its newest frame; any, if nothing can break.
        points: Point indices, shape (P,), in any order.

    Returns:
        [m], shape (P,), 0 or more; NaN where fewer than three members, or collinear ones, determine no plane.

    Raises:
        InputError: if there is no point, or an index does not exist.
    """
    sheet, families = built.simulation.sheet, built.law.families
    point_indices("points", points, sheet.size)
    chosen = np.atleast_1d(np.asarray(points, dtype=np.int64))
    members = families.members_of(chosen)
    present = members >= 0
    if built.law.intact is not None:
        words = built.law.intact.numpy()[-families.words :, chosen].T
        present &= unpack(words, families.members)
    position = sheet.positions + np.asarray(frame.displacement, np.float64)
    # About the point itself, so that a sheet far from the origin keeps its digits.
    arm = np.where(present[..., None], position[np.maximum(members, 0)] - position[chosen, None], 0.0)
    number = present.sum(axis=1)
    centre = arm.sum(axis=1) / np.maximum(number, 1)[:, None]
    centred = np.where(present[..., None], arm - centre[:, None], 0.0)
    moments, axes = np.linalg.eigh(centred.transpose(0, 2, 1) @ centred)
    distance = np.abs((centre * axes[..., 0]).sum(axis=1))
    return np.where((number >= 3) & (moments[:, 1] > COLLINEAR * moments[:, 2]), distance, np.nan)
