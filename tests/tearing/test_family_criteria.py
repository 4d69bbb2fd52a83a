"""Rupture by the stress and the energy density of families, against uniform states."""

import numpy as np
import pytest
from helpers import MU, NEO, build, exact_stress, jittered, refused, square, uniform

from warp_pd import (
    Bimodular,
    BondAssociated,
    BondBased,
    CriticalEnergyDensity,
    CriticalStress,
    Explicit,
    Fixed,
    MooneyRivlin,
    Motion,
    Newton,
    Plate,
    Sheet,
    Simulation,
)
from warp_pd.materials import energy_density

STRETCHES = (1.5, 1.1)
F = np.diag((*STRETCHES, 1.0))[:, :2]
PIOLA = float(exact_stress(NEO, F)[0, 0])
# Of an incompressible rubber the section is 1 / stretch of what it was.
RUBBER = MooneyRivlin(c10=2e5, c01=1e4)
RUBBER_PIOLA = 2.0 * (1.5 - 1.0 / (1.5**3 * 1.1**2)) * (2e5 + 1e4 * 1.1**2)


def damage_of_uniform(sheet, damage, precision=64, **more):
    """The damage of all points after one step of a uniformly stretched sheet."""
    built = build(sheet, initial_displacement=uniform(sheet, F), damage=damage, precision=precision, **more)
    built.context.run("setup")
    built.state.step.assign(np.array([1e-9]))
    built.context.run("step")
    built.context.run("frame")
    return built.rupture.damage.numpy()


@pytest.mark.parametrize(
    ("sheet", "criterion", "exact", "more"),
    [
        (square, CriticalStress, PIOLA, {}),
        (jittered, CriticalStress, PIOLA, {"precision": 32}),
        (
            square,
            lambda limit: CriticalStress(limit, measure="cauchy"),
            1.5 * RUBBER_PIOLA,
            {"material": RUBBER, "weights": "corrected"},
        ),
        (square, CriticalEnergyDensity, float(energy_density(RUBBER, *STRETCHES)), {"material": RUBBER}),
        (
            jittered,
            CriticalEnergyDensity,
            float(energy_density(RUBBER, *STRETCHES)),
            {"material": RUBBER, "weights": "corrected", "precision": 32},
        ),
    ],
    ids=["stress", "stress of a cloud", "true stress", "energy density", "energy density of a cloud"],
)
def test_uniform_sheets_break_at_their_strength_everywhere(sheet, criterion, exact, more):
    for share, broken in ((1.001, 0.0), (0.999, 1.0)):
        assert damage_of_uniform(sheet(7), criterion(share * exact), **more) == pytest.approx(broken, abs=1e-6)


def test_of_a_sheet_of_several_stiffnesses_the_stiff_part_breaks():
    sheet = square(11, thickness=np.linspace(1e-3, 3e-3, 121))
    stiff = np.arange(sheet.size) % 11 > 5
    sheet = sheet.stiffened(np.flatnonzero(stiff), 2.0)
    density = float(energy_density(RUBBER, *STRETCHES))
    damage = damage_of_uniform(sheet, CriticalEnergyDensity(1.7 * density), material=RUBBER)
    assert (damage[stiff] > 0.0).all()
    # Bonds from stiff to soft have half of both, 1.5 times the density.
    far = np.arange(sheet.size) % 11 < 3
    assert (damage[far] == 0.0).all()


def test_a_strip_in_equilibrium_breaks_at_its_strength():
    """In uniaxial tension to 1.6: the load of the last frame before the break is below the strength, the next above."""
    sheet, steps = square(9), 12
    stretches = 1.0 + 0.6 * np.arange(1, steps + 1) / steps
    nominal = 2.0 * (stretches - stretches**-2) * (2e5 + 1e4 / stretches)
    limit = 0.5 * (nominal[7] + nominal[8])
    sides = [Fixed(sheet.edges("left"), "xz"), Fixed(sheet.edges("bottom"), "yz")]
    pull = Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, 0.06])
    simulation = Simulation(
        sheet, BondAssociated(RUBBER, weights="corrected"), Newton(load_steps=steps),
        loads=[*sides, pull, Fixed(range(sheet.size), "z")], damage=CriticalStress(limit),
    )  # fmt: skip
    history = simulation.run(device="cpu", precision=64).history
    damaged = [row["largest_damage"] > 0.0 for row in history]
    assert damaged.index(True) == 9


