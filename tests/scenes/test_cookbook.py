"""The cookbook: every scene of the page is within what its table says of its closed form."""

import csv
import re
from pathlib import Path

import own_parts
import pytest
from small_runs import cli

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "cookbook.md").read_text()
FILES = {path.stem: path for path in (DOCS / "cookbook").glob("*.py")}
WITHIN = {
    name: float(percent) / 100.0
    for name, percent in re.findall(r"^\| \[\w+\]\(cookbook/(\w+)\.py\) .* ([\d.]+) % \|$", PAGE, re.M)
}
SMALLER = {"perforated": {"points": 41, "size": 16e-3}}


def test_the_table_names_every_scene():
    assert list(WITHIN) and set(WITHIN) == set(FILES)
    assert max(len(path.read_text().splitlines()) for path in FILES.values()) < 100


@pytest.mark.parametrize("name", [name for name in sorted(FILES) if name != "fitted"])
def test_a_scene_is_within_its_closed_form(name, tmp_path):
    result = own_parts.imported(FILES[name]).build(**SMALLER.get(name, {})).run(device="cpu")
    assert result.status == "finished", result.summary["message"]
    errors = [found["error"] for found in result.summary["measures"].values() if found["reference"] is not None]
    assert len(errors) == 1
    assert abs(errors[0]) < WITHIN[name]
    if name == "finger":
        assert result.summary["measures"]["needle"]["value"] > 0.02


def test_the_valve_lifts_as_far_the_other_way(tmp_path):
    up, down = (
        own_parts.imported(FILES["valve"])
        .build(pressure=pressure, points=10)
        .run(device="cpu")
        .summary["measures"]["lift"]["value"]
        for pressure in (3.0, -3.0)
    )
    assert up > 0.0 and down == pytest.approx(-up, rel=1e-6)


def test_a_fit_finds_the_constants_of_its_curve(tmp_path):
    module = own_parts.imported(FILES["fitted"])
    found = module.build()
    assert found.values == pytest.approx(list(module.EXACT.values()), rel=WITHIN["fitted"])


def test_the_trampoline_is_swept_as_on_the_page(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (command,) = re.findall(r"^warp-pd (sweep .*)$", PAGE, re.M)
    result = cli(*command.replace("--points 16", "--points 8").replace("docs", str(DOCS)).split(), "--device", "cpu")
    assert result.exit_code == 0, result.output
    with next(tmp_path.rglob("sweep.csv")).open() as table:
        rows = list(csv.DictReader(table))
    assert [float(row["weight"]) for row in rows] == [10.0, 20.0, 40.0]
    sags = [float(row["sag"]) for row in rows]
    assert sags[1] == pytest.approx(2.0 * sags[0], rel=0.01) and sags[2] == pytest.approx(4.0 * sags[0], rel=0.01)
