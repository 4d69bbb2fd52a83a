"""The table of printed numbers: its rows, its file, its pages."""

import csv
import json

import pytest
from papers.__main__ import NUMBERS, PAPERS, chosen, examples, judged, main, pages
from papers.rows import Row, by_quantity, merged
from papers.store import load

from warp_pd import InputError
from warp_pd.papers.as_published import PRINTED


def test_every_row_has_an_example_and_the_papers_have_sixty():
    rows = [row for paper in PAPERS.values() for row in paper.ROWS]
    assert len(rows) >= 60
    assert {row.example for row in rows} - {"elements"} == examples().keys()


def test_every_scene_that_a_paper_printed_is_an_example():
    """Its name is an argument of one of them, or is in the functions that they call."""
    written = "".join(str(example) for example in examples().values())
    sources = "".join(path.read_text() for path in (NUMBERS.parents[2] / "tools" / "papers").glob("*.py"))
    assert [scene for scene in PRINTED if f"'{scene}'" not in written and f'"{scene}"' not in sources] == []


def test_two_small_examples_are_run_kept_and_not_run_again(tmp_path, monkeypatch, capsys):
    out = tmp_path / "printed.json"
    call = ["papers", "--only", "ve.equations", "im.6.1.10", "--device", "cpu", "--out", str(out)]
    monkeypatch.setattr("sys.argv", call)
    main()
    found = load(out)
    assert found.keys() == {"ve.equations", "im.6.1.10"}
    assert 0.0 < found["im.6.1.10"]["values"]["displacement_error"] < 0.01
    assert "| 1.1976 | as published | +0 % | matches |" in capsys.readouterr().out
    monkeypatch.setattr("sys.argv", [*call, "--missing"])
    main()
    assert load(out) == found


def test_a_verdict_follows_from_the_numbers():
    number = Row("x", "", "", "2", "y", value=2.0, within=0.01)
    assert number.judged({"y": 2.01}) == ("2.01", "+0.5 %", "matches")
    assert number.judged({"y": 2.1})[2] == "differs"
    assert number.judged(None)[2] == "not run"
    assert number.judged({"why": "it moves more than a horizon in one step"})[2].startswith("it moves")
    statement = Row("x", "", "", "some", "y", low=1.0)
    assert statement.judged({"y": 2.0})[2] == "matches" and statement.judged({"y": 0.5})[2] == "differs"


def test_neighbours_that_are_read_at_other_places_are_one_row():
    def row(at, ours, verdict):
        return ["5.1", f"force at {at} s, off (%)", "good", ours, "as published", "", verdict]

    other = ["5.1", "pieces at the end", "2", "2", "as published", "", "matches"]
    rows = merged([row("1.5", "7", "differs"), row("2", "3", "matches"), other, row("3", "1", "matches"), other])
    assert rows[0] == ["5.1", "force at 1.5, 2 s, off (%)", "good", "7, 3", "as published", "", "differs, matches"]
    assert rows[1:] == [other, row("3", "1", "matches"), other]
    lost = ["5.1", "pieces at the end, 9 points", "2", "-", "half areas", "", "diverged: at t = 1 s (frame 2) NaN"]
    assert by_quantity([other, lost]) == [
        "- 5.1: pieces at the end: 2; here 2; 9 points, half areas: diverged: at t = 1 s"
    ]
    few = [[*other[:3], n, f"reading {n}", "", "differs"] for n in ("2", "2.1", "2.2")]
    assert by_quantity(few) == ["- 5.1: pieces at the end: 2; here 2 to 2.2 (3 readings)"]


def test_the_pages_show_the_numbers_of_the_file(tmp_path):
    """Committed tables are what the command makes from the committed file; one has every row."""
    for name in PAPERS:
        (tmp_path / f"{name}.md").write_text((NUMBERS.parent / f"{name}.md").read_text())
    pages(load(NUMBERS), tmp_path)
    for name in ("printed.csv", *(f"{name}.md" for name in PAPERS)):
        text = (tmp_path / name).read_text()
        assert text == (NUMBERS.parent / name).read_text()
    with (tmp_path / "printed.csv").open() as file:
        assert len(list(csv.reader(file))) == 1 + sum(len(paper.ROWS) for paper in PAPERS.values())


def test_an_unknown_example_is_refused_in_one_line():
    with pytest.raises(InputError, match=r"--only ba\.9: expected the beginning of a key of --list"):
        chosen(["ba.9"])
    assert json.dumps(judged(PAPERS["he"].ROWS[0], {})).endswith('"not run"]')
