"""Supports: prescribed motion, component by component, and corners that two motions share."""

import numpy as np
import pytest
from helpers import NEO, array, square
from small_runs import run

from warp_pd import BondAssociated, Explicit, Fixed, Motion, Simulation


def test_prescribed_motion_follows_its_knots_component_by_component():
    sheet = square(7)
    right = sheet.edges("right")
    result = run(
        sheet,
        solver=Explicit(0.4, frames=8, safety=0.1),
        loads=[Fixed(sheet.edges("left")), Motion(right, [0.0, 0.1, 0.2, 0.3], x=[0.0, 0.01, 0.01, -0.005], z=0.002)],
    )
    assert result.frame.displacement[right, 0] == pytest.approx(-0.005, abs=1e-12)
    assert result.frame.displacement[right, 2] == pytest.approx(0.002, abs=1e-12)
    assert np.ptp(result.frame.displacement[right, 1]) > 1e-8
    assert abs(result.history[-1]["balance_error"]) < 2e-2


def test_edges_that_move_in_different_directions_share_their_corners():
    """Each point has one row: two would write its velocity at once, and one motion would be lost."""
    sheet = square(7)
    right, top = sheet.edges("right"), sheet.edges("top")
    loads = [
        Fixed(sheet.edges("left")),
        Motion(right, [0.0, 0.1], x=[0.0, 0.01]),
        Motion(top[1:], [0.0, 0.1], y=[0.0, 0.02]),
    ]
    simulation = Simulation(sheet, BondAssociated(NEO), Explicit(0.1, frames=1, safety=0.1), loads=loads)
    built = simulation.build("cpu")
    assert (array(built, "moved_rows").numpy() >= 0).sum() == len(right) + len(top) - 2
    assert len(array(built, "moved_schedules")) == len(right) + len(top) - 2
    corner = np.intersect1d(right, top)
    assert simulation.run(device="cpu").frame.displacement[corner, :2] == pytest.approx(
        np.array([[0.01, 0.02]]), abs=1e-7
    )
