"""Do the tests notice? Small changes of the code, one at a time, each against the tests of what it changes.

    python tools/mutations.py reach           # once: which functions each file of tests runs, half an hour on a core
    python tools/mutations.py try             # the campaign; goes on where it was stopped
    python tools/mutations.py again           # survivors once more, after tests were written for them
    python tools/mutations.py page            # docs/mutations.md

A change is picked by a seed: a constant by 4 %, a sign, a comparison turned, a term or a factor left out. It is made in
a copy of the tree, in a process of its own, and counts as found if a test fails or does not end in time. Left out by
rule: indices, texts, errors, pictures, tolerances and sizes of blocks. A change that Warp cannot compile counts for
nothing.

Why no kept tool: mutatest changes bytecode and mutmut puts all mutants into one source behind a switch, while Warp
compiles the source of a function; cosmic-ray has one command of tests for all modules, changes constants by 1 alone,
leaves out no terms, and would bring 30 packages.
"""

from __future__ import annotations

import ast
import json
import os
import random
import re
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from types import CodeType
from typing import Any

from study import DOCS, ROOT, Row, load_rows, run_tool, save_rows, study_parser

NUMBERS = {
    "kernels": 66, "warp_pd/parts": 24, "warp_pd/laws": 20, "warp_pd/solvers": 16, "warp_pd/fitting": 14,
    "warp_pd/output": 14, "warp_pd/materials": 10,
}  # fmt: skip
SEED = 35
# Pictures, progress, timings of a machine; the neural law is trained, and its training is no physics.
NOT_PHYSICS = re.compile(
    r"plots|plot|colour|picture|notebook|progress|view|background|info|peak_flops|training|torch_|report|command"
)
TUNING = re.compile(r"(?i)toleran|tiny|small|block|most|limit|guess|safety|margin|shrink|restart|factor|\beps")
UNCALLED = {"range", "InputError", "required", "positive", "said", "print", "tid", "isinstance", "launch_bounds", "len"}
TURNED = {ast.Lt: ">", ast.Gt: "<", ast.LtE: ">", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "=="}
NO_KERNEL = re.compile(r"Warp\w*Error|Error while parsing|SyntaxError|Couldn't find|Could not find")
COPIED = ("warp_pd", "kernels", "scenes", "tests", "tools", "docs", "pyproject.toml", "README.md")
# Seconds of tests that a change gets, and survivors of these.
SOON, LATE = 40.0, 240.0


@dataclass(frozen=True)
class Mutation:
    """A change of one expression.

    Attributes:
        file: Path in the tree.
        function: Qualified name of the function, empty outside functions.
        kind: Such as "sign".
        span: First and last character in the text of the file.
        text: What takes their place.
        line: Line, from 1.
    """

    file: str
    function: str
    kind: str
    span: tuple[int, int]
    text: str
    line: int


