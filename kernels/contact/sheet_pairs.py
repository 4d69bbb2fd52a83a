"""Pairs of features of triangles of one moving sheet that may touch: a point and a triangle, or two sides.

Whether a pair comes near in a step is found by conservative advancement (Li, Kaufman and Jiang, Codimensional
incremental potential contact, ACM Trans. Graph. 40, 2021, section 5): the distance changes by at most the relative
motion. The impulses are found in kernels/contact/sheet_contact.py.

Pairs of triangles that share a corner are left out. A triangle cut by a crack has no contact and connects no points.
"""

from typing import Any

import warp as wp

from .distances import FaceTree
from .mesh_distance import weights_of_nearest
from .narrow_phase import between_segments
from .surface_contact import NEAREST

# A distance below this fraction of the one to be kept is zero: the faces of a crack of an outline.
ZERO = wp.constant(wp.float64(1e-3))
# Fraction of the distance to be kept that a pair may reach in a step before it counts.
REACHED = wp.constant(wp.float64(0.75))
# Within a piece pairs keep at most this fraction of their reference distance.
OF_REFERENCE = wp.constant(wp.float64(0.5))
# Maximum number of advances along the path of a pair.
ADVANCES = 64

mat43d: Any = wp.types.matrix(shape=(4, 3), dtype=wp.float64)


@wp.struct
class Surface:
    """Points, triangles and sides in a step. Entities are points, then sides.

    reference: [m]. piece: of a point. begin, drift: position at the beginning of the step, and displacement in it
    without contact [m]. ease: displacement by contact over impulse times step, along each axis [1/kg]. given:
    displacement by contact [m]. stays: whether a point stays where it is. sides: corners of a side, and its triangles
    (-1: none). across, of_face: triangles and sides across from the corners of a triangle. begins, faces: the triangles
    of point i are entries begins[i] to begins[i + 1]. intact, seen: whether a triangle is not cut, now and in the last
    step; no entries if none can be. near: whether an entity may have pairs. kept: distance to be kept [m]. skin: of the
    boxes [m]. listed_at: positions for which they were made [m].
    """

    reference: wp.array(dtype=wp.vec3d)
    piece: wp.array(dtype=wp.int32)
    begin: wp.array(dtype=wp.vec3d)
    drift: wp.array(dtype=wp.vec3d)
    ease: wp.array(dtype=wp.vec3d)
    given: wp.array(dtype=wp.vec3d)
    stays: wp.array(dtype=wp.uint8)
    triangles: wp.array(dtype=wp.vec3i)
    sides: wp.array(dtype=wp.vec4i)
    across: wp.array(dtype=wp.vec3i)
    of_face: wp.array(dtype=wp.vec3i)
    begins: wp.array(dtype=wp.int32)
    faces: wp.array(dtype=wp.int32)
    intact: wp.array(dtype=wp.uint8)
    seen: wp.array(dtype=wp.uint8)
    near: wp.array(dtype=wp.uint8)
    tree: FaceTree
    kept: wp.float64
    skin: wp.float64
    listed_at: wp.array(dtype=wp.vec3d)


@wp.func
def nearest(sides: bool, x: mat43d):
    """Weights of the nearest points of point 0 and triangle (1, 2, 3), or of sides (0, 1) and (2, 3)."""
    one = wp.float64(1.0)
    found = wp.vec4d()
    if sides:
        s, t = between_segments(x[0], x[1] - x[0], x[2], x[3] - x[2])
        found = wp.vec4d(one - s, s, t - one, -t)
    else:
        w = weights_of_nearest(x[0], x[1], x[2], x[3])
        found = wp.vec4d(one, -w[0], -w[1], -w[2])
    return found


@wp.func
def distance(sides: bool, x: mat43d):
    return wp.length(wp.transpose(x) * nearest(sides, x))


