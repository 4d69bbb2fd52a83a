"""Every command and every code block of README and guide runs, in the order of the page, in one folder per page."""

import re
import shlex
from pathlib import Path

import pytest
from small_runs import cli

ROOT = Path(__file__).parents[2]
PAGES = ("README.md", "docs/guide.md")
PAGES_OF_COMMANDS = (*PAGES, "docs/tearing.md", "docs/viewing.md")
# What is too large for a test, and what runs in its place: the same options with smaller values.
SMALLER = {
    "run ball_penetration": "run ball_penetration --points 15 --horizon 2.015 --duration 0.2 --frames 4",
    "run ball_penetration --points 51": "run ball_penetration --points 15 --horizon 2.015 --duration 0.2 --frames 4",
    "run my_scene.py --points 61": "run my_scene.py --points 15 --set duration=0.1",
    "sweep ball_penetration --points 41 --set tearing_energy=4,8,16": (
        "sweep ball_penetration --points 13 --duration 0.05 --set tearing_energy=4,8,16"
    ),
    "run tear.py --points 40": "run tear.py --points 24 --duration 0.05",
    "run pressure --points 31 --solver explicit --quiet": "run pressure --points 11 --solver explicit --quiet",
    "run pressure --points 31 --solver relaxation": "run pressure --points 15 --solver relaxation",
    "plan pressure --points 31": "plan pressure --points 15",
}
# Lines that are not warp-pd, and the file that each needs.
OTHERS = {
    "xdg-open runs/ball_penetration/view.html": "warp_pd/viewer/view.py",
    "source .venv/bin/activate": "tools/start.sh",
}


def blocks(page):
    """Kind, title and text of the code blocks of a page."""
    found = re.findall(
        r"^```(\w+)(?: title=\"(.*?)\")?\n(.*?)^```", (ROOT / page).read_text(), re.DOTALL | re.MULTILINE
    )
    return [(kind, title, text) for kind, title, text in found]


def steps(page):
    """What a reader does with a page: files to save, Python to run, commands."""
    for kind, title, text in blocks(page):
        if kind == "bash":
            for line in text.splitlines():
                command = line.split("  #")[0].split(" # ")[0].strip()
                if command:
                    yield "command", command
        elif kind == "python":
            yield ("save" if title.endswith(".py") else "python"), f"{title}\n{text}"


STEPS = [(page, kind, text) for page in PAGES_OF_COMMANDS for kind, text in steps(page)]


def test_pages_have_what_is_looked_for():
    for page in PAGES:
        kinds = [kind for name, kind, _ in STEPS if name == page]
        assert kinds.count("save") >= 1 and kinds.count("command") >= 5
    commands = {
        text.removeprefix("tools/start.sh ").removeprefix("warp-pd ") for _, kind, text in STEPS if kind == "command"
    }
    assert set(SMALLER) <= commands, "a command that no page has any more"


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A folder for each page, with the files that the page has shown so far."""
    return {page: tmp_path_factory.mktemp("page") for page in PAGES_OF_COMMANDS}


@pytest.mark.parametrize(
    ("page", "kind", "text"), STEPS, ids=[f"{page}-{kind}-{text.splitlines()[0]}" for page, kind, text in STEPS]
)
def test_pages_run(page, kind, text, folders, monkeypatch, default_pictures):
    monkeypatch.chdir(folders[page])
    if kind == "save":
        name, code = text.split("\n", 1)
        Path(name).write_text(code, encoding="utf-8")
    elif kind == "python":
        monkeypatch.syspath_prepend(str(folders[page]))
        exec(compile(text.split("\n", 1)[1], "page", "exec"), {"__name__": "page"})
    elif text in OTHERS:
        assert (ROOT / OTHERS[text]).is_file()
    else:
        start, command = re.fullmatch(r"(warp-pd|tools/start\.sh) (.*)", text).groups()
        done = cli(*shlex.split(SMALLER.get(command, command)))
        assert done.exit_code == 0, f"{start}: {done.output}"
