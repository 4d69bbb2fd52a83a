"""One map from bond to force in several evaluations: closed form, Torch, fused, a user's own module."""

import dataclasses

import numpy as np
import pytest
from helpers import (
    GENT,
    NEO,
    array,
    exact_stress,
    force_across,
    internal_force,
    jittered,
    random_gradient,
    rough,
    sever,
    square,
    uniform,
)
from point_laws import build, exact_module, tiny

from warp_pd import CriticalStretch, Neural, Nodal

CLOSED = [Nodal(NEO), Neural(NEO, evaluation="closed_form"), Neural(GENT, evaluation="closed_form")]


@pytest.mark.parametrize("law", CLOSED, ids=["nodal", "neo-Hookean", "Gent"])
def test_the_closed_form_is_the_law_of_the_training_data(law):
    """Bulk stress of uniform deformation: exactly that of the material, in any frame."""
    sheet = square(27)
    built = build(sheet, law)
    for seed in range(3):
        F = random_gradient(seed)
        stress = exact_stress(law.material, F) * sheet.thickness
        internal_force(built, uniform(sheet, F))
        scale = np.abs(stress).max()
        assert np.abs(force_across(built, horizontal=False) - stress[:, 0]).max() < 1e-11 * scale
        assert np.abs(force_across(built, horizontal=True) - stress[:, 1]).max() < 1e-11 * scale


@pytest.mark.parametrize(("sheet", "precision"), [(square(11), 64), (jittered(11), 32)], ids=["lattice", "cloud"])
def test_a_users_module_with_the_closed_form_gives_the_closed_form(sheet, precision):
    u = rough(sheet)
    exact = internal_force(build(sheet, Neural(NEO, evaluation="closed_form"), precision), u)
    hooked = internal_force(build(sheet, Neural(NEO, network=exact_module()), precision), u)
    assert np.abs(exact - hooked).max() < (1e-13 if precision == 64 else 3e-6) * np.abs(exact).max()


@pytest.mark.parametrize(
    ("sheet", "precision", "breakable"),
    [(square(11), 64, True), (square(11), 32, False), (jittered(11), 32, True)],
    ids=["torn lattice", "lattice", "torn cloud"],
)
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


def test_networks_of_any_shape_run_fused():
    sheet = square(9)
    forces = []
    for evaluation in ("torch", "fused"):
        built = build(sheet, Neural(NEO, evaluation=evaluation, network=tiny(hidden=(4, 4, 3))))
        forces.append(internal_force(built, rough(sheet)))
    assert np.abs(forces[0]).max() > 0.0
    assert np.abs(forces[0] - forces[1]).max() < 1e-12 * np.abs(forces[0]).max()


def test_torch_evaluates_what_numpy_does():
    sheet = square(9)
    network = tiny()
    built = build(sheet, Neural(NEO, network=network))
    internal_force(built, rough(sheet))
    features, pairs = array(built, "features").numpy(), array(built, "bond_pairs").numpy()
    assert pairs == pytest.approx(network.evaluate(features), abs=1e-12)
    assert np.ptp(features, axis=0).min() > 1e-3


def test_a_material_scaled_in_mu_may_use_the_same_network():
    stiff = dataclasses.replace(NEO, mu=5.0 * NEO.mu, bulk=5.0 * NEO.bulk)
    sheet = square(9)
    soft = internal_force(build(sheet, Neural(NEO, network=tiny())), rough(sheet))
    hard = internal_force(build(sheet, Neural(stiff, network=tiny())), rough(sheet))
    assert hard == pytest.approx(5.0 * soft, abs=1e-12 * np.abs(hard).max())
