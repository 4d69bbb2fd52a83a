"""Strips of a large sheet cover it once, and leave room for what is gathered around them."""

import numpy as np
import pytest

from warp_pd.laws.strips import long_strips, short_strips


@pytest.mark.parametrize(("points", "most"), [(1000, 57), (1000, 100), (999, 101), (1001, 250)])
@pytest.mark.parametrize("room", [1, 4])
def test_strips_cover_a_sheet_once(points, most, room):
    here, reach = slice(3, points - 5), 20
    strips = short_strips(here, points, reach, most, room)
    if len(strips) > 1:
        assert len(strips) > room and all(2 * reach <= strip.size <= most for strip in strips[:-1])
    computed = np.concatenate([np.arange(strip.begin, strip.end) for strip in strips])
    assert (computed == np.arange(here.start, here.stop)).all()
    gathered = np.concatenate([np.arange(strip.gather_begin, strip.gather_end) for strip in strips])
    assert (gathered == np.arange(points)).all()
    for strip in strips[:-1]:
        assert strip.gather_end + reach <= strip.end


def test_sheets_of_few_strips_or_distant_bonds_are_whole():
    assert len(short_strips(slice(0, 400), 400, 10, 100, 4)) == 1
    assert len(short_strips(slice(0, 1000), 1000, 60, 100, 4)) == 1


def test_long_strips_fit_into_the_ring():
    strips = long_strips(slice(0, 1000), 1000, 20, 200)
    assert [strip.size for strip in strips] == [160] * 6 + [40]
    assert len(long_strips(slice(0, 400), 400, 20, 200)) == 1 == len(long_strips(slice(0, 1000), 1000, 80, 200))
