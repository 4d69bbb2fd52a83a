"""The tools that make the pages: that their tables compare like with like, and say so where there is no number."""

import sys
from pathlib import Path

import numpy as np
import pytest

from warp_pd.cli import build_scene

sys.path.insert(0, str(Path(__file__).parents[1] / "tools"))
import stretch
import tearing

CUT = {"double_notch": (1, 0.005), "off_plane_tear": (1, 0.05), "precut_tear": (0, 0.5), "ball_penetration": (0, 0.5)}


@pytest.mark.parametrize("study", tearing.STUDIES, ids=[s.scene for s in tearing.STUDIES])
def test_rows_of_points_lie_alike_to_the_cut_at_all_spacings(study):
    axis, place = CUT[study.scene]
    distances = []
    for points in (study.points, *study.spacings):
        sheet = build_scene(study.scene, {"points": points}).sheet
        distances.append(np.abs(sheet.points[:, axis] - place).min() / sheet.spacing)
    assert distances == pytest.approx([distances[0]] * 4, abs=1e-6)


class Found:
    def __init__(self, points, value):
        self.points, self.found = points, value

    def value(self, name):
        return self.found


@pytest.mark.parametrize(
    ("values", "order"),
    [
        ((1.4, 1.2, 1.1), "1.00"),
        ((1.0, 1.75, 1.9375), "2.00"),
        ((0.866, 1.220, 1.133), "none"),
        ((1.0, 1.1, 1.3), "none"),
        ((1.0, 1.0, 1.0), "none"),
        ((1.0, float("nan"), 1.0), "none"),
    ],
)
def test_an_order_is_told_only_where_the_differences_show_one(values, order):
    study = tearing.STUDIES[0]
    row = tearing.convergence_row(study, [Found(p, v) for p, v in zip(study.spacings, values, strict=True)])
    assert row.split("|")[-2].strip() == order
    assert "nan" not in row


def test_the_mirrored_elements_are_the_whole_sheet_with_its_hole():
    nodes, moved = stretch.elements("equibiaxial", 2.0)
    assert np.allclose(np.abs(nodes).max(axis=0), 0.25)
    assert np.hypot(*nodes.T).min() == pytest.approx(0.08, rel=1e-6)
    right = nodes[:, 0] > 0.25 - 1e-9
    assert np.allclose(moved[right, 0], 0.25)
    assert np.allclose(moved.sum(axis=0), 0.0, atol=1e-9)
    assert stretch.elements("uniaxial", 2.0) is None


def test_errors_of_the_stretched_sheet_are_told_only_where_there_is_a_reference(tmp_path):
    case = stretch.Case("uniaxial", "crack", "bond_associated", 30)
    assert stretch.error(case, tmp_path, 2.0) == "-"
    whole = stretch.Case("equibiaxial", "none", "bond_based", 30)
    assert stretch.wanted(whole, tmp_path, 2.0) == pytest.approx(357656, rel=1e-5)
    assert stretch.wanted(stretch.Case("planar", "hole", "bond_based", 30), tmp_path, 1.5) == pytest.approx(176580)
    assert stretch.error(whole, tmp_path, 2.0) == "-", "nothing has run"


def test_the_staircase_of_a_hole_nears_its_circle():
    assert [100.0 * stretch.hole_area_error(n) for n in (30, 40, 100)] == pytest.approx([5.0, -3.6, 1.0], abs=0.1)
