"""FElupe: one layer of hexahedra of 27 nodes, since it has no membranes. It is held at its middle surface."""

from __future__ import annotations

import felupe as fem
import numpy as np

VERSION = f"FElupe {fem.__version__}"
# Stretch before the pressure, which is taken back under it: Newton's method fails from a flat sheet, and from a dome.
FIRST = 0.1


def solve(problem, settings):
    """Newton's method in load steps; settings: points."""
    along, across = (n // 2 + 1 for n in problem.counts(settings["points"]))
    half = 0.5 * problem.thickness
    mesh = fem.Cube(a=(0.0, 0.0, -half), b=(*problem.size, half), n=(along, across, 2))
    mesh = fem.mesh.convert(mesh, order=2, calc_points=True, calc_midfaces=True, calc_midvolumes=True)
    places, z = mesh.points[:, :2], mesh.points[:, 2]
    middle = np.abs(z) < 0.1 * half
    held = problem.fixed(places) & middle
    field = fem.FieldContainer([fem.Field(fem.RegionTriQuadraticHexahedron(mesh), dim=3)])
    solid = fem.SolidBody(fem.NeoHooke(mu=problem.mu, bulk=problem.bulk), field)
    # Nothing but its supports keeps a plane sheet in its plane.
    fixed = {"z": fem.Boundary(field[0], mask=middle if problem.plane else held, skip=(1, 1, 0))}
    x, y = (fem.Boundary(field[0], mask=held, skip=skip) for skip in ((0, 1, 1), (1, 0, 1)))
    goal = problem.start(places)[held]
    if problem.plane:
        ramps = [{x: [s * goal[:, 0] for s in (0.25, 0.5, 0.75, 1.0)]}]
        items = [solid]
        fixed["y"] = y
    else:
        below = fem.RegionTriQuadraticHexahedronBoundary(mesh, only_surface=True, mask=z < -0.9 * half)
        load = fem.SolidBodyPressure(fem.FieldContainer([fem.Field(below, dim=3)]))
        items = [solid, load]
        wider = FIRST * (places[held] - 0.5 * np.array(problem.size))
        rise = np.array([0.25, 0.5, 0.75, 1.0])
        parts, pressures = (
            np.r_[rise, 1.0 + 0.0 * rise, 1.0 - rise],
            problem.pressure * np.r_[0.0 * rise, rise, 1.0 + 0.0 * rise],
        )
        ramps = [{load: pressures, x: [s * wider[:, 0] for s in parts], y: [s * wider[:, 1] for s in parts]}]
    steps = [fem.Step(items=items, ramp=ramp, boundaries={**fixed, "x": x, "y": y}) for ramp in ramps]
    fem.Job(steps=steps).evaluate(x0=field, verbose=0, tol=1e-6, maxiter=30)
    return {"places": places[middle], "displacement": field[0].values[middle], "told": {"version": VERSION}}
