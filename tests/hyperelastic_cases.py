"""Law, modes and fits that the tests of hyperelastic bonds share."""

from helpers import built_on

from warp_pd import BondNeoHookean, Explicit, HyperelasticBonds, Simulation

MU = 2e5
MODES, FITS = ("equibiaxial", "planar", "uniaxial"), ("published", "refitted")


def build(sheet, mode="uniaxial", fit="published", horizon=3.015, precision=64, device="cpu", **parts):
    law = HyperelasticBonds(BondNeoHookean(MU, mode, fit), horizon)
    simulation = Simulation(sheet, force=law, solver=parts.pop("solver", Explicit(1.0)), **parts)
    return built_on(simulation, device, precision)
