"""The neural law with a damage field: tears as with the bond-associated law, and with any network."""

import numpy as np
import pytest
from helpers import NEO, internal_force, rough, square, uniform
from point_laws import build, exact_module

from warp_pd import BondAssociated, Explicit, Fixed, Motion, Neural, Simulation, TearingEnergy

CLOSED = Neural(NEO, 2.015, evaluation="closed_form")


def test_a_tear_takes_the_energy_that_it_takes_with_the_bond_associated_law():
    sheet = square(13).cut((-0.01, 0.047), (0.035, 0.047))
    bottom, top = sheet.edges("bottom"), sheet.edges("top")
    damage = TearingEnergy(6.0, spared=np.concatenate([bottom, top]), length=0.016)
    loads = [Fixed(bottom), Motion(top, [0.0, 0.4], x=0.0, y=[0.0, 0.08], z=0.0)]
    found = []
    for law in (CLOSED, BondAssociated(NEO, horizon=2.015, weights="plain")):
        solver = Explicit(0.4, frames=8, damping=2.0, precision=32)
        result = Simulation(sheet, law, solver, loads=loads, damage=damage).run(device="cpu")
        assert result.status == "finished" and result.history[-1]["largest_damage"] > 0.8
        assert not result.built.rupture.intact_faces.numpy().all()
        found.append(result.history[-1]["fracture"] - result.history[0]["fracture"])
    assert found[0] == pytest.approx(found[1], rel=0.15)


def test_a_network_softens_and_tears_as_the_closed_form():
    sheet, states = square(9), []
    for law in (CLOSED, Neural(NEO, 2.015, network=exact_module())):
        built = build(sheet, law, damage=TearingEnergy(5.0))
        built.state.step.fill_(1e-12)
        internal_force(built, uniform(sheet, [[1.6, 0.0], [0.0, 1.0], [0.0, 0.0]]) + rough(sheet))
        for _ in range(20):
            built.context.run("step")
        states.append((built.rupture.field.numpy(), built.to_numpy(built.state.force)))
    (field, force), (other_field, other_force) = states
    assert 0.2 < field.max() < 1.0
    np.testing.assert_allclose(other_field, field, atol=1e-9)
    np.testing.assert_allclose(other_force, force, atol=1e-9 * np.abs(force).max())
