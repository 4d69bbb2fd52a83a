"""The documentation: its scenes can be built, and the site has every page."""

import re
import textwrap
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = ("README.md", "docs/guide.md", "docs/tearing.md")
SCENES = [
    (page, code)
    for page in PAGES
    for code in re.findall(r"```python[^\n]*\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)
    if "def build(" in code
]


@pytest.mark.parametrize("page", PAGES)
def test_a_page_that_shows_scenes_has_one(page):
    """Without any, the test below would have nothing to look at."""
    assert [code for name, code in SCENES if name == page]


@pytest.mark.parametrize(
    "code", [code for _, code in SCENES], ids=[f"{page}-{k}" for k, (page, _) in enumerate(SCENES)]
)
def test_scenes_in_the_documentation_can_be_built(code):
    names = {}
    exec(compile(code, "scene", "exec"), names)
    plan = names["build"](points=30).plan("cpu")
    _, launches = plan.split("\nlaunches\n")
    # The header, and a force at least.
    assert len(launches.splitlines()) > 2
    assert re.search(r"^  setup +\w*force", launches, re.MULTILINE)


SHAPES = re.findall(r"```python[^\n]*\n(.*?)```", (ROOT / "docs" / "shapes.md").read_text(), re.DOTALL)


@pytest.mark.parametrize("code", SHAPES, ids=range(len(SHAPES)))
def test_examples_of_shapes_run(code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "shapes", "exec"), {})
    assert sorted(path.name for path in tmp_path.iterdir()) == re.findall(r"[a-z]+\.png", code)


FITS = re.findall(r"```python[^\n]*\n(.*?)```", (ROOT / "docs" / "fitting.md").read_text(), re.DOTALL)


@pytest.mark.parametrize("code", [code for code in FITS if "tearing_energy" not in code])
def test_examples_of_fits_run(code, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(textwrap.dedent(code), "fitting", "exec"), {})
    assert capsys.readouterr().out


@pytest.mark.parametrize(
    "page", ["bending", "bodies", "contact", "joints", "materials", "rubbers", "self-contact", "solvers", "visco"]
)
def test_examples_of_a_page_can_be_built(page):
    if page == "bodies":
        pytest.importorskip("newton", reason="newton, the extra `bodies`, is not installed")
    names = {}
    for code in re.findall(r"```python[^\n]*\n(.*?)```", (ROOT / "docs" / f"{page}.md").read_text(), re.DOTALL):
        exec(compile(textwrap.dedent(code), page, "exec"), names)
    parts = {"bodies": "newton step", "contact": "punch", "self-contact": "SelfContact"}
    parts |= {"solvers": "every V-cycle", "visco": "branches", "rubbers": "damage"}
    parts |= {"bending": "bending_slope", "joints": "Joint", "materials": "bond_materials"}
    assert parts[page] in names["simulation"].plan("cpu")
    if page == "contact":
        assert "settle_contact" in names["indentation"].plan("cpu")
    if page == "solvers":
        assert "TearingEnergy" in names["tear"].plan("cpu")
        assert "every implicit step" in names["relaxing"].plan("cpu")


def test_every_page_is_in_the_navigation():
    named = [line for line in (ROOT / "mkdocs.yml").read_text().splitlines() if not line.strip().startswith("#")]
    pages = {str(path.relative_to(ROOT / "docs")) for path in (ROOT / "docs").rglob("*.md")}
    built = {"gallery.md", "api/kernels.md"}
    assert "index.md" in pages and not built & pages, "the site builds them, tools/site_hooks.py"
    assert pages | built == set(re.findall(r"[\w/-]+\.md", "\n".join(named)))


def test_the_readme_is_short():
    """It is for someone who has ten minutes."""
    assert len((ROOT / "README.md").read_text().split()) < 1000
