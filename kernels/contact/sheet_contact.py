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
momentum, as in kernels/contact/surface_contact.py. Pairs share the mass of a point in proportion to |w|: shares that
count pairs of a weight other than zero would jump by round-off where a point meets a side. Impulses and weights are
summed as integers, whose sum does not depend on the order of the threads: in all bits, and momentum is exact.

Fail-safe: points whose pair would still come within a tenth of its distance stay where they are for this step. They
keep their velocities, and so momentum and, since the drift that is left out is along the velocity, angular momentum.
"""

import functools

import warp as wp

from ..effects import Kernel, Pointwise, kernel, pointwise
from ..integrate import StepOptions, half_step
from ..numeric import numeric
from .distances import next_face
from .narrow_phase import crosses
from .sheet_pairs import (
    ZERO,
    Surface,
    box_of,
    box_of_entity,
    comes_near,
    constraint,
    distance,
    distance_kept,
    largest_approach,
    mat43d,
    pair_of,
    path,
    whole,
)
from .surface_contact import MENDED

# Maximum number of pairs of a point or side; the earliest are kept.
SLOTS = 12
# Entries of the status: whether boxes are stale, any triangles are close, or pairs were left that would pass through
# each other; then one entry per round of solution, and one per round of the fail-safe.
STALE, CLOSE, PASSED, ROUND = 0, 1, 2, 3
# Fraction of its distance, or of the one to be kept, that a pair may reach in a step before its points stay.
SAFE = wp.constant(wp.float64(0.1))
# Unit of the sums of weights.
WEIGHT = wp.constant(wp.float64(2.0**-48))


@wp.struct
class Pairs:
    """Pairs of entity g: entries SLOTS g to SLOTS g + count[g]. Impulses are times the step [kg m].

    rooms: distance - that to be kept [m]. others: the triangle or side. whens: fraction of the way at which a pair
    comes near. pushes: impulse of friction (three components) and that along the normal, with its momentum; earlier:
    the latter without. turns: J^-1 (g n x f). pressed: whether it presses. sums: of points, of all impulses and those
    of friction, in `unit`, and of the |w| of pairs that press, in `WEIGHT`. impulse, dragged, pressing: the same sums
    of the last iteration. halts: whether the fail-safe stops a point.
    """

    count: wp.array(dtype=wp.int32)
    points: wp.array(dtype=wp.vec4i)
    weights: wp.array(dtype=wp.vec4d)
    normals: wp.array(dtype=wp.vec3d)
    rooms: wp.array(dtype=wp.float64)
    others: wp.array(dtype=wp.int32)
    whens: wp.array(dtype=wp.float64)
    pushes: wp.array(dtype=wp.vec4d)
    earlier: wp.array(dtype=wp.float64)
    turns: wp.array(dtype=wp.vec3d)
    pressed: wp.array(dtype=wp.uint8)
    sums: wp.array2d(dtype=wp.int64)
    impulse: wp.array(dtype=wp.vec3d)
    dragged: wp.array(dtype=wp.vec3d)
    pressing: wp.array(dtype=wp.float64)
    halts: wp.array(dtype=wp.uint8)
    friction: wp.float64
    unit: wp.float64


@functools.cache
def enter(bits: int, held: bool) -> Kernel:
    """Kernel that stores the path of each point in the step, after the drift, and marks boxes that a point has left."""
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @kernel(per="list", writes=("a.begin", "a.drift", "a.ease"))
    def enter_ways(
        displacement: wp.array(dtype=vec3), velocity: wp.array(dtype=vec3), mass: wp.array(dtype=real),
        held_mask: wp.array(dtype=wp.uint8), step: wp.array(dtype=real), a: Surface, first: int,
        status: wp.array(dtype=wp.int32),
    ):  # fmt: skip
        i = wp.tid() + first
        drift = wp.float64(step[0]) * wp.vec3d(velocity[i])
        begin = a.reference[i] + wp.vec3d(displacement[i]) - drift
        ease = wp.vec3d(wp.float64(1.0) / wp.float64(mass[i]))
        if wp.static(held):
            for c in range(3):
                if (wp.int32(held_mask[i]) >> c) & 1 == 1:
                    ease[c] = wp.float64(0.0)
        a.begin[i] = begin
        a.drift[i] = drift
        a.ease[i] = ease
        end = begin + drift + a.given[i]
        moved = wp.max(wp.length(begin - a.listed_at[i]), wp.length(end - a.listed_at[i]))
        # A position that is not finite counts as moved.
        if not moved < wp.float64(0.5) * a.skin:
            status[wp.static(STALE)] = 1

    return enter_ways


@kernel(per="face", writes=("a.seen",))
def watch(a: Surface, first: int, status: wp.array(dtype=wp.int32)):
    """Mark boxes as stale if a triangle has been cut."""
    f = wp.tid() + first
    if a.intact[f] != a.seen[f]:
        status[wp.static(STALE)] = 1
    a.seen[f] = a.intact[f]


@kernel(per="list", writes=("a.tree.lower", "a.tree.upper", "a.listed_at"))
def bound(a: Surface, first: int):
    """Make the boxes of triangles."""
    leaf = wp.tid() + first
    if leaf < a.begin.shape[0]:
        a.listed_at[leaf] = a.begin[leaf] + a.drift[leaf] + a.given[leaf]
    low = wp.vec3(wp.float32(1e30))
    high = -low
    f = a.tree.order[leaf]
    if whole(f, a):
        low, high = box_of(a.triangles[f], a.kept + a.skin, a)
    a.tree.lower[a.tree.leaves + leaf] = low
    a.tree.upper[a.tree.leaves + leaf] = high


@kernel(per="list", writes=("a.near",))
def mark(a: Surface, first: int, status: wp.array(dtype=wp.int32)):
    """Mark the points and sides that may come near a triangle or side before the boxes are rebuilt.

    A step looks only at the pairs of these; without any, `status` skips its other launches.
    """
    g = wp.tid() + first
    found = bool(False)
    sides = g >= a.begin.shape[0]
    lower, upper = box_of_entity(g, a.kept + a.skin, a)
    f, node = next_face(0, lower, upper, a.tree)
    while f >= 0 and not found:
        for which in range(3):
            pair, other = pair_of(g, f, which, a)
            if other >= 0 and not found:
                x, motion = path(pair, a)
                found = distance(sides, x) <= a.kept + a.skin + largest_approach(sides, motion)
        f, node = next_face(node, lower, upper, a.tree)
    a.near[g] = wp.where(found, wp.uint8(1), wp.uint8(0))
    if found:
        status[wp.static(CLOSE)] = 1


@kernel(per="list")
def cross(a: Surface, first: int, crossed: wp.array(dtype=wp.int64)):
    """Find triangles f and g that cross: 1 + f F + g, the largest of F triangles."""
    e = a.sides[wp.tid() + first]
    lower, upper = box_of_entity(a.begin.shape[0] + wp.tid() + first, a.kept, a)
    f, node = next_face(0, lower, upper, a.tree)
    while f >= 0:
        one, met_one = pair_of(e[0], f, 0, a)
        _two, met_two = pair_of(e[1], f, 0, a)
        if met_one >= 0 and met_two >= 0:
            x, _motion = path(one, a)
            if crosses(x[0], a.begin[e[1]], wp.matrix_from_rows(x[1], x[2], x[3])):
                both = wp.int64(e[2]) * wp.int64(a.triangles.shape[0]) + wp.int64(f)
                wp.atomic_max(crossed, 0, wp.int64(1) + both)
        f, node = next_face(node, lower, upper, a.tree)


LISTED = tuple(f"c.{name}" for name in (
    "count", "points", "weights", "normals", "rooms", "others", "whens", "pushes", "earlier", "turns", "pressed"
))  # fmt: skip


@kernel(per="list", writes=LISTED)
def find(a: Surface, c: Pairs, number: int, first: int, status: wp.array(dtype=wp.int32)):
    """Add the pairs of each entity that come near to its list; if it is full, the earliest."""
    g = wp.tid() + first
    listed = wp.where(number == 0, 0, c.count[g])
    more = wp.int32(listed)
    lower, upper = box_of_entity(g, a.kept, a)
    f, node = next_face(wp.where(a.near[g] != wp.uint8(0), 0, -1), lower, upper, a.tree)
    while f >= 0:
        for which in range(3):
            pair, other = pair_of(g, f, which, a)
            for slot in range(listed):
                if c.others[wp.static(SLOTS) * g + slot] == other:
                    other = wp.int32(-1)
            if other >= 0:
                w, n, gap, kept, when = constraint(f, g >= a.begin.shape[0], pair, a)
                slot = more
                if more == wp.static(SLOTS):
                    # The latest new pair gives way.
                    latest = when
                    for k in range(listed, wp.static(SLOTS)):
                        if c.whens[wp.static(SLOTS) * g + k] > latest:
                            slot = k
                            latest = c.whens[wp.static(SLOTS) * g + k]
                if when < wp.float64(2.0) and slot < wp.static(SLOTS):
                    s = wp.static(SLOTS) * g + slot
                    c.points[s] = pair
                    c.weights[s] = w
                    c.normals[s] = n
                    c.rooms[s] = wp.where(gap < kept, MENDED * (gap - kept), gap - kept)
                    c.others[s] = other
                    c.whens[s] = when
                    c.pushes[s] = wp.vec4d()
                    c.earlier[s] = wp.float64(0.0)
                    if c.friction > wp.float64(0.0):
                        c.turns[s] = wp.vec3d()
                    c.pressed[s] = wp.uint8(0)
                    more = wp.max(more, slot + 1)
        f, node = next_face(node, lower, upper, a.tree)
    c.count[g] = more
    if more > listed:
        status[wp.static(ROUND) + number] = 1


@wp.func
def from_centre(points: wp.vec4i, a: Surface):
    """Positions of the points of a pair relative to its centre, and J^-1."""
    x, _motion = path(points, a)
    centre = wp.float64(0.25) * (x[0] + x[1] + x[2] + x[3])
    J = wp.mat33d()
    for k in range(4):
        x[k] -= centre
        J += wp.dot(x[k], x[k]) * wp.identity(n=3, dtype=wp.float64) - wp.outer(x[k], x[k])
    return x, wp.inverse(J)


@kernel(per="list", writes=("c.pushes", "c.earlier", "c.turns", "c.pressed"))
def press(a: Surface, c: Pairs, momentum: wp.float64, first: int):
    """Compute the impulses of the next iteration."""
    g = wp.tid() + first
    for slot in range(c.count[g]):
        s = wp.static(SLOTS) * g + slot
        w = c.weights[s]
        n = c.normals[s]
        zero = wp.float64(0.0)
        full = zero
        full_slip = zero
        moved = mat43d()
        for k in range(4):
            i = c.points[s][k]
            moved[k] = a.drift[i] + a.given[i]
            share = wp.abs(w[k]) * c.pressing[i]
            full += share * wp.dot(wp.cw_mul(n, n), a.ease[i])
            full_slip += share * wp.max(a.ease[i])
        slip = wp.transpose(moved) * w
        left = c.rooms[s] + wp.dot(n, slip)
        push = c.pushes[s]
        much = push[3]
        rub = wp.vec3d(push[0], push[1], push[2])
        if c.pressed[s] != wp.uint8(0) and full > zero:
            much = wp.max(much - left / full, zero)
            if c.friction > zero:
                x, inverse = from_centre(c.points[s], a)
                spin = wp.vec3d()
                for k in range(4):
                    spin += wp.cross(x[k], moved[k])
                across = wp.transpose(x) * w
                slip -= wp.cross(inverse * spin, across)
                rub -= (slip - wp.dot(slip, n) * n) / full_slip
                size = wp.length(rub)
                if size > c.friction * much:
                    rub = (c.friction * much / size) * rub
                c.turns[s] = inverse * wp.cross(across, rub)
        ahead = wp.max(much + momentum * (much - c.earlier[s]), zero)
        c.earlier[s] = much
        c.pushes[s] = wp.vec4d(rub[0], rub[1], rub[2], ahead)
        c.pressed[s] = wp.where(much > zero or left < zero, wp.uint8(1), wp.uint8(0))


@wp.func
def add_up(impulses: mat43d, column: int, s: int, c: Pairs):
    """Add impulses on the points of a pair to the sums; the last point takes the rounding errors of the others."""
    for r in range(3):
        left = wp.int64(0)
        for k in range(4):
            part = -left
            if k < 3:
                part = wp.int64(wp.rint(impulses[k, r] / c.unit))
            left += part
            wp.atomic_add(c.sums, c.points[s][k], column + r, part)


@kernel(per="list", writes=("c.sums",))
def spread(a: Surface, c: Pairs, stride: int, first: int):
    """Sum the impulses on each point."""
    for g in range(wp.tid() + first, c.count.shape[0], stride):
        for slot in range(c.count[g]):
            s = wp.static(SLOTS) * g + slot
            if c.pressed[s] != wp.uint8(0):
                push = c.pushes[s]
                rub = wp.vec3d(push[0], push[1], push[2])
                w = c.weights[s]
                dragged = wp.outer(w, rub)
                if c.friction > wp.float64(0.0):
                    x, _inverse = from_centre(c.points[s], a)
                    for k in range(4):
                        dragged[k] -= wp.cross(c.turns[s], x[k])
                    add_up(dragged, 3, s, c)
                add_up(wp.outer(w, push[3] * c.normals[s]) + dragged, 0, s, c)
                for k in range(4):
                    part = wp.int64(wp.rint(wp.abs(w[k]) / WEIGHT))
                    wp.atomic_add(c.sums, c.points[s][k], 6, part)


@kernel(per="list", writes=("a.given", "c.impulse", "c.dragged", "c.pressing", "c.sums"))
def settle(a: Surface, c: Pairs, first: int):
    """Compute the displacements of the points by contact."""
    i = wp.tid() + first
    total = wp.vec3d()
    drag = wp.vec3d()
    for r in range(3):
        total[r] = c.unit * wp.float64(c.sums[i, r])
        drag[r] = c.unit * wp.float64(c.sums[i, 3 + r])
    a.given[i] = wp.cw_mul(a.ease[i], total)
    c.impulse[i] = total
    if c.friction > wp.float64(0.0):
        c.dragged[i] = drag
    c.pressing[i] = WEIGHT * wp.float64(c.sums[i, 6])
    for k in range(7):
        c.sums[i, k] = wp.int64(0)


@kernel(per="list", writes=("c.halts",))
def check(a: Surface, c: Pairs, number: int, first: int, status: wp.array(dtype=wp.int32)):
    """Mark points of pairs that would still pass; threads that share a point write the same to it."""
    g = wp.tid() + first
    sides = g >= a.begin.shape[0]
    lower, upper = box_of_entity(g, a.kept, a)
    f, node = next_face(wp.where(a.near[g] != wp.uint8(0), 0, -1), lower, upper, a.tree)
    while f >= 0:
        for which in range(3):
            pair, other = pair_of(g, f, which, a)
            if other >= 0:
                x, motion = path(pair, a)
                gap = distance(sides, x)
                if gap > ZERO * a.kept and gap <= a.kept + largest_approach(sides, motion):
                    kept = distance_kept(sides, pair, a)
                    limit = wp.max(SAFE * wp.min(gap, kept), ZERO * a.kept)
                    if kept > ZERO * a.kept and comes_near(sides, x, motion, limit) < wp.float64(2.0):
                        status[number] = 1
                        for k in range(4):
                            c.halts[pair[k]] = wp.uint8(1)
        f, node = next_face(node, lower, upper, a.tree)


@kernel(per="list", writes=("a.stays", "c.halts"))
def stay(a: Surface, c: Pairs, first: int):
    """Make marked points stay."""
    i = wp.tid() + first
    a.stays[i] = wp.max(a.stays[i], c.halts[i])
    c.halts[i] = wp.uint8(0)


@kernel(per="once")
def clear(start: int, end: int, first: int, status: wp.array(dtype=wp.int32)):
    """Reset entries of the status."""
    for k in range(start, end):
        status[k] = 0


@functools.cache
def take_impulses(options: StepOptions, rubs: bool) -> Pointwise:
    """Pointwise stage that applies the impulses and sums the losses; `rubs`: there is friction."""
    types = numeric(options.bits)
    real, vec3 = types.real, types.vec3
    held, loaded, tracked, damped = options.held, options.loaded, options.tracked, options.damped
    half_kick, half_loss = half_step(options)

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
        pressing: wp.array(dtype=wp.float64)
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
            begun = wp.vec3d(slowed / (real(1.0) - half_loss(a.step, a.damping)))
            before = wp.vec3d(a.velocity[i])
            dt = wp.float64(a.step[0])
            new = before + a.given[i] / dt
            after = vec3(new)
            change = wp.vec3d(after) - before
            impulse = a.impulse[i] / dt
            shift = dt * change
            if a.stays[i] != wp.uint8(0):
                shift = -dt * before
                if wp.static(held):
                    for c in range(3):
                        if (wp.int32(a.held_mask[i]) >> c) & 1 == 1:
                            shift[c] = wp.float64(0.0)
            a.velocity[i] = after
            a.displacement[i] = a.displacement[i] + vec3(shift)
            if wp.static(tracked):
                mean = begun + wp.float64(0.5) * change
                if wp.static(held):
                    for c in range(3):
                        if (wp.int32(a.held_mask[i]) >> c) & 1 == 1:
                            # The support balances the impulse.
                            mean[c] = before[c]
                            a.work[i] = a.work[i] - impulse[c] * before[c]
                if wp.static(loaded):
                    # The work of the load in the drift took the way without contact.
                    a.work[i] = a.work[i] + wp.float64(0.5) * wp.dot(wp.vec3d(a.external[i]), shift)
                if wp.static(damped):
                    loss = wp.float64(half_loss(a.step, a.damping) * a.mass[i])
                    a.dissipated[i] = a.dissipated[i] + loss * wp.dot(change, begun)
                rub = wp.float64(0.0)
                if wp.static(rubs):
                    rub = wp.dot(a.dragged[i] / dt, mean)
                    a.rubbed[i] = a.rubbed[i] - rub
                    a.dragged[i] = wp.vec3d()
                a.lost[i] = a.lost[i] - wp.dot(impulse, mean) + rub
            a.given[i] = wp.vec3d()
            a.impulse[i] = wp.vec3d()
            a.pressing[i] = wp.float64(0.0)
            a.stays[i] = wp.uint8(0)

    return take
