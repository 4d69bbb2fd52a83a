"""newton: cloth of triangles, VBD (a neo-Hookean membrane of its own) or XPBD (springs along the edges), let settle."""

from __future__ import annotations

import numpy as np
import warp as wp
from newton import solvers

from peers.adapters.newton_model import VERSION, cloth, finished, slow


@wp.kernel
def push(corners: wp.array2d(dtype=int), q: wp.array(dtype=wp.vec3), pressure: float, f: wp.array(dtype=wp.vec3)):
    """A third of the force of a follower pressure on each corner of a triangle [N]."""
    i, j, k = corners[wp.tid(), 0], corners[wp.tid(), 1], corners[wp.tid(), 2]
    force = pressure / 6.0 * wp.cross(q[j] - q[i], q[k] - q[i])
    wp.atomic_add(f, i, force)
    wp.atomic_add(f, j, force)
    wp.atomic_add(f, k, force)


def solve(problem, settings):
    """Settings: points, solver ("vbd", "xpbd"), iterations, step [s], keep (of a velocity, each step), device."""
    places = problem.grid(settings["points"])
    model = finished(problem, cloth(problem, settings), settings)
    vbd = settings["solver"] == "vbd"
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
