"""What the pages cite exists: files, commands, scenes and their arguments; and the site has no dead link."""

import ast
import inspect
import re
import shlex
import subprocess
import sys
from pathlib import Path

import click
import pytest

import warp_pd
from warp_pd import fitting, measures
from warp_pd.__main__ import _assigned, main
from warp_pd.command.arguments import split_values
from warp_pd.command.scene_files import load_scene, require_settings, scene_names
from warp_pd.run.result import Result

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]
FOLDERS = "tools|tests|scenes|kernels|warp_pd|docs"
# Options of a scene's arguments.
ARGUMENTS = ("points", "horizon", "force", "weights", "solver", "duration", "frames")
# Words of a command that stand for something of the reader's.
PLACEHOLDERS = re.compile(r"^[A-Z]+$|\.\.\.|\|")


def cited_files(text):
    """Paths of files and folders of the checkout."""
    return set(re.findall(rf"(?<![\w/.-])((?:{FOLDERS})/[\w./-]*\w)", text))


def commands(text):
    """Calls of warp-pd in code spans and code blocks, without comments."""
    spans = re.findall(r"`((?:warp-pd|tools/start\.sh) [^`]*)`", text)
    lines = re.findall(r"^\s*(?:\$ )?((?:warp-pd|tools/start\.sh run|tools/start\.sh plan) .*)$", text, re.MULTILINE)
    for command in spans + lines:
        yield re.split(r" {2,}[#a-z]| # ", re.sub(r"\s*\n\s*", " ", command))[0].strip()


def problem(command, text):
    """What is wrong with a command of a page with that text, or None."""
    name, *words = [*shlex.split(command)[1:], ""][:-1] or ["test"]
    if name in ("test", "docs") or name.startswith("-") or PLACEHOLDERS.search(name):
        return None
    if name not in main.commands:
        return f"no command {name!r}"
    if not words or any(PLACEHOLDERS.search(word) or word in ("--help", "-h") for word in words):
        return None
    try:
        # A command keeps the help options of its first context, which are those of the group.
        context = main.commands[name].make_context(name, words, parent=click.Context(main, **main.context_settings))
    except click.ClickException as error:
        return error.format_message()
    return problem_of_scene(context, name == "sweep", text) if name in ("run", "sweep", "plan") else None


def problem_of_scene(context, sweeps, text):
    """What is wrong with the scene of a command and its arguments, or None."""
    scene = context.params["scene"]
    given = {key: context.params[key] for key in ARGUMENTS if context.params.get(key) is not None}
    given |= _assigned(context.params["assignments"], given)
    missing = known(scene, text)
    if missing or scene.endswith(".py"):
        return missing
    parameters = inspect.signature(load_scene(scene).build).parameters
    wrong = [key for key in given if key not in parameters]
    if wrong:
        return f"{scene} has no argument {', '.join(wrong)}"
    for key, value in given.items():
        for each in split_values(value) if sweeps else [value]:
            require_settings(scene, {key: each})
    return None


def known(scene, text):
    """None for a scene of the package, or a file that the page shows."""
    shown = scene.endswith(".py") and scene in text
    return None if shown or scene in scene_names() else f"no scene {scene!r}"


def test_citations_are_found():
    """The tests below would have nothing to look at."""
    text = "".join(page.read_text() for page in PAGES)
    assert len(cited_files(text)) > 50 and len(list(commands(text))) > 100
    assert problem("warp-pd run no_such_scene", "") == "no scene 'no_such_scene'"
    assert problem("warp-pd run tension --set no_such=1", "") == "tension has no argument no_such"
    assert problem("warp-pd fly tension", "") == "no command 'fly'"
    assert "no such option" in problem("warp-pd run tension --no-such 1", "").lower()


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_cited_files_exist(page):
    found = [ROOT / name for name in cited_files(page.read_text())]
    missing = [str(p.relative_to(ROOT)) for p in found if not (p.exists() or p.with_suffix(".py").exists())]
    assert not missing


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_cited_tools_are_there(page):
    """As `python tools/NAME` or `python -m tools.NAME`, which a path with a dot is not."""
    text = page.read_text()
    named = {*re.findall(r"-m tools\.(\w+)", text), *re.findall(r"python tools/(\w+)", text)}
    assert not [name for name in named if not [*(ROOT / "tools").glob(f"{name}.*"), *(ROOT / "tools").glob(name)]]