@wp.func
def largest_approach(sides: bool, motion: mat43d):
    """Upper bound of the change of distance of a pair whose points move by `motion`."""
    mean = wp.float64(0.25) * (motion[0] + motion[1] + motion[2] + motion[3])
    a = wp.length(motion[0] - mean)
    b = wp.length(motion[1] - mean)
    cd = wp.max(wp.length(motion[2] - mean), wp.length(motion[3] - mean))
    return wp.where(sides, wp.max(a, b) + cd, a + wp.max(b, cd))


@wp.func
def comes_near(sides: bool, x: mat43d, motion: mat43d, limit: wp.float64):
    """Fraction of the step at which the distance of a pair falls to `limit`, or 2; assumed after ADVANCES advances."""
    most = largest_approach(sides, motion)
    t = wp.float64(0.0)
    found = wp.float64(2.0)
    count = wp.int32(0)
    while t < wp.float64(1.0):
        gap = distance(sides, x + t * motion)
        if gap <= limit or count == wp.static(ADVANCES):
            found = t
        if found == t or most == wp.float64(0.0):
            t = wp.float64(1.0)
        else:
            t += (gap - wp.float64(0.5) * limit) / most
        count += 1
    return found


@wp.func
def way(i: int, a: Surface):
    """Displacement of a point in the step; a held component does not yield, so it cannot stay."""
    found = a.drift[i] + a.given[i]
    if a.stays[i] != wp.uint8(0):
        for c in range(3):
            if a.ease[i][c] > wp.float64(0.0):
                found[c] = wp.float64(0.0)
    return found


@wp.func
def path(points: wp.vec4i, a: Surface):
    """Positions of points at the beginning of the step, and their displacements in it."""
    x = mat43d()
    motion = mat43d()
    for k in range(4):
        x[k] = a.begin[points[k]]
        motion[k] = way(points[k], a)
    return x, motion


@wp.func
def whole(f: int, a: Surface):
    """Whether f is a triangle that is not cut."""
    found = f >= 0
    if found and a.intact.shape[0] > 0:
        found = a.intact[f] != wp.uint8(0)
    return found


@wp.func
def share_corner(f: int, g: int, a: Surface):
    """Whether two triangles that are not cut share a corner."""
    found = bool(False)
    if whole(f, a) and whole(g, a):
        for k in range(3):
            for m in range(3):
                found = found or a.triangles[f][k] == a.triangles[g][m]
    return found


@wp.func
def box_of(corners: wp.vec3i, apart: wp.float64, a: Surface):
    """Box in float32 around the paths of three points, enlarged by half of `apart`."""
    low = a.begin[corners[0]]
    high = low
    for k in range(3):
        x = a.begin[corners[k]]
        y = x + way(corners[k], a)
        low = wp.min(low, wp.min(x, y))
        high = wp.max(high, wp.max(x, y))
    wider = wp.float64(0.5) * apart + wp.float64(1e-6) * (wp.length(low) + wp.length(high))
    lower = wp.vec3()
    upper = wp.vec3()
    for c in range(3):
        lower[c] = wp.float32(low[c] - wider)
        upper[c] = wp.float32(high[c] + wider)
    return lower, upper


@wp.func
def box_of_entity(g: int, apart: wp.float64, a: Surface):
    corners = wp.vec3i(g, g, g)
    if g >= a.begin.shape[0]:
        e = a.sides[g - a.begin.shape[0]]
        corners = wp.vec3i(e[0], e[1], e[1])
    return box_of(corners, apart, a)


@wp.func
def pair_of(g: int, f: int, which: int, a: Surface):
    """The pair of a point with triangle f (`which` = 0), or of a side with a later one whose first triangle is f.

    Return its points, and the triangle or side; -1 if it does not count.
    """
    found = wp.vec4i()
    other = wp.int32(-1)
    meets = bool(False)
    own = g - a.begin.shape[0]
    if own < 0:
        if which == 0:
            for at in range(a.begins[g], a.begins[g + 1]):
                meets = meets or share_corner(f, a.faces[at], a)
            t = a.triangles[f]
            found = wp.vec4i(g, t[0], t[1], t[2])
            other = f
    else:
        side = a.of_face[f][which]
        if a.sides[side][2] == f and own < side:
            e = a.sides[own]
            h = a.sides[side]
            for k in range(4):
                meets = meets or share_corner(e[2 + k / 2], h[2 + k % 2], a)
            found = wp.vec4i(e[0], e[1], h[0], h[1])
            other = side
    return found, wp.where(meets, -1, other)


