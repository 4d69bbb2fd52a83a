"""What docs/architecture.md says of the package, held against the package."""

import ast
import collections
import contextlib
import graphlib
import importlib
import inspect
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import warp_pd
from warp_pd import interfaces, step
from warp_pd.step import Phase

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "warp_pd"
KERNELS = ROOT / "kernels"
PAGE = (ROOT / "docs" / "architecture.md").read_text()


def tables(heading):
    """Tables under a heading: rows of the cells of each."""
    text = PAGE[PAGE.index(f"## {heading}\n") :]
    found = re.findall(r"(?:^\| .* \|$\n)\|[-|]+\|\n((?:^\| .* \|$\n)+)", text[: text.index("\n## ", 3)], re.MULTILINE)
    return [[row.strip("| ").split(" | ") for row in rows.splitlines()] for rows in found]


def contracts():
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]


def layers():
    rows = next(c for c in contracts() if c["type"] == "layers")["layers"]
    return [name.strip().removeprefix("warp_pd.") for row in rows for name in row.split("|")]


def subjects():
    named = next(c for c in contracts() if c["name"] == "The core names no subject")["forbidden_modules"]
    return [name.removeprefix("warp_pd.") for name in named]


def test_tables_of_core_and_subjects_are_the_contracts():
    core, beside = [[cells[0].strip("`") for cells in rows] for rows in tables("Core and subjects")]
    assert core == layers()
    assert sorted(beside) == sorted(subjects())


def test_contracts_know_every_module():
    found = {path.stem for path in PACKAGE.glob("*.py")} | {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert found - {"__init__"} == {*layers(), *subjects()} - {"scenes", "kernels"}
    assert {path.parent.name for path in KERNELS.glob("*/__init__.py")} <= set(subjects())
    tested = {path.name for path in (ROOT / "tests").iterdir() if list(path.glob("test_*.py"))}
    assert tested - {"core", "gpu", "scenes", "tools"} <= set(subjects())


def imports_of(name, path, modules):
    """Modules of the package that a module imports anywhere: at the top, in functions, for types."""
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            above = package.rsplit(".", node.level - 1)[0] if node.level else ""
            source = ".".join(filter(None, (above, node.module)))
            named = (f"{source}.{alias.name}" for alias in node.names)
            yield from (each if each in modules else source for each in named)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def package_of(name):
    """A folder of the package, or a subject of the kernels."""
    parts = name.split(".")
    return ".".join(parts[1:3] if parts[1:2] == ["kernels"] and len(parts) > 3 else parts[1:2])


def test_no_circle_of_imports_counting_those_in_functions_and_for_types():
    """So the package can be read in one order: what is built comes before the part of a scene that builds it."""
    folders = {"": PACKAGE, ".kernels": KERNELS, ".scenes": ROOT / "scenes"}
    modules = {
        f"warp_pd{at}" + "".join(f".{part}" for part in path.relative_to(folder).with_suffix("").parts): path
        for at, folder in folders.items()
        for path in folder.rglob("*.py")
    }
    modules = {name.removesuffix(".__init__"): path for name, path in modules.items()}
    graph = {name: {*imports_of(name, path, modules)} & {*modules} - {name} for name, path in modules.items()}
    assert sum(map(len, graph.values())) > 1500
    packages = collections.defaultdict(set)
    for name, imported in graph.items():
        for other in imported - {"warp_pd"}:
            packages[package_of(name)] |= {package_of(other)} - {package_of(name)}
    for nodes in (graph, packages):
        try:
            graphlib.TopologicalSorter(nodes).prepare()
        except graphlib.CycleError as error:
            pytest.fail(" -> ".join(reversed(error.args[1])))


def test_every_phase_has_a_place_in_the_step():
    """Each in explicit dynamics or outside the step, and a solver without it refuses parts that act in it."""
    inside = [phase for phase in Phase if phase not in (Phase.START, Phase.RESTORE, Phase.SCHEDULES, Phase.FRAME)]
    assert phases_of(step.explicit_step) == inside
    elsewhere = {Phase.RUPTURE}
    assert phases_of(step.relaxation_step) == [p for p in inside if p not in {*step.NOT_IN_RELAXATION, *elsewhere}]


def phases_of(order):
    """The phases of a step, in order."""

    class Listing:
        def add(self, phase, stage):
            stage.append(phase)

    class Phases(list):
        leads = contextlib.nullcontext

        def one_launch(self, and_next=False):
            return contextlib.nullcontext()

    order(Listing(), found := Phases())
    return found


def test_no_file_is_longer_than_its_subject_may_be():
    lines = {path: len(path.read_text().splitlines()) for path in [*PACKAGE.rglob("*.py"), *KERNELS.rglob("*.py")]}
    assert len(lines) > 90
    assert {path.name: n for path, n in lines.items() if n > 600} == {}


def test_kernels_of_the_core_use_none_of_a_subject():
    of_subjects = re.compile(rf"^from \.({'|'.join(subjects())})\b", re.MULTILINE)
    assert not [path.name for path in KERNELS.glob("*.py") if of_subjects.search(path.read_text())]
    named = next(c for c in contracts() if c["name"] == "The core uses no kernel of a subject")["forbidden_modules"]
    assert sorted(named) == sorted(f"warp_pd.kernels.{p.parent.name}" for p in KERNELS.glob("*/__init__.py"))


def test_kernels_import_warp_alone():
    for path in KERNELS.rglob("*.py"):
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
    protocols = [PACKAGE / "interfaces" / f"{name}.py" for name in ("built_part", "frame", "law", "part", "solver")]
    lines = [line for path in protocols for line in path.read_text().splitlines()]
    uses = [word for line in lines if "import" not in line for word in re.findall(r"\bAny\b", line)]
    assert 0 < len(uses) < 20


def test_nobody_asks_for_the_type_of_a_part():
    folders = ("warp_pd.parts", "warp_pd.laws", "warp_pd.solvers", *(f"warp_pd.{name}" for name in subjects()))
    offered = [getattr(warp_pd, name) for name in warp_pd.__all__]
    classes = [value for value in offered if inspect.isclass(value) and hasattr(value, "build")]
    parts = {value.__name__ for value in classes if value.__module__.startswith(folders)} | set(interfaces.__all__)
    assert {"Pressure", "BondAssociated", "Newton", "BuiltLaw"} <= parts
    # A scene compares what a user passed in with the protocols, and the command line what a file returned.
    for path in PACKAGE.rglob("*.py"):
        if path.name in ("scene.py", "__main__.py"):
            continue
        for kind in re.findall(r"isinstance\([^,()]+, \(?([\w., |]+)\)", path.read_text()):
            named = {word.strip() for word in re.split(r"[,|]", kind)}
            ours = named & parts
            defined = {word for word in ours if f"class {word}" in path.read_text()}
            assert ours == defined, f"{path}: isinstance(..., {kind})"


OFFERING = ("parts", "interfaces", "contact", "gas", "papers", "tearing")


@pytest.mark.parametrize("package", ["warp_pd", *(f"warp_pd.{name}" for name in OFFERING)])
def test_packages_offer_what_they_say(package):
    """Names are imported on first use, each from the module that has it."""
    module = importlib.import_module(package)
    assert module.__all__
    for name in module.__all__:
        assert getattr(module, name) is not None
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'nothing'") as raised:
        _ = module.nothing
    assert raised.value.obj is module and raised.value.name == "nothing", "Python suggests names"


def test_a_module_of_the_pages_keeps_the_names_of_the_package():
    """`from warp_pd import *` and then `from warp_pd.measures import *` leave `Sheet` what it was."""
    texts = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "scenes").glob("*.py")]
    modules = {found for text in texts for found in re.findall(r"from (warp_pd\.\w+) import", text.read_text())}
    assert "warp_pd.measures" in modules
    for name in sorted(modules):
        module: dict[str, object] = {}
        exec(f"from {name} import *", module)
        changed = [n for n in module if n in warp_pd.__all__ and module[n] is not getattr(warp_pd, n)]
        assert not changed, f"{name}: {changed}"


