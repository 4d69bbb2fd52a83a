"""The page on tearing energies: made from the numbers beside it, and by runs that the tool can repeat."""

import json

import tearing_energy
from tearing_energy import RUNS, STRIPS, cases, page, run


def body(text):
    """The page without the line that says when it was made."""
    return [line for line in text.splitlines() if not line.startswith("Made by")]


def test_the_page_is_that_of_the_numbers():
    text = page(json.loads(STRIPS.read_text()), json.loads(RUNS.read_text()))
    assert body(text) == body((RUNS.parent / "tearing-energy.md").read_text())


def test_every_case_of_the_tool_has_been_run():
    known = [(row["scene"], row["settings"]) for row in json.loads(RUNS.read_text())["runs"]]
    missing = [case for case in cases() if case not in known]
    assert not missing


def test_a_run_gives_its_measures():
    row = run("running_crack", {"points": 8, "horizon": 2.015, "frames": 20, "duration": 0.2}, "cpu")
    assert row["status"] == "finished" and row["worst_energy_balance"] < 0.05
    assert tearing_energy.found([row], "running_crack", row["settings"]) is row
    assert tearing_energy.found([row], "trousers", row["settings"]) == {}
