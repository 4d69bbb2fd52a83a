"""Costs of scenes beside the best rate: the rows of the table, not the speed of the machine that runs the tests."""

import pytest
from scene_rates import Clock


def test_a_row_holds_the_scene_beside_the_lattice_of_its_horizon():
    # A lattice of fewer points than the scene has would take longer a point for its launches alone.
    clock = Clock(side=61, rounds=3, seconds=0.01)
    assert clock.row("tension") is None, "it has no explicit steps"
    cells = clock.row("folded_sheet")
    assert cells[:3] == ["folded_sheet", "BondBased", "lattice"]
    cost, best, times = (float(cell) for cell in cells[7:])
    # Not that it costs more than the best: both are times of a machine that others may use.
    assert cost > 0.0 and best > 0.0
    assert times == pytest.approx(cost / best, rel=0.02)