def test_import_waits_for_nothing_else():
    """Names that were not used yet are listed, so that shells complete them."""
    code = (
        "import sys, warp_pd; assert set(warp_pd.__all__) <= set(dir(warp_pd)); "
        "sys.exit(int('warp' in sys.modules or 'numpy' in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# What is known to be wrong without a scene: its import takes Warp, and with it most of the half second of a refusal.
WITHOUT_WARP = [
    "run needles", "plan needles", "sweep needles --points 9", "fit needles good.csv --vary mu", "draw nowhere",
    "draw pressure --shape --set presure=1", "view nowhere", "info nowhere", "run pressure --device gpu",
    "run pressure --precision 16", "sweep pressure --set presure=1,2", "sweep pressure --points 9,x",
    "sweep pressure --points 9 --device gpu", "bench --points 1", "bench --horizon 0", "bench --precision 16",
    "fit pressure missing.csv --vary pressure", "fit pressure good.csv --vary presure", "fit pressure good.csv --vary=",
    "fit pressure good.csv --vary pressure --bounds horizon=1:2", "fit pressure good.csv --vary pressure --set mu=1",
    "run dropped_ball --points 2",
]  # fmt: skip


def test_wrong_input_is_refused_before_warp_is_imported(tmp_path):
    (tmp_path / "good.csv").write_text("pressure [Pa],center_deflection [m]\n1,0.001\n2,0.002\n")
    code = (
        "import sys, click.testing; from warp_pd.__main__ import main\n"
        f"for words in {WITHOUT_WARP}:\n"
        "    done = click.testing.CliRunner().invoke(main, words.split(' '))\n"
        "    assert done.exit_code == 2 and len(done.output.splitlines()) == 1, (words, done.output)\n"
        "    assert 'warp' not in sys.modules, words\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_scene_waits_for_nothing_that_only_a_run_needs():
    """Its parts are checked when the file is imported and built; SciPy alone would take a third of a second."""
    code = "import sys; from warp_pd import *; sys.exit(str({'scipy', 'matplotlib', 'pxr', 'torch'} & {*sys.modules}))"
    done = subprocess.run([sys.executable, "-c", code], stderr=subprocess.PIPE, text=True, check=False)
    assert done.stderr.strip() == "set()"


def test_pages_of_this_kind_are_in_the_navigation():
    navigation = (ROOT / "mkdocs.yml").read_text()
    assert "architecture.md" in navigation
    assert "write-your-own-part.md" in navigation
