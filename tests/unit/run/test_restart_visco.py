"""A restart keeps the internal variables of the visco-hyperelastic laws, bit for bit."""

import numpy as np
import pytest
from helpers import StopAt, square
from visco_laws import LAWS

from warp_pd import CriticalEnergy, Explicit, Fixed, Simulation


@pytest.mark.parametrize("law", ["stress-free", "published"])
def test_a_resumed_run_is_the_same_bit_for_bit(law, tmp_path):
    def simulation():
        sheet = square(7)
        velocity = np.zeros((sheet.size, 3))
        velocity[:, 0] = 300.0 * sheet.points[:, 0]
        return Simulation(
            sheet, LAWS[law], Explicit(2e-3, frames=6, safety=0.5), loads=[Fixed(sheet.edges("left"))],
            initial_velocity=velocity, damage=CriticalEnergy(20.0),
        )  # fmt: skip

    options = {"device": "cpu", "precision": 64, "usd": False}
    complete = simulation().run(**options, out=tmp_path / "complete")
    interrupted = simulation().run(**options, out=tmp_path / "interrupted", writers=[StopAt(3)])
    assert interrupted.status == "interrupted"
    resumed = simulation().run(**options, out=tmp_path / "interrupted", resume=True)
    assert resumed.status == "finished"
    assert complete.history[-1]["mean_damage"] > 0.0
    np.testing.assert_array_equal(resumed.frame.displacement, complete.frame.displacement)
    np.testing.assert_array_equal(resumed.frame.velocity, complete.frame.velocity)
    assert complete.built.law.internal
    for name, values in complete.built.law.internal.items():
        np.testing.assert_array_equal(resumed.built.law.internal[name].numpy(), values.numpy())