def test_plates_break_by_the_stress_of_the_sheet():
    """Bending has no part in the means."""
    for share, broken in ((1.001, 0.0), (0.999, 1.0)):
        damage = damage_of_uniform(square(7), CriticalStress(share * PIOLA), loads=[Plate(1e-6)])
        assert (damage == broken).all()


def test_frames_show_the_stress_of_their_own_displacement():
    sheet = square(7)
    built = build(sheet, initial_displacement=uniform(sheet, F), damage=CriticalStress(2.0 * PIOLA))
    built.context.run("setup")
    built.context.run("frame")
    assert built.context.fields["first_piola_1"].numpy() == pytest.approx(PIOLA, rel=1e-10)


def test_a_scene_may_show_what_its_criterion_reads():
    sheet = square(7)
    simulation = Simulation(
        sheet, BondAssociated(NEO), Explicit(1e-4, frames=1), damage=CriticalStress(2.0 * PIOLA),
        fields=("first_piola", "stretch"), initial_displacement=uniform(sheet, F),
    )  # fmt: skip
    frame = simulation.run(device="cpu", precision=64).frame
    assert {"first_piola_1", "first_piola_2", "stretch_1"} <= set(frame.point_data)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: CriticalStress(0.0), "CriticalStress.principal = 0.0"),
        (lambda: CriticalStress(float("nan")), "CriticalStress.principal = nan"),
        (lambda: CriticalStress([1e5, 2e5]), "CriticalStress.principal"),
        (lambda: CriticalStress(1e5, measure="piola"), "CriticalStress.measure = 'piola'"),
        (lambda: CriticalEnergyDensity(-1.0), "CriticalEnergyDensity.density = -1.0"),
    ],
)
def test_limits_that_are_none_are_refused(make, message):
    with refused(match=message):
        make()


@pytest.mark.parametrize(
    ("damage", "field"), [(CriticalStress(1e5), "first_piola_1"), (CriticalEnergyDensity(1e5), "strain_energy_density")]
)
def test_a_law_without_the_field_is_refused(damage, field):
    with refused(match=f"expected a law with the field {field}"):
        Simulation(square(7), BondBased(Bimodular(3.0 * MU)), Explicit(1.0), damage=damage).build("cpu")


@pytest.mark.parametrize("horizon", [2.015, 3.15])
def test_free_edges_and_grips_break_at_the_strength_with_the_weights_of_the_law(horizon):
    """A strip with free sides, held by spared grips; plain weights would break it too early, or not at all."""
    sheet, stretch = Sheet.rectangle(0.1, 0.05, thickness=1e-3, density=1000.0, points=(21, 11)), 1.2
    grips = sheet.edges("left", "right")
    nominal = 2.0 * (stretch - stretch**-2) * (2e5 + 1e4 / stretch)
    for share, breaks in ((1.002, False), (0.998, True)):
        pull = Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, (stretch - 1.0) * 0.1])
        loads = [Fixed(sheet.edges("left"), "x"), Fixed([0], "y"), Fixed(range(sheet.size), "z"), pull]
        simulation = Simulation(
            sheet, BondAssociated(RUBBER, horizon=horizon), Newton(load_steps=2), loads=loads,
            damage=CriticalStress(share * nominal, spared=grips),
        )  # fmt: skip
        history = simulation.run(device="cpu", precision=64).history
        assert [row["largest_damage"] > 0.0 for row in history] == [False, False, breaks]
