"""This code: the bond-associated law, with Newton's method, and explicit with a tearing energy."""

from __future__ import annotations

import numpy as np

import warp_pd
from warp_pd import BondAssociated, Explicit, Fixed, Motion, NeoHookean, Newton, Pressure, Sheet, Simulation
from warp_pd.scenes import pure_shear_tear

VERSION = f"warp_pd {warp_pd.__version__}"


def solve(problem, settings):
    """Settings: points, horizon, device."""
    return (tear if problem.cut else motion if problem.until else equilibrium)(problem, settings)


def equilibrium(problem, settings):
    """Newton's method in one load step."""
    along, _ = problem.counts(settings["points"])
    sheet = Sheet.rectangle(*problem.size, thickness=problem.thickness, density=problem.density, points=along)
    if problem.plane:
        far = (problem.stretch - 1.0) * problem.size[0]
        right = Motion(sheet.edges("right"), times=[0.0, 1.0], x=[0.0, far], y=0.0, z=0.0)
        loads = [Fixed(sheet.edges("left")), right]
    else:
        loads = [Fixed(sheet.edges(*problem.held)), Pressure(problem.pressure)]
    law = BondAssociated(NeoHookean(mu=problem.mu, bulk=problem.bulk), horizon=settings["horizon"])
    result = Simulation(sheet, law, Newton(tolerance=1e-5), loads=loads).run(device=settings["device"], out=None)
    return {"places": sheet.points[:, :2], "displacement": result.frame.displacement, "told": {"version": VERSION}}


def motion(problem, settings):
    """Explicit steps from a stretched sheet at rest, in float32."""
    points = problem.counts(settings["points"])[0]
    sheet = Sheet.rectangle(*problem.size, thickness=problem.thickness, density=problem.density, points=points)
    edge, start = sheet.edges("all"), problem.start(sheet.points[:, :2])
    x, y, _ = (np.stack([start[edge, axis]] * 2) for axis in range(3))
    result = Simulation(
        sheet,
        BondAssociated(NeoHookean(mu=problem.mu, bulk=problem.bulk), horizon=settings["horizon"]),
        Explicit(problem.until, frames=1),
        loads=[Motion(edge, times=[0.0, problem.until], x=x, y=y, z=0.0), Pressure(problem.pressure)],
        initial_displacement=start,
    ).run(device=settings["device"], out=None)
    return {"places": sheet.points[:, :2], "displacement": result.frame.displacement, "told": {"version": VERSION}}


def tear(problem, settings):
    """Scene `pure_shear_tear`, whose strip is that of the problem."""
    scene = pure_shear_tear
    own = (scene.LENGTH, scene.HEIGHT), scene.CUT, scene.THICKNESS, scene.MU
    assert own == (problem.size, problem.cut, problem.thickness, problem.mu), own
    simulation = scene.build(settings["points"], settings["horizon"], tearing_energy=problem.tearing_energy)
    history = simulation.run(device=settings["device"], out=None).history
    row = next(row for row in history if row["tip"] > 10.0 * problem.size[1] / settings["points"])
    return {"told": {"version": VERSION, "stretch": row["stretch"]}}
