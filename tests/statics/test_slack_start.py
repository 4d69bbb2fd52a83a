"""Scales of a sheet that is slack everywhere, where the tangent is zero."""

import numpy as np
import pytest
from helpers import build, square

from warp_pd import (
    BondAssociated,
    Fixed,
    MooneyRivlin,
    Motion,
    Newton,
    Ogden,
    Relaxation,
    Sheet,
    Simulation,
    TensionField,
)
from warp_pd.materials import modulus_in_tension


def slack(points=9):
    """A square that is 5 % shorter than at rest, and its displacement [m]."""
    sheet = square(points)
    shorter = np.zeros((sheet.size, 3))
    shorter[:, 0] = -0.05 * sheet.points[:, 0]
    return sheet, shorter


@pytest.mark.parametrize(("solver", "end", "stretch"), [
    (Newton(), -0.008, 0.92), (Newton(), 0.01, 1.1), (Relaxation(), -0.002, 0.98),
    (Relaxation(tolerance=1e-8), 0.01, 1.1),
])  # fmt: skip
def test_equilibrium_from_a_slack_sheet(solver, end, stretch):
    """It stays slack, without force, or is stretched to the force of uniaxial tension or pure shear."""
    sheet, shorter = slack()
    loads = [
        Fixed(range(sheet.size), "yz"), Fixed(sheet.edges("left"), "x"),
        Motion(sheet.edges("right"), [0.0, 1.0], x=[-0.005, end]),
    ]  # fmt: skip
    force = BondAssociated(TensionField(MooneyRivlin(c10=2e5)), horizon=2.015)
    result = Simulation(sheet, force, solver, loads, initial_displacement=shorter).run(device="cpu")
    assert result.status == "finished"
    pulled = -result.built.to_numpy(result.built.state.force)[sheet.edges("right"), 0].sum()
    # Pure shear of an incompressible sheet: first Piola stress 2 c10 (l - l^-3).
    expected = 0.1 * 1e-3 * 4e5 * (stretch - stretch**-3) if stretch > 1.0 else 0.0
    assert pulled == pytest.approx(expected, rel=1e-6, abs=1e-9 if isinstance(solver, Newton) else 1e-6)


def test_relaxation_of_slack_regions_beside_a_crack():
    """Points that are slack now are taut a step later; with the density of slack ones 10 000 steps did not suffice."""
    sheet = Sheet.rectangle(0.1, 0.05, thickness=1e-3, density=1000.0, points=21).cut((0.0512, -0.01), (0.0512, 0.015))
    loads = [Fixed(sheet.edges("left")), Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, 0.01], y=0.0, z=0.0)]
    force = BondAssociated(TensionField(MooneyRivlin(2e5)), horizon=2.015)
    result = Simulation(sheet, force, Relaxation(most_steps=3000), loads).run(device="cpu")
    assert result.status == "finished"


@pytest.mark.parametrize("material", [MooneyRivlin(c10=2e5), Ogden((-4e5,), (-2.0,)), Ogden((4e5,), (2.0,))])
def test_modulus_of_a_taut_sheet(material):
    """At rest dS11/dC11 is twice the shear modulus, whatever the first constant; wrinkles do not matter."""
    twice = 2.0 * 4e5
    assert modulus_in_tension(TensionField(material), "cpu") == pytest.approx(twice, rel=0.05)


def test_slack_points_have_a_fictitious_mass():
    """Also of a material whose first constant is negative."""
    sheet, shorter = slack(7)
    built = build(sheet, material=TensionField(Ogden((-4e5,), (-2.0,))), solver=Relaxation(), loads=[
        Fixed(sheet.edges("left")), Fixed(range(sheet.size), "z"),
    ], initial_displacement=shorter)  # fmt: skip
    built.context.run("start")
    built.context.run("fictitious mass")
    assert (built.context.fields["fictitious_mass"].numpy() > 0.0).all()
