"""newton's cloth, for its two adapters."""

from __future__ import annotations

import newton
import numpy as np
import warp as wp

VERSION = f"newton {newton.__version__}"


@wp.kernel
def slow(v: wp.array(dtype=wp.vec3), part: float):
    """Leave a part of the velocities."""
    v[wp.tid()] = part * v[wp.tid()]


def cloth(problem, settings, **bending):
    """The builder of the sheet; settings: points, solver ("vbd", "xpbd")."""
    along, across = problem.counts(settings["points"])
    places, vbd = problem.grid(settings["points"]), settings["solver"] == "vbd"
    sizes = problem.size[0] / (along - 1), problem.size[1] / (across - 1)
    shear = problem.mu * problem.thickness
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, -problem.gravity))
    builder.add_cloth_grid(
        pos=wp.vec3(), rot=wp.quat_identity(), vel=wp.vec3(), dim_x=along - 1, dim_y=across - 1, cell_x=sizes[0],
        cell_y=sizes[1], mass=problem.density * problem.thickness * sizes[0] * sizes[1], tri_ke=shear,
        tri_ka=2.0 * shear, tri_kd=0.0, edge_kd=0.0, add_springs=not vbd, spring_ke=1.0, spring_kd=0.0,
        particle_radius=0.1 * sizes[0], **{"edge_ke": 0.0, **bending},
    )  # fmt: skip
    for i in np.flatnonzero(problem.fixed(places)):
        builder.particle_mass[i] = 0.0
    return builder


def finished(problem, builder, settings):
    """The model, coloured; springs resist an even stretch both ways as rubber does."""
    builder.color(include_bending=problem.bending > 0.0)
    model = builder.finalize(device=settings["device"])
    if model.spring_count:
        square = float((model.spring_rest_length.numpy() ** 2).sum())
        shear = problem.mu * problem.thickness
        model.spring_stiffness.fill_(12.0 * shear * problem.size[0] * problem.size[1] / square)
    return model
