"""Coupling of the sheet with bodies moved by Newton: converts impulses to Newton's forces, and poses to paths.

Newton takes steps of `seconds`; the sheet takes many steps in each of these intervals. During an interval a body moves
at constant velocity to Newton's next pose. The impulses between body and sheet act in Newton's next step, as a constant
force.

The mean force of an interval is that at its middle, but Newton needs it at the end, half a step later. This lag would
add energy to every bounce, in proportion to the step. Extrapolation by half of the last change of the force makes the
error second order. The added terms cancel in the sum of all impulses, except half of the last one, so momentum is
conserved.
"""

import warp as wp

from ..effects import unstaged


@unstaged
def take_impulses(
    sums: wp.array2d(dtype=wp.float64),
    before: wp.array(dtype=wp.float64),
    last: wp.array(dtype=wp.float64),
    given: wp.array(dtype=wp.float64),
):
    """Compute the impulses of bodies for Newton's next step, 6 numbers per shape (momentum, angular momentum).

    sums: impulses on the sheet since the last frame, per block. before: their sum up to the last interval. last:
    impulses of one interval. given: impulses to subtract from the bodies in Newton's next step.
    """
    row = wp.tid()
    total = wp.float64(0.0)
    for b in range(sums.shape[1]):
        total += sums[row, b]
    new = total - before[row]
    given[row] = new + wp.float64(0.5) * (new - last[row])
    last[row] = new
    before[row] = total


@unstaged
def load_bodies(
    bodies: wp.array(dtype=wp.int32),
    frames: wp.array(dtype=wp.transformd),
    given: wp.array(dtype=wp.float64),
    seconds: wp.float64,
    body_q: wp.array(dtype=wp.transformf),
    body_com: wp.array(dtype=wp.vec3f),
    body_f: wp.array(dtype=wp.spatial_vectorf),
):
    """Force and torque about the centre of mass of each body; `bodies`: body of each shape, or -1."""
    body = wp.tid()
    force = wp.vec3d()
    torque = wp.vec3d()
    for s in range(bodies.shape[0]):
        if bodies[s] == body:
            at = 6 * s
            impulse = wp.vec3d(given[at], given[at + 1], given[at + 2])
            q = wp.transform_get_rotation(body_q[body])
            turned = wp.quatd(wp.float64(q[0]), wp.float64(q[1]), wp.float64(q[2]), wp.float64(q[3]))
            arm = wp.quat_rotate(turned, wp.transform_get_translation(frames[s]) - wp.vec3d(body_com[body]))
            force -= impulse / seconds
            torque -= (wp.vec3d(given[at + 3], given[at + 4], given[at + 5]) + wp.cross(arm, impulse)) / seconds
    f = wp.vec3f(force)
    t = wp.vec3f(torque)
    body_f[body] = wp.spatial_vectorf(f[0], f[1], f[2], t[0], t[1], t[2])


@unstaged
def lead_shape(
    body: int,
    frame: wp.transformd,
    seconds: wp.float64,
    body_q: wp.array(dtype=wp.transformf),
    time: wp.array(dtype=wp.float64),
    times: wp.array(dtype=wp.float64),
    places: wp.array(dtype=wp.vec3d),
    rotations: wp.array(dtype=wp.quatd),
):
    """Path of a shape in the next interval; `frame`: pose of the shape in the frame of the body."""
    p = wp.transform_get_translation(body_q[body])
    q = wp.transform_get_rotation(body_q[body])
    turned = wp.quatd(wp.float64(q[0]), wp.float64(q[1]), wp.float64(q[2]), wp.float64(q[3]))
    rotation = wp.normalize(turned * wp.transform_get_rotation(frame))
    # A quaternion and its negative are the same rotation; the closer one gives the shorter path.
    if wp.dot(rotation, rotations[1]) < wp.float64(0.0):
        rotation = -rotation
    times[0] = time[0]
    times[1] = time[0] + seconds
    places[0] = places[1]
    places[1] = wp.vec3d(p) + wp.quat_rotate(turned, wp.transform_get_translation(frame))
    rotations[0] = rotations[1]
    rotations[1] = rotation
