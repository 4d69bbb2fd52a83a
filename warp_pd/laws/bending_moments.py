"""Moments of bending at the points, from the triangles around them: a triangle at a time, or a patch of the sheet."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import warp as wp

from ..device.fields import Array
from ..device.launches import Stage, with_values
from ..interfaces.context import Context
from ..kernels.bending import PATCH_POINTS, PATCH_TRIANGLES, BendingKernels
from . import force_paths

OWNER = "bending"


class Moments(Protocol):
    """A way to compute the moments of bending (interface)."""

    def add(self, stage: Stage, displacement: Array, slope: Array, moment: Array, force: Array) -> None:
        """Add the launches that fill `moment` (6, N), and add what the triangles pull to `force` (N,) vec3 [N]."""
        ...


def moments_at_points(context: Context, kernels: BendingKernels, plate: Any) -> Moments:
    """The way for a device: patches take a third of the time on a GPU, which needs their shared memory."""
    kind = MomentsByPatch if force_paths.has_shared_memory(context.device) else MomentsByTriangle
    return kind(context, kernels, plate)


class MomentsByTriangle:
    """Triangles store their moments, and points gather them."""

    def __init__(self, context: Context, kernels: BendingKernels, plate: Any) -> None:
        self.kernels, self.plate = kernels, plate
        self.triangles, self.arrays = len(context.sheet.triangles), triangle_arrays(context, OWNER)

    def add(self, stage: Stage, displacement: Array, slope: Array, moment: Array, force: Array) -> None:
        """Add both launches."""
        given: dict[str, Any] = {"plate": self.plate, **self.arrays}
        stage.launch(OWNER, self.kernels.moments, self.triangles, displacement=displacement, slope=slope, **given)
        stage.launch(OWNER, self.kernels.gather, len(force), **given, sign=-1.0, moment=moment, force=force)


class MomentsByPatch:
    """A block of threads computes the triangles of a patch of the sheet, and sums them at its points."""

    def __init__(self, context: Context, kernels: BendingKernels, plate: Any) -> None:
        self.kernels, self.plate = kernels, plate
        order, begins = patches_of(context.sheet.positions, context.sheet.triangles)
        self.count = len(begins) - 1
        tables = patch_tables(context.sheet.triangles, order, begins)
        self.patches = with_values(kernels.Patches(), {
            name: context.array(f"patch_{name}", OWNER, dtype, values, per="table")
            for name, (dtype, values) in tables.items()
        })  # fmt: skip

    def add(self, stage: Stage, displacement: Array, slope: Array, moment: Array, force: Array) -> None:
        """Add the launch."""
        stage.launch(
            OWNER, self.kernels.patches, self.count * PATCH_POINTS, block_dim=PATCH_POINTS, plate=self.plate,
            patches=self.patches, displacement=displacement, slope=slope, sign=-1.0, moment=moment, force=force,
        )  # fmt: skip


def triangle_arrays(context: Context, owner: str) -> dict[str, Any]:
    """Buffers of what each triangle stores: its normal, the couples at its corners, and what pulls at two of them."""
    t, faces = context.types, len(context.sheet.triangles)
    shapes = {"normal": (t.vec3, faces), "couple": (t.vec2, (3, faces)), "pull": (t.vec3, (2, faces))}
    return {
        name: context.array(f"bending_{name}", owner, dtype, shape=shape, per="face")
        for name, (dtype, shape) in shapes.items()
    }


def patches_of(positions: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compact patches of a sheet: its points, a patch after another, (N,), and where patches begin, (P + 1,)."""
    from scipy.spatial import cKDTree

    tree = cKDTree(positions, leafsize=PATCH_POINTS)
    begins, nodes = [len(positions)], [tree.tree]
    while nodes:
        node = nodes.pop()
        if node.lesser is None:
            begins.append(node.start_idx)
        else:
            nodes += [node.lesser, node.greater]
    order, starts = np.asarray(tree.indices), np.sort(begins)
    # By number in each patch: neighbouring threads then read neighbouring points.
    order = order[np.lexsort((order, np.repeat(np.arange(len(starts) - 1), np.diff(starts))))]
    while len(crowded := np.flatnonzero(_triangles_of_patches(triangles, order, starts)[1] > PATCH_TRIANGLES)):
        starts = np.sort(np.append(starts, (starts[crowded] + starts[crowded + 1]) // 2))
    return order, starts


def patch_tables(triangles: np.ndarray, order: np.ndarray, begins: np.ndarray) -> dict[str, tuple[Any, np.ndarray]]:
    """The tables of `Patches` in kernels/bending.py."""
    keys, counts, place = _triangles_of_patches(triangles, order, begins)
    first = np.append(0, np.cumsum(counts))
    rank = np.empty(len(order), int)
    rank[order] = np.arange(len(order))
    owner = rank[triangles.ravel()]
    patch = np.searchsorted(begins, owner, side="right") - 1
    places = PATCH_TRIANGLES * np.tile(np.arange(3), len(triangles)) + place - first[patch]
    entries = np.argsort(owner, kind="stable")
    owners = owner[entries]
    row = np.arange(len(owners)) - np.searchsorted(owners, owners)
    around = np.zeros((row.max() + 1, len(order)), np.int16)
    around[row, owners] = places[entries]
    return {
        "points": (wp.int32, order), "first_point": (wp.int32, begins), "triangles": (wp.int32, keys % len(triangles)),
        "first_triangle": (wp.int32, first), "around": (wp.int16, around),
    }  # fmt: skip


def _triangles_of_patches(
    triangles: np.ndarray, order: np.ndarray, begins: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles at points of each patch as patch x number + triangle; their number by patch; place of each corner."""
    patch = np.empty(len(order), int)
    patch[order] = np.repeat(np.arange(len(begins) - 1), np.diff(begins))
    keys = patch[triangles] * len(triangles) + np.arange(len(triangles))[:, None]
    unique, place = np.unique(keys.ravel(), return_inverse=True)
    return unique, np.bincount(unique // len(triangles), minlength=len(begins) - 1), place
