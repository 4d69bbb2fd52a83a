"""Checks of input: numbers, indices and masks of points."""

import math

import numpy as np
import pytest
from helpers import refused

from warp_pd.device.checks import finite, numbers, point_indices


@pytest.mark.parametrize(
    ("points", "text"), [([0.5, 3.9], "points = .* point indices"), (np.ones(8, bool), "mask of 9")]
)
def test_what_is_neither_indices_nor_a_mask_is_named(points, text):
    with refused(match=text):
        point_indices("points", points, 9)


def test_a_mask_of_all_points_is_their_numbers():
    assert (point_indices("points", np.arange(9) > 6, 9) == [7, 8]).all()


@pytest.mark.parametrize("value", [True, np.bool_(False), "1", None, [1.0], math.nan])
def test_a_number_is_a_number(value):
    """True would count as 1 in silence."""
    with refused(match=r"size = .*: expected a (finite )?number"):
        finite("size", value)


@pytest.mark.parametrize("value", [True, [False, True], "1", ["1", "2"], [[1.0], [1.0, 2.0]]])
def test_truth_values_texts_and_ragged_lists_are_no_numbers(value):
    with refused(match=r"^times = .*: expected numbers$"):
        numbers("times", value)
