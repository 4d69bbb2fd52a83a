"""A tree of boxes around the triangles of a moving sheet.

Triangles are the leaves of a complete binary tree, in an order that keeps neighbours of the reference state together;
node k has the children 2 k and 2 k + 1. Its shape never changes, so a query meets triangles in the same order in every
run. Boxes are those of Ericson, Real-Time Collision Detection (2005), section 6.6, in float32.
"""

import functools
from dataclasses import dataclass

import warp as wp

from .effects import Kernel, kernel

# Levels of the tree that one thread merges.
LEVELS = 6


@wp.struct
class FaceTree:
    """Boxes and bounding spheres of triangles.

    leaves: number of leaves, a power of 2. order: triangle of each leaf that has one. lower, upper: corners of the box
    of each node [m]. spheres: centre and radius of each triangle [m].
    """

    leaves: int
    order: wp.array(dtype=wp.int32)
    lower: wp.array(dtype=wp.vec3)
    upper: wp.array(dtype=wp.vec3)
    spheres: wp.array(dtype=wp.vec4)


@wp.func
def overlaps(node: int, lower: wp.vec3, upper: wp.vec3, tree: FaceTree):
    """Whether a box overlaps that of a node."""
    low = tree.lower[node]
    high = tree.upper[node]
    found = bool(True)
    for c in range(3):
        found = found and low[c] <= upper[c] and high[c] >= lower[c]
    return found


@wp.func
def next_node(node: int, entered: bool, leaves: int):
    """The node after this one, depth first; 0 after the last. `entered`: whether the boxes overlap."""
    found = wp.int32(node)
    if entered and node < leaves:
        found = 2 * node
    else:
        found += 1
        while found % 2 == 0:
            found = found / 2
        if found == 1:
            found = 0
    return found


@wp.func
def rounded(low: wp.vec3d, high: wp.vec3d, reach: wp.float64):
    """Box enlarged by `reach`, in float32."""
    wider = reach + wp.float64(1e-6) * (wp.length(low) + wp.length(high))
    lower = wp.vec3(wp.float32(low[0] - wider), wp.float32(low[1] - wider), wp.float32(low[2] - wider))
    upper = wp.vec3(wp.float32(high[0] + wider), wp.float32(high[1] + wider), wp.float32(high[2] + wider))
    return lower, upper


@dataclass(frozen=True)
class TreeKernels:
    """Attributes: merge: Kernel that merges boxes over `levels` levels below nodes; a thread is a node."""

    merge: Kernel


@functools.cache
def tree_kernels() -> TreeKernels:
    """Kernels of the tree."""

    @kernel(per="list")
    def merge_boxes(levels: int, first: int, lower: wp.array(dtype=wp.vec3), upper: wp.array(dtype=wp.vec3)):
        root = wp.tid() + first
        for level in range(levels):
            width = 1 << (levels - 1 - level)
            for node in range(root * width, root * width + width):
                lower[node] = wp.min(lower[2 * node], lower[2 * node + 1])
                upper[node] = wp.max(upper[2 * node], upper[2 * node + 1])

    return TreeKernels(merge_boxes)
