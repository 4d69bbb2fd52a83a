"""Sheets of two stiffnesses: the bond between them, against the exact laminate."""

import numpy as np
import pytest
from helpers import GENT, NEO, array, build, exact_stress, internal_force, rough, square, strain_energy, uniform
from scipy.optimize import brentq

from warp_pd import (
    Bimodular,
    BondAssociated,
    BondBased,
    BondNeoHookean,
    CriticalStretch,
    Explicit,
    Fixed,
    HyperelasticBonds,
    InputError,
    Motion,
    Neural,
    Newton,
    Nodal,
    Simulation,
    ViscoBondBased,
    Yeoh,
)
from warp_pd.measures import support_force

FACTOR = 4.0


def laminate(points, axis="x"):
    """Soft and stiff halves."""
    sheet = square(points)
    half = sheet.where((lambda x, y: x > 0.05) if axis == "x" else (lambda x, y: y > 0.05))
    return sheet.stiffened(half, FACTOR)


def rested(sheet, pull, weights):
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
    """Points in even number: the interface lies halfway between two rows."""
    pull = 0.05

    def misfit(soft):
        return traction(soft, 1.0) - traction(2.0 * (1.0 + pull / 0.1) - soft, FACTOR)

    wanted = traction(brentq(misfit, 1.001, 1.99), 1.0) * 0.1 * 1e-3
    errors = [abs(rested(laminate(n), pull, weights)[1] / wanted - 1.0) for n in (12, 24, 48)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < {"plain": 0.0015, "corrected": 0.006}[weights], errors
    assert orders.min() > 0.95, (errors, orders)


def test_a_laminate_in_parallel_carries_the_exact_force():
    """Held evenly across, it stretches evenly: the stress is exact inside each half, the sum up to the edges."""
    sheet = laminate(24, axis="y")
    u = uniform(sheet, [[1.5, 0.0], [0.0, 1.0], [0.0, 0.0]])
    built = build(sheet, weights="corrected")
    force = internal_force(built, u)
    right = sheet.points[:, 0] > 0.05
    wanted = 0.05 * 1e-3 * (traction(1.5, 1.0) + traction(1.5, FACTOR))
    assert -force[right, 0].sum() == pytest.approx(wanted, rel=1e-6)


LAWS = {
    "bond_associated": BondAssociated(NEO, horizon=2.015, weights="plain"),
    "corrected": BondAssociated(GENT, horizon=2.015, weights="corrected", fast=False),
    "bond_based": BondBased(Bimodular(1e4, 3e3)),
    "hyperelastic": HyperelasticBonds(BondNeoHookean(1e3, "uniaxial", "refitted")),
}


def built_with(law, sheet, precision=64, **parts):
    built = Simulation(sheet, force=law, solver=Explicit(1.0), **parts).build("cpu", precision)
    built.context.compile()
    return built


@pytest.mark.parametrize("cloud", [False, True])
@pytest.mark.parametrize("name", LAWS)
def test_momentum_is_conserved_across_the_interface(name, cloud):
    sheet = laminate(12)
    force = internal_force(built_with(LAWS[name], sheet.as_cloud() if cloud else sheet), rough(sheet))
    assert np.abs(force.sum(axis=0)).max() < 1e-12 * np.abs(force).sum()


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
    plain = internal_force(built_with(LAWS[name], sheet), u)
    mixed = internal_force(built_with(LAWS[name], laminate(16)), u)
    reach = 2 * 3.1 * sheet.spacing
    soft, stiff = sheet.points[:, 0] < 0.05 - reach, sheet.points[:, 0] > 0.05 + reach
    assert soft.any() and stiff.any()
    assert np.allclose(mixed[soft], plain[soft], rtol=0.0, atol=1e-12 * np.abs(plain).max())
    assert np.allclose(mixed[stiff], FACTOR * plain[stiff], rtol=0.0, atol=1e-11 * np.abs(plain).max())


def test_a_bond_between_two_materials_has_the_mean_of_their_forces():
    """One soft point alone, far from the edges: all of its bonds are between the two, half soft and half stiff."""
    sheet = square(16)
    u = rough(sheet)
    point = sheet.nearest(0.05, 0.05)
    one = sheet.stiffened(np.delete(np.arange(sheet.size), point), FACTOR)
    soft, found = (internal_force(built_with(LAWS["bond_based"], s), u)[point] for s in (sheet, one))
    assert found == pytest.approx(0.5 * (1.0 + FACTOR) * soft, rel=1e-10)


@pytest.mark.parametrize("name", LAWS)
def test_lattice_cloud_and_single_precision_agree(name):
    sheet = laminate(12)
    u = rough(sheet)
    # Corrected weights of a cloud are not those of a lattice.
    one = internal_force(built_with(LAWS[name], sheet), u)
    if name != "corrected":
        two = internal_force(built_with(LAWS[name], sheet.as_cloud()), u)
        assert np.abs(one - two).max() < 1e-12 * np.abs(one).max()
    three = internal_force(built_with(LAWS[name], sheet, 32), u)
    assert np.abs(one - three).max() < 3e-6 * np.abs(one).max()


def test_the_fast_kernels_know_both_materials():
    sheet = laminate(24)
    u = rough(sheet)
    fast, plain = (
        internal_force(build(sheet, weights="plain", horizon=3.015, law={"fast": fast}), u) for fast in (True, False)
    )
    assert np.abs(fast - plain).max() < 1e-12 * np.abs(plain).max()


@pytest.mark.parametrize("name", LAWS)
def test_a_second_material_adds_no_array_and_no_launch(name):
    """It lies in the weights: on a lattice more rows of the table, and nothing else."""
    plans = []
    for sheet in (square(12), laminate(12)):
        w = built_with(LAWS[name], sheet).context
        launches = {stage: [x.name for x in part] for stage, part in w.stages.items()}
        plans.append(([(use.name, use.owner) for use in w.arrays], launches, w.module))
    assert plans[0] == plans[1]
    rows = [len(array(built_with(LAWS[name], s), "kind_area").numpy()) for s in (square(12), laminate(12))]
    assert rows[1] > rows[0]


def test_stiffness_goes_with_its_points():
    sheet = square(21).stiffened([0, 5], 2.0).stiffened([5], 3.0)
    assert sheet.stiffness[[0, 1, 5]].tolist() == [2.0, 1.0, 6.0]
    holed = sheet.hole((0.05, 0.05), 0.02)
    kept = [int(np.flatnonzero((sheet.points == p).all(axis=1))[0]) for p in holed.points]
    assert (holed.stiffness == sheet.stiffness[kept]).all()
    assert square(5).stiffness is None


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: square(9).stiffened([0], 0.0), "factor = 0.0"),
        (lambda: square(9).stiffened([81], 2.0), "81"),
        (lambda: built_with(Nodal(NEO, horizon=2.015), laminate(12)), "sheet.stiffness"),
        (lambda: built_with(Neural(NEO, horizon=2.015, evaluation="closed_form"), laminate(12)), "sheet.stiffness"),
        (lambda: built_with(ViscoBondBased(Yeoh(1e3, 10.0)), laminate(12)), "sheet.stiffness"),
        (lambda: built_with(BondAssociated(NEO, weights="published"), laminate(12)), "sheet.stiffness"),
        (
            lambda: built_with(BondAssociated(NEO, broken="redistribute"), laminate(12), damage=CriticalStretch(2.0)),
            "sheet.stiffness",
        ),
    ],
)
def test_wrong_input_is_named(make, says):
    with pytest.raises(InputError, match=says):
        make()
