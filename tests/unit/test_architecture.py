"""What docs/architecture.md says of the package, held against the package."""

import importlib
import inspect
import operator
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from helpers import build, square

import warp_pd
from warp_pd import interfaces
from warp_pd._renamed import RENAMED
from warp_pd.phases import STEP

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "warp_pd"
PAGE = (ROOT / "docs" / "architecture.md").read_text()


def table(heading):
    """Rows of the first table under a heading: the cells of each."""
    text = PAGE[PAGE.index(f"## {heading}\n") :]
    rows = re.findall(r"^\| (.*) \|$", text[: text.index("\n## ", 3)], re.MULTILINE)
    return [row.split(" | ") for row in rows[1:]]


def layers():
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    rows = next(c for c in contracts if c["type"] == "layers")["layers"]
    return [name.strip().removeprefix("warp_pd.") for row in rows for name in row.split("|")]


def test_table_of_layers_is_the_contract():
    named = [cells[0].strip("`") for cells in table("Layers")]
    assert named == [name for name in layers() if not name.startswith("_")]


def test_contract_knows_every_module():
    found = {path.stem for path in PACKAGE.glob("*.py")} | {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    # The package itself, the finder of old names, and parts of `sheet`.
    assert found - {"__init__", "_moved", "triangulation"} == set(layers()) - {"scenes", "kernels"}


def test_table_of_phases_is_the_step():
    assert [(name.strip("`"), text) for name, text in table("The step")] == [(p.name, p.value) for p in STEP]


def test_picture_of_the_layers_is_up_to_date():
    done = subprocess.run(
        [sys.executable, ROOT / "tools" / "draw_layers.py", "--check"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_sizes_of_files():
    lines = {path: len(path.read_text().splitlines()) for path in PACKAGE.rglob("*.py")}
    assert len(lines) > 90
    assert {path.name: n for path, n in lines.items() if n > 400} == {}
    assert lines[PACKAGE / "built.py"] < 200


def test_kernels_import_warp_alone():
    for path in (ROOT / "kernels").glob("*.py"):
        imported = set(re.findall(r"^(?:import|from) (\w+)", path.read_text(), re.MULTILINE))
        assert imported <= {
            "__future__",
            "collections",
            "dataclasses",
            "functools",
            "inspect",
            "math",
            "typing",
            "warp",
        }, path


def test_interfaces_say_what_they_take():
    """Few `Any` in the protocols, and no question for a type outside the checks of a scene."""
    lines = [line for path in (PACKAGE / "interfaces").glob("*.py") for line in path.read_text().splitlines()]
    uses = [word for line in lines if "import" not in line for word in re.findall(r"\bAny\b", line)]
    assert 0 < len(uses) < 20


def test_nobody_asks_for_the_type_of_a_part():
    folders = ("warp_pd.parts", "warp_pd.laws", "warp_pd.solvers")
    offered = [getattr(warp_pd, name) for name in warp_pd.__all__]
    classes = [value for value in offered if inspect.isclass(value)]
    parts = {value.__name__ for value in classes if value.__module__.startswith(folders)} | set(interfaces.__all__)
    assert {"Pressure", "BondAssociated", "Newton", "BuiltLaw"} <= parts
    # A scene compares what a user passed in with the protocols, and the command line what a file returned.
    for path in PACKAGE.rglob("*.py"):
        if path.name in ("scene.py", "cli.py"):
            continue
        for kind in re.findall(r"isinstance\([^,()]+, \(?([\w., |]+)\)", path.read_text()):
            named = {word.strip() for word in re.split(r"[,|]", kind)}
            ours = named & parts
            defined = {word for word in ours if f"class {word}" in path.read_text()}
            assert ours == defined, f"{path}: isinstance(..., {kind})"


@pytest.mark.parametrize("package", ["warp_pd", "warp_pd.laws", "warp_pd.solvers"])
def test_packages_offer_what_they_say(package):
    """Names are imported on first use, each from the module that has it."""
    module = importlib.import_module(package)
    assert module.__all__
    for name in module.__all__:
        assert getattr(module, name) is not None
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'nothing'"):
        _ = module.nothing


def test_import_waits_for_nothing_else():
    code = "import sys, warp_pd; sys.exit(int('warp' in sys.modules or 'numpy' in sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_old_names_of_modules_work_with_a_warning(tmp_path):
    """In a process of its own: a module is imported once."""
    script = tmp_path / "old_names.py"
    script.write_text(
        "import importlib, warnings\n"
        "import warp_pd\n"
        "from warp_pd._moved import MOVED\n"
        "with warnings.catch_warnings(record=True) as caught:\n"
        "    warnings.simplefilter('always')\n"
        "    for old in MOVED:\n"
        "        importlib.import_module(old)\n"
        "said = [str(w.message) for w in caught if w.category is FutureWarning]\n"
        "missing = [old for old in MOVED if not any(text.startswith(f'{old} has moved to') for text in said)]\n"
        "assert MOVED and not missing, missing\n"
        "from warp_pd.loads import Pressure\n"
        "assert Pressure is warp_pd.Pressure\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_old_names_of_attributes_work_with_a_warning():
    built = build(square(7))
    for old, new in RENAMED.items():
        if old in ("damage", "intact", "strain_energy"):
            continue
        with pytest.warns(FutureWarning, match=f"^{old} is .*called {new}"):
            found = getattr(built, old)
        assert found is operator.attrgetter(new)(built)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = built.nothing


def test_pages_of_this_kind_are_in_the_navigation():
    navigation = (ROOT / "mkdocs.yml").read_text()
    assert "architecture.md" in navigation
    assert "write-your-own-part.md" in navigation
