"""Tables of families on a device."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError
from ..families import Families, pack
from ..families.tables import in_blocks
from ..kernels.families import family_functions

# Tables are read with indices of 32 bits.
MAX_ENTRIES = 2**32


def _by_member(values: np.ndarray, scalar: Any, axes: tuple[int, ...] = (1, 0)) -> np.ndarray:
    """A table by point, shape (N, n, ...), with permuted axes and in the precision of the device."""
    table = np.empty([values.shape[axis] for axis in axes], scalar)
    by_point = table.transpose(np.argsort(axes))

    def fill(part: slice) -> None:
        by_point[part] = values[part]

    in_blocks(len(values), max(1, values[0].size), fill)
    return table


def family_struct(
    families: Families,
    context: Context,
    owner: str,
    inverse: np.ndarray | None,
    weights: np.ndarray,
) -> Any:
    """Copy the tables to the device, as the struct of `kernels.families`.

    K^-1, shape (R, n, 3), is None for laws without intersections, for which no masks are stored either. Weights, shape
    (R, n), are divided by the reference area.
    """
    types = context.types
    s: Any = family_functions(context.layout).struct()
    s.members, s.words = families.members, families.words
    s.horizon, s.inverse_horizon = families.horizon, 1.0 / families.horizon
    family_areas = families.member_areas.sum(axis=1)
    real = wp.dtype_to_numpy(types.real)

    def put(name: str, values: np.ndarray | None, dtype: Any) -> Any:
        return context.array(name, owner, dtype, values, per="table")

    if families.shift is not None and families.family_class is not None:
        s.stencil_shift = put("stencil_shift", families.shift, wp.int32)
        s.stencil_reverse = put("stencil_reverse", families.reverses, wp.int32)
        s.stencil_bond = put("stencil_bond", families.bonds, types.vec2)
        s.stencil_influence = put("stencil_influence", families.influence, types.real)
        if families.common.size:
            s.stencil_common = put("stencil_common", families.common, wp.uint32)
        s.family_class = put("family_class", families.family_class, wp.int32)
        s.class_initial = put("class_initial", pack(families.exists), wp.uint32)
        if inverse is not None:
            s.class_shape = put("class_shape", inverse, types.vec3)
        s.class_weight = put("class_weight", weights, types.real)
        s.class_area = put("class_area", families.areas, types.real)
        s.class_family_area = put("class_family_area", family_areas, types.real)
        return s
    assert families.neighbours is not None
    rows = len(families.exists)
    if rows * s.members >= MAX_ENTRIES:
        raise InputError(
            f"{rows} families of up to {s.members} members: expected fewer than 2^32 entries in each table; "
            "choose a shorter horizon or fewer points"
        )
    if families.common.size:
        s.commons = put("commons", _by_member(families.common, np.uint32, (1, 2, 0)), wp.uint32)
    s.initials = put("initials", pack(families.exists).T, wp.uint32)
    s.weights = put("weights", _by_member(weights, real), types.real)
    s.areas = put("areas", families.areas, types.real)
    s.family_areas = put("family_areas", family_areas, types.real)
    s.influences = put("influences", _by_member(families.influence, real), types.real)
    s.rows = rows
    if families.centres is not None and families.steps is not None:
        steps = np.zeros((families.members, 2), np.int32)
        steps[: len(families.steps)] = families.steps
        s.family_class = put("family_class", families.family_class, wp.int32)
        s.centres = put("centres", families.centres, wp.int32)
        s.stencil_line = put("stencil_line", steps[:, 1] + len(families.centres) // 2, wp.int32)
        s.stencil_right = put("stencil_right", steps[:, 0], wp.int32)
    s.neighbours = put("neighbours", _by_member(families.neighbours, np.int32), wp.int32)
    s.reverses = put("reverses", _by_member(families.reverses, np.int32), wp.int32)
    s.bonds = put("bonds", _by_member(families.bonds, real, (1, 0, 2)), types.vec2)
    if inverse is not None:
        s.shapes = put("shapes", _by_member(inverse, real, (1, 0, 2)), types.vec3)
    if families.materials is not None:
        s.materials = put("bond_materials", _by_member(families.materials, np.uint8), wp.uint8)
    if families.frames is not None and families.chords is not None:
        s.frames = put("frames", families.frames, types.mat33)
        s.chords = put("chords", _by_member(families.chords, real, (1, 0, 2)), types.vec3)
        if inverse is not None:
            s.tilts = put("tilts", _by_member(families.tilts(inverse), real, (1, 0, 2)), types.vec2)
    return s


def moments_of(families: Families) -> np.ndarray:
    """(c_k X_k / horizon, 1 / c_k) of each row, shape (n, R, 3); zero for missing members."""
    c = families.member_coefficients
    moments = np.zeros((families.members, len(c), 3))
    moments[..., :2] = (c[..., None] * families.bonds).transpose(1, 0, 2)
    np.divide(1.0, c.T, out=moments[..., 2], where=c.T > 0.0)
    return moments
