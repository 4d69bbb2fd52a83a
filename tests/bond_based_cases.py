"""Materials, sheets and runs that the tests of the bond-based law share."""

from helpers import built_on, jittered, square

from warp_pd import Bimodular, BondBased, Explicit, Fixed, PointForce, Sheet, Simulation

E = 2.0e4
LAWS = {"equal": Bimodular(E), "bimodular": Bimodular(E, 0.2 * E), "membrane": Bimodular(E, 0.0)}
CRACK = ((0.02, 0.048), (0.07, 0.062))
SHEETS = {"lattice": square, "cloud": jittered, "cells": lambda points: square(points, centred=True)}


def built(
    sheet,
    material=LAWS["equal"],
    horizon=3.0,
    precision=64,
    solver=None,
    state="plane stress",
    device="cpu",
    **parts,
):
    simulation = Simulation(sheet, BondBased(material, horizon, state), solver or Explicit(1.0), **parts)
    return built_on(simulation, device, precision)


def run(sheet, solver, loads, material=LAWS["equal"], horizon=3.0, precision=None, **parts):
    return Simulation(sheet, BondBased(material, horizon), solver, loads=loads, **parts).run(
        device="cpu", precision=precision
    )


def flat(sheet):
    """Hold all points in the plane of the sheet."""
    return Fixed(range(sheet.size), "z")


def beam(ratio=1.0, points=60, load=200.0):
    """Sheet, loads and material of a clamped beam under an end load."""
    sheet = Sheet.rectangle(2.0, 0.21, thickness=0.01, density=1000.0, points=points, centred=True)
    pull = PointForce(sheet.edges("right"), (0.0, -load, 0.0), ramp=[(0.0, 0.0), (1.0, 1.0)])
    return sheet, [Fixed(sheet.edges("left")), flat(sheet), pull], Bimodular(3.84e8, 3.84e8 / ratio)
