"""Nodal, neural and closed-form laws: one physics in several evaluations, zero-energy modes, wrong input."""

import itertools

import numpy as np
import pytest
from helpers import (
    GENT,
    NEO,
    array,
    exact_stress,
    internal_force,
    jittered,
    random_gradient,
    rough,
    sever,
    square,
    strain_energy,
    uniform,
)
from test_bond_associated import force_across

from warp_pd import BondAssociated, CriticalStretch, Explicit, InputError, Neural, Newton, Nodal, Simulation
from warp_pd.forces import network as networks
from warp_pd.forces.network import Network
from warp_pd.forces.training import relative_errors, sampled_states, training_data

RANGE = (0.8, 4.0)


def build(sheet, law, precision=64, device="cpu", solver=None, **parts):
    built = Simulation(sheet, force=law, solver=solver or Explicit(1.0), **parts).build(device, precision)
    built.workspace.compile()
    return built


def tiny(seed=0, hidden=(5, 7), **changes):
    """A network with random weights, force-free at rest."""
    from warp_pd.forces.training import at_rest

    rng = np.random.default_rng(seed)
    sizes = [4, *hidden, 2]
    values = {
        "weights": tuple(rng.normal(size=(b, a)) / a for a, b in itertools.pairwise(sizes)),
        "biases": tuple(0.3 * rng.normal(size=b) for b in sizes[1:]),
        "input_mean": np.array([0.1, 0.02, 0.3, 0.0]),
        "input_scale": np.array([0.5, 0.2, 1.1, 1.0]),
        "output_scale": np.array([1.5, 0.7]),
        "material": "NeoHookean",
        "ratios": {"bulk/mu": 100.0},
        "stretches": RANGE,
    }
    return at_rest(Network(**(values | changes)))


def exact_module():
    """The closed form of the neo-Hookean law as a user's own module, from the formula of the paper's quantities."""
    import torch

    class Exact(torch.nn.Module):
        def forward(self, features):
            stretch, angle, c33, det = features.unbind(1)
            a, b = stretch * angle.cos(), stretch * angle.sin()
            g = (c33 * det**2) ** (-1.0 / 3.0)
            along, across = g * (a - c33 * (1.0 + b * b / det) / a), g * b * (1.0 + c33 / det)
            return torch.stack(
                [along * angle.cos() + across * angle.sin(), across * angle.cos() - along * angle.sin()], 1
            )

    return Exact()


LAWS = {
    "nodal": lambda: Nodal(NEO),
    "closed form": lambda: Neural(NEO, evaluation="closed_form"),
    "closed form, Gent": lambda: Neural(GENT, evaluation="closed_form"),
    "neural": lambda: Neural(NEO),
    "neural, tiny": lambda: Neural(NEO, network=tiny()),
    "neural, fused": lambda: Neural(NEO, evaluation="fused", network=tiny()),
}


# One map in several evaluations ---------------------------------------------------------------------------


@pytest.mark.parametrize("material", [NEO, GENT], ids=["neo-Hookean", "Gent"])
def test_the_closed_form_is_the_law_of_the_training_data(material):
    """Bulk stress of uniform deformation: exactly that of the material, in any frame."""
    sheet = square(27)
    for seed in range(3):
        F = random_gradient(seed)
        stress = exact_stress(material, F) * sheet.thickness
        for law in (Nodal(material), Neural(material, evaluation="closed_form")):
            built = build(sheet, law)
            internal_force(built, uniform(sheet, F))
            scale = np.abs(stress).max()
            assert np.abs(force_across(built, horizontal=False) - stress[:, 0]).max() < 1e-11 * scale
            assert np.abs(force_across(built, horizontal=True) - stress[:, 1]).max() < 1e-11 * scale


@pytest.mark.parametrize("material", [NEO, GENT], ids=["neo-Hookean", "Gent"])
def test_training_data_are_first_piola_stress_on_the_bond(material):
    states = sampled_states(RANGE, 40, seed=1)
    data = training_data(material, states)
    for (first, second, angle), features, force in zip(states, data.features, data.forces, strict=True):
        U = np.diag([first, second])
        x = np.array([np.cos(angle), np.sin(angle)])
        y = U @ x
        T = exact_stress(material, U) @ x / material.mu
        along = y / np.linalg.norm(y)
        assert force == pytest.approx([T @ along, T @ [-along[1], along[0]]], abs=1e-10)
        turn = np.arcsin((x[0] * y[1] - x[1] * y[0]) / np.linalg.norm(y))
        assert features[[0, 1, 3]] == pytest.approx([np.linalg.norm(y), turn, first * second], abs=1e-13)


