"""Pairs of features of triangles of one moving sheet that may touch: a point and a triangle, or two sides.

Whether a pair comes near in a step is found by conservative advancement (Li, Kaufman and Jiang, Codimensional
incremental potential contact, ACM Trans. Graph. 40, 2021, section 5): the distance changes by at most the relative
motion. The impulses are found in kernels/sheet_contact.py.

Pairs of triangles that share a corner are left out. A triangle cut by a crack has no contact and connects no points.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from .body_search import wide_places
from .distances import weights_of_nearest
from .face_tree import FaceTree, rounded
from .numeric import numeric
from .narrow_phase import between_segments
from .surface_contact import NEAREST

# A distance below this fraction of the one to be kept is zero: the faces of a crack of an outline.
ZERO = wp.constant(wp.float64(1e-3))
# Fraction of the distance to be kept that a pair may reach in a step before it counts.
REACHED = wp.constant(wp.float64(0.75))
# Within a piece pairs keep at most this fraction of their reference distance.
OF_REFERENCE = wp.constant(wp.float64(0.5))
# Advances on the way of a pair.
ADVANCES = 64

mat43d: Any = wp.types.matrix(shape=(4, 3), dtype=wp.float64)


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
def largest_approach(sides: bool, motion: mat43d):
    """Upper bound of the change of distance of a pair whose points move by `motion`."""
    mean = wp.float64(0.25) * (motion[0] + motion[1] + motion[2] + motion[3])
    a = wp.length(motion[0] - mean)
    b = wp.length(motion[1] - mean)
    c = wp.length(motion[2] - mean)
    d = wp.length(motion[3] - mean)
    found = a + wp.max(b, wp.max(c, d))
    if sides:
        found = wp.max(a, b) + wp.max(c, d)
    return found


@wp.func
def comes_near(sides: bool, x: mat43d, motion: mat43d, limit: wp.float64):
    """Fraction of its way at which the distance of a pair falls to `limit`, else 2; after many advances, assumed."""
    most = largest_approach(sides, motion)
    t = wp.float64(0.0)
    found = wp.float64(2.0)
    count = wp.int32(0)
    while t < wp.float64(1.0):
        y = x + t * motion
        gap = wp.length(wp.transpose(y) * nearest(sides, y))
        if gap <= limit or count == wp.static(ADVANCES):
            found = t
        if found == t or most == wp.float64(0.0):
            t = wp.float64(1.0)
        else:
            t += (gap - wp.float64(0.5) * limit) / most
        count += 1
    return found


@dataclass(frozen=True)
class SheetPairs:
    """Struct and Warp functions of one configuration; `a` is the struct.

    Entities are points, then sides. The pairs of a point are with triangles, those of a side with later sides.

    Attributes:
        Surface: Points, triangles and sides.
        start: (i, a) -> position of a point at the beginning of the step [m].
        ease: (i, a) -> velocity change per impulse along each axis [1/kg].
        whole: (f, a) -> whether f is a triangle that is not cut.
        path: (points, a) -> positions of the points of a pair at the beginning of the step, and their ways in it [m].
        box_of: (points, reach, a) -> box around the ways of three points.
        box_of_entity: (g, apart, a) -> the same of an entity, with a reach of half of `apart`.
        pair_of: (g, f, which, a) -> points of a pair, and the triangle or side that g meets.
        distance_kept: (sides, points, a) -> distance that a pair keeps [m].
        constraint: (f, sides, points, a) -> weights, normal, distances, and when the pair comes near.
    """

    Surface: Any
    start: wp.Function
    ease: wp.Function
    whole: wp.Function
    path: wp.Function
    box_of: wp.Function
    box_of_entity: wp.Function
    pair_of: wp.Function
    distance_kept: wp.Function
    constraint: wp.Function


@functools.cache
def sheet_pairs(bits: int, curved: bool, held: bool, torn: bool) -> SheetPairs:
    """Functions of pairs; the arguments are those of `sheet_contact`."""
    types = numeric(bits)
    real, vec3 = types.real, types.vec3
    wide, placed = wide_places(bits, curved)

    @wp.struct
    class Surface:
        """Points, triangles and sides.

        sides: corners of a side, and its triangles (-1: none). across, of_face: triangles and sides across from the
        corners of a triangle. owned: bits of the sides (1, 2, 4) that a triangle owns; each has one owner. begins,
        faces: the triangles of point i are entries begins[i] to begins[i + 1]. near: whether an entity may have pairs.
        unit: impulses times the step are summed as integer multiples of this [kg m].
        """

        reference: wp.array(dtype=vec3 if curved else types.vec2)
        piece: wp.array(dtype=wp.int32)
        mass: wp.array(dtype=real)
        held_mask: wp.array(dtype=wp.uint8)
        displacement: wp.array(dtype=vec3)
        velocity: wp.array(dtype=vec3)
        step: wp.array(dtype=real)
        given: wp.array(dtype=wp.vec3d)
        stays: wp.array(dtype=wp.uint8)
        triangles: wp.array(dtype=wp.vec3i)
        intact: wp.array(dtype=wp.uint8)
        sides: wp.array(dtype=wp.vec4i)
        across: wp.array(dtype=wp.vec3i)
        owned: wp.array(dtype=wp.int32)
        of_face: wp.array(dtype=wp.vec3i)
        begins: wp.array(dtype=wp.int32)
        faces: wp.array(dtype=wp.int32)
        near: wp.array(dtype=wp.uint8)
        tree: FaceTree
        kept: wp.float64
        skin: wp.float64
        friction: wp.float64
        unit: wp.float64

    @wp.func
    def start(i: int, a: Surface):
        return placed(a.reference[i], a.displacement[i]) - wp.float64(a.step[0]) * wide(a.velocity[i])

    @wp.func
    def ease(i: int, a: Surface):
        """Velocity change per impulse along each axis [1/kg]."""
        found = wp.vec3d(wp.float64(1.0) / wp.float64(a.mass[i]))
        if wp.static(held):
            for c in range(3):
                if (wp.int32(a.held_mask[i]) >> c) & 1 == 1:
                    found[c] = wp.float64(0.0)
        return found

    @wp.func
    def way(i: int, a: Surface):
        found = wp.float64(a.step[0]) * (wide(a.velocity[i]) + a.given[i])
        if a.stays[i] != wp.uint8(0):
            e = ease(i, a)
            for c in range(3):
                if e[c] > wp.float64(0.0):
                    found[c] = wp.float64(0.0)
        return found

    @wp.func
    def path(points: wp.vec4i, a: Surface):
        x = mat43d()
        motion = mat43d()
        for k in range(4):
            x[k] = start(points[k], a)
            motion[k] = way(points[k], a)
        return x, motion

    @wp.func
    def whole(f: int, a: Surface):
        found = f >= 0
        if wp.static(torn):
            if found:
                found = a.intact[f] != wp.uint8(0)
        return found

    @wp.func
    def shares_corner(f: int, g: int, a: Surface):
        found = bool(False)
        for k in range(3):
            for m in range(3):
                found = found or a.triangles[f][k] == a.triangles[g][m]
        return found

    @wp.func
    def faces_meet(e: wp.vec4i, f: wp.vec4i, a: Surface):
        """Whether triangles of two sides share a corner."""
        found = bool(False)
        for k in range(2, 4):
            for m in range(2, 4):
                if whole(e[k], a) and whole(f[m], a):
                    found = found or shares_corner(e[k], f[m], a)
        return found

    @wp.func
    def point_meets(i: int, f: int, a: Surface):
        """Whether a triangle of a point shares a corner with triangle f."""
        found = bool(False)
        for at in range(a.begins[i], a.begins[i + 1]):
            if whole(a.faces[at], a) and not found:
                found = shares_corner(f, a.faces[at], a)
        return found

    @wp.func
    def box_of(corners: wp.vec3i, reach: wp.float64, a: Surface):
        """Box around the ways of three points, enlarged."""
        low = start(corners[0], a)
        high = low
        for k in range(3):
            x = start(corners[k], a)
            y = x + way(corners[k], a)
            low = wp.min(low, wp.min(x, y))
            high = wp.max(high, wp.max(x, y))
        return rounded(low, high, reach)

    @wp.func
    def box_of_entity(g: int, apart: wp.float64, a: Surface):
        corners = wp.vec3i(g, g, g)
        if g >= a.mass.shape[0]:
            e = a.sides[g - a.mass.shape[0]]
            corners = wp.vec3i(e[0], e[1], e[1])
        return box_of(corners, wp.float64(0.5) * apart, a)

    @wp.func
    def pair_of(g: int, f: int, which: int, a: Surface):
        """The pair of a point with triangle f (`which` = 0), or of a side with a later one of f: its points, and the
        triangle or side; -1 if it does not count."""
        found = wp.vec4i()
        other = wp.int32(-1)
        t = a.triangles[f]
        own = g - a.mass.shape[0]
        if own < 0:
            if which == 0 and not point_meets(g, f, a):
                found = wp.vec4i(g, t[0], t[1], t[2])
                other = f
        else:
            side = a.of_face[f][which]
            if (a.owned[f] >> which) & 1 == 1 and own < side:
                e = a.sides[own]
                h = a.sides[side]
                if not faces_meet(e, h, a):
                    found = wp.vec4i(e[0], e[1], h[0], h[1])
                    other = side
        return found, other

    @wp.func
    def distance_kept(sides: bool, points: wp.vec4i, a: Surface):
        kept = a.kept
        if a.piece[points[0]] == a.piece[points[2]]:
            x = mat43d()
            for k in range(4):
                x[k] = placed(a.reference[points[k]], vec3())
            kept = wp.min(kept, OF_REFERENCE * wp.length(wp.transpose(x) * nearest(sides, x)))
        return kept

    @wp.func
    def away_from(i: int, a: Surface):
        """Sum of the vectors from a point to the other corners of its triangles."""
        total = wp.vec3d()
        for at in range(a.begins[i], a.begins[i + 1]):
            if whole(a.faces[at], a):
                for k in range(3):
                    total += start(a.triangles[a.faces[at]][k], a) - start(i, a)
        return total

    @wp.func
    def at_rim(i: int, f: int, x: mat43d, w: wp.vec4d, a: Surface):
        """Weights of the point nearest to point i on the rim of triangle f that faces it, and the outward normal.

        The normal is 0 without such a rim.
        """
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
                facing = wp.dot(n, away_from(i, a))
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
        if sides:
            for k in range(4):
                counts = counts and w[k] != wp.float64(0.0)
        else:
            for k in range(1, 4):
                if w[k] == wp.float64(0.0):
                    g = a.across[f][k - 1]
                    if whole(g, a):
                        c = a.triangles[g]
                        y = mat43d()
                        y[0] = x[0]
                        for m in range(3):
                            y[m + 1] = start(c[m], a)
                        beside = wp.length(wp.transpose(y) * nearest(sides, y))
                        counts = counts and beside >= NEAREST * gap
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
        if gap <= a.kept + largest_approach(sides, motion):
            kept = distance_kept(sides, points, a)
            if gap <= ZERO * a.kept:
                kept = wp.float64(0.0)
                if not sides:
                    w, n = at_rim(points[0], f, x, w, a)
                    gap = wp.dot(n, wp.transpose(x) * w)
                    if wp.length(n) > wp.float64(0.0):
                        when = wp.float64(0.0)
            else:
                n = n / gap
                if gap > kept:
                    when = comes_near(sides, x, motion, wp.max(REACHED * kept, ZERO * a.kept))
                elif counts_here(f, sides, x, w, gap, a):
                    when = wp.float64(0.0)
        return w, n, gap, kept, when

    return SheetPairs(
        Surface, start, ease, whole, path, box_of, box_of_entity, pair_of, distance_kept, constraint
    )
