"""A tree of boxes around triangles, of a moving sheet or of a body.

Triangles are the leaves of a complete binary tree, in an order that keeps neighbours of the reference state together;
node k has the children 2 k and 2 k + 1. Its shape never changes, so a query meets triangles in the same order in every
run (Ericson, Real-Time Collision Detection, 2005, section 6.6). The boxes of a sheet are made by launches, which are
skipped while nothing has moved; the refit of a `wp.Bvh` is a call, which a stage cannot skip.
"""

import warp as wp

from ..effects import kernel


@wp.struct
class FaceTree:
    """Boxes of triangles.

    leaves: number of leaves, a power of 2. order: triangle of each leaf, -1 for a leaf without one. lower, upper:
    corners of the box of each node [m].
    """

    leaves: int
    order: wp.array(dtype=wp.int32)
    lower: wp.array(dtype=wp.vec3)
    upper: wp.array(dtype=wp.vec3)


@wp.func
def next_face(after: int, lower: wp.vec3, upper: wp.vec3, tree: FaceTree):
    """The next triangle whose box overlaps another one, depth first, and its node; triangle -1 after the last.

    `after`: the node before, 0 for the first, -1 to find none.
    """
    node = wp.where(after < 0, 0, wp.max(after, 1))
    # Whether the children of the node are still to come.
    down = after == 0
    found = wp.int32(-1)
    while node != 0 and found < 0:
        if down:
            low = tree.lower[node]
            high = tree.upper[node]
            for c in range(3):
                down = down and low[c] <= upper[c] and high[c] >= lower[c]
            if down and node >= tree.leaves:
                found = tree.order[node - tree.leaves]
                down = False
        if found < 0:
            if down:
                node = 2 * node
            else:
                node += 1
                while node % 2 == 0:
                    node = node / 2
                node = wp.where(node == 1, 0, node)
                down = True
    return found, node


@kernel(per="list", writes=("tree.lower", "tree.upper"))
def merge_boxes(tree: FaceTree, first: int):
    """Box of a node from those of its children; a thread is a node."""
    node = wp.tid() + first
    tree.lower[node] = wp.min(tree.lower[2 * node], tree.lower[2 * node + 1])
    tree.upper[node] = wp.max(tree.upper[2 * node], tree.upper[2 * node + 1])
