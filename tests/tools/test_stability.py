"""Stability: verdicts that a law must get, that verdicts tell laws apart, and that calls share a page."""

from dataclasses import replace

import numpy as np
import pytest
from stability.__main__ import main
from stability.cases.long_runs import gain_of
from stability.cases.rupture import ball_scene, missed_points
from stability.laws import Trial
from stability.verdicts import CLEAN, GAIN, NONE, STABLE, WRONG
from study import load_rows, save_rows

from warp_pd import InputError, RigidBall

# Case, and the most that its number may be in float32 where it has a bound of its own.
MUST_HOLD = {
    "K/mu = 1e6": 1e-6,
    "units: millimetres": 5e-6,
    "step: stretched": None,
    "one bond": 1e-6,
    "ball at 100 times": 1e-3,
}


def verdicts(*options):
    """Rows of a call by case and law."""
    return {(row["case"], row["law"]): row for row in main(["--device", "cpu", *options])}


def test_the_default_law_is_stable_where_it_must_be(tmp_path):
    page = tmp_path / "stability.md"
    found = verdicts("--fast", "--laws", "corrected", "--out", str(page), "--only", *MUST_HOLD)
    assert {case for case, _ in found} == set(MUST_HOLD)
    for name, most in MUST_HOLD.items():
        row = found[name, "corrected"]
        assert (row["verdict"], row["double_verdict"]) == (STABLE, STABLE), name
        assert most is None or row["number"] <= most, name
        assert f"| {name} | " in page.read_text()
    stretched = found["step: stretched", "corrected"]
    assert stretched["number"] >= 1.0
    assert "unstable at" in stretched["remark"]
    assert [row["case"] for row in load_rows(page.with_suffix(".json"))] == [case for case, _ in found]


def test_the_table_tells_laws_apart():
    """A verdict that every law gets would show nothing: the nodal law has zero-energy modes, the plain one has none."""
    found = verdicts("--laws", "nodal", "plain", "--only", "zero-energy")
    assert [row["verdict"] for row in found.values()] == [WRONG, STABLE]
    assert verdicts("--laws", "plain", "--only", "beyond").popitem()[1]["verdict"] == CLEAN


def test_a_law_that_has_no_lock_says_so():
    laws = ("bond-based", "hyperelastic bonds", "visco bonds")
    found = verdicts("--laws", *laws, "--only", "Jm = 1", "K/mu = 1e3")
    assert {row["verdict"] for row in found.values()} == {NONE}
    for law in laws:
        assert "no lock" in found["99 % of the lock, Jm = 1", law]["remark"]
        assert "no K/mu" in found["K/mu = 1e3", law]["remark"]


def test_a_sheet_with_a_prestress_is_not_asked_to_keep_its_shape():
    assert verdicts("--laws", "visco bonds", "--only", "rigid spin").popitem()[1]["verdict"] == NONE


def test_viscous_sheets_only_lose_energy():
    (oscillation,) = verdicts("--fast", "--laws", "visco", "--only", "undamped oscillation").values()
    assert (oscillation["unit"], oscillation["verdict"]) == (GAIN, STABLE)
    left = float(oscillation["remark"].split(" %")[0])
    assert 10.0 < left < 95.0


def test_energy_that_a_viscous_sheet_gains_is_seen():
    falling = np.exp(-np.linspace(0.0, 3.0, 200))
    assert gain_of(falling, 1.0 - falling) == 0.0
    assert gain_of(falling + 0.3 * (np.arange(200) > 100), 1.0 - falling) > 0.2
    assert gain_of(falling, falling) > 0.01


def test_a_ball_that_touches_no_point_is_seen():
    trial = Trial("nodal", 32, "cpu")
    scene = ball_scene(trial, 10.0, 0.9)
    assert missed_points(trial, scene) is None
    beside = replace(scene, contact=RigidBall(0.3, (5.0, 0.5, 0.151), (0.0, 0.0, -10.0)))
    assert "5 of the 5 points" in missed_points(trial, beside)


def test_processes_share_the_cases_and_a_page_is_completed(tmp_path, capsys):
    """What is missing runs, in the order of the page; what is there does not run again."""
    page = ["--out", str(tmp_path / "page.md")]
    options = ["--laws", "nodal", "bond-based", "--only", "inside out", "K/mu = 1e3"]
    shared = verdicts(*options, "--jobs", "2")
    assert list(shared) == [(c, law) for c in ("K/mu = 1e3", "sheet inside out") for law in ("nodal", "bond-based")]
    verdicts("--laws", "bond-based", "--only", "inside out", *page)
    assert "K/mu = 1e3" not in (tmp_path / "page.md").read_text()
    verdicts(*options, *page, "--missing")
    assert "| K/mu = 1e3 | error of the mean stress | stable" in (tmp_path / "page.md").read_text()
    numbers = (tmp_path / "page.json").read_text()
    capsys.readouterr()
    again = verdicts(*options, *page, "--missing")
    assert capsys.readouterr().out.startswith("wrote "), "there was nothing left to run"
    assert (tmp_path / "page.json").read_text() == numbers
    assert {key: row["verdict"] for key, row in again.items()} == {key: row["verdict"] for key, row in shared.items()}


def test_a_page_is_of_one_device_and_says_what_each_call_made(tmp_path):
    page, numbers = tmp_path / "page.md", tmp_path / "page.json"
    options = ["--only", "inside out", "--out", str(page)]
    verdicts(*options, "--laws", "nodal", "--commit", "first")
    verdicts(*options, "--laws", "bond-based", "--commit", "second")
    text = page.read_text()
    assert "commit first, long runs of up to 10 s: 1 cells of nodal;" in text
    assert "commit second, long runs of up to 10 s: 1 cells of bond-based;" in text
    assert "| nodal | bond-based |" in text
    save_rows(numbers, [{**row, "made": row["made"].replace("CPU", "NVIDIA H200")} for row in load_rows(numbers)])
    with pytest.raises(InputError, match="expected another page for 'CPU'"):
        verdicts(*options, "--laws", "nodal")
    page.unlink()
    # A page can be made again where its device is not there.
    assert len(verdicts("--only-page", "--out", str(page))) == 2
    assert "| sheet inside out | force over mu h dx | stable" in page.read_text()
