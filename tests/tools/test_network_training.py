"""Training of the network of the neural law, and the network that comes with the package."""

import argparse

import numpy as np
import pytest
from helpers import GENT, NEO, exact_stress
from network_training import Training, determination, relative_errors, sampled_states, train, training_data
from point_laws import RANGE
from train_neural_law import material_named

from warp_pd import InputError, Neural, Yeoh
from warp_pd.papers.neural import networks


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


def test_the_default_network_is_as_good_as_promised():
    """R^2 >= 0.9999 and at most 1 % relative error (of the force, or 0.1 mu) on states training never saw."""
    network = networks.default()
    data = training_data(NEO, sampled_states(RANGE, 20_000, seed=99))
    found = network.evaluate(data.features)
    assert min(determination(found, data.forces)) >= 0.9999
    assert relative_errors(found, data.forces).max() <= 0.01
    assert network.evaluate(np.array([[1.0, 0.0, 1.0, 1.0]])) == pytest.approx(np.zeros((1, 2)), abs=1e-14)


def test_training_finds_the_law_and_repeats_itself(tmp_path):
    seen = []
    how = Training(samples=400, hidden=(6,), steps=25, seed=3, stretches=(0.9, 2.0))
    network, parts = train(NEO, how, lambda *now: seen.append(now))
    assert [len(parts[name].states) for name in ("training", "validation", "test")] == [280, 60, 60]
    assert network.report["largest_relative_error"] < 0.1
    assert seen[-1][2] < 0.1 * seen[0][2]
    again, _ = train(NEO, how)
    assert all((a == b).all() for a, b in zip(network.weights, again.weights, strict=True))
    network.save(tmp_path / "mine.npz")
    assert not list(tmp_path.glob("*.part"))
    loaded = networks.load(tmp_path / "mine.npz")
    features = parts["test"].features
    assert (loaded.evaluate(features) == network.evaluate(features)).all()
    assert (loaded.stretches, loaded.ratios) == ((0.9, 2.0), {"bulk/mu": 100.0})
    assert Neural(NEO, network=tmp_path / "mine.npz").loaded is not None


def test_a_network_of_another_material_serves_it_alone(tmp_path):
    material = material_named("Yeoh(500, c20=20)")
    network, _ = train(material, Training(samples=400, hidden=(6,), steps=25, seed=3, stretches=(0.9, 2.0)))
    assert network.report["largest_relative_error"] < 0.1
    network.save(tmp_path / "yeoh.npz")
    assert Neural(Yeoh(5e5, 2e4), network=tmp_path / "yeoh.npz").loaded is not None
    with pytest.raises(InputError, match="expected Yeoh"):
        Neural(Yeoh(500.0, 30.0), network=tmp_path / "yeoh.npz")


@pytest.mark.parametrize("text", ["yeoh", "Yeoh()", "Sheet(1)", "Yeoh(1", "Yeoh(-1)", "Bimodular(1e3)"])
def test_materials_that_are_none_are_refused_in_one_line(text):
    with pytest.raises(argparse.ArgumentTypeError, match="expected"):
        material_named(text)
