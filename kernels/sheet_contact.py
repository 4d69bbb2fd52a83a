"""Contact of the triangles of a sheet with each other, swept over the step.

A pair is a point and a triangle, or two sides of triangles. Its nearest points at the beginning of the step, with
weights w_k of its four points (positive on one side, negative on the other, sum 0), are at the distance g along the
normal n. If the pair comes too near on its way through the step, an impulse lambda w_k n acts on each of its points, so
that at the end the distance along n is at least that to be kept, d (the position constraint of RATTLE; d < g may be
approached).

Friction opposes the slip sum_k w_k v_k - W x g n. The spin W = J^-1 sum_k r_k x v_k is that of the pair, with r_k from
its centre and J = sum_k (|r_k|^2 I - r_k r_k^T), so a pair that turns as a whole does not slip. The impulse of friction
f acts on its points as w_k f - (J^-1 (g n x f)) x r_k, the transpose of the slip: no moment is left across the gap.

Points and sides list their pairs. Impulses are found by the projected Jacobi method with mass splitting and Nesterov
momentum, as in kernels/surface_contact.py. They are summed as integers, whose sum does not depend on the order of the
threads: in all bits, and momentum is exact.

Fail-safe: points whose pair would still come within a tenth of its distance stay where they are for this step. They
keep their velocities, and so momentum and, since the drift that is left out is along the velocity, angular momentum.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from .body_search import wide_places
from .effects import Kernel, kernel
from .face_tree import next_face
from .integrate import half_step
from .narrow_phase import crosses
from .numeric import numeric
from .pointwise import Pointwise, pointwise
from .sheet_pairs import ZERO, comes_near, largest_approach, mat43d, nearest, sheet_pairs
from .surface_contact import MENDED

# Pairs of a point or side.
SLOTS = 12
# Entries of the status: whether boxes are stale, any triangles are close, or pairs were left that would pass through
# each other; then one entry per round of solution, and one per round of the fail-safe.
STALE, CLOSE, PASSED, ROUND = 0, 1, 2, 3
# Fraction of its distance, or of the one to be kept, that a pair may reach in a step before its points stay.
SAFE = wp.constant(wp.float64(0.1))


@dataclass(frozen=True)
class SheetContact:
    """Kernels of one configuration; entities are points, then sides.

    Attributes:
        Surface, Pairs, Taken: Structs of the kernels and of `take`.
        watch: Marks boxes as stale if a triangle has been cut.
        look: Marks boxes as stale if a point has left them.
        bound: Makes the boxes of triangles.
        mark: Finds entities with a triangle or side close.
        cross: Finds triangles f and g that cross: 1 + f F + g, the largest of F triangles; 0 without.
        find: Adds the pairs of each entity that come near to its list; if it is full, the earliest.
        press: Computes one iteration of the impulses.
        spread: Sums the impulses on each point.
        settle: Computes the velocity changes of the points.
        check: Marks points of pairs that would still pass.
        stay: Makes marked points stay.
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
    cross: Kernel
    find: Kernel
    press: Kernel
    spread: Kernel
    settle: Kernel
    check: Kernel
    stay: Kernel
    take: Pointwise
    clear: Kernel


