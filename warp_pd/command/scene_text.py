"""What the text of a scene's file says of its arguments, read without importing the file and with it Warp."""

from __future__ import annotations

import ast
import contextlib
import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..device import checks

# Checks of one number or word; the first argument is the name, the second the value.
CHECKS: dict[str, Callable[..., Any]] = {
    check.__name__: check
    for check in (
        checks.below_one, checks.count, checks.finite, checks.not_negative, checks.one_of, checks.positive,
    )
}  # fmt: skip


@dataclass(frozen=True)
class WrittenBuild:
    """The function `build` of a scene's file.

    Attributes:
        parameters: Its parameters, by name.
        node: Its syntax tree.
        imported: Names that the file imports from the checks of the package.
    """

    parameters: dict[str, inspect.Parameter]
    node: ast.FunctionDef
    imported: frozenset[str]

    @classmethod
    def of(cls, file: Path) -> WrittenBuild | None:
        """Read a file; None if a default is an expression, or there is no plain function `build`."""
        try:
            tree = ast.parse(file.read_text("utf-8"))
        except (SyntaxError, ValueError):
            return None
        found = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "build"]
        if len(found) != 1 or found[0].decorator_list or found[0].args.vararg or found[0].args.kwarg:
            return None
        imports = [node for node in tree.body if isinstance(node, ast.ImportFrom) and node.module == checks.__name__]
        names = frozenset(alias.name for node in imports for alias in node.names if alias.asname is None)
        try:
            return cls(_parameters(found[0].args), found[0], names)
        except ValueError:
            return None

    def check(self, values: Mapping[str, Any]) -> None:
        """Make the checks of `values` that `build` makes in any case and that need no other value.

        Such as `count("points", points, 3)`, in the order of the text. Raises InputError as `build` would.
        """
        for name, argument, others in self._checks():
            if argument in values:
                # Wrong use of a check is reported where `build` is called.
                with contextlib.suppress(TypeError):
                    CHECKS[name](argument, values[argument], *others)

    def _checks(self) -> Iterator[tuple[str, str, list[Any]]]:
        """Name of the check, of the argument, and further arguments of each check."""
        unchanged = set(self.parameters)
        for statement in self.node.body:
            if isinstance(statement, ast.FunctionDef):
                continue
            for call in _calls(statement):
                match call:
                    case ast.Call(ast.Name(name), [ast.Constant(str(label)), ast.Name(argument), *others], []):
                        if name in self.imported & CHECKS.keys() and label == argument and argument in unchanged:
                            with contextlib.suppress(ValueError):
                                yield name, argument, [ast.literal_eval(other) for other in others]
            inside = list(ast.walk(statement))
            unchanged -= {node.id for node in inside if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
            if any(isinstance(node, ast.Return) for node in inside):
                return


def _calls(node: ast.AST) -> Iterator[ast.Call]:
    """Calls that are made whenever a statement or expression is reached, in the order of the text."""
    match node:
        case ast.If(test=first) | ast.While(test=first) | ast.For(iter=first) | ast.IfExp(test=first):
            yield from _calls(first)
        case ast.BoolOp(values=[first, *_]):
            yield from _calls(first)
        case ast.Compare(left=first, comparators=[second, *_]):
            yield from _calls(first)
            yield from _calls(second)
        case ast.Lambda() | ast.FunctionDef() | ast.ListComp() | ast.SetComp() | ast.DictComp() | ast.GeneratorExp():
            return
        case ast.Try() | ast.With() | ast.Match():
            return
        case _:
            for child in ast.iter_child_nodes(node):
                yield from _calls(child)
            if isinstance(node, ast.Call):
                yield node


def _parameters(given: ast.arguments) -> dict[str, inspect.Parameter]:
    """Parameters of a function. Raises ValueError if a default is an expression."""
    places, keywords = [*given.posonlyargs, *given.args], given.kwonlyargs
    none = [None] * (len(places) - len(given.defaults))
    return {
        argument.arg: inspect.Parameter(
            argument.arg,
            inspect.Parameter.KEYWORD_ONLY,
            default=inspect.Parameter.empty if default is None else ast.literal_eval(default),
            annotation="" if argument.annotation is None else ast.unparse(argument.annotation),
        )
        for argument, default in zip([*places, *keywords], [*none, *given.defaults, *given.kw_defaults], strict=True)
    }
