"""Nodal and neural laws in a run: bonds outside the training range, a law without a tangent."""

import numpy as np
import pytest
from helpers import NEO, refused, square, uniform
from point_laws import exact_module

from warp_pd import Explicit, Fixed, Neural, Newton, Nodal, Simulation


def stretched_run(law, gradient, **parts):
    sheet = square(9)
    u = uniform(sheet, gradient)
    solver = Explicit(duration=1e-4, frames=2)
    return Simulation(
        sheet, force=law, solver=solver, loads=[Fixed(sheet.edges("all"))], initial_displacement=u, **parts
    ).run(device="cpu")


def test_bonds_outside_the_training_range_are_counted_and_reported():
    inside = stretched_run(Neural(NEO), [[2.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    assert inside.history[0]["bonds_outside_training"] == 0.0
    assert not [n for n in inside.summary["notes"] if "training range" in n]
    beyond = stretched_run(Neural(NEO), [[0.75, 0.0], [0.0, 1.0], [0.0, 0.0]])
    assert beyond.history[0]["bonds_outside_training"] == beyond.summary["bonds"]
    reported = [n for n in beyond.summary["notes"] if "training range" in n]
    assert len(reported) == 1 and f"{beyond.summary['bonds']} of {beyond.summary['bonds']} bonds" in reported[0]
    for law in (Neural(NEO, evaluation="closed_form"), Neural(NEO, network=exact_module()), Nodal(NEO)):
        assert "bonds_outside_training" not in stretched_run(law, np.eye(3)[:, :2]).history[0]


@pytest.mark.parametrize(
    "stretches", [(0.97, 0.97), (0.97, 0.03), (0.97, 1.03), (1.03, 1.03), (-0.03, 0.5), (0.03, 0.03)]
)
def test_a_bond_is_outside_if_a_principal_stretch_is(stretches):
    """In parts of the range: 0 is its lower and 1 its upper end."""
    law, sheet = Neural(NEO), square(5)
    least, most = law.loaded.stretches
    first, second = (least + part * (most - least) for part in stretches)
    turn = np.array([[np.cos(0.4), -np.sin(0.4), 0.0], [np.sin(0.4), np.cos(0.4), 0.0], [0.0, 0.0, 1.0]])
    gradient = turn @ np.diag([first, second, 1.0]) @ turn.T
    built = Simulation(sheet, law, Explicit(1.0), initial_displacement=uniform(sheet, gradient[:, :2])).build("cpu")
    built.context.run("frame")
    outside = any(not 0.0 < part < 1.0 for part in stretches)
    assert built.law.outside.numpy().sum() == outside * built.law.families.bond_count


def test_newton_asks_for_a_tangent():
    sheet = square(9)
    with refused(match="^force = Nodal: .*BondAssociated, BondBased or Neural, .* tangent; or use .*Relaxation$"):
        Simulation(sheet, force=Nodal(NEO), solver=Newton()).build(device="cpu")
