"""Tears of the study: a small run has what its table shows."""

import pytest
from tears import SCENES, found, run, scenes_table, strips, strips_table


class Options:
    rows, horizons, stretches, grids, set = [8], [2.015], [3.0], ["45"], ["duration=0.2"]


def test_a_strip_has_an_onset_and_a_balance():
    (settings,) = strips(Options)
    row = run("pure_shear_tear", {**settings, "frames": 10}, "cpu")
    assert row["status"] == "finished"
    assert row["worst_energy_balance"] < 0.05
    assert row["settings"]["turn"] == 45.0
    assert found([row], "pure_shear_tear", row["settings"]) is row
    assert {f"onset_{n}" for n in (1, 3, 6, 12)} < set(row)
    assert strips_table([row])[-1].startswith("| 2.015 | 8 | 1 | 1 |")


def test_the_spread_over_grids_is_told_where_there_are_runs():
    scene, name, settings, middle, points = SCENES[0]
    rows = [
        {"scene": scene, "settings": {"points": middle, **settings, **change}, name: value}
        for change, value in (({}, 1.0), ({"turn": 15.0}, 1.5))
    ]
    first, second = scenes_table(rows)[2:4]
    assert first.endswith("1, 1.5, -, -, - | 40 % |")
    assert f"{middle}: 1" in first and f"{points[0]}: -" in first
    assert second.endswith("| - |")
    with pytest.raises(StopIteration):
        next(row for row in rows if found([row], "none", settings))
