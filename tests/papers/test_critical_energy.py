"""Rupture by energy release rate: the work of a bond, the bonds that break by it, what it does not go with."""

import numpy as np
import pytest
from helpers import NEO, array, refused, square
from visco_laws import LAWS, POLYUREA, flight

from warp_pd import BondAssociated, CriticalEnergy, Explicit, Nodal, Relaxation, Simulation, ViscoBondBased
from warp_pd.papers.critical_energy import crossing_bonds


def test_the_energy_released_by_a_bond_is_its_work():
    """Elastic published law, equal stretches: G = V_i V_j / (h dx) integral t |X| ds of every inner bond."""
    law = ViscoBondBased(POLYUREA, horizon=3.015)
    result = flight(law, (1.0, 1.0), 1.0, steps=1000, damage=CriticalEnergy(1e12), points=13)
    built, sheet = result.built, result.built.simulation.sheet
    i, families = 84, built.law.families
    delta, volume = families.horizon, sheet.areas[i] * sheet.thickness
    length = np.linalg.norm(families.bonds, axis=1) * delta
    exists = families.rows_of_points(families.exists)[i]
    areas = families.rows_of_points(families.member_areas)[i] * families.reference_area
    w = (delta / length) ** 2
    m = (w * length**2 * areas)[exists].sum() * sheet.thickness
    stretch = np.linspace(1.0, 2.0, 10001)
    modulus = np.trapezoid((POLYUREA.c10 + 4.0 * POLYUREA.c20 * (stretch**2 - 1.0)) * stretch, stretch)
    expected = 4.0 / m * w * length**2 * modulus * volume**2 / (sheet.thickness * sheet.spacing)
    near = exists & (length < 1.01 * sheet.spacing)
    assert near.sum() == 4
    found = array(built, "energy_release").numpy()[:, i]
    np.testing.assert_allclose(found[near], expected[near], rtol=2e-3)


def test_bonds_break_at_the_critical_energy_on_both_sides():
    sheet = square(9)
    velocity = np.zeros((sheet.size, 3))
    velocity[:, 0] = 200.0 * (sheet.points[:, 0] - 0.05)
    solver = Explicit(2e-3, frames=8, safety=0.2)
    simulation = Simulation(
        sheet, LAWS["stress-free"], solver, initial_velocity=velocity, damage=CriticalEnergy(40.0)
    )  # fmt: skip
    result = simulation.run(device="cpu", precision=64)
    assert result.status == "finished"
    built = result.built
    bits, energy, families = built.law.intact.numpy(), array(built, "energy_release").numpy(), built.law.families
    exists = families.rows_of_points(families.exists).T
    intact = np.stack([(bits[k // 32] >> np.uint32(k % 32)) & 1 for k in range(families.members)]).astype(bool)
    critical = 40.0 / crossing_bonds(2.015)
    assert 0.05 < (exists & ~intact).sum() / exists.sum() < 0.95
    assert (energy[exists & ~intact] > critical).all()
    k, i = np.nonzero(exists)
    j, reverse = families.heads(i, k), families.reverse_members(i, k)
    np.testing.assert_array_equal(intact[k, i], intact[reverse, j])
    np.testing.assert_array_equal(energy[k, i], energy[reverse, j])


@pytest.mark.parametrize("law", [ViscoBondBased(POLYUREA, 2.015), Nodal(NEO, 2.015)])
def test_the_work_of_all_bonds_is_the_energy_of_the_sheet(law):
    """Of any law that stores the forces of families on their bonds."""
    result = flight(law, (1.0, 0.5), 0.2, steps=400, damage=CriticalEnergy(1e12))
    built, sheet = result.built, result.built.simulation.sheet
    work = array(built, "energy_release").numpy().sum() * sheet.thickness * sheet.spacing
    gained = result.history[-1]["strain"] - result.history[0]["strain"]
    assert gained > 0.0 and work == pytest.approx(gained, rel=5e-3)


def test_bonds_across_a_line():
    assert crossing_bonds(3.015) == 36
    assert crossing_bonds(1.1) == 2


def require_refused(said, law, solver):
    with refused(match=said):
        Simulation(square(7), law, solver, damage=CriticalEnergy(1.0)).build("cpu")


def test_parts_that_do_not_fit_critical_energy_are_refused():
    require_refused("^damage = CriticalEnergy .*expected .*fast = False", BondAssociated(POLYUREA), Explicit(1.0))
    law = ViscoBondBased(POLYUREA, horizon=2.015)
    require_refused("^damage = CriticalEnergy: .*Relaxation.*Explicit", law, Relaxation())
    with refused("CriticalEnergy.energy = 0.0: expected a positive number"):
        CriticalEnergy(0.0)
