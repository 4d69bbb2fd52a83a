"""Signed distances to rigid bodies, negative inside, and the outward normal at the nearest point of the surface.

A distance is a function (arm, reach, body) -> vec4d (normal, distance); `arm` is in the frame of the body [m]. If the
body is further away than `reach`, the function may return `reach`. Distances are float64 whatever the precision of the
sheet, because float32 cannot resolve contact with a large body. A distance of a point is a function
(i, arm, reach, body); point i may remember where the surface of a mesh is (kernels/contact/mesh_distance.py).

`FaceTree` has boxes around the triangles of a moving sheet or of a body. Triangles are the leaves of a complete binary
tree, in an order that keeps neighbours of the reference state together; node k has the children 2 k and 2 k + 1. Its
shape never changes, so a query meets triangles in the same order in every run (Ericson, Real-Time Collision Detection,
2005, section 6.6). The boxes of a sheet are made by launches, which are skipped while nothing has moved; the refit of a
`wp.Bvh` is a call, which a stage cannot skip.
"""

import functools
from dataclasses import dataclass

import warp as wp

from ..effects import kernel, unstaged

# Maximum number of parts into which the path of a point in a step is divided to find its entry into a body.
PARTS = 256
# Maximum number of shifts until a point is on the surface; the second half of them go straight out.
TRIES = 6
# Smallest cosine of the angle to the normal for a direction along which points are moved out of a body.
STEEP = wp.constant(wp.float64(0.9))

# Below this length [m] the square of a vector loses digits, so it has no direction.
TINY = wp.constant(wp.float64(1e-140))


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


@wp.struct
class MeshSurface:
    """Surface of a mesh, see kernels/contact/mesh_distance.py.

    size: largest distance of a vertex from the origin [m]. mesh, tree: for searches. triangles: first corner, vectors
    from there to the others [m], and unit normal, (F, 4). normals: of the sides opposite the three corners, then of the
    corners, (F, 6), any length. far: distance up to which a search looks [m]. close: distance within which points list
    triangles [m]. unsure: largest error of the search in float32 [m]. trust: fraction of a distance that is remembered.
    seen, faces, apart: what points remember, (N,).
    """

    size: wp.float64
    mesh: wp.uint64
    tree: FaceTree
    triangles: wp.array2d(dtype=wp.vec3d)
    normals: wp.array2d(dtype=wp.vec3d)
    far: wp.float64
    close: wp.float64
    unsure: wp.float64
    trust: wp.float64
    seen: wp.array(dtype=wp.vec4)
    faces: wp.array(dtype=wp.vec4i)
    apart: wp.array(dtype=wp.vec4)


@wp.struct
class BodyShape:
    """Sizes [m] of a body, documented at each distance function; of a mesh also its surface.

    surface: (1,); an array, because functions that are not inlined copy their arguments. seen, faces, apart: the same
    arrays as there, by which launches declare that they write them.
    """

    size: wp.vec4d
    surface: wp.array(dtype=MeshSurface)
    seen: wp.array(dtype=wp.vec4)
    faces: wp.array(dtype=wp.vec4i)
    apart: wp.array(dtype=wp.vec4)


@wp.func
def with_normal(n: wp.vec3d, distance: wp.float64):
    return wp.vec4d(n[0], n[1], n[2], distance)


@wp.func
def from_point(arm: wp.vec3d, radius: wp.float64):
    length = wp.length(arm)
    n = wp.vec3d(wp.float64(1.0), wp.float64(0.0), wp.float64(0.0))
    if length > TINY:
        n = arm / length
    return with_normal(n, length - radius)


@wp.func
def sphere_distance(arm: wp.vec3d, reach: wp.float64, body: BodyShape):
    """Distance to a sphere; size: radius."""
    return from_point(arm, body.size[0])


@wp.func
def plane_distance(arm: wp.vec3d, reach: wp.float64, body: BodyShape):
    """Distance to a half space; size: unit normal."""
    n = wp.vec3d(body.size[0], body.size[1], body.size[2])
    return with_normal(n, wp.dot(arm, n))


