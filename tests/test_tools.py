"""The tools that make the pages: that their tables compare like with like, and say so where there is no number."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from warp_pd.cli import build_scene

sys.path.insert(0, str(Path(__file__).parents[1] / "tools"))
import stability
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


# Case, and the most that its number may be in float32 where it has a bound of its own.
MUST_HOLD = {
    "K/mu = 1e6": 1e-6,
    "thickness 1e-6 of the side": 5e-6,
    "units: millimetres": 5e-6,
    "units: kilometres": 5e-6,
    "step: stretched": None,
    "one bond": 1e-6,
    "sheet turned by 180°": 1e-5,
    "ball at 100 times": 1e-3,
    "every bond in one step": 0.01,
    "restart in the middle of a tear": 0.0,
    "two runs on one device": 0.0,
}


def test_the_default_law_is_stable_where_it_must_be(tmp_path):
    page = tmp_path / "stability.md"
    cells = stability.main(
        ["--fast", "--device", "cpu", "--laws", "corrected", "--out", str(page), "--only", *MUST_HOLD]
    )
    assert set(cells) == set(MUST_HOLD)
    for name, most in MUST_HOLD.items():
        cell = cells[name]["corrected"]
        assert (cell.verdict, cell.double_verdict) == (stability.STABLE, stability.STABLE), name
        assert most is None or cell.number <= most, name
        assert "| " + name + " | " in page.read_text()
    assert cells["step: stretched"]["corrected"].number >= 1.0
    assert "unstable at" in cells["step: stretched"]["corrected"].remark
    numbers = json.loads(page.with_suffix(".json").read_text())
    assert numbers["one bond"]["corrected"]["verdict"] == stability.STABLE


def test_the_table_tells_laws_apart():
    """A verdict that every law gets would show nothing: the nodal law has zero-energy modes, the plain one has none."""
    cells = stability.main(["--device", "cpu", "--laws", "nodal", "plain", "--only", "zero-energy", "beyond"])
    zero = cells["zero-energy excitations"]
    assert (zero["nodal"].verdict, zero["plain"].verdict) == (stability.WRONG, stability.STABLE)
    assert {cell.verdict for cell in cells["stretched beyond the lock, Jm = 20"].values()} == {stability.CLEAN}


def test_a_law_that_has_no_lock_says_so():
    cells = stability.main(["--device", "cpu", "--laws", "bond-based", "--only", "Jm = 1"])
    assert {row["bond-based"].verdict for row in cells.values()} == {stability.NONE}
    assert "no lock" in cells["99 % of the lock, Jm = 1"]["bond-based"].remark
