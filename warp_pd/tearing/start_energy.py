"""Energy density at the start, from the triangles of the sheet: known before a kernel of the law is compiled."""

from __future__ import annotations

import numpy as np

from ..context import Context
from ..interfaces import BuiltLaw


def principal_stretches(context: Context) -> tuple[np.ndarray, np.ndarray]:
    """Larger and smaller principal stretch of each triangle in the initial displacement [-], each of shape (F,)."""
    sheet = context.sheet
    now = sheet.positions + context.initial_displacement
    before, after = (_metric(at[sheet.triangles]) for at in (sheet.positions, now))
    # Eigenvalues of before^-1 after, from trace and determinant.
    determinant = _determinant(before)
    trace = (before[1] * after[0] + before[0] * after[1] - 2.0 * before[2] * after[2]) / determinant
    product = _determinant(after) / determinant
    apart = np.sqrt(np.maximum(0.25 * trace**2 - product, 0.0))
    larger = 0.5 * trace + apart
    return np.sqrt(larger), np.sqrt(product / np.maximum(larger, 1e-300))


def _metric(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Squares and scalar product of two sides of triangles of shape (F, 3, 3)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return (a * a).sum(axis=1), (b * b).sum(axis=1), (a * b).sum(axis=1)


def _determinant(metric: tuple[np.ndarray, np.ndarray, np.ndarray]) -> np.ndarray:
    return np.asarray(metric[0] * metric[1] - metric[2] ** 2)


def density_at_start(context: Context, law: BuiltLaw) -> np.ndarray:
    """Mean energy density of the triangles around each point at the start [J/m^3], (N,); 0 without triangles."""
    sheet = context.sheet
    density = np.nan_to_num(law.energy_density(*principal_stretches(context)), nan=0.0, posinf=0.0)
    corners = sheet.triangles.ravel()
    found = np.bincount(corners, np.repeat(density, 3), sheet.size)
    mean = found / np.maximum(np.bincount(corners, minlength=sheet.size), 1)
    return np.asarray(mean if sheet.stiffness is None else mean * sheet.stiffness)