class Finder(ast.NodeVisitor):
    """Mutations of a file."""

    def __init__(self, file: str, source: str) -> None:
        self.file, self.source, self.names, self.found = file, source, [], []
        lines = source.splitlines(keepends=True)
        self.begins = [sum(map(len, lines[:i])) for i in range(len(lines) + 1)]
        self.lines = lines
        self.visit(ast.parse(source))

    def place(self, line: int, column: int) -> int:
        return self.begins[line - 1] + len(self.lines[line - 1].encode()[:column].decode())

    def span(self, node: Any) -> tuple[int, int]:
        return self.place(node.lineno, node.col_offset), self.place(node.end_lineno, node.end_col_offset)

    def text(self, node: ast.AST) -> str:
        begin, end = self.span(node)
        return self.source[begin:end]

    def add(self, kind: str, node: Any, text: str) -> None:
        self.found.append(Mutation(self.file, ".".join(self.names), kind, self.span(node), text, node.lineno))

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        self.names.append(node.name)
        for statement in node.body:
            self.visit(statement)
        self.names.pop()

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        self.visit_FunctionDef(node)  # type: ignore[arg-type]

    def skip(self, node: ast.AST) -> None:
        pass

    visit_Raise = visit_Assert = visit_JoinedStr = visit_Import = visit_ImportFrom = skip

    def visit_Subscript(self, node: ast.Subscript) -> None:
        self.visit(node.value)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        # A default of a dataclass is a choice.
        if node.value is not None and not isinstance(node.value, ast.Constant):
            self.visit(node.value)

    def visit_Call(self, node: ast.Call) -> None:
        name = self.text(node.func).rsplit(".", 1)[-1]
        if name not in UNCALLED and not name.startswith(("check", "log_", "add_argument", "expect")):
            self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        tuned = TUNING.search(self.lines[node.lineno - 1])
        if isinstance(node.value, float) and 1e-3 < abs(node.value) < 1e6 and not tuned:
            self.add("constant", node, repr(1.04 * node.value))

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.USub) and not isinstance(node.operand, ast.Constant):
            self.add("sign", node, f"({self.text(node.operand)})")
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        if isinstance(node.op, ast.Add) and not isinstance(node.value, ast.Constant | ast.List | ast.JoinedStr):
            self.add("sign", node, f"{self.text(node.target)} -= ({self.text(node.value)})")
        self.visit(node.value)

    def visit_Compare(self, node: ast.Compare) -> None:
        if len(node.ops) == 1 and "bits" not in self.text(node) and (turned := TURNED.get(type(node.ops[0]))):
            self.add("comparison", node, f"(({self.text(node.left)}) {turned} ({self.text(node.comparators[0])}))")
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        left, right = self.text(node.left), self.text(node.right)
        counts = any(isinstance(o, ast.Constant) and not isinstance(o.value, float) for o in (node.left, node.right))
        joins = any(isinstance(o, ast.JoinedStr | ast.List | ast.Tuple | ast.Dict) for o in (node.left, node.right))
        if not (counts or joins or "tid()" in left or "perf_counter" in left + right):
            if isinstance(node.op, ast.Add | ast.Sub):
                other = "-" if isinstance(node.op, ast.Add) else "+"
                self.add("sign", node, f"(({left}) {other} ({right}))")
                self.add("term", node, f"({left})")
            elif isinstance(node.op, ast.Mult | ast.Div):
                self.add("factor", node, f"({left})" if isinstance(node.op, ast.Div) else f"({right})")
        self.generic_visit(node)


def mutations(folder: str) -> Iterator[Mutation]:
    """Mutations of a folder in the order of the seed: each file in turn, of a kind that is picked first."""
    rng = random.Random(f"{SEED} {folder}")
    files = [path for path in sorted((ROOT / folder).rglob("*.py")) if not NOT_PHYSICS.search(path.stem)]
    rng.shuffle(files)
    orders = []
    for path in files:
        found = Finder(str(path.relative_to(ROOT)), path.read_text()).found
        kinds: dict[str, list[Mutation]] = {}
        for mutation in rng.sample(found, len(found)):
            kinds.setdefault(mutation.kind, []).append(mutation)
        names = rng.sample(sorted(kinds), len(kinds))
        orders.append([m for group in zip_longest(*(kinds[name] for name in names)) for m in group if m])
    yield from (mutation for group in zip_longest(*orders) for mutation in group if mutation)


# Which tests run which functions ----------------------------------------------------------------------------

seen: dict[int, CodeType] = {}


def pytest_sessionstart() -> None:
    """As a plugin of pytest: note the functions that are called, and those that Warp compiles or finds compiled."""
    from warp._src.context import ModuleHasher

    hash_adjoint = ModuleHasher.hash_adjoint

    def noted(self: Any, adjoint: Any) -> Any:
        code = getattr(adjoint.func, "__code__", None)
        seen[id(code)] = code
        return hash_adjoint(self, adjoint)

    def called(frame: Any, event: str, argument: Any) -> None:
        seen[id(frame.f_code)] = frame.f_code

    ModuleHasher.hash_adjoint = noted
    sys.settrace(called)
    threading.settrace(called)


