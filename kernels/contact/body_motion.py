"""Motion of rigid bodies in float64: along a path, or free under gravity and the impulses of the sheet.

Each body has
    place, rotation  now and at the beginning of the step (centre of mass [m], unit quaternion x, y, z, w);
    motion           velocity [m/s] and spin [1/s], as used by contact; on a path, then those of the previous step;
and a free body also has
    momenta          velocity [m/s], angular momentum [kg m^2/s], and velocity and spin at the last full step.

A free body is integrated like the sheet: half kick, drift, half kick. kernels/contact/free_contact.py has its contact.
"""

import functools

import warp as wp

from ..effects import Kernel, kernel
from ..numeric import numeric

# Distance that a point far from a body goes in a step without being looked at, over the margin.
SLOW = wp.constant(wp.float64(1.0 / 32.0))
# Entries of the counts of a body: number of this step, 1 if other parts move points after the body has looked which are
# near, and the last step in which points further away than the margin were told apart. From PREVIOUS on there are the
# first two again, of the previous step: one array, as every thread reads them.
STEP, MOVES, PREVIOUS, SEARCH = wp.constant(0), wp.constant(1), wp.constant(2), wp.constant(4)
COUNTS = 5
vec6d = wp.types.vector(length=6, dtype=wp.float64)


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
def differ(p: wp.quatd, q: wp.quatd):
    """Whether quaternions differ; a body that does not turn needs no roots and angles, which one thread waits for."""
    d = q - p
    return d[0] != wp.float64(0.0) or d[1] != wp.float64(0.0) or d[2] != wp.float64(0.0) or d[3] != wp.float64(0.0)


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
def length_of(v: wp.vec3d):
    """Length in float32, which takes less time."""
    return wp.float64(wp.length(wp.vec3(v)))


@wp.func
def count_step(counts: wp.array(dtype=wp.int32)):
    counts[PREVIOUS + STEP] = counts[STEP]
    counts[STEP] = counts[STEP] + 1


@wp.func
def search_again(
    moved: wp.float64, margin: wp.float64, counts: wp.array(dtype=wp.int32), travelled: wp.array(dtype=wp.float64)
):
    """Tell points apart in this step if they and the body, which moves by `moved` [m], may come nearer by `margin`."""
    if travelled[0] + moved + SLOW * margin >= wp.float64(0.9) * margin:
        counts[SEARCH] = counts[STEP]
        travelled[0] = wp.float64(0.0)


@kernel(per="once")
def follow_path(
    times: wp.array(dtype=wp.float64),
    places: wp.array(dtype=wp.vec3d),
    rotations: wp.array(dtype=wp.quatd),
    advance: wp.array(dtype=wp.float64),
    counts_time: int,
    radius: wp.float64,
    margin: wp.float64,
    first: int,
    time: wp.array(dtype=wp.float64),
    place: wp.array(dtype=wp.vec3d),
    rotation: wp.array(dtype=wp.quatd),
    motion: wp.array(dtype=wp.vec3d),
    counts: wp.array(dtype=wp.int32),
    travelled: wp.array(dtype=wp.float64),
):
    """Move bodies by one step along a piecewise linear path.

    `counts_time`: no clock advances the time. travelled: how far the body and a point further away than `margin` [m]
    may have come nearer since the last search [m], see kernels/contact/body_contact.py.
    """
    dt = advance[0]
    soon = wp.min(time[0] + dt, advance[1])
    if counts_time != 0:
        time[0] = soon
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
                turned = rotations[k]
                if differ(turned, rotations[k + 1]):
                    turned = wp.normalize(wp.quat_slerp(turned, rotations[k + 1], fraction))
    here = place[0]
    was = rotation[0]
    place[1] = here
    rotation[1] = was
    place[0] = there
    rotation[0] = turned
    motion[2] = motion[0]
    motion[3] = motion[1]
    # In static equilibrium no time passes.
    turn = wp.vec3d()
    if differ(was, turned):
        turn = turn_between(was, turned)
    if dt > wp.float64(0.0):
        motion[0] = (there - here) / dt
        motion[1] = turn / dt
    count_step(counts)
    moved = wp.length(there - here)
    if wp.length_sq(turn) > wp.float64(0.0):
        moved += radius * wp.length(turn)
    travelled[0] = travelled[0] + moved + SLOW * margin
    # The body and the points may move as far again in the step that follows from this test.
    search_again(moved, margin, counts, travelled)


@functools.cache
def free_motion(bits: int) -> Kernel:
    """Kernel `move_body`: first half kick and drift of a free body."""
    real = numeric(bits).real

    @kernel(per="once")
    def move_body(
        inverse_inertia: wp.mat33d,
        gravity: wp.vec3d,
        step: wp.array(dtype=real),
        radius: wp.float64,
        margin: wp.float64,
        slack: wp.float64,
        first: int,
        place: wp.array(dtype=wp.vec3d),
        rotation: wp.array(dtype=wp.quatd),
        motion: wp.array(dtype=wp.vec3d),
        momenta: wp.array(dtype=wp.vec3d),
        any_near: wp.array(dtype=wp.int32),
        changes: wp.array(dtype=vec6d),
        counts: wp.array(dtype=wp.int32),
        travelled: wp.array(dtype=wp.float64),
    ):
        """Arguments as for `follow_path`; a body that yields by more than `slack` [m] may touch any point."""
        # Until a point is marked.
        any_near[0] = 0
        changes[0] = vec6d()
        dt = wp.float64(step[0])
        q = rotation[0]
        spin = spin_of(q, inverse_inertia, momenta[1])
        momenta[2] = momenta[0]
        momenta[3] = spin
        count_step(counts)
        # In the last step it has also yielded. A turn is less than 2.25 times the change of its quaternion.
        gone = length_of(place[0] - place[1])
        turned = q - rotation[1]
        gone += wp.float64(2.25) * radius * length_of(wp.vec3d(turned[0], turned[1], turned[2]))
        gone += wp.float64(2.25) * radius * wp.abs(turned[3])
        travelled[0] = travelled[0] + gone + SLOW * margin
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
        moved = dt * (length_of(velocity) + radius * length_of(motion[1]))
        search_again(moved + slack, margin, counts, travelled)

    return move_body
