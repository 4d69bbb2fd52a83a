"""Do the tests notice? Small changes of the code, one at a time, each against the tests of what it changes.

    python tools/mutations.py reach     # which functions each file of tests runs: once, half an hour on a core
    python tools/mutations.py try       # the campaign; goes on where it was stopped
    python tools/mutations.py again     # survivors once more, after tests were written for them
    python tools/mutations.py page      # the section of docs/reliability.md

A change is picked by a seed: a constant by 4 %, a sign, a comparison turned, a term or a factor left out. It is made in
a copy of the tree, in a new process, and counts as found if a test fails or does not end in time. Left out by
rule: indices, texts, errors, defaults, pictures, tolerances and sizes of blocks. What Warp cannot compile counts for
nothing. A survivor is tried with more tests; one that changes no result gets a `reason` in docs/mutations.json. Rows of
the kind "chosen" there were picked by hand, where an energy, a unit, a direction or an origin is computed.

No kept tool fits. mutatest changes bytecode and mutmut switches between mutants in one source, while Warp compiles the
source of a function; cosmic-ray has one command for all tests, changes constants by 1 alone and leaves out no terms.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import shutil
import signal
import sys
import threading
from collections.abc import Sequence
from multiprocessing import get_context
from pathlib import Path
from types import CodeType
from typing import Any

from code_changes import Mutation, mutations, mutations_in
from study import DOCS, ROOT, Row, load_rows, provenance, renew, run_tool, save_rows, study_parser

from warp_pd.run.folder import write_atomically

NUMBERS = {
    "kernels": 230, "warp_pd/contact": 37, "warp_pd/shapes": 30, "warp_pd/statics": 27, "warp_pd/fitting": 24,
    "warp_pd/papers": 20, "warp_pd/parts": 17, "warp_pd/tearing": 17, "warp_pd/gas": 14, "warp_pd/laws": 11,
    "warp_pd/viewer": 10, "warp_pd/output": 9, "warp_pd/solvers": 8, "warp_pd/bending": 7, "warp_pd/families": 7,
    "warp_pd/geometry": 7, "warp_pd/materials": 6, "warp_pd/run": 6, "warp_pd/device": 5, "warp_pd/distributed": 3,
    "warp_pd/command": 2, "warp_pd/visco": 2, "warp_pd/fast": 1, "warp_pd/interfaces": 1,
}  # fmt: skip
NO_KERNEL = re.compile("Warp[A-Za-z]*Error|Error while parsing|SyntaxError|Could(n't| not) find (?!or load)")
# Seconds of tests that a change gets, and the survivors of these at their second trial.
SOON, LATE = 8.0, 240.0


class Reach:
    """Plugin of pytest that notes the functions of a tree that are called, and those of kernels that are loaded."""

    def __init__(self, tree: Path) -> None:
        self.tree, self.out = tree, tree / "reached.json"
        self.seen: dict[int, CodeType] = {}

    def pytest_sessionstart(self) -> None:
        """Begin."""
        from warp._src.context import ModuleHasher

        hash_adjoint, seen = ModuleHasher.hash_adjoint, self.seen

        def noted(hasher: Any, adjoint: Any) -> Any:
            seen[id(adjoint.func)] = adjoint.func.__code__
            return hash_adjoint(hasher, adjoint)

        def called(frame: Any, event: str, argument: Any) -> None:
            seen[id(frame.f_code)] = frame.f_code

        ModuleHasher.hash_adjoint = noted
        sys.settrace(called)
        threading.settrace(called)

    def pytest_sessionfinish(self) -> None:
        """Write them."""
        sys.settrace(None)
        codes = [code for code in self.seen.values() if code.co_filename.startswith(str(self.tree))]
        names = {(c.co_filename[len(str(self.tree)) + 1 :], c.co_qualname.replace(".<locals>", "")) for c in codes}
        short = {(file.replace("warp_pd/kernels/", "kernels/"), name) for file, name in names}
        self.out.write_text(json.dumps(sorted(short)), "utf-8")


def pytest(files: Sequence[str], tree: Path, seconds: float, plugins: Sequence[object] = ()) -> tuple[str, float]:
    """Output of pytest in a tree, and its seconds on a core; it ends after some times what it should take.

    A fork has Warp, SciPy and the like loaded; the package is loaded anew from the tree.
    """
    import h5py, hypothesis, matplotlib.figure, meshio, scipy.interpolate, scipy.optimize, scipy.sparse.linalg  # noqa: E401, F401, I001

    out = tree / "mutations.log"
    process = get_context("fork").Process(target=_pytest, args=(files, tree, out, seconds, plugins))
    begun = sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    process.start()
    process.join(3600.0)
    if process.exitcode is None:
        os.killpg(process.pid or 0, signal.SIGKILL)
        process.join()
    said = out.read_text(errors="replace")
    if (process.exitcode or 0) < 0:
        said += f"\nFAILED {files[0]} - ended by signal {-(process.exitcode or 0)}"
    return said, sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2]) - begun


def _pytest(files: Sequence[str], tree: Path, out: Path, seconds: float, plugins: Sequence[object]) -> None:
    os.setpgid(0, 0)
    resource.setrlimit(resource.RLIMIT_CPU, (int(30.0 + 4.0 * seconds),) * 2)
    os.dup2(os.open(out, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 1)
    os.dup2(1, 2)
    for name in [name for name in sys.modules if name.split(".")[0] in ("warp_pd", "study")]:
        del sys.modules[name]
    os.chdir(tree)
    os.environ |= {"PYTHONPATH": str(tree), "COLUMNS": "200"}
    sys.path[0] = str(tree)
    import pytest as runner

    options = ["-x", "-q", "-p", "no:cacheprovider", "-m", "not slow and not gpu"]
    sys.exit(runner.main([*options, *files], plugins=[*plugins]))


def plant(tree: Path) -> Path:
    """A copy of the tree, with kernels and scenes in the package."""
    shutil.rmtree(tree, ignore_errors=True)
    tree.mkdir(parents=True)
    for name in ("warp_pd", "kernels", "scenes", "tests", "tools", "docs", "pyproject.toml", "README.md"):
        (shutil.copytree if (ROOT / name).is_dir() else shutil.copy)(ROOT / name, tree / name)
    for name in ("kernels", "scenes"):
        (tree / "warp_pd" / name).symlink_to(tree / name)
    return tree


def reach(options: argparse.Namespace) -> None:
    """Run each file of tests once and note what it reaches, in `work`/reach."""
    tree = plant(options.work / "tree-reach")
    folders = (*(f"tests/core/{Path(name).name}" for name in NUMBERS), "tests/core", "tests")
    for path in dict.fromkeys(path for folder in folders for path in sorted((ROOT / folder).rglob("test_*.py"))):
        file, plugin = str(path.relative_to(ROOT)), Reach(tree)
        out = options.work / "reach" / (file.replace("/", "+") + ".json")
        # One test launches every kernel and looks at what it touches, not at its numbers.
        if out.exists() or options.only not in file or path.stem == "test_effects":
            continue
        # Tracing is slow, and a file that is ended would count as one that reaches nothing.
        said, seconds = pytest([file], tree, 400.0, [plugin])
        functions = json.loads(plugin.out.read_text("utf-8"))
        plugin.out.unlink()
        out.parent.mkdir(exist_ok=True)
        write_atomically(out, json.dumps({"file": file, "seconds": seconds, "functions": functions}))
        print(f"{file}: {seconds:.0f} s, {len(functions)} functions, {said.strip().splitlines()[-1]}", flush=True)


def tests_of(row: Row, work: Path) -> list[tuple[str, float]]:
    """Files of tests that reach a change with their seconds, the likeliest to notice first."""
    found = []
    stem, folder = Path(row["file"]).stem, Path(row["file"]).parent.name
    for path in (work / "reach").glob("*.json"):
        run = json.loads(path.read_text("utf-8"))
        reached = {name for file, name in run["functions"] if file == row["file"]}
        # Outside functions any of the file will do.
        if row["function"] in reached or (reached and not row["function"]):
            near = (stem in run["file"]) + (f"/{folder}/" in run["file"])
            found.append((-near, run["seconds"], run["file"]))
    return [(file, seconds) for _, seconds, file in sorted(found)]


def outcome(mutation: Mutation, tree: Path, tests: Sequence[tuple[str, float]]) -> Row:
    """Make a change, run tests in order until one fails, and take the change back."""
    path = tree / mutation.row["file"]
    source = path.read_bytes()
    path.write_bytes(source[: mutation.begin] + mutation.text.encode() + source[mutation.end :])
    # Python tells a changed source by its size and the second of its time.
    stale = path.parent / "__pycache__" / f"{path.stem}.{sys.implementation.cache_tag}.pyc"
    stale.unlink(missing_ok=True)
    try:
        said, _ = pytest([file for file, _ in tests], tree, sum(seconds for _, seconds in tests))
    finally:
        path.write_bytes(source)
        stale.unlink(missing_ok=True)
    failed = re.search(r"^(?:FAILED|ERROR) (.*?)(?: - .*)?$", said, re.MULTILINE)
    result = "survived" if not failed else "does not compile" if NO_KERNEL.search(said) else "found"
    return {"result": result, "by": failed[1] if failed else ""}


def attempt(mutation: Mutation, tree: Path, rows: list[Row], options: argparse.Namespace, seconds: float) -> None:
    """Try a change with tests of some seconds, at least a file of them, and keep what came."""
    tests, taken = tests_of(mutation.row, options.work), []
    for test in tests:
        if test[1] + sum(other for _, other in taken) < seconds:
            taken.append(test)
    taken = taken or sorted(tests, key=lambda test: test[1])[:1]
    row = mutation.row | {"result": "survived", "by": "", "reason": ""}
    row |= outcome(mutation, tree, taken) if taken else {}
    rows.append(row)
    save_rows(options.out, rows)
    print(f"{row['file']}:{row['line']} {row['before']} -> {row['after']}: {row['result']} {row['by']}", flush=True)


def key(row: Row) -> tuple[str, ...]:
    """What tells changes apart, wherever their lines move."""
    return tuple(str(row[name]) for name in ("file", "function", "before", "after"))


def campaign(options: argparse.Namespace) -> None:
    """Try changes of all folders in turn until each has its number."""
    rows, tree = load_rows(options.out), plant(options.work / "tree")
    tried = {key(row) for row in rows}
    waiting = {folder: mutations(folder) for folder in NUMBERS if options.only in folder}
    while waiting:
        for folder in [*waiting]:
            tries = sum(row["result"] != "does not compile" for row in rows if row["file"].startswith(f"{folder}/"))
            mutation = next((m for m in waiting[folder] if key(m.row) not in tried), None)
            if mutation is None or tries >= NUMBERS[folder]:
                del waiting[folder]
            else:
                tried.add(key(mutation.row))
                attempt(mutation, tree, rows, options, SOON)


def again(options: argparse.Namespace) -> None:
    """Try survivors without a reason once more."""
    rows, tree = load_rows(options.out), plant(options.work / "tree")
    left = [row for row in rows if row["result"] == "survived" and not row["reason"] and options.only in row["file"]]
    for row in left:
        same = [m for m in mutations_in(row["file"]) if key(m.row) == key(row)]
        mutation = min(same, key=lambda m: abs(m.row["line"] - row["line"]), default=None)
        if mutation is None:
            print(f"{row['file']}: {row['before']} is not there any more")
        else:
            rows.remove(row)
            attempt(mutation, tree, rows, options, LATE)


def page(options: argparse.Namespace) -> None:
    """Renew the section of the page."""
    rows = [row for row in load_rows(options.out) if row["result"] != "does not compile"]
    found, same = sum(row["result"] == "found" for row in rows), sum(bool(row["reason"]) for row in rows)
    origin = f"`python tools/mutations.py` made {len(rows)} small changes of the code that tests should notice, on "
    origin += f"{provenance('a CPU')}: {found} were found, {same} have no effect, {len(rows) - found - same} missed. "
    origin += "Every change, and why some have no effect: [mutations.json](mutations.json)."
    text = [origin, ""]
    missed = [row for row in rows if row["result"] == "survived" and not row["reason"]]
    listed = [f"- `{row['file']}`, line {row['line']}: `{row['before']}`" for row in missed]
    text += ["Missed:", "", *listed, ""] if listed else []
    renew(DOCS / "reliability.md", {"## Tests that notice": text})


def main() -> None:
    """Command line of the tool."""
    parser = study_parser(__doc__, work=Path("/tmp/mutants"), out=DOCS / "mutations.json")
    parser.add_argument("what", choices=("reach", "try", "again", "page"))
    parser.add_argument("--only", default="", help="folders or files whose path has this text")
    options = parser.parse_args()
    {"reach": reach, "try": campaign, "again": again, "page": page}[options.what](options)


if __name__ == "__main__":
    run_tool(main)