def pytest_sessionfinish() -> None:
    """Write the functions of the package among them."""
    sys.settrace(None)
    begins = tuple(f"{ROOT}/{name}/" for name in ("kernels", "warp_pd"))
    codes = [code for code in seen.values() if code is not None and code.co_filename.startswith(begins)]
    names = {(str(Path(c.co_filename).relative_to(ROOT)), c.co_qualname.replace(".<locals>", "")) for c in codes}
    Path(os.environ["MUTATIONS_REACH"]).write_text(json.dumps(sorted(names)))


def pytest(files: Sequence[str], tree: Path, limit: float, *options: str, **environment: str) -> tuple[str, float]:
    """Output of pytest in a tree, and its seconds."""
    command = ["nice", "-n", "19", sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    command += ["-m", "not slow and not gpu", *options, *files]
    begun = time.monotonic()
    try:
        done = subprocess.run(
            command, cwd=tree, env={**os.environ, **environment}, capture_output=True, text=True, timeout=limit,
            check=False,
        )  # fmt: skip
        output = done.stdout + done.stderr
    except subprocess.TimeoutExpired:
        output = f"FAILED {files[0]} - no end after {limit:.0f} s"
    return output, time.monotonic() - begun


def reach(work: Path) -> None:
    """Run each file of tests once and note what it reaches, in `work`/reach."""
    (work / "reach").mkdir(parents=True, exist_ok=True)
    folders = (*(f"tests/unit/{Path(name).name}" for name in NUMBERS), "tests/physics", "tests/unit", "tests/scenes")
    for path in dict.fromkeys(path for folder in folders for path in sorted((ROOT / folder).rglob("test_*.py"))):
        file = str(path.relative_to(ROOT))
        out = work / "reach" / (file.replace("/", "+") + ".json")
        if not out.exists():
            part = out.with_suffix(".part")
            said, seconds = pytest(
                [file], ROOT, 200.0, "-p", "mutations", MUTATIONS_REACH=str(part), PYTHONPATH=str(ROOT / "tools")
            )
            functions = json.loads(part.read_text()) if part.exists() else []
            part.write_text(json.dumps({"file": file, "seconds": seconds, "functions": functions}))
            part.rename(out)
            print(f"{file}: {seconds:.0f} s, {len(functions)} functions, {said.strip().splitlines()[-1]}", flush=True)


def tests_of(mutation: Mutation, work: Path) -> list[tuple[str, float]]:
    """Files of tests that reach a change with their seconds, the likeliest to notice first."""
    found = []
    stem, folder = Path(mutation.file).stem, Path(mutation.file).parent.name
    for path in (work / "reach").glob("*.json"):
        run = json.loads(path.read_text())
        reached = {name for file, name in run["functions"] if file == mutation.file}
        if mutation.function in reached or (reached and "." not in mutation.function and "<" not in mutation.function):
            near = (stem in run["file"]) + (f"unit/{folder}/" in run["file"] and folder != "kernels")
            found.append((-near, run["seconds"], run["file"]))
    return [(file, seconds) for _, seconds, file in sorted(found)]


# The campaign -----------------------------------------------------------------------------------------------


def plant(work: Path) -> Path:
    """A copy of the tree, with kernels and scenes in the package."""
    tree = work / "tree"
    shutil.rmtree(tree, ignore_errors=True)
    tree.mkdir(parents=True)
    for name in COPIED:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, tree / name)
    for name in ("kernels", "scenes"):
        (tree / "warp_pd" / name).symlink_to(tree / name)
    return tree


