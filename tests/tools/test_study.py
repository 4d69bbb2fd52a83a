"""What the tools share: options, runs of scenes, page headers, errors in one line."""

import argparse
import datetime
import json
import re
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import study

from warp_pd import InputError
from warp_pd.run.divergence import DivergedError


@dataclass(frozen=True, eq=False)
class Pressure(study.Case):
    scene: str = "pressure"
    settings: dict = field(default_factory=lambda: {"points": 9, "horizon": 2.015})


def test_the_header_of_a_page_says_where_and_when(monkeypatch):
    day = datetime.date.today()
    assert study.page_header("scenes.py", "CPU", "abc123") == f"Made by `tools/scenes.py` on CPU, {day}, commit abc123."
    monkeypatch.setattr(study, "ROOT", Path("/"))
    assert study.provenance("CPU").endswith("commit unknown")


def test_a_commit_is_that_of_the_checkout(tmp_path, monkeypatch):
    git = ["git", "-c", "user.name=a", "-c", "user.email=a@b"]
    subprocess.run([*git, "init", "--quiet"], cwd=tmp_path, check=True)
    subprocess.run([*git, "commit", "--quiet", "--allow-empty", "-m", "first"], cwd=tmp_path, check=True)
    monkeypatch.setattr(study, "ROOT", tmp_path)
    assert re.fullmatch(r"[0-9a-f]{7,}", study.current_commit())


def test_a_study_has_the_options_that_it_asks_for(tmp_path):
    parser = study.study_parser("About.", jobs=1, out=tmp_path / "page.md", only_page=False, commit=None)
    options = parser.parse_args([])
    assert vars(options) == {"jobs": 1, "out": tmp_path / "page.md", "only_page": False, "commit": None}
    assert parser.parse_args(["--out", str(tmp_path)]).out == tmp_path / "page.md", "a folder"
    assert parser.parse_args(["--out", "other.md"]).out == Path("other.md")


def test_older_names_of_options_work_and_are_not_shown():
    parser = study.study_parser(None, only_page=False, commit=None)
    options = parser.parse_args(["--stand", "abc", "--page-only"])
    assert (options.commit, options.only_page) == ("abc", True)
    assert parser.parse_args(["--commit", "abc"]).commit == "abc"
    assert "--commit" in parser.format_help()
    assert not re.search("--stand|--page-only", parser.format_help())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--jobs", "0"], "'0': expected a whole number of 1 or more"),
        (["--jobs", "1.5"], "'1.5': expected a whole number of 1 or more"),
        (["--device", "abacus"], "device = 'abacus': expected one of 'cpu'"),
    ],
)
def test_wrong_options_are_refused_in_one_line(arguments, said, capsys):
    with pytest.raises(SystemExit):
        study.study_parser(None, jobs=1, device="cpu").parse_args(arguments)
    assert said in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize(("error", "code"), [(InputError("points = 1"), 2), (DivergedError("points = 1"), 3)])
def test_wrong_input_and_diverged_runs_end_a_tool_with_one_line(error, code, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["tools/some.py"])

    def main():
        raise error

    with pytest.raises(SystemExit) as ended:
        study.run_tool(main)
    assert ended.value.code == code
    assert capsys.readouterr().err == "some.py: points = 1\n"


def test_a_run_is_made_once(tmp_path, capsys):
    case = Pressure()
    assert case.name == "pressure-points=9-horizon=2.015"
    assert case.summary(tmp_path) is None
    options = argparse.Namespace(work=tmp_path, device="cpu", jobs=2, only_page=True)
    study.execute_all([case], options)
    assert case.summary(tmp_path) is None, "--only-page runs nothing"
    options.only_page = False
    study.execute_all([case], options)
    assert capsys.readouterr().out.startswith(f"{case.name}: exit 0")
    summary = case.summary(tmp_path)
    assert (summary["status"], summary["points"], summary["horizon"]) == ("finished", 81, 2.015)
    assert study.devices_of([summary, None]) == "CPU"
    assert not list((tmp_path / case.name).glob("*.png"))
    study.execute_all([case], options)
    assert capsys.readouterr().out == "", "the run was repeated"


def test_a_run_that_is_refused_leaves_no_summary(tmp_path, capsys):
    case = Pressure(settings={"points": 1})
    study.execute(case, tmp_path, "cpu")
    assert "exit 2 warp-pd: points = 1" in capsys.readouterr().out
    assert case.summary(tmp_path) is None
    assert study.devices_of([None], "the device") == "the device"


def test_tables_and_paragraphs():
    assert study.table(["a", "b"], [["1", "2"]]) == ["| a | b |", "|---|---|", "| 1 | 2 |"]
    lines = study.paragraph("word " * 50)
    assert lines[-1] == ""
    assert all(len(line) <= 120 for line in lines)
    assert " ".join(lines[:-1]) == ("word " * 50).strip()


def test_every_tool_says_what_it_does(capsys):
    """Each has a command line of its own; none ends with a traceback."""
    tools = Path(study.__file__).parent
    scripts = [p for p in tools.glob("*.py") if "study_parser" in p.read_text() and p.stem != "study"]
    scripts += [p.parent for p in tools.glob("*/__main__.py")]
    assert len(scripts) > 10
    for script in scripts:
        done = subprocess.run([sys.executable, str(script), "--help"], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout[:6]) == (0, "usage:"), f"{script.name}: {done.stderr}"


def test_results_of_a_table_of_scenes_are_markdown(tmp_path):
    """One section for a run that exists, one for a run that does not."""
    import scenes

    folder = tmp_path / scenes.CASES[0].name
    folder.mkdir()
    measure = {"value": 0.5, "unit": "m", "of": "last frame", "reference": 0.4, "source": "elements", "error": 0.25}
    summary = {
        "points": 9, "horizon": 2.015, "weights": "plain", "precision": 64, "steps": 3, "wall_s": 2.0,
        "compile_s": 0.5, "status": "finished", "message": "", "device": "CPU",
        "date": "2026-11-22T10:00:00", "measures": {"deflection": measure},
    }  # fmt: skip
    (folder / "summary.json").write_text(json.dumps(summary))
    text = scenes.page(tmp_path, "here")
    assert "| deflection | last frame | 0.5 m | 0.4 (elements) | +25.000 % |" in text
    assert "3 steps in 1.5 s (and 0.5 s of compilation); finished, on CPU, 2026-11-22" in text
    assert text.count("Not run.") == len(scenes.CASES) - 1
    # Without the run, the section stays.
    (folder / "summary.json").unlink()
    assert scenes.page(tmp_path, "there", text) == text
