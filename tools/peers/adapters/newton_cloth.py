"""newton: cloth of triangles, VBD (a neo-Hookean membrane of its own) or XPBD (springs along the edges), let settle."""

from __future__ import annotations

import newton
import numpy as np
import warp as wp

VERSION = f"newton {newton.__version__}"


@wp.kernel
def push(corners: wp.array2d(dtype=int), q: wp.array(dtype=wp.vec3), pressure: float, f: wp.array(dtype=wp.vec3)):
    """A third of the force of a follower pressure on each corner of a triangle [N]."""
    i, j, k = corners[wp.tid(), 0], corners[wp.tid(), 1], corners[wp.tid(), 2]
    force = pressure / 6.0 * wp.cross(q[j] - q[i], q[k] - q[i])
    wp.atomic_add(f, i, force)
    wp.atomic_add(f, j, force)
    wp.atomic_add(f, k, force)


@wp.kernel
def slow(v: wp.array(dtype=wp.vec3), part: float):
    """Leave a part of the velocities."""
    v[wp.tid()] = part * v[wp.tid()]


def solve(problem, settings):
    """Settings: points, solver ("vbd", "xpbd"), iterations, step [s], keep (of a velocity, each step), device."""
    along, across = problem.counts(settings["points"])
    places, vbd = problem.grid(settings["points"]), settings["solver"] == "vbd"
    sizes = problem.size[0] / (along - 1), problem.size[1] / (across - 1)
    shear = problem.mu * problem.thickness
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    builder.add_cloth_grid(
        pos=wp.vec3(), rot=wp.quat_identity(), vel=wp.vec3(), dim_x=along - 1, dim_y=across - 1, cell_x=sizes[0],
        cell_y=sizes[1], mass=problem.density * problem.thickness * sizes[0] * sizes[1], tri_ke=shear,
        tri_ka=2.0 * shear, tri_kd=0.0, edge_ke=0.0, edge_kd=0.0, add_springs=not vbd, spring_ke=1.0, spring_kd=0.0,
        particle_radius=0.1 * sizes[0],
    )  # fmt: skip
    for i in np.flatnonzero(problem.fixed(places)):
        builder.particle_mass[i] = 0.0
    builder.color()
    model = builder.finalize(device=settings["device"])
    if not vbd:
        # Springs that resist an even stretch both ways as rubber does.
        square = float((model.spring_rest_length.numpy() ** 2).sum())
        model.spring_stiffness.fill_(12.0 * shear * problem.size[0] * problem.size[1] / square)
    solvers = newton.solvers
    solver = (solvers.SolverVBD if vbd else solvers.SolverXPBD)(model, iterations=settings["iterations"])
    now, then, control = model.state(), model.state(), model.control()
    rest = np.column_stack([places, np.zeros(len(places))])

    def two_steps():
        nonlocal now, then
        for _ in range(2):
            now.clear_forces()
            inputs = [model.tri_indices, now.particle_q, problem.pressure, now.particle_f]
            wp.launch(push, model.tri_count, inputs, device=model.device)
            solver.step(now, then, control, None, settings["step"])
            wp.launch(slow, model.particle_count, [then.particle_qd, settings["keep"]], device=model.device)
            now, then = then, now

    start = (rest + problem.start(places)).astype(np.float32)
    now.particle_q.assign(start)
    two_steps()
    with wp.ScopedCapture(model.device) as capture:
        two_steps()
    now.particle_q.assign(start)
    now.particle_qd.zero_()
    before, steps = now.particle_q.numpy().copy(), 0
    while steps < settings["most"]:
        for _ in range(settings["between"] // 2):
            wp.capture_launch(capture.graph)
        steps += settings["between"]
        last, before = before, now.particle_q.numpy().copy()
        if np.abs(last - before).max() < settings["tolerance"] * np.abs(before - rest).max():
            break
    return {"places": places, "displacement": before - rest, "told": {"version": VERSION, "steps": steps}}