@pytest.mark.parametrize("precision", [32, 64])
@pytest.mark.parametrize("sheet", [square(11), jittered(11)], ids=["lattice", "cloud"])
def test_a_users_module_with_the_closed_form_gives_the_closed_form(sheet, precision):
    u = rough(sheet)
    exact = internal_force(build(sheet, Neural(NEO, evaluation="closed_form"), precision), u)
    hooked = internal_force(build(sheet, Neural(NEO, network=exact_module()), precision), u)
    assert np.abs(exact - hooked).max() < (1e-13 if precision == 64 else 3e-6) * np.abs(exact).max()


@pytest.mark.parametrize("precision", [32, 64])
@pytest.mark.parametrize("breakable", [False, True])
@pytest.mark.parametrize("sheet", [square(11), jittered(11)], ids=["lattice", "cloud"])
def test_fused_and_torch_agree(sheet, precision, breakable):
    forces = []
    for evaluation in ("torch", "fused"):
        law = Neural(NEO, evaluation=evaluation, network=tiny())
        built = build(sheet, law, precision, damage=CriticalStretch(9.0) if breakable else None)
        if breakable:
            sever(built, ((0.02, 0.048), (0.07, 0.062)))
        forces.append(internal_force(built, rough(sheet)))
    assert np.isfinite(forces[0]).all()
    difference = np.abs(forces[0] - forces[1]).max()
    assert difference < (1e-12 if precision == 64 else 2e-5) * np.abs(forces[0]).max()


def test_torch_evaluates_what_numpy_does():
    sheet = square(9)
    network = tiny()
    built = build(sheet, Neural(NEO, network=network))
    internal_force(built, rough(sheet))
    features, pairs = array(built, "features").numpy(), array(built, "bond_pairs").numpy()
    assert pairs == pytest.approx(network.evaluate(features), abs=1e-12)
    assert np.ptp(features, axis=0).min() > 1e-3


# Physics ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("precision", [32, 64])
@pytest.mark.parametrize("law", LAWS)
def test_rigid_motion_gives_no_force_and_momentum_is_conserved(law, precision):
    sheet = square(11)
    built = build(sheet, LAWS[law](), precision)
    rotation, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))
    tolerance = 1e-12 if precision == 64 else 1e-4
    strained = np.abs(internal_force(built, uniform(sheet, 1.1 * rotation[:, :2]))).max()
    moved = uniform(sheet, rotation[:, :2]) + [0.3, -0.2, 0.5]
    assert np.abs(internal_force(built, moved)).max() < 10 * tolerance * strained
    force = internal_force(built, rough(sheet))
    assert np.abs(force.sum(axis=0)).max() < tolerance * np.abs(force).max()


@pytest.mark.parametrize("law", LAWS)
def test_forces_turn_with_the_sheet(law):
    sheet = square(11)
    built = build(sheet, LAWS[law]())
    rotation, _ = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))
    flat = np.column_stack([sheet.points, np.zeros(sheet.size)])
    displacement = rough(sheet)
    turned = (flat + displacement) @ rotation.T - flat
    force = internal_force(built, displacement)
    assert internal_force(built, turned) == pytest.approx(force @ rotation.T, abs=1e-10 * np.abs(force).max())