@wp.func
def capsule_distance(arm: wp.vec3d, reach: wp.float64, body: BodyShape):
    """Distance to a capsule along z; sizes: radius, half length of the axis."""
    along = wp.clamp(arm[2], -body.size[1], body.size[1])
    return from_point(wp.vec3d(arm[0], arm[1], arm[2] - along), body.size[0])


@wp.func
def cylinder_distance(arm: wp.vec3d, reach: wp.float64, body: BodyShape):
    """Distance to a cylinder along z; sizes: radius, half height, rounding of the edges."""
    zero = wp.float64(0.0)
    rounding = body.size[2]
    across = wp.sqrt(arm[0] * arm[0] + arm[1] * arm[1])
    outward = wp.vec3d(wp.float64(1.0), zero, zero)
    if across > TINY:
        outward = wp.vec3d(arm[0] / across, arm[1] / across, zero)
    up = wp.vec3d(zero, zero, wp.where(arm[2] < zero, wp.float64(-1.0), wp.float64(1.0)))
    beside = across - body.size[0] + rounding
    above = wp.abs(arm[2]) - body.size[1] + rounding
    found = with_normal(outward, beside - rounding)
    if beside > zero and above > zero:
        distance = wp.sqrt(beside * beside + above * above)
        found = with_normal((beside / distance) * outward + (above / distance) * up, distance - rounding)
    elif above > beside:
        found = with_normal(up, above - rounding)
    return found


@wp.func
def box_distance(arm: wp.vec3d, reach: wp.float64, body: BodyShape):
    """Distance to a box; sizes: half lengths of the sides, rounding of the edges."""
    zero = wp.float64(0.0)
    beyond = wp.vec3d()
    signs = wp.vec3d()
    nearest = int(0)  # noqa: RUF046
    for c in range(3):
        signs[c] = wp.where(arm[c] < zero, wp.float64(-1.0), wp.float64(1.0))
        beyond[c] = wp.abs(arm[c]) - body.size[c] + body.size[3]
        if beyond[c] > beyond[nearest]:
            nearest = c
    n = wp.vec3d()
    n[nearest] = signs[nearest]
    distance = beyond[nearest]
    if distance > TINY:
        out = wp.vec3d(wp.max(beyond[0], zero), wp.max(beyond[1], zero), wp.max(beyond[2], zero))
        distance = wp.length(out)
        n = wp.cw_mul(out / distance, signs)
    return with_normal(n, distance - body.size[3])


@functools.cache
def distances(distance: wp.Function) -> wp.Kernel:
    """Kernel that fills `found` (N,) vec4d with the signed distances of N points from a placed and rotated body."""

    @unstaged
    def find_distances(
        points: wp.array(dtype=wp.vec3d),
        reach: wp.float64,
        body: BodyShape,
        first: int,
        found: wp.array(dtype=wp.vec4d),
    ):
        i = wp.tid() + first
        found[i] = distance(points[i], reach, body)

    return find_distances


@functools.cache
def of_any_point(distance: wp.Function) -> wp.Function:
    """Distance of a point that remembers nothing."""

    @wp.func
    def distance_of_point(i: int, arm: wp.vec3d, reach: wp.float64, body: BodyShape):
        return distance(arm, reach, body)

    return distance_of_point


@dataclass(frozen=True)
class WaysOut:
    """Warp functions of a shape, in the frame of the body.

    Attributes:
        way_out: (i, a0, a1, end, turn, reach, body, skin) -> (touches, n, shift, pressed, of_start), for a point that
            moves from `a0` to `a1` [m]. `end` is the distance at `a1`, computed up to `reach`; `turn` rotates
            directions from the frame at the beginning of the step to that at the end. `shift` moves the point out along
            `n`. `pressed` [m] is the length of the shift or, for a point that was on the surface, by how much it came
            nearer. `of_start` is true if `n` is the normal at the beginning.
        pushed_out: (i, a, n, end, reach, body, skin) -> shift along n from `a`, where the distance is `end`, to the
            surface; zero outside the body.
    """

    way_out: wp.Function
    pushed_out: wp.Function


