"""This code: the bond-associated law, with Newton's method, implicit and explicit steps, and with a tearing energy."""

from __future__ import annotations

import numpy as np

import warp_pd as pd
from warp_pd.scenes import pure_shear_tear

VERSION = f"warp_pd {pd.__version__}"


def solve(problem, settings):
    """Settings: points, horizon, device; relaxed, or steps of `Implicit`; damping and duration of a fall."""
    return (tear if problem.cut else moved)(problem, settings)


def solver(problem, settings):
    """Newton's method in one load step, relaxation, or implicit or explicit steps; those are in float32."""
    implicit = settings.get("steps")
    if settings.get("relaxed"):
        return pd.Relaxation()
    if not (problem.until or problem.gravity):
        return pd.Implicit(1.0, steps=implicit, frames=1, inertia=False) if implicit else pd.Newton(tolerance=1e-5)
    until, damping = problem.until or settings["duration"], settings.get("damping", 0.0)
    return (
        pd.Implicit(until, steps=implicit, frames=1, damping=damping) if implicit
        else pd.Explicit(until, frames=1, damping=damping)
    )  # fmt: skip


def moved(problem, settings):
    """The displacement at the end."""
    points, ends = problem.counts(settings["points"])[0], [0.0, problem.until or 1.0]
    sheet = pd.Sheet.rectangle(*problem.size, thickness=problem.thickness, density=problem.density, points=points)
    held, start = np.flatnonzero(problem.fixed(sheet.points)), problem.start(sheet.points)
    if problem.plane:
        right = pd.Motion(sheet.edges("right"), ends, x=[0.0, (problem.stretch - 1.0) * problem.size[0]], y=0.0, z=0.0)
        loads, start = [pd.Fixed(sheet.edges("left")), right], None
    elif problem.until:
        x, y = (np.stack([start[held, axis]] * 2) for axis in (0, 1))
        loads = [pd.Motion(held, ends, x=x, y=y, z=0.0)]
    else:
        loads, start = [pd.Fixed(held)], settings.get("start", start) if problem.gravity else None
    if problem.pressure:
        loads.append(pd.Pressure(problem.pressure))
    if problem.gravity:
        loads += [pd.BodyForce((0.0, 0.0, -problem.density * problem.gravity)), pd.Plate(problem.bending)]
    simulation = pd.Simulation(
        sheet,
        pd.BondAssociated(pd.NeoHookean(mu=problem.mu, bulk=problem.bulk), horizon=settings["horizon"]),
        solver(problem, settings), loads=loads, contact=ball(problem), initial_displacement=start,
    )  # fmt: skip
    displacement = simulation.run(device=settings["device"], out=None).frame.displacement
    return {"places": sheet.points[:, :2], "displacement": displacement, "told": {"version": VERSION}}


def ball(problem):
    """That of the problem, if it has one."""
    velocity = (0.0, 0.0, -problem.ball_speed)
    path = (
        pd.Free(problem.ball_mass, problem.ball_at, velocity, gravity=(0.0, 0.0, 0.0)) if problem.ball_mass
        else pd.BodyPath.still(problem.ball_at)
    )  # fmt: skip
    return [pd.RigidBody(pd.Sphere(2.0 * problem.ball), path, name="ball")] if problem.ball else []


def tear(problem, settings):
    """Scene `pure_shear_tear`, whose strip is that of the problem."""
    scene = pure_shear_tear
    own = (scene.LENGTH, scene.HEIGHT), scene.CUT, scene.THICKNESS, scene.MU
    assert own == (problem.size, problem.cut, problem.thickness, problem.mu), own
    simulation = scene.build(settings["points"], settings["horizon"], tearing_energy=problem.tearing_energy)
    history = simulation.run(device=settings["device"], out=None).history
    row = next(row for row in history if row["tip"] > 10.0 * problem.size[1] / settings["points"])
    return {"told": {"version": VERSION, "stretch": row["stretch"]}}
