"""Costs of scenes beside the best rate: the rows of the table, not the speed of the machine that runs the tests."""

import pytest
import scene_rates


def test_rows_of_scenes(monkeypatch, capsys):
    monkeypatch.setattr(scene_rates, "available_cores", lambda: 1)
    # A lattice of fewer points than the scene has would take longer a point for its launches alone.
    monkeypatch.setattr(scene_rates, "SIDE", 61)
    monkeypatch.setattr(scene_rates, "ROUNDS", 3)
    monkeypatch.setattr(scene_rates, "SECONDS", 0.01)
    scene_rates.main(["--scenes", "folded_sheet", "tension"])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3, "tension has no explicit steps"
    cells = [cell.strip() for cell in lines[2].split("|")[1:-1]]
    assert cells[:3] == ["folded_sheet", "BondBased", "lattice"]
    cost, best, times = (float(cell) for cell in cells[7:])
    # Not that it costs more than the best: both are times of a machine that others may use.
    assert cost > 0.0 and best > 0.0
    assert times == pytest.approx(cost / best, rel=0.02)
