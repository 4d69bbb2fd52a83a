"""Strips of a large sheet cover it once, and leave room for what is gathered around them."""

import numpy as np
import pytest
import warp as wp
from helpers import build, square

from warp_pd.laws.strips import known_lists, strips_of


@pytest.mark.parametrize(("points", "most"), [(1000, 57), (1000, 100), (999, 101), (1001, 250)])
@pytest.mark.parametrize("room", [1, 4])
def test_strips_cover_a_sheet_once(points, most, room):
    here, reach = slice(3, points - 5), 20
    strips = strips_of(here, points, reach, most, room)
    if len(strips) > 1:
        assert len(strips) > room and all(2 * reach <= strip.size <= most for strip in strips[:-1])
    computed = np.concatenate([np.arange(strip.begin, strip.end) for strip in strips])
    assert (computed == np.arange(here.start, here.stop)).all()
    gathered = np.concatenate([np.arange(strip.gather_begin, strip.gather_end) for strip in strips])
    assert (gathered == np.arange(points)).all()
    for strip in strips[:-1]:
        assert strip.gather_end + reach <= strip.end


def test_sheets_of_few_strips_or_distant_bonds_are_whole():
    assert len(strips_of(slice(0, 400), 400, 10, 100, 4)) == 1
    assert len(strips_of(slice(0, 1000), 1000, 60, 100, 4)) == 1


def test_lists_of_strips_hold_their_points():
    built = build(square(9))
    others = np.zeros(built.simulation.sheet.size, bool)
    others[[0, 5, 40, 80]] = True
    lists = known_lists(built.context, "test", strips_of(slice(0, 81), 81, 5, 20, 1), others)
    assert [listed.most for listed in lists] == [2, 0, 1, 0, 1]
    for listed, points in zip(lists, [[0, 5], [], [40], [], [80]], strict=True):
        assert listed.points.numpy()[: listed.most].tolist() == points
        assert listed.count.numpy().tolist() == [listed.most] and listed.points.dtype == wp.int32