@wp.func
def distance_kept(sides: bool, points: wp.vec4i, a: Surface):
    kept = a.kept
    if a.piece[points[0]] == a.piece[points[2]]:
        x = mat43d()
        for k in range(4):
            x[k] = a.reference[points[k]]
        kept = wp.min(kept, OF_REFERENCE * distance(sides, x))
    return kept


@wp.func
def at_rim(i: int, f: int, x: mat43d, w: wp.vec4d, a: Surface):
    """Weights of the point nearest to point i on the rim of triangle f that faces it, and the outward normal.

    The normal is 0 without such a rim.
    """
    away = wp.vec3d()
    for at in range(a.begins[i], a.begins[i + 1]):
        if whole(a.faces[at], a):
            for k in range(3):
                away += a.begin[a.triangles[a.faces[at]][k]] - x[0]
    best = wp.float64(0.0)
    normal = wp.vec3d()
    found = wp.vec4d()
    for k in range(1, 4):
        if not whole(a.across[f][k - 1], a) and -w[k] < wp.float64(0.1):
            one = k % 3 + 1
            two = one % 3 + 1
            side = x[two] - x[one]
            out = x[one] - x[k]
            n = wp.normalize(out - (wp.dot(out, side) / wp.dot(side, side)) * side)
            facing = wp.dot(n, away)
            if facing > best:
                best = facing
                normal = n
                t = wp.clamp(wp.dot(x[0] - x[one], side) / wp.dot(side, side), wp.float64(0.0), wp.float64(1.0))
                found = wp.vec4d(wp.float64(1.0))
                found[k] = wp.float64(0.0)
                found[one] = t - wp.float64(1.0)
                found[two] = -t
    return found, normal


@wp.func
def counts_here(f: int, sides: bool, x: mat43d, w: wp.vec4d, gap: wp.float64, a: Surface):
    """Whether no other pair of the same triangles is nearer, so that sheets slide over sides without a bump."""
    counts = bool(True)
    for k in range(4):
        if w[k] == wp.float64(0.0):
            if sides:
                counts = False
            elif whole(a.across[f][wp.max(k - 1, 0)], a):
                c = a.triangles[a.across[f][wp.max(k - 1, 0)]]
                y = mat43d()
                y[0] = x[0]
                for m in range(3):
                    y[m + 1] = a.begin[c[m]]
                counts = counts and distance(sides, y) >= NEAREST * gap
    return counts


@wp.func
def constraint(f: int, sides: bool, points: wp.vec4i, a: Surface):
    """Weights, normal and distance of a pair, that to be kept, and when it comes near (2: not in this step)."""
    x, motion = path(points, a)
    w = nearest(sides, x)
    n = wp.transpose(x) * w
    gap = wp.length(n)
    kept = wp.float64(0.0)
    when = wp.float64(2.0)
    if gap <= ZERO * a.kept:
        if not sides:
            w, n = at_rim(points[0], f, x, w, a)
            gap = wp.dot(n, wp.transpose(x) * w)
            if wp.length(n) > wp.float64(0.0):
                when = wp.float64(0.0)
    elif gap <= a.kept + largest_approach(sides, motion):
        kept = distance_kept(sides, points, a)
        n = n / gap
        if gap > kept:
            when = comes_near(sides, x, motion, wp.max(REACHED * kept, ZERO * a.kept))
        elif counts_here(f, sides, x, w, gap, a):
            when = wp.float64(0.0)
    return w, n, gap, kept, when
