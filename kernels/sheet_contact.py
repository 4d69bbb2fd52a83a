"""Contact of the triangles of a sheet with each other, swept over the step.

A pair is a point and a triangle, or two sides of triangles. Its nearest points at the beginning of the step, with
weights w_k of its four points (positive on one side, negative on the other, sum 0), are at the distance g along the
normal n. If the pair comes too near on its way through the step, an impulse lambda w_k n acts on each of its points, so
that at the end the distance along n is at least that to be kept, d (the position constraint of RATTLE; d < g may be
approached). n is along the line between the nearest points, so the impulses change neither momentum nor angular
momentum.

Each point, triangle and side has a list of its pairs; so a pair is in two lists. Both find it by the same operations
on the same numbers, and so agree in all bits. Impulses are found by the projected Jacobi method with mass splitting and
Nesterov momentum, as in kernels/surface_contact.py; points gather from their lists in a fixed order.

Fail-safe: points whose pair would still come within a tenth of its distance stay where they are for this step. They
keep their velocities, and so momentum and, since the drift that is left out is along the velocity, angular momentum.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from .body_search import wide_places
from .effects import Kernel, kernel
from .face_tree import next_node, overlaps
from .integrate import half_step
from .numeric import numeric
from .pointwise import Pointwise, pointwise
from .sheet_pairs import ZERO, comes_near, largest_approach, mat43d, nearest, sheet_pairs
from .surface_contact import MENDED

# Pairs of a point, triangle or side.
SLOTS = 12
# Entries of the status: whether boxes are stale, any triangles are close, or pairs were left that would pass through
# each other; then one entry per round of solution, and one per round of the fail-safe.
STALE, CLOSE, PASSED, ROUND = 0, 1, 2, 3
# Fraction of its distance, or of the one to be kept, that a pair may reach in a step before its points stay.
SAFE = wp.constant(wp.float64(0.1))


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
    wide, _ = wide_places(bits, curved)
    pairs = sheet_pairs(bits, curved, held, torn)
    Surface = pairs.Surface
    start, ease, way, whole, shares_corner = pairs.start, pairs.ease, pairs.way, pairs.whole, pairs.shares_corner
    is_close, corners_of, box_of, pair_of = pairs.is_close, pairs.corners_of, pairs.box_of, pairs.pair_of
    distance_kept, constraint = pairs.distance_kept, pairs.constraint
    half_kick, half_loss = half_step(bits, loaded, damped)

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

    @wp.func
    def within(sides: bool, points: wp.vec4i, a: Surface):
        """Whether a pair may come near before the boxes are made anew."""
        x = mat43d()
        motion = mat43d()
        for k in range(4):
            x[k] = start(points[k], a)
            motion[k] = way(points[k], a)
        gap = wp.length(wp.transpose(x) * nearest(sides, x))
        return gap <= a.kept + a.skin + largest_approach(sides, motion)

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
                    if apart < own[3] + other[3] and not shares_corner(f, g, a):
                        t = a.triangles[f]
                        h = a.triangles[g]
                        for each in range(15):
                            k = each % 3
                            pair = wp.vec4i(t[k], h[0], h[1], h[2])
                            if each >= 12:
                                pair = wp.vec4i(h[k], t[0], t[1], t[2])
                            elif each >= 3:
                                m = each / 3 - 1
                                pair = wp.vec4i(t[k], t[(k + 1) % 3], h[m], h[(m + 1) % 3])
                            found = found or within(each >= 3 and each < 12, pair, a)
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
            after = vec3(
                real(before[0] + a.given[i][0]), real(before[1] + a.given[i][1]), real(before[2] + a.given[i][2])
            )
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