def options_of_tools(text):
    """Names of tools of the checkout, and an option that a page gives them."""
    for name, rest in re.findall(r"(?:python (?:-m )?)?tools[/.](\w+)(?:\.py)?([^`]*)`", text):
        yield from ((name, option) for option in re.findall(r"--[a-z-]+", rest))


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_cited_tools_have_these_options(page):
    for name, option in options_of_tools(page.read_text()):
        files = [
            *(ROOT / "tools").glob(f"{name}.*"),
            *(ROOT / "tools" / name).glob("*.py"),
            ROOT / "tools" / "study.py",
        ]
        words = "".join(path.read_text() for path in files)
        # The parser of the studies makes options from names.
        assert option in words or re.search(rf"\b{option[2:].replace('-', '_')}\b", words), (name, option)


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_no_number_is_of_a_tool_that_is_gone(page):
    """A reader cannot make it again."""
    words = re.sub(r"\s+", " ", page.read_text())
    gone = r".{40}(?:last in (?:commit )?[0-9a-f]{7}|with the tool of commit|tool (?:that )?has been removed).{20}"
    assert not re.findall(gone, words)


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_pages_name_no_commit(page):
    """A number is of a command, a device and a date."""
    assert not re.findall(r"\b(?=[a-f]*\d)(?=\d*[a-f])[0-9a-f]{7,10}\b", page.read_text())


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_cited_commands_have_these_arguments(page):
    text = page.read_text()
    wrong = {command: why for command in commands(text) if (why := problem(command, text))}
    assert not wrong


def named_in_code(text):
    """Files of the checkout, and modules and what they hold, that docstrings and comments name."""
    yield from re.findall(rf"(?<![\w/.])((?:{FOLDERS})/[\w/.-]+\.(?:py|md|json|csv))", text)
    for dotted in re.findall(r"`(?:warp_pd\.)?((?:kernels|warp_pd)(?:\.\w+)+)(?:\([^`]*\))?`", text):
        yield from [dotted.replace(".", "/")]


def is_there(name):
    """Whether a file is there, or a folder or module that holds the rest of a dotted name."""
    path, rest = ROOT / name, ""
    while not (path.exists() or path.with_suffix(".py").is_file()):
        path, rest = path.parent, path.name
    source = (
        path
        if path.is_file()
        else path.with_suffix(".py")
        if path.with_suffix(".py").is_file()
        else path / "__init__.py"
    )
    return not rest or (path != ROOT and source.is_file() and rest in source.read_text())


def test_code_names_what_is_there():
    files = [path for folder in ("warp_pd", "kernels", "scenes", "tools") for path in (ROOT / folder).rglob("*.py")]
    named = {(path.name, name) for path in files for name in named_in_code(path.read_text())}
    assert len(named) > 100
    assert not [(path, name) for path, name in sorted(named) if not is_there(name)]


def test_every_picture_and_table_is_on_a_page():
    """Of those beside the pages; tools and tests read some tables."""
    text = "".join(p.read_text() for p in [*PAGES, *(ROOT / "tools").rglob("*.py"), *(ROOT / "tests").rglob("*.py")])
    beside = [p for p in (ROOT / "docs").rglob("*") if p.suffix in (".png", ".json") and p.parent.name != "gallery"]
    assert beside and [p.name for p in beside if p.name not in text] == []


def test_the_site_has_no_dead_link(tmp_path):
    pytest.importorskip("mkdocs", reason="mkdocs, of the extra `test`, is not installed")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", tmp_path / "site"], cwd=ROOT,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    warnings = [line for line in (done.stdout + done.stderr).splitlines() if line.startswith(("WARNING", "ERROR"))]
    assert done.returncode == 0 and not warnings, warnings
    assert (tmp_path / "site" / "index.html").is_file()


def called(call):
    """What a call of a page calls, if its name is public or belongs to a sheet, a scene or its result; or None."""
    if isinstance(call.func, ast.Name):
        found = (getattr(module, call.func.id, None) for module in (warp_pd, measures, fitting))
        return next(filter(callable, found), None)
    owners = (warp_pd.Sheet, warp_pd.Simulation, warp_pd.BodyPath, warp_pd.TriangleMesh, Result)
    names = {owner.__name__.lower(): owner for owner in owners}
    if not isinstance(call.func, ast.Attribute) or not isinstance(call.func.value, ast.Name):
        return None
    owner = names.get(call.func.value.id.lower(), warp_pd.Sheet)
    return inspect.getattr_static(owner, call.func.attr, None)


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_cited_calls_have_these_arguments(page):
    """Calls in code spans, such as `Pressure(value, follower=True)`; those of blocks run."""
    text, wrong = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL), []
    for span in re.findall(r"`([^`]*\([^`]*)`", text):
        source = re.sub(r"=(?=[,)])", "=0", " ".join(span.split()))
        try:
            tree = ast.parse("sheet" * source.startswith(".") + source)
        except SyntaxError:
            continue
        for call in ast.walk(tree):
            if not isinstance(call, ast.Call) or (function := called(call)) is None:
                continue
            method = not isinstance(function, type | staticmethod) and isinstance(call.func, ast.Attribute)
            places = [0] * (method + sum(ast.unparse(place) != "..." for place in call.args))
            words = {keyword.arg: 0 for keyword in call.keywords if keyword.arg}
            try:
                inspect.signature(getattr(function, "__func__", function)).bind_partial(*places, **words)
            except TypeError as error:
                wrong.append(f"{span}: {error}")
    assert not wrong
