"""What the tools share: options, runs of scenes, numbers, sections of pages, errors in one line."""

import argparse
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
