"""Contact of the triangles of a sheet with each other, swept over the step.

A pair is a point and a triangle, or two sides of triangles. Its nearest points at the beginning of the step, with
weights w_k of its four points (positive on one side, negative on the other, sum 0), are at the distance g along the
normal n. If the pair comes too near on its way through the step, an impulse lambda w_k n acts on each of its points, so
that at the end the distance along n is at least that to be kept, d (the position constraint of RATTLE; d < g may be
approached). n is along the line between the nearest points, so the impulses change neither momentum nor angular
momentum.

Whether a pair comes near is found by conservative advancement (Li, Kaufman and Jiang, Codimensional incremental
potential contact, ACM Trans. Graph. 40, 2021, section 5): the distance changes by at most the relative motion.

Each point, triangle and side has a list of its pairs; so a pair is in two lists. Both find it by the same operations
on the same numbers, and so agree in all bits. Impulses are found by the projected Jacobi method with mass splitting and
Nesterov momentum, as in kernels/surface_contact.py; points gather from their lists in a fixed order.

Fail-safe: points whose pair would still come within a tenth of its distance stay where they are for this step. They
keep their velocities, and so momentum and, since the drift that is left out is along the velocity, angular momentum.

Pairs of triangles that share a corner are left out. A triangle cut by a crack has no contact and connects no points.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from .body_search import wide_places
from .distances import weights_of_nearest
from .effects import Kernel, kernel
from .face_tree import FaceTree, next_node, overlaps, rounded
from .integrate import half_step
from .numeric import numeric
from .pointwise import Pointwise, pointwise
from .surface_contact import MENDED, NEAREST, between_segments

# Pairs of a point, triangle or side.
SLOTS = 12
# Entries of the status: whether boxes are stale, any triangles are close, or pairs were left that would pass through
# each other; then one entry per round of solution, and one per round of the fail-safe.
STALE, CLOSE, PASSED, ROUND = 0, 1, 2, 3
# A distance below this fraction of the one to be kept is zero: the faces of a crack of an outline.
ZERO = wp.constant(wp.float64(1e-3))
# Fraction of the distance to be kept, or of that at the beginning, that a pair may reach in a step before it counts.
REACHED, SAFE = wp.constant(wp.float64(0.75)), wp.constant(wp.float64(0.1))
# Within a piece pairs keep at most this fraction of their reference distance.
OF_REFERENCE = wp.constant(wp.float64(0.5))
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
class SheetContact:
    """Kernels of one configuration; entities are points, then triangles, then sides.

    Attributes:
        Surface, Pairs, Taken: Structs of the kernels and of `take`.
        watch: Marks boxes as stale if a triangle has been cut.
        look: Marks boxes as stale if a point has left them.
        bound: Makes the boxes of triangles.
        mark: Finds triangles with another one close.
        find: Adds the pairs of each entity that come near to its list; if it is full, the earliest.
        agree: Removes new pairs that had no room in one of their two lists.
        press: Computes one iteration of the impulses.
        gather: Computes the velocity changes of the points.
        check: Marks entities with a pair that would still pass.
        stay: Marks the points of such entities, which stay.
        take: Pointwise stage that applies the impulses and sums the losses.
        clear: Resets entries of the status.
    """

    Surface: Any
    Pairs: Any
    Taken: Any
    watch: Kernel
    look: Kernel
    bound: Kernel
    mark: Kernel
    find: Kernel
    agree: Kernel
    press: Kernel
    gather: Kernel
    check: Kernel
    stay: Kernel
    take: Pointwise
    clear: Kernel


@functools.cache
def sheet_contact(
    bits: int, curved: bool, held: bool, loaded: bool, damped: bool, tracked: bool, torn: bool, rubs: bool
) -> SheetContact:
    """Kernels of contact of triangles with each other.

    Args:
        bits: 32 or 64.
        curved: Whether the reference positions have a z.
        held: Whether any component is held; it does not yield.
        loaded: Whether external forces act.
        damped: Whether there is mass damping and energies use half-step velocities.
        tracked: Whether work and losses are summed.
        torn: Whether bonds can break.
        rubs: Whether there is friction.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3
    wide, placed = wide_places(bits, curved)
    half_kick, half_loss = half_step(bits, loaded, damped)

    @wp.struct
    class Surface:
        """Points, triangles and sides.

        sides: corners of a side, and its triangles (-1: none). across: triangle across from each corner. owned: bits of
        the corners (1, 2, 4) and of the sides across from them (8, 16, 32) that a triangle owns; each has one owner.
        of_face: the sides across from the corners. begins, entities: the entities of point i, without itself, are
        entries begins[i] to begins[i + 1].
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
        entities: wp.array(dtype=wp.int32)
        close: wp.array(dtype=wp.uint8)
        tree: FaceTree
        kept: wp.float64
        skin: wp.float64
        friction: wp.float64

    @wp.struct
    class Pairs:
        """Pairs of entity g: entries SLOTS g to SLOTS g + count[g].

        rooms: (distance - that to be kept) / step [m/s]. others: the other entity. whens: fraction of the way at which
        a new pair comes near, -1 for older pairs.
        """

        count: wp.array(dtype=wp.int32)
        points: wp.array(dtype=wp.vec4i)
        weights: wp.array(dtype=wp.vec4d)
        normals: wp.array(dtype=wp.vec3d)
        rooms: wp.array(dtype=wp.float64)
        others: wp.array(dtype=wp.int32)
        whens: wp.array(dtype=wp.float64)

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
        points = a.mass.shape[0]
        faces = a.triangles.shape[0]
        found = bool(False)
        for at in range(a.begins[i], a.begins[i + 1]):
            g = a.entities[at] - points
            if g < faces and not found:
                if whole(g, a):
                    found = shares_corner(f, g, a)
        return found

    @wp.func
    def is_close(g: int, a: Surface):
        """Whether an entity has a triangle with another one close."""
        points = a.mass.shape[0]
        faces = a.triangles.shape[0]
        found = bool(False)
        if g < points:
            for at in range(a.begins[g], a.begins[g + 1]):
                f = a.entities[at] - points
                if f < faces:
                    found = found or a.close[f] != wp.uint8(0)
        elif g < points + faces:
            found = a.close[g - points] != wp.uint8(0)
        else:
            e = a.sides[g - points - faces]
            for k in range(2, 4):
                if e[k] >= 0:
                    found = found or a.close[e[k]] != wp.uint8(0)
        return found

    @wp.func
    def corners_of(g: int, a: Surface):
        """Points of an entity; the last is repeated."""
        points = a.mass.shape[0]
        faces = a.triangles.shape[0]
        found = wp.vec3i(g, g, g)
        if g >= points + faces:
            e = a.sides[g - points - faces]
            found = wp.vec3i(e[0], e[1], e[1])
        elif g >= points:
            found = a.triangles[g - points]
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
    def pair_of(g: int, f: int, which: int, a: Surface):
        """The pair of entity g with a feature of triangle f: its points, and the other entity, -1 if it does not count.

        A point meets the triangle itself (`which` = 0), a triangle its corner, a side its side.
        """
        points = a.mass.shape[0]
        faces = a.triangles.shape[0]
        found = wp.vec4i()
        other = wp.int32(-1)
        corners = a.triangles[f]
        if g < points:
            if which == 0 and not point_meets(g, f, a):
                found = wp.vec4i(g, corners[0], corners[1], corners[2])
                other = points + f
        elif g < points + faces:
            t = a.triangles[g - points]
            i = corners[which]
            if (a.owned[f] >> which) & 1 == 1 and not point_meets(i, g - points, a):
                found = wp.vec4i(i, t[0], t[1], t[2])
                other = i
        else:
            own = g - points - faces
            side = a.of_face[f][which]
            if (a.owned[f] >> (3 + which)) & 1 == 1 and own != side:
                e = a.sides[wp.min(own, side)]
                h = a.sides[wp.max(own, side)]
                if not faces_meet(e, h, a):
                    found = wp.vec4i(e[0], e[1], h[0], h[1])
                    other = points + faces + side
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
        points = a.mass.shape[0]
        total = wp.vec3d()
        for at in range(a.begins[i], a.begins[i + 1]):
            f = a.entities[at] - points
            if f < a.triangles.shape[0]:
                if whole(f, a):
                    for k in range(3):
                        total += start(a.triangles[f][k], a) - start(i, a)
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
        x = mat43d()
        motion = mat43d()
        for k in range(4):
            x[k] = start(points[k], a)
            motion[k] = way(points[k], a)
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

    @kernel(per="face")
    def watch(intact: wp.array(dtype=wp.uint8), first: int, seen: wp.array(dtype=wp.uint8),
              status: wp.array(dtype=wp.int32)):  # fmt: skip
        f = wp.tid() + first
        if intact[f] != seen[f]:
            status[wp.static(STALE)] = 1
        seen[f] = intact[f]

    @kernel(per="list")
    def look(a: Surface, listed_at: wp.array(dtype=wp.vec3d), first: int, status: wp.array(dtype=wp.int32)):
        i = wp.tid() + first
        x = start(i, a)
        moved = wp.max(wp.length(x - listed_at[i]), wp.length(x + way(i, a) - listed_at[i]))
        # A position that is not finite counts as moved.
        if not moved < wp.float64(0.5) * a.skin:
            status[wp.static(STALE)] = 1

    @kernel(per="list")
    def bound(a: Surface, first: int, listed_at: wp.array(dtype=wp.vec3d), lower: wp.array(dtype=wp.vec3),
              upper: wp.array(dtype=wp.vec3), spheres: wp.array(dtype=wp.vec4)):  # fmt: skip
        leaf = wp.tid() + first
        if leaf < a.mass.shape[0]:
            listed_at[leaf] = start(leaf, a) + way(leaf, a)
        node = a.tree.leaves + leaf
        lower[node] = wp.vec3(wp.float32(1e30))
        upper[node] = wp.vec3(wp.float32(-1e30))
        if leaf < a.triangles.shape[0]:
            f = a.tree.order[leaf]
            if whole(f, a):
                reach = wp.float64(0.5) * (a.kept + a.skin)
                low, high = box_of(a.triangles[f], reach, a)
                lower[node] = low
                upper[node] = high
                centre = wp.vec3d()
                for k in range(3):
                    i = a.triangles[f][k]
                    centre += (start(i, a) + wp.float64(0.5) * way(i, a)) / wp.float64(3.0)
                radius = wp.float64(0.0)
                for k in range(3):
                    i = a.triangles[f][k]
                    x = start(i, a)
                    radius = wp.max(radius, wp.max(wp.length(x - centre), wp.length(x + way(i, a) - centre)))
                size = wp.float64(1e-6) * wp.length(centre)
                spheres[f] = wp.vec4(
                    wp.float32(centre[0]), wp.float32(centre[1]), wp.float32(centre[2]),
                    wp.float32(radius + reach + size),
                )  # fmt: skip

    @kernel(per="face")
    def mark(a: Surface, first: int, close: wp.array(dtype=wp.uint8), status: wp.array(dtype=wp.int32)):
        f = wp.tid() + first
        found = bool(False)
        if whole(f, a):
            own = a.tree.spheres[f]
            centre = wp.vec3(own[0], own[1], own[2])
            size = wp.vec3(own[3])
            node = wp.int32(1)
            while node != 0 and not found:
                entered = overlaps(node, centre - size, centre + size, a.tree)
                if entered and node >= a.tree.leaves:
                    g = a.tree.order[node - a.tree.leaves]
                    other = a.tree.spheres[g]
                    apart = wp.length(centre - wp.vec3(other[0], other[1], other[2]))
                    found = apart < own[3] + other[3] and not shares_corner(f, g, a)
                node = next_node(node, entered, a.tree.leaves)
        close[f] = wp.where(found, wp.uint8(1), wp.uint8(0))
        if found:
            status[wp.static(CLOSE)] = 1

    @kernel(per="list")
    def find(
        a: Surface, number: int, first: int, count: wp.array(dtype=wp.int32), points: wp.array(dtype=wp.vec4i),
        weights: wp.array(dtype=wp.vec4d), normals: wp.array(dtype=wp.vec3d), rooms: wp.array(dtype=wp.float64),
        others: wp.array(dtype=wp.int32), whens: wp.array(dtype=wp.float64), left_out: wp.array(dtype=wp.float64),
        pushes: wp.array(dtype=wp.vec4d), pressed: wp.array(dtype=wp.uint8), earlier: wp.array(dtype=wp.float64),
        status: wp.array(dtype=wp.int32),
    ):  # fmt: skip
        """`left_out`: when the earliest pair comes near that has no room in the list."""
        g = wp.tid() + first
        own = a.mass.shape[0]
        sides = g >= own + a.triangles.shape[0]
        listed = wp.where(number == 0, 0, count[g])
        more = wp.int32(listed)
        earliest = wp.float64(2.0)
        node = wp.where(is_close(g, a), 1, 0)
        lower, upper = box_of(corners_of(g, a), wp.float64(0.5) * a.kept, a)
        while node != 0:
            entered = overlaps(node, lower, upper, a.tree)
            if entered and node >= a.tree.leaves:
                f = a.tree.order[node - a.tree.leaves]
                for which in range(3):
                    pair, other = pair_of(g, f, which, a)
                    known = other < 0
                    for slot in range(listed):
                        known = known or others[wp.static(SLOTS) * g + slot] == other
                    if not known:
                        target = wp.where(g >= own and not sides, g - own, f)
                        w, n, gap, kept, when = constraint(target, sides, pair, a)
                        slot = more
                        if more == wp.static(SLOTS):
                            latest = when
                            for k in range(wp.static(SLOTS)):
                                if whens[wp.static(SLOTS) * g + k] > latest:
                                    slot = k
                                    latest = whens[wp.static(SLOTS) * g + k]
                            earliest = wp.min(earliest, latest)
                        if when < wp.float64(2.0) and slot < wp.static(SLOTS):
                            s = wp.static(SLOTS) * g + slot
                            points[s] = pair
                            weights[s] = w
                            normals[s] = n
                            left = (gap - kept) / wp.float64(a.step[0])
                            rooms[s] = wp.where(gap < kept, MENDED * left, left)
                            others[s] = other
                            whens[s] = when
                            pushes[s] = wp.vec4d()
                            pressed[s] = wp.uint8(0)
                            earlier[s] = wp.float64(0.0)
                            more = wp.max(more, slot + 1)
            node = next_node(node, entered, a.tree.leaves)
        count[g] = more
        left_out[g] = earliest
        if more > listed:
            status[wp.static(ROUND) + number] = 1

    @kernel(per="list")
    def agree(
        left_out: wp.array(dtype=wp.float64), first: int, count: wp.array(dtype=wp.int32),
        points: wp.array(dtype=wp.vec4i), weights: wp.array(dtype=wp.vec4d), normals: wp.array(dtype=wp.vec3d),
        rooms: wp.array(dtype=wp.float64), others: wp.array(dtype=wp.int32), whens: wp.array(dtype=wp.float64),
    ):  # fmt: skip
        g = wp.tid() + first
        kept = wp.int32(0)
        for slot in range(count[g]):
            s = wp.static(SLOTS) * g + slot
            if whens[s] < wp.min(left_out[g], left_out[others[s]]):
                t = wp.static(SLOTS) * g + kept
                points[t] = points[s]
                weights[t] = weights[s]
                normals[t] = normals[s]
                rooms[t] = rooms[s]
                others[t] = others[s]
                whens[t] = wp.float64(-1.0)
                kept += 1
        count[g] = kept

    @kernel(per="list")
    def press(
        a: Surface, c: Pairs, pressing: wp.array(dtype=wp.int32), momentum: wp.float64, first: int,
        pushes: wp.array(dtype=wp.vec4d), pressed: wp.array(dtype=wp.uint8), earlier: wp.array(dtype=wp.float64),
    ):  # fmt: skip
        g = wp.tid() + first
        for slot in range(c.count[g]):
            s = wp.static(SLOTS) * g + slot
            w = c.weights[s]
            n = c.normals[s]
            zero = wp.float64(0.0)
            moving = wp.vec3d()
            full = zero
            full_slip = zero
            sure = bool(True)
            for k in range(4):
                i = c.points[s][k]
                moving += w[k] * (wide(a.velocity[i]) + a.given[i])
                e = ease(i, a)
                share = w[k] * w[k] * wp.float64(wp.max(pressing[i], 1))
                full += share * wp.dot(wp.cw_mul(n, n), e)
                full_slip += share * wp.max(e)
                sure = sure and (w[k] == zero or pressing[i] > 0)
            rate = c.rooms[s] + wp.dot(n, moving)
            push = pushes[s]
            much = push[3]
            rub = wp.vec3d(push[0], push[1], push[2])
            if sure and full > zero:
                much = wp.max(much - rate / full, zero)
                if wp.static(rubs):
                    rub -= (moving - wp.dot(moving, n) * n) / full_slip
                    size = wp.length(rub)
                    if size > a.friction * much:
                        rub = (a.friction * much / size) * rub
            ahead = wp.max(much + momentum * (much - earlier[s]), zero)
            earlier[s] = much
            pushes[s] = wp.vec4d(rub[0], rub[1], rub[2], ahead)
            pressed[s] = wp.where(much > zero or rate < zero, wp.uint8(1), wp.uint8(0))

    @kernel(per="list")
    def gather(
        a: Surface, c: Pairs, pushes: wp.array(dtype=wp.vec4d), pressed: wp.array(dtype=wp.uint8), first: int,
        given: wp.array(dtype=wp.vec3d), pressing: wp.array(dtype=wp.int32), impulse: wp.array(dtype=wp.vec3d),
        dragged: wp.array(dtype=wp.vec3d),
    ):  # fmt: skip
        i = wp.tid() + first
        total = wp.vec3d()
        drag = wp.vec3d()
        number = wp.int32(0)
        for at in range(a.begins[i] - 1, a.begins[i + 1]):
            g = wp.where(at < a.begins[i], i, a.entities[wp.max(at, 0)])
            for slot in range(c.count[g]):
                s = wp.static(SLOTS) * g + slot
                if pressed[s] != wp.uint8(0):
                    push = pushes[s]
                    for k in range(4):
                        b = c.weights[s][k]
                        if c.points[s][k] == i and b != wp.float64(0.0):
                            rub = b * wp.vec3d(push[0], push[1], push[2])
                            total += b * push[3] * c.normals[s] + rub
                            drag += rub
                            number += 1
        given[i] = wp.cw_mul(ease(i, a), total)
        pressing[i] = number
        impulse[i] = total
        if wp.static(rubs):
            dragged[i] = drag

    @kernel(per="list")
    def check(a: Surface, number: int, first: int, passes: wp.array(dtype=wp.uint8),
              status: wp.array(dtype=wp.int32)):  # fmt: skip
        g = wp.tid() + first
        sides = g >= a.mass.shape[0] + a.triangles.shape[0]
        found = bool(False)
        node = wp.where(is_close(g, a), 1, 0)
        lower, upper = box_of(corners_of(g, a), wp.float64(0.5) * a.kept, a)
        while node != 0 and not found:
            entered = overlaps(node, lower, upper, a.tree)
            if entered and node >= a.tree.leaves:
                f = a.tree.order[node - a.tree.leaves]
                for which in range(3):
                    pair, other = pair_of(g, f, which, a)
                    if other >= 0:
                        x = mat43d()
                        motion = mat43d()
                        for k in range(4):
                            x[k] = start(pair[k], a)
                            motion[k] = way(pair[k], a)
                        gap = wp.length(wp.transpose(x) * nearest(sides, x))
                        if gap > ZERO * a.kept and gap <= a.kept + largest_approach(sides, motion):
                            kept = distance_kept(sides, pair, a)
                            if kept > ZERO * a.kept:
                                limit = wp.max(SAFE * wp.min(gap, kept), ZERO * a.kept)
                                found = found or comes_near(sides, x, motion, limit) < wp.float64(2.0)
            node = next_node(node, entered, a.tree.leaves)
        passes[g] = wp.where(found, wp.uint8(1), wp.uint8(0))
        if found:
            status[number] = 1

    @kernel(per="list")
    def stay(a: Surface, passes: wp.array(dtype=wp.uint8), first: int, stays: wp.array(dtype=wp.uint8)):
        i = wp.tid() + first
        found = passes[i] != wp.uint8(0)
        for at in range(a.begins[i], a.begins[i + 1]):
            found = found or passes[a.entities[at]] != wp.uint8(0)
        if found and wp.max(ease(i, a)) > wp.float64(0.0):
            stays[i] = wp.uint8(1)

    @wp.struct
    class Taken:
        mass: wp.array(dtype=real)
        held_mask: wp.array(dtype=wp.uint8)
        step: wp.array(dtype=real)
        damping: wp.array(dtype=real)
        force: wp.array(dtype=vec3)
        external: wp.array(dtype=vec3)
        displacement: wp.array(dtype=vec3)
        velocity: wp.array(dtype=vec3)
        given: wp.array(dtype=wp.vec3d)
        impulse: wp.array(dtype=wp.vec3d)
        dragged: wp.array(dtype=wp.vec3d)
        pressing: wp.array(dtype=wp.int32)
        stays: wp.array(dtype=wp.uint8)
        work: wp.array(dtype=wp.float64)
        dissipated: wp.array(dtype=wp.float64)
        lost: wp.array(dtype=wp.float64)
        rubbed: wp.array(dtype=wp.float64)

    written = (
        "displacement", "velocity", "given", "impulse", "dragged", "pressing", "stays", "work", "dissipated", "lost",
        "rubbed",
    )  # fmt: skip

    @pointwise(Taken, writes=written)
    def take(begin: int, end: int, a: Taken):
        for i in range(begin, end):
            slowed = a.velocity[i] - half_kick(i, a.step, a.mass, a.force, a.external)
            begun = wide(slowed / (real(1.0) - half_loss(a.step, a.damping)))
            before = wide(a.velocity[i])
            after = vec3(real(before[0] + a.given[i][0]), real(before[1] + a.given[i][1]), real(before[2] + a.given[i][2]))
            change = wide(after) - before
            dt = wp.float64(a.step[0])
            shift = dt * change
            if a.stays[i] != wp.uint8(0):
                shift = -dt * before
                if wp.static(held):
                    for c in range(3):
                        if (wp.int32(a.held_mask[i]) >> c) & 1 == 1:
                            shift[c] = wp.float64(0.0)
            a.velocity[i] = after
            a.displacement[i] = a.displacement[i] + vec3(real(shift[0]), real(shift[1]), real(shift[2]))
            if wp.static(tracked):
                mean = begun + wp.float64(0.5) * change
                if wp.static(held):
                    for c in range(3):
                        if (wp.int32(a.held_mask[i]) >> c) & 1 == 1:
                            # The support balances the impulse.
                            mean[c] = before[c]
                            a.work[i] = a.work[i] - a.impulse[i][c] * before[c]
                if wp.static(loaded):
                    # The work of the load in the drift took the way without contact.
                    a.work[i] = a.work[i] + wp.float64(0.5) * wp.dot(wide(a.external[i]), shift)
                if wp.static(damped):
                    loss = wp.float64(half_loss(a.step, a.damping) * a.mass[i])
                    a.dissipated[i] = a.dissipated[i] + loss * wp.dot(change, begun)
                rub = wp.float64(0.0)
                if wp.static(rubs):
                    rub = wp.dot(a.dragged[i], mean)
                    a.rubbed[i] = a.rubbed[i] - rub
                    a.dragged[i] = wp.vec3d()
                a.lost[i] = a.lost[i] - wp.dot(a.impulse[i], mean) + rub
            a.given[i] = wp.vec3d()
            a.impulse[i] = wp.vec3d()
            a.pressing[i] = 0
            a.stays[i] = wp.uint8(0)

    @kernel(per="once")
    def clear(start: int, end: int, first: int, status: wp.array(dtype=wp.int32)):
        for k in range(start, end):
            status[k] = 0

    return SheetContact(
        Surface, Pairs, Taken, watch, look, bound, mark, find, agree, press, gather, check, stay, take, clear
    )