@functools.cache
def ways_out(distance: wp.Function) -> WaysOut:
    """The functions for the distance of a point."""

    @wp.func
    def normal_of(found: wp.vec4d):
        return wp.vec3d(found[0], found[1], found[2])

    @wp.func
    def entry(
        i: int, a0: wp.vec3d, way: wp.vec3d, travel: wp.float64, start: wp.vec4d, body: BodyShape, skin: wp.float64
    ):  # fmt: skip
        """Where a point enters the body along its path (-1: nowhere), and the normal there, by sphere tracing."""
        found = start
        at = wp.float64(0.0)
        hit = wp.float64(-1.0)
        least = wp.max(wp.float64(0.5) * skin, travel / wp.static(wp.float64(PARTS)))
        for _part in range(wp.static(2 * PARTS)):
            if found[3] < wp.float64(0.1) * skin and wp.dot(normal_of(found), way) < wp.float64(0.0):
                hit = at
                break
            at += wp.max(found[3], least)
            if at >= travel:
                break
            found = distance(i, a0 + at * way, travel, body)
        return hit, normal_of(found)

    @wp.func
    def pushed_out(
        i: int, a: wp.vec3d, n: wp.vec3d, end: wp.vec4d, reach: wp.float64, body: BodyShape, skin: wp.float64
    ):  # fmt: skip
        """Shift to the surface by Newton's method; if n is nearly tangential, the shift to the nearest point."""
        close = wp.float64(1e-3) * skin
        shift = wp.vec3d()
        left = end
        again = wp.int32(0)
        while again < wp.static(TRIES) and (left[3] < -close or (again > 0 and left[3] > close)):
            steep = wp.dot(normal_of(left), n)
            if again < wp.static(TRIES // 2) and steep > wp.static(STEEP):
                shift -= (left[3] / steep) * n
            elif left[3] < wp.float64(0.0):
                shift -= left[3] * normal_of(left)
            left = distance(i, a + shift, reach, body)
            again += 1
        return shift

    @wp.func
    def way_out(
        i: int, a0: wp.vec3d, a1: wp.vec3d, end: wp.vec4d, turn: wp.quatd, reach: wp.float64, body: BodyShape,
        skin: wp.float64,
    ):  # fmt: skip
        zero = wp.float64(0.0)
        travel = wp.length(a1 - a0)
        touches = bool(False)
        of_start = bool(False)
        n = normal_of(end)
        shift = wp.vec3d()
        pressed = zero
        if end[3] < wp.max(travel, skin):
            start = distance(i, a0, reach + wp.abs(end[3]), body)
            gap = start[3]
            ahead = wp.dot(normal_of(start), a1 - a0)
            crosses = bool(False)
            if end[3] < zero:
                crosses = wp.dot(normal_of(start), n) < zero
            else:
                crosses = gap + end[3] < travel and (gap >= skin or ahead < -skin)
            left = end
            if crosses and travel > zero:
                way = (a1 - a0) / travel
                hit, facing = entry(i, a0, way, travel, start, body, skin)
                if hit >= zero:
                    below = wp.dot(a1 - (a0 + hit * way), facing)
                    if below < zero:
                        touches = True
                        n = facing
                        shift = -below * facing
                        left = distance(i, a1 + shift, reach, body)
            elif end[3] < zero or gap < skin:
                began = wp.quat_rotate(turn, normal_of(start))
                of_start = wp.dot(began, n) > wp.static(STEEP)
                if of_start:
                    n = began
            if end[3] < zero or (end[3] < skin and gap < skin):
                touches = True
            if touches:
                shift += pushed_out(i, a1 + shift, n, left, reach, body, skin)
                # For a point that stays on the surface the shift is rounding of its position.
                pressed = wp.where(gap < skin, wp.max(gap - end[3], zero), wp.length(shift))
        return touches, n, shift, pressed, of_start

    return WaysOut(way_out, pushed_out)