@wp.func
def spin_of_pair(x: mat43d, moments: wp.vec3d):
    """J^-1 times a vector; rows of x are from the centre of the pair."""
    J = wp.mat33d()
    for k in range(4):
        J += wp.dot(x[k], x[k]) * wp.identity(n=3, dtype=wp.float64) - wp.outer(x[k], x[k])
    return wp.inverse(J) * moments


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
    Surface, start, ease, path, pair_of = pairs.Surface, pairs.start, pairs.ease, pairs.path, pairs.pair_of
    box_of, box_of_entity, whole = pairs.box_of, pairs.box_of_entity, pairs.whole
    distance_kept, constraint = pairs.distance_kept, pairs.constraint
    half_kick, half_loss = half_step(bits, loaded, damped)

    @wp.struct
    class Pairs:
        """Pairs of entity g: entries SLOTS g to SLOTS g + count[g].

        rooms: (distance - that to be kept) / step [m/s]. others: the triangle or side. whens: fraction of the way at
        which a pair comes near.
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
        x, motion = path(wp.vec4i(i, i, i, i), a)
        moved = wp.max(wp.length(x[0] - listed_at[i]), wp.length(x[0] + motion[0] - listed_at[i]))
        # A position that is not finite counts as moved.
        if not moved < wp.float64(0.5) * a.skin:
            status[wp.static(STALE)] = 1

    @kernel(per="list")
    def bound(a: Surface, first: int, listed_at: wp.array(dtype=wp.vec3d), lower: wp.array(dtype=wp.vec3),
              upper: wp.array(dtype=wp.vec3)):  # fmt: skip
        leaf = wp.tid() + first
        if leaf < a.mass.shape[0]:
            x, motion = path(wp.vec4i(leaf, leaf, leaf, leaf), a)
            listed_at[leaf] = x[0] + motion[0]
        low = wp.vec3(wp.float32(1e30))
        high = -low
        f = a.tree.order[leaf]
        if whole(f, a):
            low, high = box_of(a.triangles[f], wp.float64(0.5) * (a.kept + a.skin), a)
        lower[a.tree.leaves + leaf] = low
        upper[a.tree.leaves + leaf] = high

    @kernel(per="list")
    def mark(a: Surface, first: int, near: wp.array(dtype=wp.uint8), status: wp.array(dtype=wp.int32)):
        g = wp.tid() + first
        found = bool(False)
        lower, upper = box_of_entity(g, a.kept + a.skin, a)
        f, node = next_face(0, lower, upper, a.tree)
        while f >= 0:
            for which in range(3):
                pair, other = pair_of(g, f, which, a)
                if other >= 0 and not found:
                    sides = g >= a.mass.shape[0]
                    x, motion = path(pair, a)
                    gap = wp.length(wp.transpose(x) * nearest(sides, x))
                    # The pair may come near before the boxes are made anew.
                    found = gap <= a.kept + a.skin + largest_approach(sides, motion)
            f, node = next_face(node, lower, upper, a.tree)
        near[g] = wp.where(found, wp.uint8(1), wp.uint8(0))
        if found:
            status[wp.static(CLOSE)] = 1

    @kernel(per="list")
    def cross(a: Surface, first: int, crossed: wp.array(dtype=wp.int64)):
        e = a.sides[wp.tid() + first]
        lower, upper = box_of_entity(a.mass.shape[0] + wp.tid() + first, a.kept, a)
        f, node = next_face(0, lower, upper, a.tree)
        while f >= 0:
            one, met_one = pair_of(e[0], f, 0, a)
            two, met_two = pair_of(e[1], f, 0, a)
            if met_one >= 0 and met_two >= 0:
                x, _motion = path(one, a)
                y, _motion = path(two, a)
                if crosses(x[0], y[0], wp.matrix_from_rows(x[1], x[2], x[3])):
                    both = wp.int64(e[2]) * wp.int64(a.triangles.shape[0]) + wp.int64(f)
                    wp.atomic_max(crossed, 0, wp.int64(1) + both)
            f, node = next_face(node, lower, upper, a.tree)

    @kernel(per="list")
    def find(
        a: Surface, number: int, first: int, count: wp.array(dtype=wp.int32), points: wp.array(dtype=wp.vec4i),
        weights: wp.array(dtype=wp.vec4d), normals: wp.array(dtype=wp.vec3d), rooms: wp.array(dtype=wp.float64),
        others: wp.array(dtype=wp.int32), whens: wp.array(dtype=wp.float64), pushes: wp.array(dtype=wp.vec4d),
        turns: wp.array(dtype=wp.vec3d), pressed: wp.array(dtype=wp.uint8), earlier: wp.array(dtype=wp.float64),
        status: wp.array(dtype=wp.int32),
    ):  # fmt: skip
        g = wp.tid() + first
        listed = wp.where(number == 0, 0, count[g])
        more = wp.int32(listed)
        f = wp.int32(-1)
        node = wp.int32(0)
        lower, upper = box_of_entity(g, a.kept, a)
        if a.near[g] != wp.uint8(0):
            f, node = next_face(0, lower, upper, a.tree)
        while f >= 0:
            for which in range(3):
                pair, other = pair_of(g, f, which, a)
                for slot in range(listed):
                    if others[wp.static(SLOTS) * g + slot] == other:
                        other = wp.int32(-1)
                if other >= 0:
                    w, n, gap, kept, when = constraint(f, g >= a.mass.shape[0], pair, a)
                    slot = more
                    if more == wp.static(SLOTS):
                        # The latest new pair gives way.
                        latest = when
                        for k in range(listed, wp.static(SLOTS)):
                            if whens[wp.static(SLOTS) * g + k] > latest:
                                slot = k
                                latest = whens[wp.static(SLOTS) * g + k]
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
                        turns[s] = wp.vec3d()
                        pressed[s] = wp.uint8(0)
                        earlier[s] = wp.float64(0.0)
                        more = wp.max(more, slot + 1)
            f, node = next_face(node, lower, upper, a.tree)
        count[g] = more
        if more > listed:
            status[wp.static(ROUND) + number] = 1

    @wp.func
    def from_centre(points: wp.vec4i, a: Surface):
        x, _motion = path(points, a)
        centre = wp.float64(0.25) * (x[0] + x[1] + x[2] + x[3])
        for k in range(4):
            x[k] -= centre
        return x

    @kernel(per="list")
    def press(
        a: Surface, c: Pairs, pressing: wp.array(dtype=wp.int32), momentum: wp.float64, first: int,
        pushes: wp.array(dtype=wp.vec4d), turns: wp.array(dtype=wp.vec3d), pressed: wp.array(dtype=wp.uint8),
        earlier: wp.array(dtype=wp.float64),
    ):  # fmt: skip
        """`pushes`: the impulse of friction (three components) and that along the normal [N s]."""
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
            v = mat43d()
            for k in range(4):
                i = c.points[s][k]
                v[k] = wide(a.velocity[i]) + a.given[i]
                moving += w[k] * v[k]
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
                    x = from_centre(c.points[s], a)
                    spin = wp.vec3d()
                    for k in range(4):
                        spin += wp.cross(x[k], v[k])
                    across = wp.transpose(x) * w
                    slip = moving - wp.cross(spin_of_pair(x, spin), across)
                    rub -= (slip - wp.dot(slip, n) * n) / full_slip
                    size = wp.length(rub)
                    if size > a.friction * much:
                        rub = (a.friction * much / size) * rub
                    turns[s] = spin_of_pair(x, wp.cross(across, rub))
            ahead = wp.max(much + momentum * (much - earlier[s]), zero)
            earlier[s] = much
            pushes[s] = wp.vec4d(rub[0], rub[1], rub[2], ahead)
            pressed[s] = wp.where(much > zero or rate < zero, wp.uint8(1), wp.uint8(0))

    @wp.func
    def add_up(impulses: mat43d, points: wp.vec4i, column: int, a: Surface, sums: wp.array2d(dtype=wp.int64)):
        scale = wp.float64(a.step[0]) / a.unit
        for c in range(3):
            left = wp.int64(0)
            for k in range(4):
                part = -left
                if k < 3:
                    part = wp.int64(wp.rint(scale * impulses[k, c]))
                left += part
                wp.atomic_add(sums, points[k], column + c, part)

    @kernel(per="list")
    def spread(
        a: Surface, c: Pairs, pushes: wp.array(dtype=wp.vec4d), turns: wp.array(dtype=wp.vec3d),
        pressed: wp.array(dtype=wp.uint8), stride: int, first: int, sums: wp.array2d(dtype=wp.int64),
    ):  # fmt: skip
        for g in range(wp.tid() + first, c.count.shape[0], stride):
            for slot in range(c.count[g]):
                s = wp.static(SLOTS) * g + slot
                if pressed[s] != wp.uint8(0):
                    push = pushes[s]
                    w = c.weights[s]
                    add_up(wp.outer(w, push[3] * c.normals[s]), c.points[s], 0, a, sums)
                    if wp.static(rubs):
                        x = from_centre(c.points[s], a)
                        rub = wp.outer(w, wp.vec3d(push[0], push[1], push[2]))
                        for k in range(4):
                            rub[k] -= wp.cross(turns[s], x[k])
                        add_up(rub, c.points[s], 3, a, sums)
                    for k in range(4):
                        if w[k] != wp.float64(0.0):
                            wp.atomic_add(sums, c.points[s][k], 6, wp.int64(1))

    @kernel(per="list")
    def settle(
        a: Surface, first: int, sums: wp.array2d(dtype=wp.int64), given: wp.array(dtype=wp.vec3d),
        pressing: wp.array(dtype=wp.int32), impulse: wp.array(dtype=wp.vec3d), dragged: wp.array(dtype=wp.vec3d),
    ):  # fmt: skip
        i = wp.tid() + first
        unit = a.unit / wp.float64(a.step[0])
        drag = unit * wp.vec3d(wp.float64(sums[i, 3]), wp.float64(sums[i, 4]), wp.float64(sums[i, 5]))
        total = unit * wp.vec3d(wp.float64(sums[i, 0]), wp.float64(sums[i, 1]), wp.float64(sums[i, 2])) + drag
        given[i] = wp.cw_mul(ease(i, a), total)
        pressing[i] = wp.int32(sums[i, 6])
        impulse[i] = total
        if wp.static(rubs):
            dragged[i] = drag
        for k in range(7):
            sums[i, k] = wp.int64(0)

    @kernel(per="list")
    def check(a: Surface, number: int, first: int, halts: wp.array(dtype=wp.uint8),
              status: wp.array(dtype=wp.int32)):  # fmt: skip
        """Threads that share a point write the same to it."""
        g = wp.tid() + first
        sides = g >= a.mass.shape[0]
        f = wp.int32(-1)
        node = wp.int32(0)
        lower, upper = box_of_entity(g, a.kept, a)
        if a.near[g] != wp.uint8(0):
            f, node = next_face(0, lower, upper, a.tree)
        while f >= 0:
            for which in range(3):
                pair, other = pair_of(g, f, which, a)
                if other >= 0:
                    x, motion = path(pair, a)
                    gap = wp.length(wp.transpose(x) * nearest(sides, x))
                    if gap > ZERO * a.kept and gap <= a.kept + largest_approach(sides, motion):
                        kept = distance_kept(sides, pair, a)
                        limit = wp.max(SAFE * wp.min(gap, kept), ZERO * a.kept)
                        if kept > ZERO * a.kept and comes_near(sides, x, motion, limit) < wp.float64(2.0):
                            status[number] = 1
                            for k in range(4):
                                halts[pair[k]] = wp.uint8(1)
            f, node = next_face(node, lower, upper, a.tree)

    @kernel(per="list")
    def stay(first: int, halts: wp.array(dtype=wp.uint8), stays: wp.array(dtype=wp.uint8)):
        i = wp.tid() + first
        stays[i] = wp.max(stays[i], halts[i])
        halts[i] = wp.uint8(0)

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
        Surface, Pairs, Taken, watch, look, bound, mark, cross, find, press, spread, settle, check, stay, take, clear
    )
