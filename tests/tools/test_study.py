"""What the tools share: options, numbers, sections of pages, errors in one line."""

import runpy
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import study

from warp_pd import InputError
from warp_pd.interfaces.solver import FINISHED, STOPPED


@pytest.mark.parametrize(("error", "code"), [(InputError("points = 1"), 2), (study.DivergedError("points = 1"), 3)])
def test_wrong_input_and_diverged_runs_end_a_tool_with_one_line(error, code, capsys):
    def main():
        raise error

    with pytest.raises(SystemExit) as ended:
        study.run_tool(main)
    assert ended.value.code == code
    assert capsys.readouterr().err == f"{Path(sys.argv[0]).name}: points = 1\n"


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
    scripts += [p.parent for p in tools.glob("*/__main__.py")]
    assert len(scripts) > 10
    for script in scripts:
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(str(script), run_name="__main__")
        assert ended.value.code == 0, script.name
        assert capsys.readouterr().out.startswith("usage:"), script.name


def test_an_interrupted_run_leaves_no_number(capsys):
    """The numbers of a run so far, when SIGTERM or Ctrl-C ends it, are not those of the run."""
    whole, part = (SimpleNamespace(status=status) for status in (FINISHED, STOPPED))
    assert study.whole(whole) is whole
    with pytest.raises(SystemExit) as caught:
        study.run_tool(lambda: study.whole(part))
    assert caught.value.code == 130
    assert "interrupted; what ended before is kept" in capsys.readouterr().err
