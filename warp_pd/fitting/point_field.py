"""Displacements of a frame at places on the sheet, for fits to camera measurements."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..device.checks import InputError
from ..geometry.sheet import Sheet
from ..interfaces.frame import Frame


@dataclass(frozen=True, eq=False)
class PointField:
    """Displacements at positions on the undeformed sheet, linear on its triangles, for camera measurements.

    Attributes:
        weights: Sparse interpolation matrix, shape (M, N).
        inside: Mask of the requested places that are on the sheet.
    """

    weights: Any
    inside: np.ndarray = field(repr=False)

    @staticmethod
    def at(sheet: Sheet, places: np.ndarray, tolerance: float = 0.02) -> PointField:
        """Create the probe for places [m], shape (M, 2) or (M, 3), on the clamped, undeformed sheet.

        Places more than `tolerance` spacings outside the sheet are dropped. Raises InputError if none is on it.
        """
        from scipy import sparse
        from scipy.spatial import cKDTree

        if len(sheet.triangles) == 0:
            raise InputError("PointField: expected a sheet with triangles")
        corners = sheet.positions[sheet.triangles]
        where = np.zeros((len(places), 3))
        where[:, : places.shape[1]] = places
        count = min(24, len(corners))
        _, near = cKDTree(corners.mean(axis=1)).query(where, k=count)
        near = near.reshape(len(where), count)
        fractions = _barycentric(corners[near], where[:, None])
        best = np.argmax(fractions.min(axis=-1), axis=1)
        rows = np.arange(len(where))
        fraction = fractions[rows, best]
        gap = np.maximum(0.0, -fraction.min(axis=1)) * np.sqrt(2.0)
        inside = gap <= tolerance
        if not inside.any():
            raise InputError("places: none of them is on the sheet; check their unit and origin")
        points = sheet.triangles[near[rows, best]][inside]
        kept = int(inside.sum())
        entries = fraction[inside].ravel(), (np.repeat(np.arange(kept), 3), points.ravel())
        return PointField(sparse.csr_matrix(entries, shape=(kept, sheet.size)), inside)

    def values(self, frame: Frame) -> np.ndarray:
        """Displacements [m], shape (M, 3)."""
        return np.asarray(self.weights @ frame.displacement)


def _barycentric(corners: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Barycentric coordinates of places projected on triangles, shape (..., 3); corners have shape (..., 3, 3)."""
    a, b, p = (
        corners[..., 1, :] - corners[..., 0, :],
        corners[..., 2, :] - corners[..., 0, :],
        places - corners[..., 0, :],
    )
    aa, ab, bb = (a * a).sum(-1), (a * b).sum(-1), (b * b).sum(-1)
    pa, pb = (p * a).sum(-1), (p * b).sum(-1)
    determinant = np.maximum(aa * bb - ab**2, 1e-300)
    second, third = (bb * pa - ab * pb) / determinant, (aa * pb - ab * pa) / determinant
    return np.stack([1.0 - second - third, second, third], axis=-1)