def broken(sheet, law):
    built = build(sheet, law, damage=CriticalStretch(9.0))
    sever(built, ((0.02, 0.048), (0.07, 0.062)))
    alive = built.force.alive.numpy()
    rng = np.random.default_rng(2)
    keep = built.force.families.rows_of_points(built.force.families.exists)
    for i in (30, 31, 44):
        for k in np.flatnonzero(((rng.random(keep.shape[1]) < 0.8) | (i == 44)) & keep[i]):
            j, back = i + built.force.families.shift[k], built.force.families.mates[k]
            alive[k // 32, i] &= ~np.uint32(1 << (k % 32))
            alive[back // 32, j] &= ~np.uint32(1 << (back % 32))
    built.force.alive.assign(alive)
    return built


NODAL = {
    "lattice": lambda: build(square(9), Nodal(NEO)),
    "Gent, short horizon": lambda: build(square(9), Nodal(GENT, horizon=1.5)),
    "cloud": lambda: build(jittered(9), Nodal(NEO)),
    "cut": lambda: build(square(9).cut((-0.01, 0.045), (0.045, 0.045)), Nodal(NEO)),
    "broken": lambda: broken(square(11), Nodal(NEO)),
}


@pytest.mark.parametrize("case", NODAL)
def test_the_nodal_force_is_minus_the_gradient_of_its_energy(case):
    built = NODAL[case]()
    sheet = built.simulation.sheet
    displacement = rough(sheet)
    force = internal_force(built, displacement)
    rng = np.random.default_rng(3)
    for _ in range(3):
        direction = rng.normal(size=(sheet.size, 3)) * sheet.spacing
        up, down = (strain_energy(built, displacement + s * 1e-5 * direction) for s in (1.0, -1.0))
        assert (up - down) / 2e-5 == pytest.approx(
            -(force * direction).sum(), abs=2e-7 * np.abs(force * direction).sum()
        )


@pytest.mark.parametrize("law", LAWS)
def test_broken_families_stay_finite_and_conserve_momentum(law):
    built = broken(square(11), LAWS[law]())
    force = internal_force(built, rough(built.simulation.sheet))
    assert np.isfinite(force).all()
    assert np.abs(force[44]).max() == 0.0
    assert np.abs(force.sum(axis=0)).max() < 1e-12 * np.abs(force).max()


def test_a_bond_turned_over_is_pushed_back():
    """Past the pole of the closed form at 90 degrees the force stays finite, and works against the turn."""
    sheet = square(15)
    built = build(sheet, Neural(NEO, evaluation="closed_form"))
    middle = sheet.nearest(0.05, 0.05)
    largest = []
    for share in (0.9, 1.0, 1.1, 1.5):
        u = np.zeros((sheet.size, 3))
        u[middle, 0] = share * sheet.spacing
        force = internal_force(built, u)
        assert force[middle, 0] < 0.0
        largest.append(np.abs(force).max())
    assert np.isfinite(largest).all() and max(largest) < 1e3 * NEO.mu * sheet.thickness * sheet.spacing


# Zero-energy modes -------------------------------------------------------------------------------------------

RESISTING = {
    "closed form": lambda horizon: Neural(NEO, horizon=horizon, evaluation="closed_form"),
    "neural": lambda horizon: Neural(NEO, horizon=horizon),
    "bond-associated": lambda horizon: BondAssociated(NEO, horizon=horizon, weights="plain"),
}


def checkerboard(sheet, direction):
    """A checkerboard in the middle of a sheet, with margins of uniform deformation, [m]."""
    column, row = np.arange(sheet.size) % sheet.lattice.columns, np.arange(sheet.size) // sheet.lattice.columns
    board = np.zeros((sheet.size, 3))
    board[:, direction] = 0.02 * sheet.spacing * (-1.0) ** (column + row)
    return board


def resistance(law, sheet, mode, rows):
    """Work of the force against a mode, at the points `rows`, over E h times its squared size."""
    built = build(sheet, law)
    stretched = uniform(sheet, [[1.2, 0.0], [0.0, 1.2], [0.0, 0.0]])
    change = internal_force(built, stretched + mode) - internal_force(built, stretched)
    return -(change * mode)[rows].sum() / (3e3 * sheet.thickness * (mode[rows] ** 2).sum())


@pytest.mark.parametrize("direction", [0, 1, 2])
@pytest.mark.parametrize("horizon", [1.5, 2.015, 3.15])
def test_a_checkerboard_is_felt_by_all_laws_but_the_nodal_one(horizon, direction):
    sheet = square(21)
    inside = np.flatnonzero(np.abs(sheet.points - 0.05).max(axis=1) < 0.01)
    board = checkerboard(sheet, direction)
    assert abs(resistance(Nodal(NEO, horizon=horizon), sheet, board, inside)) < 1e-12
    for name, law in RESISTING.items():
        assert resistance(law(horizon), sheet, board, inside) > 0.1 / horizon**2, name


@pytest.mark.parametrize("direction", [0, 1, 2])
def test_a_family_does_not_feel_its_own_middle_only_in_the_nodal_law(direction):
    """The centre-point mode: what the family of a moved point does, not what its neighbours' families do."""
    sheet = square(21)
    middle = sheet.nearest(0.05, 0.05)
    stretched = uniform(sheet, [[1.2, 0.0], [0.0, 1.2], [0.0, 0.0]])
    moved = stretched.copy()
    moved[middle, direction] += 0.2 * sheet.spacing
    changes = {}
    for name, law in {"nodal": lambda horizon: Nodal(NEO, horizon=horizon), **RESISTING}.items():
        built = build(sheet, law(3.15))
        internal_force(built, stretched)
        before = built.to_numpy(array(built, "bond_force"))[:, middle]
        internal_force(built, moved)
        after = built.to_numpy(array(built, "bond_force"))[:, middle]
        changes[name] = (after - before).sum(axis=0)[direction] / np.linalg.norm(before, axis=1).max()
    assert abs(changes.pop("nodal")) < 1e-12
    # The sum of the family's pull on the moved point is against its move.
    assert all(change < -1e-2 for change in changes.values()), changes
