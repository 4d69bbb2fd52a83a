"""Helpers for surface writers: damage colours, bounding boxes, normals, cameras."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geometry.triangulation import corner_sums, doubled_normals

# Linear red, green and blue from natural rubber to torn. It darkens all the way, so that it also reads in
# grey print, and turns red early: along a crack the damage is near 0.4, the fraction of bonds that cross it.
RAMP_DAMAGE = (0.0, 0.15, 0.4, 0.7, 1.0)
RAMP_COLOUR = np.array(
    [[0.80, 0.52, 0.26], [0.86, 0.36, 0.13], [0.72, 0.06, 0.10], [0.32, 0.01, 0.24], [0.03, 0.02, 0.22]]
)

# From where a camera looks at the sheet: from the front, a little to the right, and above.
VIEW_DIRECTION = np.array([0.45, -0.80, 0.62])
VIEW_MARGIN = 1.12


def damage_colours(damage: NDArray[np.floating]) -> NDArray[np.float64]:
    """Linear red, green and blue of the damage, shape (N, 3): amber 0, red around 0.4, deep blue 1."""
    return np.stack([np.interp(damage, RAMP_DAMAGE, channel) for channel in RAMP_COLOUR.T], axis=-1)


def bounding_box(points: NDArray[np.floating]) -> NDArray[np.float64]:
    """Lowest and highest corner of points [m], shape (2, 3)."""
    # Along rows: across them NumPy takes several times as long.
    columns = np.ascontiguousarray(points.T)
    return np.array([columns.min(axis=1), columns.max(axis=1)], np.float64)


def point_normals(
    positions: NDArray[np.floating], faces: NDArray[np.integer], *, fallback: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Unit normals at the points, shape (N, 3): the mean over each point's faces, weighted with their area.

    A point without a face, or whose faces cancel, takes its `fallback`, shape (N, 3) or (3,).
    """
    # As long as twice the area: a plain sum is weighted with the area already.
    products = np.repeat(doubled_normals(positions, faces)[:, None], 3, axis=1)
    sums = np.stack([corner_sums(products[..., c], faces, len(positions)) for c in range(3)], axis=-1)
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    usable = lengths > 1e-12 * max(lengths.max(), np.finfo(np.float64).tiny)
    return np.where(usable, sums / np.where(usable, lengths, 1.0), fallback)


def camera_place(
    box: NDArray[np.float64], apertures: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Eye and target [m] from which a whole box, shape (2, 3), is visible, and their distance [m].

    `apertures` are width and height of the picture divided by the focal length.
    """
    target = box.mean(axis=0)
    towards_camera = VIEW_DIRECTION / np.linalg.norm(VIEW_DIRECTION)
    right = np.cross([0.0, 0.0, 1.0], towards_camera)
    right /= np.linalg.norm(right)
    axes = np.array([right, np.cross(towards_camera, right), towards_camera])
    corners = np.array([[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    across, upwards, nearer = axes @ (corners - target).T * VIEW_MARGIN
    slopes = 0.5 * np.array(apertures)
    for_width, for_height = np.abs(across) / slopes[0] + nearer, np.abs(upwards) / slopes[1] + nearer
    distance = float(max(for_width.max(), for_height.max()))
    return target + distance * towards_camera, target, distance
