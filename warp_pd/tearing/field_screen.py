"""Where a sheet may store more than a damage field allows: bonds to check in each step, and the energy at the start."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from ..context import Context
from ..interfaces import BuiltLaw

# Fraction of the limit of the energy density that no bond reaches outside the stretches that are looked at.
SCREEN = 0.8
# Members that the screen looks at one by one, and the margin for round-off when it does.
FEW, ROUND_OFF = 4, 1e-4


def screen_of(law: BuiltLaw, context: Context, owner: str, limit: float) -> tuple[dict[str, Any], int]:
    """Tables by which `wake` looks at bonds, and the number of members that it checks without families, or 0.

    Args:
        law: The law.
        context: Arrays of the sheet.
        owner: Owner of the array of members.
        limit: Energy density at which intact material begins to tear [J/m^3], the minimum over all points.
    """
    members, shortest, longest = _looked_at(law, context, limit)
    checked = context.array("looked_at", owner, wp.int32, members, per="table")
    values: dict[str, Any] = {"members": checked, "shortest": shortest, "longest": longest}
    families, few = law.families, 0
    if families.shift is not None and families.bonds is not None and len(members) <= FEW:
        few, at, vector = len(members), np.resize(members, 4), context.types.parameters
        x, y = families.horizon * families.bonds[at].T
        squared = x**2 + y**2
        values["shifts"] = wp.vec4i(families.shift[at].tolist())
        values["x"], values["y"] = vector(x.tolist()), vector(y.tolist())
        values["least"] = vector(((1.0 - ROUND_OFF) * shortest * squared).tolist())
        values["most"] = vector(((1.0 + ROUND_OFF) * longest * squared).tolist())
    return values, few


def _looked_at(law: BuiltLaw, context: Context, limit: float) -> tuple[np.ndarray, float, float]:
    """Members to check for high energy, and the squared stretches between which the energy is low.

    On a lattice the shortest bonds in four directions are enough: every direction is within 22.5 degrees of one of
    them.
    """
    stiffness = context.whole.stiffness
    stiffest = 1.0 if stiffness is None else float(stiffness.max())
    allowed = SCREEN * limit / stiffest
    steps, shorter = law.families.steps, np.geomspace(1.0, 1e-3, 400)
    over = ~(law.energy_density(shorter, shorter) <= allowed)
    low = float(shorter[max(int(np.argmax(over)) - 1, 0)]) if over.any() else 0.0
    first, second = np.meshgrid(np.geomspace(1.0, 30.0, 400), np.append(np.linspace(low, 1.0, 60), np.inf))
    second = np.asarray(np.where(np.isinf(second), first, np.minimum(second, first)))
    high = ~(law.energy_density(first.ravel(), second.ravel()).reshape(first.shape) <= allowed)
    along = np.cos(np.pi / 8.0) ** 2
    if steps is not None and context.layout.kind == "lattice":
        members = [k for k, step in enumerate(steps.tolist()) if step in ([1, 0], [0, 1], [1, 1], [-1, 1])]
        seen = along * first**2 + (1.0 - along) * second**2
        longest = float(seen[high].min()) if high.any() else np.inf
        if len(members) == 4 and longest > 1.05:
            return np.array(members), along * low**2 if low > 0.0 else 0.0, longest
    longest = float((first**2)[high].min()) if high.any() else np.inf
    return np.arange(law.families.members), low**2, longest


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
