"""Do the tests notice? Small changes of the code, one at a time, each against the tests of what it changes.

    python tools/mutations.py reach     # which functions each file of tests runs: once, half an hour on a core
    python tools/mutations.py try       # the campaign; goes on where it was stopped
    python tools/mutations.py again     # survivors once more, after tests were written for them
    python tools/mutations.py page      # the section of docs/reliability.md

A change is picked by a seed: a constant by 4 %, a sign, a comparison turned, a term or a factor left out. It is made in
a copy of the tree, in a process of its own, and counts as found if a test fails or does not end in time. Left out by
rule: indices, texts, errors, defaults, pictures, tolerances and sizes of blocks. What Warp cannot compile counts for
nothing. A survivor is tried with more tests; one that changes no behaviour gets a `reason` in docs/mutations.json.

No kept tool fits. mutatest changes bytecode and mutmut switches between mutants in one source, while Warp compiles the
source of a function; cosmic-ray has one command for all tests, changes constants by 1 alone and leaves out no terms.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import re
import resource
import shutil
import signal
import sys
import threading
from collections.abc import Iterable, Iterator, Sequence
from itertools import zip_longest
from multiprocessing import get_context
from pathlib import Path
from types import CodeType
from typing import Any, NamedTuple

from study import DOCS, ROOT, Row, load_rows, provenance, renew, run_tool, save_rows, study_parser, table

from warp_pd.run.folder import write_atomically

NUMBERS = {
    "kernels": 66, "warp_pd/parts": 24, "warp_pd/laws": 20, "warp_pd/solvers": 16, "warp_pd/fitting": 14,
    "warp_pd/output": 14, "warp_pd/materials": 10,
}  # fmt: skip
SEED = 35
# Pictures, progress and messages; the training of networks, whose result is tested.
NOT_PHYSICS = re.compile(
    r"plot|colour|picture|notebook|progress|view|background|info|peak_flops|training|torch_|report|command"
)
TUNING = re.compile(r"(?i)toleran|tiny|small|block|most|limit|guess|safety|margin|shrink|restart|factor|\beps")
NOT_INSIDE = re.compile(
    r"(check|log_|expect|range$|InputError|required|positive|said|print|isinstance|launch_bounds|len$)"
)
TURNED = {ast.Lt: ">", ast.Gt: "<", ast.LtE: ">", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "=="}
NO_KERNEL = re.compile(r"Warp\w*Error|Error while parsing|SyntaxError|Couldn't find|Could not find")
COPIED = ("warp_pd", "kernels", "scenes", "tests", "tools", "docs", "pyproject.toml", "README.md")
# Seconds of tests that a change gets, and survivors of these.
SOON, LATE = 40.0, 240.0


# What is changed --------------------------------------------------------------------------------------------


class Mutation(NamedTuple):
    """A change of one expression: where, in which function, and the text that takes the place of a span."""

    file: str
    function: str
    kind: str
    begin: int
    end: int
    text: str
    row: Row


def found_in(file: str) -> Iterator[Mutation]:
    """Mutations of a file."""
    source = (ROOT / file).read_text()
    begins = [0]
    for line in source.splitlines(keepends=True):
        begins.append(begins[-1] + len(line.encode()))
    encoded = source.encode()

    def span(node: Any) -> tuple[int, int]:
        return begins[node.lineno - 1] + node.col_offset, begins[node.end_lineno - 1] + node.end_col_offset

    def text(node: ast.AST) -> str:
        begin, end = span(node)
        return f"({encoded[begin:end].decode()})"

    def walk(node: ast.AST, names: tuple[str, ...]) -> Iterator[Mutation]:
        for kind, new in changes(node, text, source):
            begin, end = span(node)
            row = {"file": file, "line": node.lineno, "function": ".".join(names), "kind": kind}  # type: ignore[attr-defined]
            told = {"before": " ".join(text(node)[1:-1].split()), "after": " ".join(new.split())}
            yield Mutation(file, row["function"], kind, begin, end, new, row | told)
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names = (*names, node.name)
        for child in parts_of(node, text):
            yield from walk(child, names)

    yield from walk(ast.parse(source), ())


def parts_of(node: ast.AST, text: Any) -> Iterable[ast.AST]:
    """Parts of an expression or a statement that may be changed."""
    if isinstance(node, ast.Raise | ast.Assert | ast.JoinedStr):
        return ()
    if isinstance(node, ast.Call) and NOT_INSIDE.match(text(node.func)[1:-1].rsplit(".", 1)[-1]):
        return ()
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return node.body
    if isinstance(node, ast.Subscript):
        return (node.value,)
    if isinstance(node, ast.AnnAssign):
        # A default of a dataclass is a choice.
        return () if node.value is None or isinstance(node.value, ast.Constant) else (node.value,)
    return ast.iter_child_nodes(node)


def changes(node: ast.AST, text: Any, source: str) -> Iterator[tuple[str, str]]:
    """Kinds of changes of an expression or a statement, and its new texts."""
    match node:
        case ast.Constant(value=float(value)) if 1e-3 < abs(value) < 1e6:
            if not TUNING.search(source.splitlines()[node.lineno - 1]):
                yield "constant", repr(1.04 * value)
        case ast.UnaryOp(op=ast.USub()) if not isinstance(node.operand, ast.Constant):
            yield "sign", text(node.operand)
        case ast.AugAssign(op=ast.Add()) if not isinstance(node.value, ast.Constant | ast.List | ast.JoinedStr):
            yield "sign", f"{text(node.target)[1:-1]} -= {text(node.value)}"
        case ast.Compare(ops=[one]) if type(one) in TURNED and "bits" not in text(node):
            yield "comparison", f"({text(node.left)} {TURNED[type(one)]} {text(node.comparators[0])})"
        case ast.BinOp(left=left, right=right, op=op) if not any(map(counts, (left, right))):
            if re.search(r"tid\(\)|perf_counter", text(node)):
                return
            if isinstance(op, ast.Add | ast.Sub):
                yield "sign", f"({text(left)} {'-' if isinstance(op, ast.Add) else '+'} {text(right)})"
                yield "term", text(left)
            elif isinstance(op, ast.Mult | ast.Div):
                yield "factor", text(left if isinstance(op, ast.Div) else right)


def counts(node: ast.AST) -> bool:
    """Whether an operand counts or joins: indices, texts, lists."""
    number = isinstance(node, ast.Constant) and not isinstance(node.value, float)
    return number or isinstance(node, ast.JoinedStr | ast.List | ast.Tuple | ast.Dict)


def mutations(folder: str) -> Iterator[Mutation]:
    """Mutations of a folder in the order of the seed: of each file in turn one, of each kind in turn."""
    rng = random.Random(f"{SEED} {folder}")
    files = [path for path in sorted((ROOT / folder).rglob("*.py")) if not NOT_PHYSICS.search(path.stem)]
    orders = []
    for path in rng.sample(files, len(files)):
        kinds: dict[str, list[Mutation]] = {}
        found = list(found_in(str(path.relative_to(ROOT))))
        for mutation in rng.sample(found, len(found)):
            kinds.setdefault(mutation.kind, []).append(mutation)
        orders.append(in_turn([kinds[name] for name in rng.sample(sorted(kinds), len(kinds))]))
    yield from in_turn(orders)


def in_turn(lists: Iterable[Iterable[Mutation]]) -> Iterator[Mutation]:
    """The first of each list, the second of each, and so on."""
    yield from (mutation for group in zip_longest(*lists) for mutation in group if mutation)


# Which tests run which functions ----------------------------------------------------------------------------


class Reach:
    """Plugin of pytest that notes the functions that are called, and those of the kernels that are loaded."""

    def __init__(self, tree: Path, out: Path) -> None:
        self.tree, self.out = tree, out
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
        """Write the functions of the package among them."""
        sys.settrace(None)
        codes = [code for code in self.seen.values() if code.co_filename.startswith(str(self.tree))]
        names = {(c.co_filename[len(str(self.tree)) + 1 :], c.co_qualname.replace(".<locals>", "")) for c in codes}
        short = {(file.replace("warp_pd/kernels/", "kernels/"), name) for file, name in names}
        self.out.write_text(json.dumps(sorted(short)))


def pytest(files: Sequence[str], tree: Path, seconds: float, plugins: Sequence[object] = ()) -> tuple[str, float]:
    """Output of pytest in a tree, and its seconds; it ends when it has used many times the seconds it should take.

    A fork has Warp, SciPy and the like loaded; the package is loaded anew from the tree.
    """
    import h5py  # noqa: F401

    out = tree / "mutations.log"
    process = get_context("fork").Process(target=_pytest, args=(files, tree, out, seconds, plugins))
    begun = sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    process.start()
    process.join(600.0)
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
    for name in [name for name in sys.modules if name.split(".")[0] in ("warp_pd", "study", "references")]:
        del sys.modules[name]
    os.chdir(tree)
    os.environ["PYTHONPATH"] = sys.path[0] = str(tree)
    os.environ["COLUMNS"] = "200"
    import pytest as runner

    options = ["-x", "-q", "-p", "no:cacheprovider", "-m", "not slow and not gpu"]
    sys.exit(runner.main([*options, *files], plugins=[*plugins]))


def reach(options: argparse.Namespace) -> None:
    """Run each file of tests once and note what it reaches, in `work`/reach."""
    tree = plant(options.work / "tree-reach")
    (options.work / "reach").mkdir(parents=True, exist_ok=True)
    folders = (*(f"tests/unit/{Path(name).name}" for name in NUMBERS), "tests/physics", "tests/unit", "tests/scenes")
    for path in dict.fromkeys(path for folder in folders for path in sorted((ROOT / folder).rglob("test_*.py"))):
        file = str(path.relative_to(ROOT))
        out = options.work / "reach" / (file.replace("/", "+") + ".json")
        if out.exists():
            continue
        part = tree / "reached.json"
        said, seconds = pytest([file], tree, 40.0, [Reach(tree, part)])
        functions = json.loads(part.read_text()) if part.exists() else []
        part.unlink(missing_ok=True)
        write_atomically(out, json.dumps({"file": file, "seconds": seconds, "functions": functions}))
        print(f"{file}: {seconds:.0f} s, {len(functions)} functions, {said.strip().splitlines()[-1]}", flush=True)


def tests_of(mutation: Mutation, work: Path) -> list[tuple[str, float]]:
    """Files of tests that reach a change with their seconds, the likeliest to notice first."""
    found = []
    stem, folder = Path(mutation.file).stem, Path(mutation.file).parent.name
    for path in (work / "reach").glob("*.json"):
        run = json.loads(path.read_text())
        reached = {name for file, name in run["functions"] if file == mutation.file}
        # Outside functions any of the file will do.
        if mutation.function in reached or (reached and not mutation.function):
            near = (stem in run["file"]) + (f"unit/{folder}/" in run["file"]) - 3 * ("test_effects" in run["file"])
            found.append((-near, run["seconds"], run["file"]))
    return [(file, seconds) for _, seconds, file in sorted(found)]


# The campaign -----------------------------------------------------------------------------------------------


def plant(tree: Path) -> Path:
    """A copy of the tree, with kernels and scenes in the package."""
    shutil.rmtree(tree, ignore_errors=True)
    tree.mkdir(parents=True)
    for name in COPIED:
        (shutil.copytree if (ROOT / name).is_dir() else shutil.copy)(ROOT / name, tree / name)
    for name in ("kernels", "scenes"):
        (tree / "warp_pd" / name).symlink_to(tree / name)
    return tree


def outcome(mutation: Mutation, tree: Path, tests: Sequence[tuple[str, float]]) -> Row:
    """Make a change, run tests in order until one fails, and take the change back."""
    path = tree / mutation.file
    source = path.read_bytes()
    path.write_bytes(source[: mutation.begin] + mutation.text.encode() + source[mutation.end :])
    # Python tells a changed source by its size and the second of its time.
    stale = path.parent / "__pycache__" / f"{path.stem}.{sys.implementation.cache_tag}.pyc"
    stale.unlink(missing_ok=True)
    try:
        said, seconds = pytest([file for file, _ in tests], tree, sum(s for _, s in tests))
    finally:
        path.write_bytes(source)
        stale.unlink(missing_ok=True)
    failed = re.search(r"^(?:FAILED|ERROR) (\S+?)(?: - (.*))?$", said, re.MULTILINE)
    by, why = (failed[1], (failed[2] or "")[:80]) if failed else ("", "")
    result = "survived" if not failed else "does not compile" if NO_KERNEL.search(said) else "found"
    return {"result": result, "by": by, "why": why, "seconds": seconds}


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
                attempt(mutation, tree, rows, options)


def attempt(mutation: Mutation, tree: Path, rows: list[Row], options: argparse.Namespace) -> None:
    """Try a change with the likeliest tests, then with more, and keep what came."""
    tests = tests_of(mutation, options.work)
    row = mutation.row | {"result": "survived", "by": "", "why": "no test reaches it", "seconds": 0.0}
    ends = [sum(seconds for _, seconds in tests[: i + 1]) for i in range(len(tests))]
    soon = [test for test, end in zip(tests, ends, strict=True) if test == tests[0] or end < SOON]
    late = [test for test, end in zip(tests, ends, strict=True) if test not in soon and end < LATE]
    for group in (soon, late):
        if group and row["result"] == "survived":
            row |= outcome(mutation, tree, group)
    rows.append({**row, "files": len(soon) + len(late), "reason": ""})
    save_rows(options.out, rows)
    print(f"{row['file']}:{row['line']} {row['before']} -> {row['after']}: {row['result']} {row['by']}", flush=True)


def again(options: argparse.Namespace) -> None:
    """Try survivors without a reason once more."""
    rows, tree = load_rows(options.out), plant(options.work / "tree")
    for row in [row for row in rows if row["result"] == "survived" and not row["reason"]]:
        same = (mutation for mutation in found_in(row["file"]) if key(mutation.row) == key(row))
        if (mutation := next(same, None)) is None:
            print(f"{row['file']}: {row['before']} is not there any more")
        else:
            rows.remove(row)
            attempt(mutation, tree, rows, options)


def page(options: argparse.Namespace) -> None:
    """Write the section of the page, which has the survivors with their reasons."""
    rows = [row for row in load_rows(options.out) if row["result"] != "does not compile"]
    same = [row for row in rows if row["reason"]]
    lost = [row for row in rows if row["result"] == "survived" and not row["reason"]]
    counts_of = [
        [f for f in part if f["file"].startswith(f"{folder}/")] for folder in NUMBERS for part in (rows, same, lost)
    ]
    head = ["folder", "changes", "found", "change no behaviour", "missed"]
    lines = [
        [folder, str(len(all_)), str(len(all_) - len(even) - len(left)), str(len(even)), str(len(left))]
        for folder, all_, even, left in zip(NUMBERS, counts_of[::3], counts_of[1::3], counts_of[2::3], strict=True)
    ]
    print(head, lines, provenance, renew, table, DOCS)


def main() -> None:
    """Command line of the tool."""
    parser = study_parser(__doc__, work=Path("/tmp/mutants"), out=DOCS / "mutations.json")
    parser.add_argument("what", choices=("reach", "try", "again", "page"))
    parser.add_argument("--only", default="", help="folders whose path has this text")
    options = parser.parse_args()
    {"reach": reach, "try": campaign, "again": again, "page": page}[options.what](options)


if __name__ == "__main__":
    run_tool(main)
