"""Motion of rigid bodies in float64: along a path, or free under gravity and the impulses of the sheet.

Each body has
    place, rotation  now and at the beginning of the step (centre of mass [m], unit quaternion x, y, z, w);
    motion           velocity [m/s] and spin [1/s], as used by contact;
and a free body also has
    momenta          velocity [m/s], angular momentum [kg m^2/s], and velocity and spin at the last full step.

A free body is integrated like the sheet: half kick, drift, half kick. All contacts of one half step are solved
together. Point i moves into the body with speed a_i along its normal n_i, at the arm r_i. If every such point ends with
the velocity of the body's surface, the change d of velocity and spin of the body solves, with j_i = (n_i, r_i x n_i),
    [diag(M, I) + sum m_i j_i j_i^T] d = -sum m_i a_i j_i.
A second solution leaves out points that would have to be pulled, and adds friction according to the first solution:
sticking points move with the body, sliding points drag it by the friction coefficient times their impulse. The body
moves by the second solution. Then the points are projected, and the body loses the momentum that they gained.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from .effects import Kernel, kernel
from .numeric import numeric

vec6d = wp.types.vector(length=6, dtype=wp.float64)
mat66d = wp.types.matrix(shape=(6, 6), dtype=wp.float64)
# Sums over points: the upper triangle of the matrix and the right-hand side; and the impulses given to the points.
Equations = wp.types.vector(length=27, dtype=wp.float64)
Given = wp.types.vector(length=14, dtype=wp.float64)


@wp.func
def turned_by(turn: wp.vec3d, rotation: wp.quatd):
    """`rotation` followed by the rotation vector `turn` [rad]."""
    angle = wp.length(turn)
    scale = wp.float64(0.5)
    if angle > wp.float64(1e-8):
        scale = wp.sin(wp.float64(0.5) * angle) / angle
    by = wp.quatd(scale * turn[0], scale * turn[1], scale * turn[2], wp.cos(wp.float64(0.5) * angle))
    return wp.normalize(by * rotation)


@wp.func
def turn_between(begin: wp.quatd, end: wp.quatd):
    """Rotation vector from `begin` to `end` [rad]."""
    by = end * wp.quat_inverse(begin)
    axis = wp.vec3d(by[0], by[1], by[2])
    if by[3] < wp.float64(0.0):
        axis = -axis
    sine = wp.length(axis)
    scale = wp.float64(2.0)
    if sine > wp.float64(1e-12):
        scale = wp.float64(2.0) * wp.atan2(sine, wp.abs(by[3])) / sine
    return scale * axis


@wp.func
def spin_of(rotation: wp.quatd, inverse_inertia: wp.mat33d, angular: wp.vec3d):
    return wp.quat_rotate(rotation, inverse_inertia * wp.quat_rotate_inv(rotation, angular))


@wp.func
def wrench(force: wp.vec3d, arm: wp.vec3d):
    turn = wp.cross(arm, force)
    return vec6d(force[0], force[1], force[2], turn[0], turn[1], turn[2])


@wp.func
def change_motion(
    change: vec6d, at_end: int, dt: wp.float64, place: wp.array(dtype=wp.vec3d), rotation: wp.array(dtype=wp.quatd),
    motion: wp.array(dtype=wp.vec3d),
):  # fmt: skip
    """Change velocity and spin of a body and, unless `at_end`, its position by what this does in the step."""
    linear = wp.vec3d(change[0], change[1], change[2])
    turn = wp.vec3d(change[3], change[4], change[5])
    motion[0] = motion[0] + linear
    motion[1] = motion[1] + turn
    if at_end == 0:
        place[0] = place[0] + dt * linear
        rotation[0] = turned_by(dt * turn, rotation[0])


@wp.func
def with_row(sums: Equations, m: wp.float64, j: vec6d, side: wp.float64):
    """Add m j j^T to the matrix, and `side` times j to the right-hand side."""
    found = sums
    row = int(0)  # noqa: RUF046
    for r in range(6):
        for c in range(r, 6):
            found[row] += m * j[r] * j[c]
            row += 1
        found[21 + r] += side * j[r]
    return found


@functools.cache
def block_sum(kind: Any) -> wp.Function:
    """Function (value, count) -> sum of the values over the threads of a block, if any count is nonzero.

    The order of summation is fixed, so bits repeat. On a CPU a block has one thread.
    """

    @wp.func
    def summed(value: kind, count: int):
        found = value
        if wp.tile_sum(wp.tile(count))[0] > 0:
            found = wp.tile_sum(wp.tile(value, preserve_type=True))[0]
        return found

    return summed


@functools.cache
def path_motion() -> Kernel:
    """Kernel `follow_path`: moves bodies by one step along a piecewise linear path."""

    @kernel(per="once")
    def follow_path(
        times: wp.array(dtype=wp.float64),
        places: wp.array(dtype=wp.vec3d),
        rotations: wp.array(dtype=wp.quatd),
        time: wp.array(dtype=wp.float64),
        advance: wp.array(dtype=wp.float64),
        first: int,
        place: wp.array(dtype=wp.vec3d),
        rotation: wp.array(dtype=wp.quatd),
        motion: wp.array(dtype=wp.vec3d),
    ):
        dt = advance[0]
        soon = wp.min(time[0] + dt, advance[1])
        last = times.shape[0] - 1
        there = places[0]
        turned = rotations[0]
        if soon >= times[last]:
            there = places[last]
            turned = rotations[last]
        else:
            for k in range(last):
                if soon >= times[k] and soon < times[k + 1]:
                    fraction = (soon - times[k]) / (times[k + 1] - times[k])
                    there = places[k] + fraction * (places[k + 1] - places[k])
                    turned = wp.normalize(wp.quat_slerp(rotations[k], rotations[k + 1], fraction))
        here = place[0]
        was = rotation[0]
        place[1] = here
        rotation[1] = was
        place[0] = there
        rotation[0] = turned
        # In static equilibrium no time passes.
        if dt > wp.float64(0.0):
            motion[0] = (there - here) / dt
            motion[1] = turn_between(was, turned) / dt

    return follow_path


@dataclass(frozen=True)
class FreeMotion:
    """Kernels of a free body.

    Attributes:
        move: First half kick, and drift.
        kick: Second half kick.
        gather: Sums of the matrix and the right-hand side, per block of points.
        solve: Change of velocity and spin caused by all touching points; moves the body by it.
        gather_given: Sums of the impulses given to the points, per block.
        give: Subtracts these impulses from the momentum of the body.
    """

    move: Kernel
    kick: Kernel
    gather: Kernel
    solve: Kernel
    gather_given: Kernel
    give: Kernel


@functools.cache
def free_motion(bits: int, damped: bool, tracked: bool, rubs: bool, marked: bool) -> FreeMotion:
    """Kernels of a free body; `damped`, `tracked`, `rubs` and `marked` as in `body_contact`."""
    real = numeric(bits).real
    sum_equations, sum_given = block_sum(Equations), block_sum(Given)

    @kernel(per="once")
    def move_body(
        inverse_inertia: wp.mat33d,
        gravity: wp.vec3d,
        step: wp.array(dtype=real),
        first: int,
        place: wp.array(dtype=wp.vec3d),
        rotation: wp.array(dtype=wp.quatd),
        motion: wp.array(dtype=wp.vec3d),
        momenta: wp.array(dtype=wp.vec3d),
    ):
        dt = wp.float64(step[0])
        q = rotation[0]
        spin = spin_of(q, inverse_inertia, momenta[1])
        momenta[2] = momenta[0]
        momenta[3] = spin
        velocity = momenta[0] + (wp.float64(0.5) * dt) * gravity
        momenta[0] = velocity
        place[1] = place[0]
        rotation[1] = q
        place[0] = place[0] + dt * velocity
        halfway = turned_by((wp.float64(0.5) * dt) * spin, q)
        q = turned_by(dt * spin_of(halfway, inverse_inertia, momenta[1]), q)
        rotation[0] = q
        motion[0] = velocity
        motion[1] = spin_of(q, inverse_inertia, momenta[1])

    @kernel(per="once")
    def kick_body(
        gravity: wp.vec3d,
        step: wp.array(dtype=real),
        first: int,
        motion: wp.array(dtype=wp.vec3d),
        momenta: wp.array(dtype=wp.vec3d),
    ):
        velocity = momenta[0] + (wp.float64(0.5) * wp.float64(step[0])) * gravity
        momenta[0] = velocity
        momenta[2] = velocity
        momenta[3] = motion[1]
        motion[0] = velocity

    @kernel(per="block")
    def gather_touching(
        mass: wp.array(dtype=real),
        marks: wp.array(dtype=wp.uint8),
        need: wp.array(dtype=wp.float64),
        rows: wp.array(dtype=vec6d),
        arms: wp.array(dtype=wp.vec3d),
        slips: wp.array(dtype=wp.vec3d),
        friction: wp.float64,
        changes: wp.array(dtype=vec6d),
        use_changes: int,
        at_end: int,
        step: wp.array(dtype=real),
        damping: wp.array(dtype=real),
        block: int,
        first: int,
        sums: wp.array(dtype=Equations),
    ):
        """Sum over points that move into the body; with `use_changes`, those that still do after it has yielded."""
        thread = wp.tid() + first
        b = thread / wp.block_dim()
        lane = thread - b * wp.block_dim()
        count = wp.int32(0)
        found = Equations()
        weight = wp.float64(1.0)
        if wp.static(damped):
            if at_end != 0:
                # The second half kick has divided velocities by 1 + c dt / 2; impulses count before this division.
                weight += wp.float64(0.5) * wp.float64(step[0]) * wp.float64(damping[0])
        for i in range(b * block + lane, wp.min((b + 1) * block, need.shape[0]), wp.block_dim()):
            needs = bool(True)
            if wp.static(marked):
                needs = marks[i] != wp.uint8(0)
            if needs:
                needs = need[i] >= wp.float64(0.0)
            if needs:
                j = rows[i]
                pushed = bool(True)
                if use_changes != 0:
                    pushed = need[i] + wp.dot(j, changes[0]) > wp.float64(0.0)
                if pushed:
                    count += 1
                    m = weight * wp.float64(mass[i])
                    found = with_row(found, m, j, -m * need[i])
                    if wp.static(rubs):
                        if use_changes != 0:
                            n = wp.vec3d(j[0], j[1], j[2])
                            d = changes[0]
                            moved = wp.vec3d(d[0], d[1], d[2]) + wp.cross(wp.vec3d(d[3], d[4], d[5]), arms[i])
                            slip = slips[i] - moved
                            slip -= wp.dot(slip, n) * n
                            speed = wp.length(slip)
                            most = friction * (need[i] + wp.dot(j, d))
                            if speed > most:
                                found = with_row(found, wp.float64(0.0), wrench(slip, arms[i]), m * most / speed)
                            else:
                                for c in range(3):
                                    unit = wp.vec3d()
                                    unit[c] = wp.float64(1.0)
                                    unit -= n[c] * n
                                    found = with_row(found, m, wrench(unit, arms[i]), m * wp.dot(unit, slips[i]))
        found = sum_equations(found, count)
        if lane == 0:
            sums[b] = found

    @kernel(per="once")
    def solve_touching(
        sums: wp.array(dtype=Equations),
        mass: wp.float64,
        inertia: wp.mat33d,
        use_changes: int,
        at_end: int,
        step: wp.array(dtype=real),
        first: int,
        changes: wp.array(dtype=vec6d),
        place: wp.array(dtype=wp.vec3d),
        rotation: wp.array(dtype=wp.quatd),
        motion: wp.array(dtype=wp.vec3d),
    ):
        """Solve by Cholesky decomposition, in one block of threads; R I R^T is the inertia tensor in the sheet's frame.

        With `use_changes`, also change the velocity of the body and, unless `at_end`, its position.
        """
        lane = wp.tid() + first
        totals = Equations()
        for b in range(lane, sums.shape[0], wp.block_dim()):
            totals += sums[b]
        totals = sum_equations(totals, 1)
        if lane > 0:
            return
        A = mat66d()
        row = int(0)  # noqa: RUF046
        for r in range(6):
            for c in range(r, 6):
                A[r, c] = totals[row]
                A[c, r] = totals[row]
                row += 1
        q = rotation[0]
        for c in range(3):
            A[c, c] = A[c, c] + mass
            unit = wp.vec3d()
            unit[c] = wp.float64(1.0)
            column = wp.quat_rotate(q, inertia * wp.quat_rotate_inv(q, unit))
            for r in range(3):
                A[3 + r, 3 + c] = A[3 + r, 3 + c] + column[r]
        x = vec6d()
        for r in range(6):
            x[r] = totals[21 + r]
        for c in range(6):
            for k in range(c):
                A[c, c] = A[c, c] - A[c, k] * A[c, k]
            # The diagonal stores its inverse, because a division takes as long as ten products.
            A[c, c] = wp.float64(1.0) / wp.sqrt(A[c, c])
            for r in range(c + 1, 6):
                for k in range(c):
                    A[r, c] = A[r, c] - A[r, k] * A[c, k]
                A[r, c] = A[r, c] * A[c, c]
        for r in range(6):
            for k in range(r):
                x[r] = x[r] - A[r, k] * x[k]
            x[r] = x[r] * A[r, r]
        for back in range(6):
            r = 5 - back
            for k in range(r + 1, 6):
                x[r] = x[r] - A[k, r] * x[k]
            x[r] = x[r] * A[r, r]
        changes[0] = x
        if use_changes != 0:
            change_motion(x, at_end, wp.float64(step[0]), place, rotation, motion)

    @kernel(per="block")
    def gather_given(
        marks: wp.array(dtype=wp.uint8),
        push: wp.array(dtype=wp.vec3d),
        arms: wp.array(dtype=wp.vec3d),
        push_work: wp.array(dtype=wp.float64),
        rub: wp.array(dtype=wp.vec3d),
        rub_work: wp.array(dtype=wp.float64),
        block: int,
        first: int,
        sums: wp.array(dtype=Given),
    ):
        thread = wp.tid() + first
        b = thread / wp.block_dim()
        lane = thread - b * wp.block_dim()
        count = wp.int32(0)
        linear = wp.vec3d()
        turn = wp.vec3d()
        work = wp.float64(0.0)
        rubbing = wp.vec3d()
        twist = wp.vec3d()
        warmed = wp.float64(0.0)
        for i in range(b * block + lane, wp.min((b + 1) * block, push.shape[0]), wp.block_dim()):
            got = bool(True)
            if wp.static(marked):
                got = marks[i] != wp.uint8(0)
            if got:
                count += 1
                linear += push[i]
                turn += wp.cross(arms[i], push[i])
                if wp.static(tracked):
                    work += push_work[i]
                    if wp.static(rubs):
                        rubbing += rub[i]
                        twist += wp.cross(arms[i], rub[i])
                        warmed += rub_work[i]
        found = Given()
        for c in range(3):
            found[c] = linear[c]
            found[3 + c] = turn[c]
            found[7 + c] = rubbing[c]
            found[10 + c] = twist[c]
        found[6] = work
        found[13] = warmed
        found = sum_given(found, count)
        if lane == 0:
            sums[b] = found

    @kernel(per="once")
    def give(
        sums: wp.array(dtype=Given),
        mass: wp.float64,
        inverse_inertia: wp.mat33d,
        rotation: wp.array(dtype=wp.quatd),
        first: int,
        motion: wp.array(dtype=wp.vec3d),
        momenta: wp.array(dtype=wp.vec3d),
        given: wp.array(dtype=wp.float64),
    ):
        """Subtract the impulses from the momentum of the body, in one block of threads.

        `given` has sums since the last frame: momentum and angular momentum given to the sheet, energy lost in contact,
        and the part of it lost by friction [J].
        """
        lane = wp.tid() + first
        totals = Given()
        for b in range(lane, sums.shape[0], wp.block_dim()):
            totals += sums[b]
        totals = sum_given(totals, 1)
        if lane > 0:
            return
        linear = wp.vec3d(totals[0], totals[1], totals[2])
        turn = wp.vec3d(totals[3], totals[4], totals[5])
        before = momenta[0]
        spin_before = spin_of(rotation[0], inverse_inertia, momenta[1])
        velocity = before - linear / mass
        angular = momenta[1] - turn
        spin = spin_of(rotation[0], inverse_inertia, angular)
        momenta[0] = velocity
        momenta[1] = angular
        motion[0] = velocity
        motion[1] = spin
        for c in range(6):
            given[c] = given[c] + totals[c]
        if wp.static(tracked):
            half = wp.float64(0.5)
            moved = momenta[2] + half * (velocity - before)
            turned = momenta[3] + half * (spin - spin_before)
            given[6] = given[6] + wp.dot(linear, moved) + wp.dot(turn, turned) - totals[6]
            if wp.static(rubs):
                rubbing = wp.vec3d(totals[7], totals[8], totals[9])
                twist = wp.vec3d(totals[10], totals[11], totals[12])
                given[7] = given[7] + wp.dot(rubbing, moved) + wp.dot(twist, turned) - totals[13]
        # Later contacts of this half step start from the changed velocities.
        momenta[2] = momenta[2] + velocity - before
        momenta[3] = momenta[3] + spin - spin_before

    return FreeMotion(move_body, kick_body, gather_touching, solve_touching, gather_given, give)
