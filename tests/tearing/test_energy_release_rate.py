"""The energy release rate of a crack: in a strip in pure shear, and as the change of energy with its length."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import refused, square
from scipy.spatial.transform import Rotation

from warp_pd import (
    Bimodular,
    BondAssociated,
    BondBased,
    Explicit,
    Fixed,
    Maxwell,
    MooneyRivlin,
    Motion,
    NeoHookean,
    Newton,
    Sheet,
    Simulation,
    TearingEnergy,
    TensionField,
    Visco,
)
from warp_pd.materials.energy import energy_density
from warp_pd.measures import energy_release_rate

RUBBER, HEIGHT, THICKNESS = NeoHookean(1e5, 1e7), 0.04, 1e-3
CUT = 1.5 * HEIGHT
TIP = (CUT, 0.5 * HEIGHT)


def in_pure_shear(stretch, points=57, damage=None, horizon=1.5):
    """A long strip, cut along its middle from the left, stretched across."""
    sheet = Sheet.rectangle(3.5 * HEIGHT, HEIGHT, thickness=THICKNESS, density=1000.0, points=points)
    middle = 0.5 * HEIGHT + 1e-5
    sheet = sheet.cut((-1.0, middle), (CUT, middle))
    bottom, top = sheet.edges("bottom"), sheet.edges("top")
    inner = np.setdiff1d(np.arange(sheet.size), np.concatenate([bottom, top]))
    move = Motion(top, [0.0, 1.0], x=0.0, y=[0.0, (stretch - 1.0) * HEIGHT], z=0.0)
    force = BondAssociated(TensionField(RUBBER, slack_stiffness=100.0), horizon=horizon)
    loads = [Fixed(bottom), Fixed(inner, "z"), move]
    result = Simulation(sheet, force, Newton(load_steps=3), loads=loads, damage=damage).run(device="cpu")
    assert result.status == "finished"
    return result.built, HEIGHT * float(energy_density(RUBBER, stretch, 1.0))


@pytest.mark.parametrize(("stretch", "horizon"), [(1.02, 1.5), (1.5, 2.015), (3.0, 1.5)])
def test_a_strip_in_pure_shear_releases_its_height_times_its_energy_density(stretch, horizon):
    built, exact = in_pure_shear(stretch, horizon=horizon)
    for radius in (0.3 * HEIGHT, 0.48 * HEIGHT):
        assert energy_release_rate(built, TIP, (2.0, 0.0), radius) == pytest.approx(exact, rel=0.013)
    # Nothing is released by a crack that does not lie there.
    assert abs(energy_release_rate(built, (3.0 * HEIGHT, 0.5 * HEIGHT), (1, 0), 0.4 * HEIGHT)) < 0.02 * exact


def test_only_the_ring_counts_with_its_thickness_and_the_stiffness_that_damage_leaves():
    """The same displacements of a sheet that is twice as thick outside, all as thick, or damaged evenly."""
    built, _ = in_pure_shear(1.2, damage=TearingEnergy(1e9, cut_profile=False))
    radius, sheet = 0.45 * HEIGHT, built.context.sheet
    whole = energy_release_rate(built, TIP, (1.0, 0.0), radius)
    far = np.linalg.norm(sheet.points - TIP, axis=1) > 1.2 * radius
    built.context.sheet = replace(sheet, thickness=np.where(far, 2.0 * THICKNESS, THICKNESS))
    assert energy_release_rate(built, TIP, (1.0, 0.0), radius) == pytest.approx(whole, rel=1e-12)
    built.context.sheet = sheet
    built.law.damage.assign(np.full(sheet.size, 0.3))
    assert energy_release_rate(built, TIP, (1.0, 0.0), radius) == pytest.approx(0.7**2 * whole, rel=1e-9)


def test_damage_around_a_cut_changes_it_little():
    built, exact = in_pure_shear(1.2, 85, TearingEnergy(1e4, length=3.4e-3))
    assert built.law.damage.numpy().max() > 0.9
    assert energy_release_rate(built, TIP, (1.0, 0.0), 0.48 * HEIGHT) == pytest.approx(exact, rel=0.013)


def slit(cells, side=0.06, points=61):
    spacing = side / (points - 1)
    y, reach = 0.5 * side + 0.5 * spacing, (cells + 0.5) * spacing
    sheet = Sheet.rectangle(side, side, thickness=THICKNESS, density=1000.0, points=points)
    sheet = sheet.cut((0.5 * side - reach, y), (0.5 * side + reach, y))
    move = Motion(sheet.edges("top"), [0.0, 1.0], x=0.0, y=[0.0, 0.01], z=0.0)
    loads = [Fixed(sheet.edges("bottom")), move]
    result = Simulation(sheet, BondAssociated(MooneyRivlin(5e4), horizon=1.5), Newton(), loads=loads).run(device="cpu")
    assert result.status == "finished"
    return result, (0.5 * side + reach, y), spacing


def test_it_is_the_energy_that_a_longer_slit_leaves_less_and_turns_with_the_sheet():
    (shorter, _, _), (here, tip, spacing), (longer, _, _) = (slit(cells) for cells in (7, 8, 9))
    # Both tips move by a spacing each way.
    released = (shorter.history[-1]["strain"] - longer.history[-1]["strain"]) / (4.0 * spacing * THICKNESS)
    found = energy_release_rate(here.built, tip, (1.0, 0.0), 12.0 * spacing)
    assert found == pytest.approx(released, rel=0.015)
    sheet, state = here.built.context.sheet, here.built.state
    places = Rotation.from_rotvec((0.3, -1.0, 2.0)).apply(sheet.positions + state.displacement.numpy())
    state.displacement.assign(places - sheet.positions)
    assert energy_release_rate(here.built, tip, (1.0, 0.0), 12.0 * spacing) == pytest.approx(found, rel=1e-6)


WRONG = [
    ({"radius": 0.09}, r"^radius = 0.09: expected a ring that does not reach an edge"),
    ({"radius": 0.001}, r"^radius = 0.001: expected ten spacings of 0.0083"),
    ({"radius": -1.0}, r"^radius = -1.0: expected a positive number"),
    ({"tip": (0.05,)}, r"^tip = "),
    ({"force": BondBased(Bimodular(1e3))}, r"force = BondBased: expected one hyperelastic material"),
    ({"force": Visco(RUBBER, branches=(Maxwell(1e4, 1.0),))}, r"force = Visco: expected a law without viscosity"),
    ({"sheet": Sheet.tube(0.05, 0.1, points=(20, 11), thickness=1e-3, density=1e3)}, "expected a flat sheet"),
]


@pytest.mark.parametrize(("changed", "said"), WRONG, ids=[said for _, said in WRONG])
def test_what_it_cannot_do_is_named(changed, said):
    given = {"sheet": square(13), "force": BondAssociated(RUBBER), "tip": (0.05, 0.05), "radius": 0.045} | changed
    built = Simulation(given["sheet"], given["force"], Explicit(1.0)).build("cpu")
    with refused(match=said):
        energy_release_rate(built, given["tip"], (1.0, 0.0), given["radius"])
