"""Bond-based law: constants of plane stress and of a bar, force, energy and momentum."""

import numpy as np
import pytest
from bond_based_cases import CRACK, LAWS, SHEETS, E, built
from helpers import array, internal_force, rough, sever, square, strain_energy, uniform

from warp_pd import BodyForce, BondBased, CriticalStretch, Fixed, Newton, Sheet, Simulation

# Constants ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sheet", SHEETS)
@pytest.mark.parametrize(("horizon", "points"), [(1.5, 11), (3.0, 15)], ids=["1.5", "3.0"])
def test_isotropic_strain_has_the_energy_and_stress_of_plane_stress_at_every_point(sheet, horizon, points):
    sheet, strain = SHEETS[sheet](points), 1e-6
    part = built(sheet, horizon=horizon, fields=("principal_stress", "wrinkle_level"))
    strain_energy(part, uniform(sheet, (1.0 + strain) * np.eye(3)[:, :2]))
    density = part.law.strain_energy.numpy() / (sheet.areas * sheet.thickness)
    assert density == pytest.approx(E * strain**2 / (1.0 - 1.0 / 3.0), rel=1e-5)
    if sheet.lattice is not None:
        largest, smallest, _ = array(part, "principal_stress").numpy().T
        inside = np.linalg.norm(sheet.points - 0.05, ord=np.inf, axis=1) < 0.05 - 2.2 * horizon * sheet.spacing
        assert inside.any()
        exact = E * strain / (1.0 - 1.0 / 3.0)
        assert largest[inside] == pytest.approx(exact, rel=1e-5) and smallest[inside] == pytest.approx(exact, rel=1e-5)
    assert (array(part, "wrinkle_level").numpy() == 0.0).all()


# Energy inside a lattice over that of plane stress with Poisson's ratio 1/3: the discrete family is not round.
UNIAXIAL = {1.0: 5.0 / 3.0, 1.5: 0.8856, 2.015: 1.2395, 3.0: 1.0229, 4.0: 1.0248}


@pytest.mark.parametrize("horizon", UNIAXIAL)
def test_uniaxial_strain_has_the_energy_of_the_lattice(horizon):
    sheet, strain = square(25), 1e-6
    part = built(sheet, horizon=horizon, fields=("principal_stress",))
    strain_energy(part, uniform(sheet, [[1.0 + strain, 0.0], [0.0, 1.0 - strain / 3.0], [0.0, 0.0]]))
    middle = sheet.nearest(0.05, 0.05)
    density = part.law.strain_energy.numpy()[middle] / (sheet.areas[middle] * sheet.thickness)
    assert density == pytest.approx(UNIAXIAL[horizon] * 0.5 * E * strain**2, rel=1e-3)
    # Stresses that do this work, with the sum that all lattices share in this strain.
    across = 0.75 * (1.0 - UNIAXIAL[horizon]) * E * strain
    stresses = sorted((E * strain - across, across), reverse=True)
    assert array(part, "principal_stress").numpy()[middle, :2] == pytest.approx(stresses, abs=1e-3 * E * strain)


def test_a_uniformly_strained_bar_is_in_equilibrium_inside_and_carries_its_force():
    sheet = Sheet.line(1.0, 1e-4, density=1000.0, points=30)
    part = built(sheet, state="line")
    force = internal_force(part, np.outer(sheet.points[:, 0], [1e-6, 0.0, 0.0]))
    assert np.abs(force[6:-6]).max() < 1e-10 * E * 1e-4 * 1e-6
    assert force[:6, 0].sum() == pytest.approx(E * 1e-4 * 1e-6, rel=1e-5)


# Force --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("sheet", "material", "broken"), [(s, m, m == "bimodular") for s in SHEETS for m in LAWS])
def test_the_force_is_minus_the_gradient_of_the_energy(sheet, material, broken):
    sheet = SHEETS[sheet](11)
    part = built(sheet, LAWS[material], damage=CriticalStretch(9.0) if broken else None)
    if broken:
        sever(part, CRACK)
    u = rough(sheet)
    force = internal_force(part, u)
    direction = np.random.default_rng(2).normal(size=u.shape) * sheet.spacing
    step = 1e-6
    difference = (strain_energy(part, u + step * direction) - strain_energy(part, u - step * direction)) / (2.0 * step)
    assert -(force * direction).sum() == pytest.approx(difference, rel=1e-6)
    scale = np.abs(force).sum()
    assert np.abs(force.sum(axis=0)).max() < 1e-14 * scale
    position = np.column_stack([sheet.points, np.zeros(sheet.size)]) + u
    assert np.abs(np.cross(position, force).sum(axis=0)).max() < 1e-14 * scale


def test_lattice_and_cloud_agree_and_the_frame_does_not_matter():
    sheet = square(11)
    u = rough(sheet)
    force = internal_force(built(sheet, LAWS["bimodular"]), u)
    as_cloud = internal_force(built(sheet.as_cloud(), LAWS["bimodular"]), u)
    assert as_cloud == pytest.approx(force, abs=1e-13 * np.abs(force).max())
    rotation, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    place = np.column_stack([sheet.points, np.zeros(sheet.size)])
    turned = internal_force(built(sheet, LAWS["bimodular"]), (place + u) @ rotation.T - place)
    assert turned == pytest.approx(force @ rotation.T, abs=1e-12 * np.abs(force).max())


def test_float32_keeps_the_digits_of_small_strains():
    sheet = square(11)
    u = 1e-5 * rough(sheet)
    double = internal_force(built(sheet, LAWS["bimodular"]), u)
    single = internal_force(built(sheet, LAWS["bimodular"], precision=32), u)
    assert single == pytest.approx(double, abs=2e-5 * np.abs(double).max())


def test_gravity_on_a_float32_bar():
    sheet = Sheet.line(1.0, 1e-4, density=1000.0, points=30)
    loads = [Fixed([0]), Fixed(range(30), "yz"), BodyForce((-9.81e3, 0.0, 0.0))]
    ends = []
    for precision in (32, 64):
        result = Simulation(sheet, BondBased(LAWS["equal"], state="line"), Newton(), loads=loads).run(
            device="cpu", precision=precision
        )
        assert result.status == "finished"
        ends.append(result.frame.displacement)
    assert ends[0] == pytest.approx(ends[1], abs=1e-4 * np.abs(ends[1]).max())