def outcome(mutation: Mutation, tree: Path, tests: Sequence[tuple[str, float]]) -> Row:
    """Apply a change, run tests in order until one fails, and take the change back."""
    path = tree / mutation.file
    source = path.read_text()
    begin, end = mutation.span
    for stale in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
        stale.unlink()
    path.write_text(source[:begin] + mutation.text + source[end:])
    limit = 120.0 + 4.0 * sum(seconds for _, seconds in tests)
    try:
        said, seconds = pytest([file for file, _ in tests], tree, limit, PYTHONPATH=str(tree))
    finally:
        path.write_text(source)
        for stale in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
            stale.unlink()
    failed = re.search(r"^(?:FAILED|ERROR) (\S+?)(?: - (.*))?$", said, re.MULTILINE)
    by, why = (failed[1], (failed[2] or "")[:80]) if failed else ("", "")
    result = "survived" if not failed else "does not compile" if NO_KERNEL.search(said) else "found"
    return {"result": result, "by": by, "why": why, "seconds": seconds}


def row_of(mutation: Mutation) -> Row:
    """How a change is told in the results."""
    source = (ROOT / mutation.file).read_text()
    begin, end = mutation.span
    before, after = (" ".join(text.split()) for text in (source[begin:end], mutation.text))
    return {
        "file": mutation.file, "line": mutation.line, "function": mutation.function, "kind": mutation.kind,
        "before": before, "after": after,
    }  # fmt: skip


def key(row: Row) -> tuple[str, ...]:
    """What tells changes apart, wherever their lines move."""
    return tuple(str(row[name]) for name in ("file", "function", "before", "after"))


def campaign(options: Any) -> None:
    """Try changes of all folders in turn until each has its number."""
    rows, tree = load_rows(options.out), plant(options.work)
    tried = {key(row) for row in rows}
    waiting = {folder: mutations(folder) for folder in NUMBERS if options.only in folder}
    while waiting:
        for folder in [*waiting]:
            counted = sum(row["result"] != "does not compile" for row in rows if row["file"].startswith(folder + "/"))
            mutation = next((m for m in waiting[folder] if key(row_of(m)) not in tried), None)
            if mutation is None or counted >= NUMBERS[folder]:
                del waiting[folder]
                continue
            attempt(mutation, tree, rows, options)
            tried.add(key(rows[-1]))


def attempt(mutation: Mutation, tree: Path, rows: list[Row], options: Any) -> None:
    """Try a change with the likeliest tests, then with more, and keep what came."""
    tests, row = tests_of(mutation, options.work), row_of(mutation)
    soon = [test for i, test in enumerate(tests) if i == 0 or sum(s for _, s in tests[: i + 1]) < SOON]
    late = [t for i, t in enumerate(tests) if t not in soon and sum(s for _, s in tests[: i + 1]) < LATE]
    row |= {"result": "survived", "by": "", "why": "no test reaches it", "seconds": 0.0}
    for group in (soon, late):
        if group and row["result"] == "survived":
            row |= outcome(mutation, tree, group)
    rows.append({**row, "files": len(soon) + len(late), "reason": ""})
    save_rows(options.out, rows)
    print(f"{row['file']}:{row['line']} {row['before']} -> {row['after']}: {row['result']} {row['by']}", flush=True)


def again(options: Any) -> None:
    """Try survivors without a reason once more."""
    rows, tree = load_rows(options.out), plant(options.work)
    for row in [row for row in rows if row["result"] == "survived" and not row["reason"]]:
        for mutation in mutations(next(folder for folder in NUMBERS if row["file"].startswith(folder + "/"))):
            if key(row_of(mutation)) == key(row):
                rows.remove(row)
                attempt(mutation, tree, rows, options)
                break
        else:
            print(f"{row['file']}: {row['before']} is not there any more")


def main() -> None:
    """Command line of the tool."""
    parser = study_parser(__doc__, work=Path("/tmp/mutants"), out=DOCS / "mutations.json")
    parser.add_argument("what", choices=("reach", "try", "again", "page"))
    parser.add_argument("--only", default="", help="folders whose path has this text")
    options = parser.parse_args()
    {"reach": lambda o: reach(o.work), "try": campaign, "again": again, "page": page}[options.what](options)


def page(options: Any) -> None:
    """Write the page beside the results."""
    rows = load_rows(options.out)


if __name__ == "__main__":
    run_tool(main)
