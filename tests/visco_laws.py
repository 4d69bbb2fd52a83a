"""Polyurea sheets: visco-hyperelastic laws, and sheets that are stretched uniformly at a given rate."""

import numpy as np
from helpers import square, uniform

from warp_pd import Explicit, Measure, Prony, Simulation, Visco, ViscoBondBased, Yeoh

POLYUREA = Yeoh(c10=0.1996e6, c20=0.0170e6)
TERMS = (Prony(c10=0.1e6, c20=0.01e6, time=1.0), Prony(c10=0.05e6, time=0.1))
LAWS = {
    "stress-free": Visco(POLYUREA, horizon=2.015, prony=TERMS),
    "published": ViscoBondBased(POLYUREA, prony=TERMS, horizon=2.015),
}
HEAVY = 1e20


def build(sheet, law, **parts):
    return Simulation(sheet, law, Explicit(1.0), **parts).build("cpu", 64)


def virial(built):
    """Mean first Piola stress in the plane [Pa], (2, 2)."""
    sheet = built.simulation.sheet
    force = built.to_numpy(built.state.force)[:, :2]
    return -force.T @ sheet.points / (sheet.areas.sum() * sheet.thickness)


def flight(law, rates, duration, steps=800, frames=20, start=None, precision=64, damage=None, points=7):
    """A sheet so heavy that it flies on: F = I + rates t, exactly uniform; two rates are those along x and y."""
    sheet, rates = square(points, density=HEAVY), np.diag(rates) if np.ndim(rates) == 1 else np.asarray(rates)
    velocity = np.column_stack([sheet.points @ rates.T, np.zeros(sheet.size)])
    initial = None if start is None else uniform(sheet, np.vstack([np.diag(start), np.zeros((1, 2))]))
    result = Simulation(
        sheet,
        law,
        Explicit(duration, frames=frames, step=duration / steps),
        initial_velocity=velocity,
        initial_displacement=initial,
        damage=damage,
        measures=[
            Measure("xx", "Pa", lambda built, frame: virial(built)[0, 0]),
            Measure("yy", "Pa", lambda built, frame: virial(built)[1, 1]),
        ],
    ).run(device="cpu", precision=precision)
    assert result.status == "finished" and len(result.history) == frames + 1
    return result
