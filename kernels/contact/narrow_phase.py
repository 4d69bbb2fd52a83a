"""Distances between triangles of a sheet and segments of a body.

Two pairs of features can touch besides points of the sheet and faces of the body: an end of a segment and a triangle,
and a segment and a side of a triangle (Ericson, Real-Time Collision Detection, 2005, section 5.1).
"""

import functools

import warp as wp

from ..effects import unstaged
from .distances import BodyShape, of_any_point, ways_out
from .mesh_distance import weights_of_nearest


@wp.struct
class Segments:
    """Segments of a body in its frame.

    vertices: [m]. ends: indices of both vertices of a segment, and which of them it owns (1: first, 2: second,
    3: both); each vertex has one owner. tree: bounding volume hierarchy of the segments, float32. core: radius of the
    body around them [m]. radius: core plus the layer [m]. size: largest distance of a vertex from the origin [m].
    """

    vertices: wp.array(dtype=wp.vec3d)
    ends: wp.array(dtype=wp.vec3i)
    tree: wp.uint64
    core: wp.float64
    radius: wp.float64
    size: wp.float64


@wp.func
def between_segments(p: wp.vec3d, d: wp.vec3d, q: wp.vec3d, e: wp.vec3d):
    """Parameters (s, t) of the nearest points p + s d and q + t e, 0 <= s, t <= 1 (Ericson 2005, section 5.1.9)."""
    zero = wp.float64(0.0)
    one = wp.float64(1.0)
    r = p - q
    dd = wp.dot(d, d)
    ee = wp.dot(e, e)
    de = wp.dot(d, e)
    dr = wp.dot(d, r)
    er = wp.dot(e, r)
    s = zero
    left = dd * ee - de * de
    if left > wp.float64(1e-12) * dd * ee:
        s = wp.clamp((de * er - dr * ee) / left, zero, one)
    t = wp.clamp((de * s + er) / ee, zero, one)
    s = wp.clamp((de * t - dr) / dd, zero, one)
    return s, t


@wp.func
def nearest_pair(pair: int, x: wp.mat33d, entry: int, of: Segments):
    """Nearest points of one pair of features of a segment and a triangle with corners x in the frame of the body.

    Pairs 0 and 1 are an end of the segment and the triangle; pairs 2 to 4 are the segment and a side. Return the
    weights of the corners, the point on the segment, and whether the pair counts. It does not count if another segment
    owns the end, or if the side is nearest to an end, which is a pair of its own.
    """
    ends = of.ends[entry]
    begin = of.vertices[ends[0]]
    along = of.vertices[ends[1]] - begin
    spot = begin
    w = wp.vec3d()
    counts = bool(True)
    if pair < 2 or ends[0] == ends[1]:
        counts = (ends[2] & (pair + 1)) != 0 and pair < 2
        if pair == 1:
            spot = begin + along
        w = weights_of_nearest(spot, x[0], x[1], x[2])
    else:
        k = pair - 2
        side = x[(k + 1) % 3] - x[k]
        s, t = between_segments(begin, along, x[k], side)
        spot = begin + s * along
        w[k] = wp.float64(1.0) - t
        w[(k + 1) % 3] = t
        counts = s > wp.float64(0.0) and s < wp.float64(1.0)
    return w, spot, counts


@wp.func
def crosses(begin: wp.vec3d, end: wp.vec3d, x: wp.mat33d):
    """Whether the segment from `begin` to `end` passes through a triangle."""
    normal = wp.cross(x[1] - x[0], x[2] - x[0])
    below = wp.dot(normal, begin - x[0])
    above = wp.dot(normal, end - x[0])
    found = bool(False)
    if below * above < wp.float64(0.0):
        met = (above * begin - below * end) / (above - below)
        w = weights_of_nearest(met, x[0], x[1], x[2])
        # All weights are positive for a point inside the triangle.
        found = wp.min(w) > wp.float64(0.0)
    return found


@wp.func
def passes_through(x: wp.mat33d, entry: int, of: Segments):
    """Whether a segment passes through a triangle."""
    return crosses(of.vertices[of.ends[entry][0]], of.vertices[of.ends[entry][1]], x)


@wp.func
def box_around(x: wp.mat33d, reach: wp.float64, of: Segments):
    """Lower and upper corner of the bounding box of a triangle, enlarged by `reach`, in float32."""
    wider = reach + wp.float64(1e-6) * (of.size + wp.length(x[0]))
    lower = wp.min(x[0], wp.min(x[1], x[2]))
    upper = wp.max(x[0], wp.max(x[1], x[2]))
    return (
        wp.vec3(wp.float32(lower[0] - wider), wp.float32(lower[1] - wider), wp.float32(lower[2] - wider)),
        wp.vec3(wp.float32(upper[0] + wider), wp.float32(upper[1] + wider), wp.float32(upper[2] + wider)),
    )


@functools.cache
def clearances(distance: wp.Function) -> wp.Kernel:
    """Kernel of the distances of triangles from the segments of a body [m], at most `reach`.

    Corners are in the frame of the body [m], (F, 3) vec3d. The distance is -1 if a segment passes through the triangle,
    or a side of the triangle through the body.
    """
    way_out = ways_out(of_any_point(distance)).way_out

    @unstaged
    def find_clearances(
        corners: wp.array2d(dtype=wp.vec3d), reach: wp.float64, of: Segments, body: BodyShape, first: int,
        out: wp.array(dtype=wp.float64),
    ):  # fmt: skip
        f = wp.tid() + first
        least = reach
        x = wp.matrix_from_rows(corners[f, 0], corners[f, 1], corners[f, 2])
        lower, upper = box_around(x, reach, of)
        query = wp.bvh_query_aabb(of.tree, lower, upper)
        entry = int(0)  # noqa: RUF046
        # Variables, so that the loops are not unrolled: this runs once.
        pairs = int(5)  # noqa: RUF046
        sides = int(3)  # noqa: RUF046
        while wp.bvh_query_next(query, entry):
            for pair in range(pairs):
                w, spot, _counts = nearest_pair(pair, x, entry, of)
                least = wp.min(least, wp.length(wp.transpose(x) * w - spot))
            if passes_through(x, entry, of):
                least = wp.float64(-1.0)
        for k in range(sides):
            begin = x[k]
            end = x[(k + 1) % 3]
            far = wp.length(begin) + wp.length(end) + of.size
            unturned = wp.quat_identity(wp.float64)
            touches, _n, _shift, _pressed, _of = way_out(
                -1, begin, end, distance(end, far, body), unturned, far, body, wp.float64(1e-6) * of.size
            )
            if touches:
                least = wp.float64(-1.0)
        out[f] = least

    return find_clearances
