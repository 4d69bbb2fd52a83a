"""Small simulations with one law, and their runs on a CPU."""

from click.testing import CliRunner
from helpers import NEO

from warp_pd import BondAssociated, Explicit, Simulation
from warp_pd.__main__ import main

# Arguments of a small ball scene; the fixture `ball` of tests/core has the folder of its run with 24 frames.
BALL = ("ball_penetration", "--points", "21", "--horizon", "2.015", "--device", "cpu", "--quiet")


def simulate(sheet, solver=None, *, material=NEO, horizon=2.015, weights="plain", law=None, **parts):
    force = BondAssociated(material, horizon=horizon, weights=weights, **(law or {}))
    return Simulation(sheet, force=force, solver=solver or Explicit(0.1, frames=4), **parts)


def run(sheet, solver=None, *, precision=64, **parts):
    return simulate(sheet, solver, **parts).run(device="cpu", precision=precision)


def cli(*arguments):
    """The result of the command warp-pd."""
    return CliRunner().invoke(main, [str(argument) for argument in arguments])
