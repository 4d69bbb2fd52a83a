"""Self-contact on every device: bits repeat, and the lists of a GPU are those of a CPU."""

import numpy as np
import pytest
from helpers import square
from small_runs import simulate

from warp_pd import Explicit, Place, SelfContact, placed, together


def collision(**contact):
    """A square that falls on a larger one and slides over it."""
    sheet = together(square(31), square(21, 0.067))
    start = placed(sheet, Place(), Place((0.02, 0.01, 1.6 * sheet.spacing), degrees=20.0))
    velocity = np.zeros((sheet.size, 3))
    velocity[sheet.pieces == 2] = (0.3, 0.0, -0.5)
    return simulate(
        sheet, Explicit(0.02, frames=4), contact=SelfContact(friction=0.3, **contact), initial_displacement=start,
        initial_velocity=velocity,
    )  # fmt: skip


@pytest.mark.parametrize("surface", [False, True], ids=["points", "triangles"])
def test_devices_agree(device, surface):
    here, again, cpu = (collision(surface=surface).run(device=name, precision=64) for name in (device, device, "cpu"))
    assert here.history == again.history
    np.testing.assert_array_equal(here.frame.displacement, again.frame.displacement)
    difference = np.abs(here.frame.displacement - cpu.frame.displacement).max()
    assert difference < 1e-9 * np.abs(cpu.frame.displacement).max()
