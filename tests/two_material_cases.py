"""Sheets of two materials and the laws that know them, for the tests that share them."""

from helpers import GENT, NEO, built_on, square

from warp_pd import Bimodular, BondAssociated, BondBased, BondNeoHookean, Explicit, HyperelasticBonds, Simulation

FACTOR = 4.0


def laminate(points, axis="x"):
    """A square with a soft and a stiff half."""
    sheet = square(points)
    half = sheet.where((lambda x, y: x > 0.05) if axis == "x" else (lambda x, y: y > 0.05))
    return sheet.stiffened(half, FACTOR)


LAWS = {
    "bond_associated": BondAssociated(NEO, horizon=2.015, weights="plain"),
    "corrected": BondAssociated(GENT, horizon=2.015, weights="corrected", fast=False),
    "bond_based": BondBased(Bimodular(1e4, 3e3)),
    "hyperelastic": HyperelasticBonds(BondNeoHookean(1e3, "uniaxial", "refitted")),
}


def built_with(law, sheet, precision=64, device="cpu", **parts):
    return built_on(Simulation(sheet, force=law, solver=Explicit(1.0), **parts), device, precision)
