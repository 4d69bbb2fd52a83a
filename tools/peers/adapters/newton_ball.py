"""newton: its cloth on or under a rigid ball, by VBD (contact by a stiffness) or XPBD (by projection)."""

from __future__ import annotations

import newton
import numpy as np
import warp as wp

from peers.adapters.newton_model import VERSION, cloth, finished, slow


def solve(problem, settings):
    """Settings: as in newton_cloth; stiffness of contact [N/m]; duration [s] and damping [1/s] of a fall."""
    vbd, step = settings["solver"] == "vbd", settings["step"]
    places = problem.grid(settings["points"])
    size = problem.size[0] / (problem.counts(settings["points"])[0] - 1)
    # Hinges: VBD multiplies by the length of an edge; XPBD's gradient is that of the angle times twice a triangle.
    builder = cloth(problem, settings, edge_ke=problem.bending / (size if vbd else size**2))
    radius, body = problem.ball - builder.particle_radius[0], -1
    centre = wp.transform(wp.vec3(problem.ball_at), wp.quat_identity())
    if problem.ball_mass:
        inertia = 0.4 * problem.ball_mass * problem.ball**2 * np.eye(3)
        body = builder.add_body(
            xform=centre, mass=problem.ball_mass, inertia=wp.mat33(inertia.ravel()), lock_inertia=True
        )
    smooth = newton.ModelBuilder.ShapeConfig(density=0.0, ke=settings["stiffness"], kd=0.0, mu=0.0)
    at = wp.transform_identity() if problem.ball_mass else centre
    builder.add_shape_sphere(body, xform=at, radius=radius, cfg=smooth)
    model = finished(problem, builder, settings)
    model.soft_contact_ke, model.soft_contact_kd = settings["stiffness"], 0.0
    model.soft_contact_mu = model.particle_mu = 0.0
    pipeline = newton.CollisionPipeline(model, broad_phase="nxn", soft_contact_gap=size)
    contacts, iterations = pipeline.contacts(), settings["iterations"]
    solver = (
        newton.solvers.SolverVBD(
            model, iterations=iterations, rigid_body_particle_contact_buffer_size=len(places),
            collision_pipeline=pipeline,
        )
        if vbd
        else newton.solvers.SolverXPBD(model, iterations=iterations)
    )  # fmt: skip
    now, then, control = model.state(), model.state(), model.control()
    rest = np.column_stack([places, np.zeros(len(places))])
    start = rest + problem.start(places)
    keep = float(np.exp(-settings.get("damping", 0.0) * step))

    def two_steps():
        nonlocal now, then
        for _ in range(2):
            now.clear_forces()
            if not vbd:
                pipeline.collide(now, contacts)
            solver.step(now, then, control, None if vbd else contacts, step)
            wp.launch(slow, model.particle_count, [then.particle_qd, keep], device=model.device)
            now, then = then, now

    now.particle_q.assign(start.astype(np.float32))
    if problem.ball_mass:
        now.body_qd.assign(np.array([[0.0, 0.0, -problem.ball_speed, 0.0, 0.0, 0.0]], np.float32))
    # The solver keeps where the ball was, so the first steps count.
    two_steps()
    with wp.ScopedCapture(model.device) as capture:
        two_steps()
    steps = 2 * round((problem.until or settings["duration"]) / (2.0 * step))
    for _ in range(steps // 2 - 1):
        wp.capture_launch(capture.graph)
    moved = now.particle_q.numpy() - rest
    return {"places": places, "displacement": moved, "told": {"version": VERSION, "steps": steps}}
