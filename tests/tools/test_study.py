"""What the tools share: options, runs of scenes, numbers, sections of pages, errors in one line."""

import argparse
import datetime
import re
import runpy
import sys
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import study

from warp_pd import InputError


@dataclass(frozen=True, eq=False)
class Pressure(study.Case):
    scene: str = "pressure"
    settings: dict = field(default_factory=lambda: {"points": 9, "horizon": 2.015})


def test_provenance_names_device_date_and_commit():
    day = datetime.date.today()
    assert study.provenance("CPU", "abc123") == f"CPU, {day}, commit abc123"
    assert re.fullmatch(rf"CPU, {day}, commit ([0-9a-f]{{7,}}|unknown)", study.provenance("CPU"))


def test_a_study_has_the_options_that_it_asks_for(tmp_path):
    parser = study.study_parser("About.", jobs=1, out=tmp_path / "page.md", only_page=False, commit=None)
    options = parser.parse_args([])
    assert vars(options) == {"jobs": 1, "out": tmp_path / "page.md", "only_page": False, "commit": None}
    assert parser.parse_args(["--out", str(tmp_path)]).out == tmp_path / "page.md", "a folder"
    assert parser.parse_args(["--out", "other.md"]).out == Path("other.md")


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


@pytest.mark.parametrize(("error", "code"), [(InputError("points = 1"), 2), (study.DivergedError("points = 1"), 3)])
def test_wrong_input_and_diverged_runs_end_a_tool_with_one_line(error, code, capsys):
    def main():
        raise error

    with pytest.raises(SystemExit) as ended:
        study.run_tool(main)
    assert ended.value.code == code
    assert capsys.readouterr().err == f"{Path(sys.argv[0]).name}: points = 1\n"


def test_a_run_is_made_once(tmp_path, capsys):
    case = Pressure()
    assert case.name == "pressure-points=9-horizon=2.015"
    options = argparse.Namespace(work=tmp_path, device="cpu", jobs=2, only_page=True)
    study.execute_all([case], options)
    assert case.summary(tmp_path) is None, "--only-page runs nothing"
    options.only_page = False
    study.execute_all([case], options)
    assert capsys.readouterr().out.startswith(f"{case.name}: exit 0")
    summary = case.summary(tmp_path)
    assert (summary["status"], summary["points"], summary["horizon"]) == ("finished", 81, 2.015)
    assert not list((tmp_path / case.name).glob("*.png"))
    study.execute_all([case], options)
    assert capsys.readouterr().out == "", "the run was repeated"


def test_a_run_that_is_refused_leaves_no_summary(tmp_path, capsys):
    case = Pressure(settings={"points": 1})
    study.execute(case, tmp_path, "cpu")
    assert "exit 2 warp-pd: points = 1" in capsys.readouterr().out
    assert case.summary(tmp_path) is None


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_case_gets_its_own_result(jobs):
    assert dict(study.in_processes(divmod, [(7, 2), (9, 4)], jobs)) == {(7, 2): (3, 1), (9, 4): (2, 1)}


def test_rows_are_read_as_they_were_written_in_six_digits(tmp_path):
    path = tmp_path / "more" / "numbers.json"
    assert study.load_rows(path) == []
    study.save_rows(path, [{"name": "a", "value": 1.23456789e-7}, {"name": "b", "settings": {"points": 3}}])
    assert study.load_rows(path) == [
        {"name": "a", "value": 1.23457e-7, "settings": None}, {"name": "b", "value": None, "settings": {"points": 3}}
    ]  # fmt: skip
    assert len(path.read_text().splitlines()) == 5, "a line for each row"


def test_a_renewed_section_leaves_the_others_as_they_are(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Title\n\nText.\n\n## Numbers\n\nold\n\n## Numbers, more\n\nkept\n")
    study.renew(page, {"## Numbers": ["new", "line"], "## Last": study.table(["a", "b"], [["1", "2"]])})
    wanted = (
        "# Title\n\nText.\n\n## Numbers\n\nnew\nline\n\n## Numbers, more\n\nkept\n\n## Last\n\n| a | b |\n|---|---|\n"
    )
    assert page.read_text() == wanted + "| 1 | 2 |\n"
    study.renew(page, {"## Last": ["at the end"]})
    assert page.read_text().endswith("kept\n\n## Last\n\nat the end\n")


def test_every_tool_says_what_it_does(capsys, monkeypatch):
    """Each has a command line of its own; none ends with a traceback. The patch is the command line."""
    monkeypatch.setattr(sys, "argv", ["tool", "--help"])
    tools = Path(study.__file__).parent
    scripts = [p for p in tools.glob("*.py") if "study_parser" in p.read_text() and p.stem != "study"]
    scripts.append(tools / "references")
    assert len(scripts) > 10
    for script in scripts:
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(str(script), run_name="__main__")
        assert ended.value.code == 0, script.name
        assert capsys.readouterr().out.startswith("usage:"), script.name


def test_a_section_of_a_scene_has_its_numbers_beside_their_references():
    import scenes

    measure = {"value": 0.5, "unit": "m", "of": "last frame", "reference": 0.4, "source": "elements", "error": 0.25}
    summary = {
        "points": 9, "horizon": 2.015, "weights": "plain", "precision": 64, "steps": 3, "wall_s": 2.0,
        "compile_s": 0.5, "status": "finished", "message": "", "device": "CPU",
        "date": "2026-11-22T10:00:00", "measures": {"deflection": measure},
    }  # fmt: skip
    text = "\n".join(scenes.section(scenes.SCENES[0], summary))
    assert "`warp-pd run tension --set points=101`: 9 points" in text
    assert "| deflection | last frame | 0.5 m | 0.4 (elements) | +25.000 % |" in text
    assert "3 steps in 1.5 s (and 0.5 s of compilation); finished, on CPU, 2026-11-22" in text


def test_every_scene_is_on_a_page():
    import scenes

    assert {case.scene for cases in scenes.PAGES.values() for case in cases} == set(study.scene_names())
