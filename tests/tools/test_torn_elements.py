"""Finite elements that tear: the energy of a tear, and the load at which it runs."""

import numpy as np
import pytest

pytest.importorskip("skfem")

from error_vs_time.elements import SCENES
from torn_elements import TornSheet, graded


def test_elements_are_small_where_they_are_to_be_and_grow_elsewhere():
    places = graded(10.0, 3.0, 4.1, 5.0, 0.25)
    gaps = np.diff(places)
    assert (places[0], places[-1]) == (0.0, 10.0)
    assert gaps[(places[:-1] > 2.99) & (places[1:] < 5.01)] == pytest.approx(0.25, rel=0.15)
    assert np.abs(places - 4.1).min() < 1e-12
    assert gaps.min() > 0.2
    assert gaps[0] > 2.0 * 0.25
    assert graded(1.0, -1.0, 0.5, 2.0, 0.5) == pytest.approx([0.0, 0.5, 1.0])


def test_a_crack_across_has_the_tearing_energy():
    """Gc for each square metre; a row of broken elements adds 3 e / (8 l), for which Gc is lower."""
    sheet = TornSheet(1.0, 1.0, 1.0, 0.0, 3.0, 0.08, 0.02, 1e3)
    assert sheet.tear_energy == pytest.approx(3.0, rel=0.01)
    assert sheet.tip > 0.97


def test_elements_larger_than_the_damage_are_refused():
    for points in (1, 2, 20):
        with pytest.raises(ArithmeticError, match="size"):
            SCENES["double_notch"](points, False)


def test_two_notches_tear_at_a_load_that_coarse_elements_know():
    """An element of two thirds of the length of the field."""
    assert abs(SCENES["double_notch"](40, False).scalar) < 0.03
