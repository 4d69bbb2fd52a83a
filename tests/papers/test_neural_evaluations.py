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

from warp_pd import ArrudaBoyce, CriticalStretch, InputError, MooneyRivlin, Neural, Nodal, Ogden, Yeoh
from warp_pd.papers import force_law
from warp_pd.papers.neural import networks

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


def mooney_rivlin_stress(gradient):
    """First Piola stress 3x2 over c10 of an incompressible sheet, c01 = c10 / 4, from its energy."""
    F = np.asarray(gradient)
    C = F.T @ F
    C33 = 1.0 / np.linalg.det(C)
    inverse = np.linalg.inv(C)
    # I1 = tr C + C33, I2 = det C + C33 tr C, and C33 follows C.
    first = np.eye(2) - C33 * inverse
    second = inverse / C33 + C33 * (np.eye(2) - np.trace(C) * inverse)
    return F @ (2.0 * first + 0.5 * second)


OTHERS = [MooneyRivlin(1e3, 250.0), Yeoh(500.0, 20.0), Ogden((1e3, -20.0), (2.0, -2.0)), ArrudaBoyce(1e3, 4.0)]


def test_the_closed_form_takes_the_stress_of_any_material():
    """NN: "any constitutive law". Without C33 as a function of its own, the bond's stretch tensor gives it."""
    sheet, F = square(17), random_gradient(0)
    stress = mooney_rivlin_stress(F) * OTHERS[0].c10 * sheet.thickness
    built = build(sheet, Neural(OTHERS[0], 2.015, evaluation="closed_form"))
    internal_force(built, uniform(sheet, F))
    assert np.abs(force_across(built, horizontal=False) - stress[:, 0]).max() < 1e-11 * np.abs(stress).max()
    assert np.abs(force_across(built, horizontal=True) - stress[:, 1]).max() < 1e-11 * np.abs(stress).max()


@pytest.mark.parametrize("material", OTHERS, ids=lambda material: type(material).__name__)
def test_a_users_module_runs_whatever_the_material(material):
    """Forces of a network are in units of the shear modulus, where a material has no mu."""
    sheet = square(9)
    module = lambda features: 0.5 * features[:, :2] - features.new_tensor([[0.5, 0.0]])  # noqa: E731
    forces = [internal_force(build(sheet, Neural(m, 2.015, network=module)), rough(sheet)) for m in (NEO, material)]
    ratio = networks.unit_of_stress(material) / NEO.mu
    assert np.abs(forces[1] - ratio * forces[0]).max() < 1e-12 * np.abs(forces[1]).max()


@pytest.mark.parametrize(("sheet", "precision"), [(square(11), 64), (jittered(11), 32)], ids=["lattice", "cloud"])
def test_a_users_module_with_the_closed_form_gives_the_closed_form(sheet, precision):
    u = rough(sheet)
    exact = internal_force(build(sheet, Neural(NEO, evaluation="closed_form"), precision), u)
    hooked = internal_force(build(sheet, Neural(NEO, network=exact_module()), precision), u)
    assert np.abs(exact - hooked).max() < (1e-13 if precision == 64 else 3e-6) * np.abs(exact).max()


def test_a_plain_network_with_the_papers_inputs_runs_from_its_file(tmp_path):
    """Weights as any tool writes them, with the scaling of MATLAB's mapminmax."""
    random = np.random.default_rng(0)
    arrays = {
        "w0": random.normal(size=(5, 4)), "b0": random.normal(size=(5, 1)),
        "w1": random.normal(size=(2, 5)), "b1": random.normal(size=2),
        "input_mean": [2.4, 0.0, 0.5, 8.0], "input_scale": [1.6, 0.5, 0.5, 7.5], "output_mean": [1.0, 0.0],
        "output_scale": [2.0, 0.3],
    }  # fmt: skip
    np.savez(tmp_path / "law.npz", **arrays)

    def same(features):
        x = (features.numpy() - arrays["input_mean"]) / arrays["input_scale"]
        hidden = np.tanh(x @ arrays["w0"].T + arrays["b0"].ravel())
        out = hidden @ arrays["w1"].T + arrays["b1"]
        return features.new_tensor(out * arrays["output_scale"] + arrays["output_mean"])

    sheet = square(9)
    laws = Neural(NEO, 2.015, network=same), force_law(str(tmp_path / "law.npz"), NEO, 2.015)
    found = [internal_force(build(sheet, law), rough(sheet)) for law in laws]
    assert np.abs(found[0] - found[1]).max() < 1e-12 * np.abs(found[0]).max()
    with pytest.raises(InputError, match="expected evaluation 'torch'"):
        Neural(NEO, evaluation="fused", network=tmp_path / "law.npz")
    np.savez(tmp_path / "wide.npz", **{**arrays, "w0": random.normal(size=(5, 3))})
    with pytest.raises(InputError, match="layer"):
        Neural(NEO, network=tmp_path / "wide.npz")


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
