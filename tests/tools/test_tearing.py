"""The tearing study compares like with like, and reports an order only where there is one."""

import numpy as np
import pytest
import tearing

from warp_pd.__main__ import build_scene

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
    assert row[-1] == order
    assert "nan" not in "".join(row)


def test_a_page_without_runs_says_so(tmp_path):
    """Every run of the study has a row, and no number is invented."""
    study = tearing.STUDIES[0]
    text = tearing.page([study], tmp_path, 1.0, "CPU", "here", "A remark.")
    assert text.count("| - | - | - | - | - | - | not run |") == 15
    assert "commit here" in text
    assert "A remark." in text
    assert "nan" not in text
