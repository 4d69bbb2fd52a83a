"""Costs of scenes beside the best rate: one that is computed with more than a plain lattice costs more."""

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
    assert float(cells[7]) > 0.0
    assert float(cells[-1]) > 1.0
