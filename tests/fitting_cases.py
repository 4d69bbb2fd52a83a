"""Small scenes whose derivatives and fits are tested."""

import numpy as np

from warp_pd import (
    BondAssociated,
    EnclosedGas,
    Fixed,
    Gent,
    Measure,
    MooneyRivlin,
    Motion,
    Newton,
    Ogden,
    PointForce,
    Pressure,
    Sheet,
    Simulation,
    Yeoh,
)
from warp_pd.fitting import Deflection, SupportForce

TOLERANCE = 1e-12


def pulled(material, points=9, stretch=1.3, thickness=1e-3, solver=None, hole=False):
    """A strip in two grips, free on the other two edges; the force of the right grip."""
    sheet = Sheet.rectangle(0.1, 0.05, thickness=thickness, density=1e3, points=points)
    if hole:
        sheet = sheet.hole((0.05, 0.025), 0.012)
    left, right = sheet.edges("left"), sheet.edges("right")
    others = np.setdiff1d(np.arange(sheet.size), np.concatenate([left, right]))
    top = sheet.nearest(0.05, 0.05)
    return Simulation(
        sheet,
        force=BondAssociated(material, horizon=2.015),
        loads=[
            Fixed(left),
            Fixed(others, "z"),
            Motion(right, times=[0.0, 1.0], x=[0.0, (stretch - 1.0) * 0.1], y=0.0, z=0.0),
        ],
        solver=solver or Newton(tolerance=TOLERANCE),
        measures=[
            Measure("force", "N", SupportForce(right, "x")),
            Measure("narrowing", "m", Deflection(top, "y")),
            Measure("squared", "m^2", lambda built, frame: float((frame.displacement**2).sum())),
        ],
    )


def ogden_strip(mu1=0.5e6, a1=1.6, mu2=2e4, a2=4.0, **more):
    return pulled(Ogden((mu1, mu2), (a1, a2)), **more)


def yeoh_strip(c10=0.2e6, c20=-2e3, c30=100.0, **more):
    return pulled(Yeoh(c10, c20, c30), **more)


def blown(
    mu=0.4e6, lock=20.0, pressure=15e3, thickness=1e-3, prestretch=1.1, free=False, push=0.0, points=9, gas=0.0,
    ratio=50.0, duration=1.0,
):  # fmt: skip
    """A square Gent sheet under follower pressure, clamped all around or, `free`, on two edges."""
    sheet = Sheet.rectangle(0.1, 0.1, thickness=thickness, density=1e3, points=points)
    held = sheet.edges("left", "right") if free else sheet.edges("all")
    centre, edge = sheet.nearest(0.05, 0.05), sheet.nearest(0.05, 0.0)
    right = sheet.edges("right")
    if prestretch > 1.0:
        sheet = sheet.prestretched(prestretch)
    loads = [Fixed(held), Pressure(pressure)]
    if push:
        loads.append(PointForce([edge], (0.0, 0.0, push)))
    if gas:
        loads[1] = EnclosedGas(gas, amount=[(0.0, 1.0), (1.0, 1.3)], chamber=1e-4)
    return Simulation(
        sheet,
        force=BondAssociated(Gent(mu, ratio * mu, lock), horizon=2.015),
        loads=loads,
        solver=Newton(tolerance=TOLERANCE, duration=duration),
        measures=[
            Measure("height", "m", Deflection(centre, "z")),
            Measure("edge_height", "m", Deflection([edge], "z")),
            Measure("pull", "N", SupportForce(right, "x")),
        ],
    )


def mooney_disc(c10=0.2e6, c01=0.02e6, pressure=8e3, prestretch=1.2):
    """An incompressible Mooney-Rivlin sheet, stretched before it was clamped."""
    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1e3, points=9)
    held, centre = sheet.edges("all"), sheet.nearest(0.05, 0.05)
    return Simulation(
        sheet.prestretched(prestretch),
        force=BondAssociated(MooneyRivlin(c10, c01), horizon=2.015),
        loads=[Fixed(held), Pressure(pressure)],
        solver=Newton(tolerance=TOLERANCE),
        measures=[Measure("height", "m", Deflection(centre, "z"))],
    )
