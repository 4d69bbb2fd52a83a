"""The tools that make the pages: that their tables compare like with like, and say so where there is no number."""

import dataclasses
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from warp_pd.cli import build_scene
from warp_pd.solvers import explicit

sys.path.insert(0, str(Path(__file__).parents[1] / "tools"))
import error_vs_time as evt
import scene_costs
import stability
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


def row(points, seconds, field, scalar=0.01, **case):
    case = evt.Case(
        **{"scene": "pressure", "law": "plain", "horizon": 2.015, "precision": 64, "solver": "newton", **case},
        points=points,
    )
    status = "finished" if field is not None else "not converged"
    return evt.Row(case, status, scalar, field, seconds, 0.0, 0.0, 0.0, 1e6 * seconds, "CPU", "today")


def test_the_front_of_error_over_time_holds_what_nothing_beats():
    rows = [row(11, 1.0, 0.1), row(21, 2.0, 0.2), row(31, 3.0, 0.02), row(41, 4.0, None), row(51, 2.5, 0.02)]
    assert [r.case.points for r in evt.front(rows, evt.field_of, lambda r: r.seconds)] == [11, 51]


def test_observed_orders_come_from_the_spacings():
    table = evt.orders([row(11, 1.0, 0.16), row(21, 2.0, 0.04), row(41, 2.0, 0.01)])
    assert table[-1].endswith("| 2.0, 2.0 |")


def test_what_the_published_settings_lose():
    published = row(101, 2.0, 0.05, law="published", horizon=3.15, solver="relaxation")
    text = evt.published_text([published, row(51, 1.0, 0.05), row(101, 1.9, 0.001)])
    assert "50 times less" in text
    assert text.endswith("2 times less.")


def test_the_fast_version_of_error_over_time(tmp_path, capsys):
    evt.main(["--fast", "--device", "cpu", "--laws", "corrected", "--numbers", str(tmp_path)])
    rows = evt.load(tmp_path)
    assert len(rows) == 8
    assert all(r.status == "finished" for r in rows)
    coarse, fine = (min(evt.field_of(r) for r in rows if r.case.points == n) for n in (11, 21))
    assert fine < 0.4 * coarse
    (tmp_path / "error-vs-time").mkdir()
    text = evt.page(rows, tmp_path)
    assert "What to choose" in text
    assert "corrected, 2.015, 21 points" in capsys.readouterr().out
    evt.main(["--fast", "--device", "cpu", "--laws", "corrected", "--numbers", str(tmp_path), "--missing"])
    assert len(evt.load(tmp_path)) == 8


def test_what_a_scene_is_spared(tmp_path):
    page = tmp_path / "costs.md"
    scenes = ["double_notch", "pressure", "visco_sheet"]
    options = ["--scenes", *scenes, "--points", "31", "--seconds", "0.05", "--device", "cpu", "--out", str(page)]
    scene_costs.main(options)
    rows = [
        line.split("|") for line in page.read_text().splitlines() if line.startswith(tuple(f"| {s}" for s in scenes))
    ]
    assert len(rows) == 3
    for row in rows:
        for column in (3, 4, 5):
            needs, forced = (float(x) for x in row[column].split("/"))
            assert needs < forced


def test_errors_against_finite_elements_vanish_for_their_own_field():
    """Their field, and what a sheet of 21 points finds: known from the runs of the solvers' tests."""
    options = evt.parsed(["--fast"])
    study = evt.STUDIES[0]
    case = evt.Case("pressure", "corrected", 2.015, 21, 64, "newton")
    found = evt.measure(study, case, "cpu", 1, options.enough, "here", [])
    assert 0.0 < found.scalar < 0.01
    assert 0.0 < found.field < 0.015
    sheet = evt.simulation_of(study, case).sheet
    data = np.load(evt.DATA / "pressure.npz")
    moved = data["x"] - np.column_stack([data["X"], np.zeros(len(data["X"]))])
    field = evt.quarter_field(data["X"], moved, sheet.points, (0.05, 0.05))
    corner = evt.quarter_field(data["X"], moved, 0.1 - sheet.points, (0.05, 0.05))
    assert evt.field_error(sheet, field, field) == 0.0
    # Turned by half a turn about the centre, the sheet deflects alike and moves in its plane the other way; on the
    # lines of symmetry the cubics leave a motion across them.
    assert evt.field_error(sheet, field * [-1.0, -1.0, 1.0], corner) < 1e-5


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


@pytest.mark.parametrize("law", ["bond-based", "hyperelastic bonds", "visco bonds"])
def test_a_law_that_has_no_lock_says_so(law):
    cells = stability.main(["--device", "cpu", "--laws", law, "--only", "Jm = 1", "K/mu = 1e3"])
    assert {row[law].verdict for row in cells.values()} == {stability.NONE}
    assert "no lock" in cells["99 % of the lock, Jm = 1"][law].remark
    assert "no K/mu" in cells["K/mu = 1e3"][law].remark


