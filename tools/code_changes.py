"""Small changes of the code that tests ought to notice, see tools/mutations.py."""

from __future__ import annotations

import ast
import random
import re
from collections.abc import Iterable, Iterator
from itertools import accumulate, zip_longest
from typing import Any, NamedTuple

from study import ROOT, Row

SEED = 35
# Pictures, progress and messages; the training of networks, whose result is tested.
NOT_PHYSICS = re.compile(
    "plot|colour|picture|curves|projection|camera|_view|notebook|progress|background|info|peak|training|torch|report|command"
)
TUNING = re.compile(r"(?i)toleran|tiny|small|block|most|limit|guess|safety|margin|shrink|restart|factor|\beps")
CHECKS = re.compile("check|log_|expect|range$|InputError|required|positive|said|print|isinstance|launch_bounds|len$")
TURNED = {ast.Lt: ">", ast.Gt: "<", ast.LtE: ">", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "=="}


class Mutation(NamedTuple):
    """The bytes of a file from `begin` to `end` become `text`; `row` tells it in the results."""

    begin: int
    end: int
    text: str
    row: Row


def mutations_in(file: str) -> list[Mutation]:
    """Mutations of a file."""
    source = (ROOT / file).read_bytes()
    begins = [0, *accumulate(map(len, source.splitlines(keepends=True)))]
    found = []

    def span(node: Any) -> slice:
        return slice(begins[node.lineno - 1] + node.col_offset, begins[node.end_lineno - 1] + node.end_col_offset)

    def text(node: ast.AST) -> str:
        return f"({source[span(node)].decode()})"

    def walk(node: Any, function: str) -> None:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            function = f"{function}.{node.name}".lstrip(".")
        for kind, new in changes(node, text):
            place, before = span(node), text(node)[1:-1]
            if not (kind == "constant" and TUNING.search(source.splitlines()[node.lineno - 1].decode())):
                row = {"file": file, "line": node.lineno, "function": function, "kind": kind}
                row |= {"before": " ".join(before.split()), "after": " ".join(new.split())}
                found.append(Mutation(place.start, place.stop, new, row))
        for child in parts_of(node, text):
            walk(child, function)

    walk(ast.parse(source), "")
    return found


def parts_of(node: ast.AST, text: Any) -> Iterable[ast.AST]:
    """Parts of an expression or a statement that may be changed."""
    match node:
        case ast.Raise() | ast.Assert() | ast.JoinedStr() | ast.AnnAssign(value=None | ast.Constant()):
            return ()
        case ast.Call(func=function) if CHECKS.match(text(function)[1:-1].rsplit(".", 1)[-1]):
            return ()
        case ast.FunctionDef(body=body) | ast.ClassDef(body=body):
            return body
        case ast.Subscript(value=value) | ast.AnnAssign(value=value):
            return (value,)  # type: ignore[return-value]
    return ast.iter_child_nodes(node)


def changes(node: ast.AST, text: Any) -> Iterator[tuple[str, str]]:
    """Kinds of changes of an expression or a statement, and its new texts."""
    match node:
        case ast.Constant(value=float(value)) if 1e-3 < abs(value) < 1e6:
            yield "constant", repr(1.04 * value)
        case ast.UnaryOp(op=ast.USub(), operand=operand) if not isinstance(operand, ast.Constant):
            yield "sign", text(operand)
        case ast.AugAssign(op=ast.Add(), target=target, value=value) if not counts(value):
            yield "sign", f"{text(target)[1:-1]} -= {text(value)}"
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in TURNED and "bits" not in text(node):
            yield "comparison", f"({text(left)} {TURNED[type(op)]} {text(right)})"
        case ast.BinOp(left=left, right=right, op=op):
            if counts(left) or counts(right) or re.search(r"tid\(\)|perf_counter", text(node)):
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

    def in_turn(lists: Iterable[Iterable[Mutation]]) -> list[Mutation]:
        return [mutation for group in zip_longest(*lists) for mutation in group if mutation]

    rng = random.Random(f"{SEED} {folder}")
    files = [path for path in sorted((ROOT / folder).rglob("*.py")) if not NOT_PHYSICS.search(path.stem)]
    orders = []
    for path in rng.sample(files, len(files)):
        found = [m for m in mutations_in(str(path.relative_to(ROOT))) if not NOT_PHYSICS.search(m.row["function"])]
        kinds: dict[str, list[Mutation]] = {}
        for mutation in rng.sample(found, len(found)):
            kinds.setdefault(mutation.row["kind"], []).append(mutation)
        orders.append(in_turn([kinds[name] for name in rng.sample(sorted(kinds), len(kinds))]))
    yield from in_turn(orders)
