"""Stability: verdicts that a law must get, that verdicts tell laws apart, and that calls share a page."""

import dataclasses
import json

import numpy as np
import pytest
from stability import execution
from stability.cases.long_runs import gain_of
from stability.cases.rupture import ball_scene, missed_points
from stability.cli import main
from stability.laws import Trial
from stability.verdicts import CLEAN, GAIN, NONE, STABLE, WRONG

from warp_pd import InputError
from warp_pd.parts import contact

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
    cells = main(["--fast", "--device", "cpu", "--laws", "corrected", "--out", str(page), "--only", *MUST_HOLD])
    assert set(cells) == set(MUST_HOLD)
    for name, most in MUST_HOLD.items():
        cell = cells[name]["corrected"]
        assert (cell.verdict, cell.double_verdict) == (STABLE, STABLE), name
        assert most is None or cell.number <= most, name
        assert "| " + name + " | " in page.read_text()
    assert cells["step: stretched"]["corrected"].number >= 1.0
    assert "unstable at" in cells["step: stretched"]["corrected"].remark
    numbers = json.loads(page.with_suffix(".json").read_text())
    assert numbers["one bond"]["corrected"]["verdict"] == STABLE


def test_the_table_tells_laws_apart():
    """A verdict that every law gets would show nothing: the nodal law has zero-energy modes, the plain one has none."""
    cells = main(["--device", "cpu", "--laws", "nodal", "plain", "--only", "zero-energy", "beyond"])
    zero = cells["zero-energy excitations"]
    assert (zero["nodal"].verdict, zero["plain"].verdict) == (WRONG, STABLE)
    assert {cell.verdict for cell in cells["stretched beyond the lock, Jm = 20"].values()} == {CLEAN}


@pytest.mark.parametrize("law", ["bond-based", "hyperelastic bonds", "visco bonds"])
def test_a_law_that_has_no_lock_says_so(law):
    cells = main(["--device", "cpu", "--laws", law, "--only", "Jm = 1", "K/mu = 1e3"])
    assert {row[law].verdict for row in cells.values()} == {NONE}
    assert "no lock" in cells["99 % of the lock, Jm = 1"][law].remark
    assert "no K/mu" in cells["K/mu = 1e3"][law].remark


def test_a_sheet_with_a_prestress_is_not_asked_to_keep_its_shape():
    cells = main(["--device", "cpu", "--laws", "visco bonds", "--only", "rigid spin", "inside out"])
    assert (cells["rigid spin"]["visco bonds"].verdict, cells["sheet inside out"]["visco bonds"].verdict) == (
        NONE, STABLE,
    )  # fmt: skip


def test_viscous_sheets_hold_their_balance_and_only_lose():
    """Stress and lock with what has not relaxed yet, the balance with what was lost, and energy that falls."""
    names = ["K/mu = 1e6", "two bonds", "undamped oscillation"]
    cells = main(["--fast", "--device", "cpu", "--laws", "visco", "--only", *names[::2]])
    oscillation = cells["undamped oscillation"]["visco"]
    assert cells["K/mu = 1e6"]["visco"].number < 1e-6
    assert oscillation.unit == GAIN
    assert {cell["visco"].verdict for cell in cells.values()} == {STABLE}
    left = float(oscillation.remark.split(" %")[0])
    assert 10.0 < left < 95.0
    bonds = main(["--device", "cpu", "--laws", "visco", "--only", "two bonds"])
    assert bonds["two bonds"]["visco"].number < 1e-4


def test_energy_that_a_viscous_sheet_gains_is_seen():
    falling = np.exp(-np.linspace(0.0, 3.0, 200))
    assert gain_of(falling, 1.0 - falling) == 0.0
    assert gain_of(falling + 0.3 * (np.arange(200) > 100), 1.0 - falling) > 0.2
    assert gain_of(falling, falling) > 0.01


def test_a_ball_that_jumps_over_the_sheet_is_seen(monkeypatch):
    trial = Trial("nodal", 32, "cpu")
    scene = ball_scene(trial, 10.0, 0.9)
    assert missed_points(trial, scene) is None
    monkeypatch.setattr(contact, "MAX_TRAVEL", 100.0)
    assert "5 of the 5 points" in missed_points(trial, scene)


def told(cells):
    """Cells but for what differs from call to call."""
    return {
        name: {law: dataclasses.replace(cell, seconds=0.0, made="") for law, cell in row.items()}
        for name, row in cells.items()
    }


def test_processes_share_the_cases_and_a_stopped_call_goes_on(tmp_path, monkeypatch):
    page = tmp_path / "page.md"
    options = ["--device", "cpu", "--laws", "nodal", "bond-based", "--only", "inside out", "K/mu = 1e3"]
    shared = main([*options, "--jobs", "2", "--out", str(page)])
    assert list(shared["sheet inside out"]) == ["nodal", "bond-based"]
    measured, ran = execution.run_cell, []

    def stopped(name, trial):
        if len(ran) == 2:
            raise KeyboardInterrupt
        ran.append((name, trial.law))
        return measured(name, trial)

    monkeypatch.setattr(execution, "run_cell", stopped)
    alone = ["--out", str(tmp_path / "alone.md")]
    with pytest.raises(KeyboardInterrupt):
        main([*options, *alone])
    assert "| K/mu = 1e3 | error of the mean stress | stable" in (tmp_path / "alone.md").read_text()
    assert "inside out" not in (tmp_path / "alone.md").read_text()
    monkeypatch.setattr(execution, "run_cell", measured)
    found = main([*options, *alone, "--missing"])
    assert told(found) == told(shared)
    numbers = (tmp_path / "alone.json").read_text()
    monkeypatch.setattr(execution, "run_cell", lambda name, trial: pytest.fail("there was nothing left to run"))
    main([*options, *alone, "--missing"])
    assert (tmp_path / "alone.json").read_text() == numbers


def test_a_page_is_of_one_device_and_says_what_each_call_made(tmp_path):
    page, numbers = tmp_path / "page.md", tmp_path / "page.json"
    options = ["--device", "cpu", "--only", "inside out", "--out", str(page)]
    main([*options, "--laws", "nodal", "--stand", "first"])
    main([*options, "--laws", "bond-based", "--stand", "second"])
    text = page.read_text()
    assert "commit first, long runs of up to 10 s: cases of nodal: 1;" in text
    assert "commit second, long runs of up to 10 s: cases of bond-based: 1;" in text
    assert "| nodal | bond-based |" in text
    numbers.write_text(numbers.read_text().replace("on CPU,", "on NVIDIA H200,"))
    with pytest.raises(InputError, match="expected another page for 'CPU'"):
        main([*options, "--laws", "nodal"])


def test_a_page_can_be_made_again_without_a_run(tmp_path, monkeypatch):
    """Even where its device is not there."""
    page, numbers = tmp_path / "page.md", tmp_path / "page.json"
    made = main(["--device", "cpu", "--only", "inside out", "--laws", "nodal", "--out", str(page)])
    numbers.write_text(numbers.read_text().replace("on CPU,", "on NVIDIA H200,"))
    page.unlink()
    monkeypatch.setattr(execution, "run_cell", lambda name, trial: pytest.fail("nothing may run"))
    cells = main(["--only-page", "--out", str(page)])
    assert told(cells) == told(made)
    text = page.read_text()
    assert text.startswith("# Stability on stiff and extreme cases, NVIDIA H200\n")
    assert "| sheet inside out | force over mu h dx | stable" in text
