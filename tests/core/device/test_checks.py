"""Checks of input: indices and masks of points."""

import numpy as np
import pytest
from helpers import refused

from warp_pd.device.checks import point_indices


@pytest.mark.parametrize(
    ("points", "text"), [([0.5, 3.9], "points = .* point indices"), (np.ones(8, bool), "mask of 9")]
)
def test_what_is_neither_indices_nor_a_mask_is_named(points, text):
    with refused(match=text):
        point_indices("points", points, 9)


def test_a_mask_of_all_points_is_their_numbers():
    assert (point_indices("points", np.arange(9) > 6, 9) == [7, 8]).all()
