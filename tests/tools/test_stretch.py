"""The stretch study compares with the right reference, and says so where there is none."""

import numpy as np
import pytest
import stretch
from stretch import StretchCase


def test_the_mirrored_elements_are_the_whole_sheet_with_its_hole():
    nodes, moved = stretch.elements("equibiaxial", 2.0)
    assert np.allclose(np.abs(nodes).max(axis=0), 0.25)
    assert np.hypot(*nodes.T).min() == pytest.approx(0.08, rel=1e-6)
    right = nodes[:, 0] > 0.25 - 1e-9
    assert right.any()
    assert np.allclose(moved[right, 0], 0.25)
    assert np.allclose(moved.sum(axis=0), 0.0, atol=1e-9)
    assert stretch.elements("uniaxial", 2.0) is None


def test_errors_of_the_stretched_sheet_are_told_only_where_there_is_a_reference(tmp_path):
    case = StretchCase("uniaxial", "crack", "bond_associated", 30)
    assert stretch.force_error(case, tmp_path, 2.0) == "-"
    perfect = StretchCase("equibiaxial", "none", "bond_based", 30)
    assert stretch.reference_force(perfect, 2.0) == pytest.approx(357656, rel=1e-5)
    holed = StretchCase("planar", "hole", "bond_based", 30)
    assert stretch.reference_force(holed, 1.5) == pytest.approx(176584)
    assert stretch.force_error(perfect, tmp_path, 2.0) == "-", "nothing has run"


def test_the_staircase_of_a_hole_nears_its_circle():
    assert [100.0 * stretch.hole_area_error(n) for n in (30, 40, 100)] == pytest.approx([5.0, -3.6, 1.0], abs=0.1)


def test_the_observed_order_is_the_slope_of_the_errors_and_none_where_they_change_sign(monkeypatch, tmp_path):
    row = {n: StretchCase("planar", "hole", "bond_associated", n, horizon=2.015) for n in (21, 41, 81)}
    exact = stretch.reference_force(row[21], 1.5)

    def falls(case, work):
        return {1.5: exact * (1.0 + 3e-3 * (20 / (case.points - 1)) ** 2)}

    monkeypatch.setattr(stretch, "history_by_stretch", falls)
    assert stretch.observed_order(row, tmp_path) == "2.0"
    monkeypatch.setattr(stretch, "history_by_stretch", lambda case, work: {1.5: exact * (case.points / 41.0)})
    assert stretch.observed_order(row, tmp_path) == "-"
