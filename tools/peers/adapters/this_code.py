"""This code: the bond-associated law, with Newton's method, implicit and explicit steps, and with a tearing energy."""

from __future__ import annotations

from dataclasses import replace

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
    if implicit:
        return pd.Implicit(until, steps=implicit, frames=1, damping=damping)
    return pd.Explicit(until, frames=1, damping=damping)


def moved(problem, settings):
    """The displacement at the end."""
    points, ends = problem.counts(settings["points"])[0], [0.0, problem.until or 1.0]
    sheet = pd.Sheet.rectangle(*problem.size, thickness=problem.thickness, density=problem.density, points=points)
    held, start = np.flatnonzero(problem.fixed(sheet.points)), problem.start(sheet.points)
    if problem.plane:
        far = (problem.stretch - 1.0) * problem.size[0]
        right = pd.Motion(sheet.edges("right"), ends, x=[0.0, far], y=0.0, z=0.0)
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
    mass, still, speed = problem.ball_mass, pd.BodyPath.still(problem.ball_at), (0.0, 0.0, -problem.ball_speed)
    path = pd.Free(mass, problem.ball_at, speed, gravity=(0.0, 0.0, 0.0)) if mass else still
    return [pd.RigidBody(pd.Sphere(2.0 * problem.ball), path, name="ball")] if problem.ball else []


def tear(problem, settings):
    """Scene `pure_shear_tear`, whose strip is that of the problem, pulled to 0.96 Gc in 0.3 s and then slowly."""
    height, points = problem.size[1], settings["points"]
    built = pure_shear_tear.build(points, settings["horizon"], tearing_energy=problem.tearing_energy)
    levels, times = (0.0, 0.96, 1.06), [0.0, 0.3, 0.3 + 0.1 / settings["rate"]]
    densities = [level * problem.tearing_energy / height for level in levels]
    stretches = [pure_shear_tear.stretch_at(built.force.material, density) for density in densities]
    (top, bottom, *others), up = built.loads, 0.5 * height * (np.array(stretches) - 1.0)
    loads = [replace(top, times=times, y=up), replace(bottom, times=times, y=-up), *others]
    slowly = pd.Explicit(times[-1], frames=list(np.linspace(*times[1:], 60)), damping=20.0, safety=0.8)
    history = replace(built, loads=loads, solver=slowly).run(device=settings["device"], out=None).history
    time = next(row["time"] for row in history if row["tip"] > 10.0 * height / points)
    return {"told": {"version": VERSION, "stretch": float(np.interp(time, times, stretches))}}