def test_a_sheet_under_tension_at_rest_is_not_asked_to_keep_its_shape():
    cells = stability.main(["--device", "cpu", "--laws", "visco bonds", "--only", "rigid spin", "inside out"])
    assert (cells["rigid spin"]["visco bonds"].verdict, cells["sheet inside out"]["visco bonds"].verdict) == (
        stability.NONE, stability.STABLE,
    )  # fmt: skip


def test_viscous_sheets_hold_their_balance_and_only_lose():
    """Stress and lock with what has not relaxed yet, the balance with what was lost, and energy that falls."""
    names = ["K/mu = 1e6", "two bonds", "undamped oscillation"]
    cells = stability.main(["--fast", "--device", "cpu", "--laws", "visco", "--only", *names[::2]])
    oscillation = cells["undamped oscillation"]["visco"]
    assert cells["K/mu = 1e6"]["visco"].number < 1e-6
    assert oscillation.unit == stability.GAIN
    assert {cell["visco"].verdict for cell in cells.values()} == {stability.STABLE}
    left = float(oscillation.remark.split(" %")[0])
    assert 10.0 < left < 95.0
    bonds = stability.main(["--device", "cpu", "--laws", "visco", "--only", "two bonds"])
    assert bonds["two bonds"]["visco"].number < 1e-4


def test_energy_that_a_viscous_sheet_gains_is_seen():
    falling = np.exp(-np.linspace(0.0, 3.0, 200))
    assert stability.gain_of(falling, 1.0 - falling) == 0.0
    assert stability.gain_of(falling + 0.3 * (np.arange(200) > 100), 1.0 - falling) > 0.2
    assert stability.gain_of(falling, falling) > 0.01


def test_a_ball_that_leaps_over_the_sheet_is_seen(monkeypatch):
    trial = stability.Trial("nodal", 32, "cpu")
    scene = stability.ball_scene(trial, 10.0, 0.9)
    assert stability.passed_through(trial, scene) is None
    monkeypatch.setattr(explicit, "BALL_TRAVEL", 100.0)
    assert "5 of the 5 points" in stability.passed_through(trial, scene)


def told(cells):
    """Cells but for what differs from call to call."""
    return {
        name: {law: dataclasses.replace(cell, seconds=0.0, made="") for law, cell in row.items()}
        for name, row in cells.items()
    }


def test_processes_share_the_cases_and_a_stopped_call_goes_on(tmp_path, monkeypatch):
    page = tmp_path / "page.md"
    options = ["--device", "cpu", "--laws", "nodal", "bond-based", "--only", "inside out", "K/mu = 1e3"]
    shared = stability.main([*options, "--jobs", "2", "--out", str(page)])
    assert list(shared["sheet inside out"]) == ["nodal", "bond-based"]
    measured, ran = stability.cell, []

    def stopped(name, trial):
        if len(ran) == 2:
            raise KeyboardInterrupt
        ran.append((name, trial.law))
        return measured(name, trial)

    monkeypatch.setattr(stability, "cell", stopped)
    alone = ["--out", str(tmp_path / "alone.md")]
    with pytest.raises(KeyboardInterrupt):
        stability.main([*options, *alone])
    assert "| K/mu = 1e3 | error of the mean stress | stable" in (tmp_path / "alone.md").read_text()
    assert "inside out" not in (tmp_path / "alone.md").read_text()
    monkeypatch.setattr(stability, "cell", measured)
    found = stability.main([*options, *alone, "--missing"])
    assert told(found) == told(shared)
    numbers = (tmp_path / "alone.json").read_text()
    monkeypatch.setattr(stability, "cell", lambda name, trial: pytest.fail("there was nothing left to run"))
    stability.main([*options, *alone, "--missing"])
    assert (tmp_path / "alone.json").read_text() == numbers


def test_a_page_is_of_one_device_and_says_what_each_call_made(tmp_path, capsys):
    page, numbers = tmp_path / "page.md", tmp_path / "page.json"
    options = ["--device", "cpu", "--only", "inside out", "--out", str(page)]
    stability.main([*options, "--laws", "nodal", "--stand", "first"])
    stability.main([*options, "--laws", "bond-based", "--stand", "second"])
    text = page.read_text()
    assert "commit first, long runs of up to 10 s: cases of nodal: 1;" in text
    assert "commit second, long runs of up to 10 s: cases of bond-based: 1;" in text
    assert "| nodal | bond-based |" in text
    numbers.write_text(numbers.read_text().replace("on CPU,", "on NVIDIA H200,"))
    with pytest.raises(SystemExit):
        stability.main([*options, "--laws", "nodal"])
    assert "allowed on 'CPU' is a page of its own" in capsys.readouterr().err
