"""Sheets of two stiffnesses: exact laminates, the bonds across the interface, momentum and energy."""

import numpy as np
import pytest
from helpers import NEO, build, exact_stress, internal_force, rough, square, strain_energy, uniform
from scipy.optimize import brentq
from two_material_cases import FACTOR, LAWS, built_with, laminate

from warp_pd import BondAssociated, Fixed, Motion, Newton, Simulation
from warp_pd.measures import support_force


def equilibrium(sheet, pull, weights):
    left, right = sheet.edges("left"), sheet.edges("right")
    simulation = Simulation(
        sheet,
        force=BondAssociated(NEO, horizon=2.015, weights=weights),
        loads=[
            Fixed(range(sheet.size), "yz"),
            Fixed(left, "x"),
            Motion(right, [0.0, 1.0], x=[0.0, pull]),
        ],
        solver=Newton(tolerance=1e-9),
    )
    result = simulation.run(device="cpu")
    assert result.status == "finished"
    return result, support_force(result.built, right)[0]


def traction(stretch, factor):
    return factor * exact_stress(NEO, [[stretch, 0.0], [0.0, 1.0], [0.0, 0.0]])[0, 0]


@pytest.mark.parametrize("weights", ["plain", "corrected"])
def test_a_laminate_in_series_converges_to_the_exact_force(weights):
    """With an even number of points, the interface lies halfway between two rows."""
    pull = 0.05

    def misfit(soft):
        return traction(soft, 1.0) - traction(2.0 * (1.0 + pull / 0.1) - soft, FACTOR)

    wanted = traction(brentq(misfit, 1.001, 1.99), 1.0) * 0.1 * 1e-3
    errors = [abs(equilibrium(laminate(n), pull, weights)[1] / wanted - 1.0) for n in (12, 24, 48)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < {"plain": 0.0015, "corrected": 0.006}[weights], errors
    assert orders.min() > 0.95, (errors, orders)


def test_a_laminate_in_parallel_carries_the_exact_force():
    """The stretch is uniform: the stress is exact inside each half, and so is the sum up to the edges."""
    sheet = laminate(24, axis="y")
    u = uniform(sheet, [[1.5, 0.0], [0.0, 1.0], [0.0, 0.0]])
    built = build(sheet, weights="corrected")
    force = internal_force(built, u)
    right = sheet.points[:, 0] > 0.05
    wanted = 0.05 * 1e-3 * (traction(1.5, 1.0) + traction(1.5, FACTOR))
    assert -force[right, 0].sum() == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("name", ["bond_associated", "corrected", "bond_based"])
def test_the_force_is_minus_the_gradient_of_the_energy(name):
    sheet = laminate(10)
    built = built_with(LAWS[name], sheet)
    u = rough(sheet)
    force = internal_force(built, u)
    direction = np.random.default_rng(1).normal(size=u.shape)
    h = 1e-6 * sheet.spacing
    slope = (strain_energy(built, u + h * direction) - strain_energy(built, u - h * direction)) / (2.0 * h)
    assert -(force * direction).sum() == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("name", LAWS)
def test_far_from_the_interface_the_force_is_that_of_each_material(name):
    sheet = square(16)
    u = rough(sheet)
    soft_sheet = internal_force(built_with(LAWS[name], sheet), u)
    mixed = internal_force(built_with(LAWS[name], laminate(16)), u)
    reach = 2 * 3.1 * sheet.spacing
    soft, stiff = sheet.points[:, 0] < 0.05 - reach, sheet.points[:, 0] > 0.05 + reach
    assert soft.any() and stiff.any()
    assert np.allclose(mixed[soft], soft_sheet[soft], rtol=0.0, atol=1e-12 * np.abs(soft_sheet).max())
    assert np.allclose(mixed[stiff], FACTOR * soft_sheet[stiff], rtol=0.0, atol=1e-11 * np.abs(soft_sheet).max())


def test_a_bond_between_two_materials_has_the_mean_of_their_forces():
    """A single soft point far from the edges: each of its bonds is half soft and half stiff."""
    sheet = square(16)
    u = rough(sheet)
    point = sheet.nearest(0.05, 0.05)
    one = sheet.stiffened(np.delete(np.arange(sheet.size), point), FACTOR)
    soft, found = (internal_force(built_with(LAWS["bond_based"], s), u)[point] for s in (sheet, one))
    assert found == pytest.approx(0.5 * (1.0 + FACTOR) * soft, rel=1e-10)


@pytest.mark.parametrize("name", LAWS)
def test_momentum_is_conserved_and_lattice_cloud_and_single_precision_agree(name):
    sheet = laminate(12)
    u = rough(sheet)
    lattice = internal_force(built_with(LAWS[name], sheet), u)
    assert np.abs(lattice.sum(axis=0)).max() < 1e-12 * np.abs(lattice).sum()
    # The corrected weights of a cloud differ from those of a lattice.
    if name != "corrected":
        cloud = internal_force(built_with(LAWS[name], sheet.as_cloud()), u)
        assert np.abs(lattice - cloud).max() < 1e-12 * np.abs(lattice).max()
    single = internal_force(built_with(LAWS[name], sheet, 32), u)
    assert np.abs(lattice - single).max() < 3e-6 * np.abs(lattice).max()


def test_the_fast_kernels_know_both_materials():
    sheet = laminate(24)
    u = rough(sheet)
    fast, reference = (build(sheet, weights="plain", horizon=3.015, law={"fast": chosen}) for chosen in (True, False))
    assert (fast.law.force_path, reference.law.force_path) == ("rows", "reference")
    expected = internal_force(reference, u)
    assert np.abs(internal_force(fast, u) - expected).max() < 1e-12 * np.abs(expected).max()
