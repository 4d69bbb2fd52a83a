"""Lazy import of the names of a package, so that `import warp_pd` is fast."""

from __future__ import annotations

import ast
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any


def lazy(package: str) -> Callable[[str], Any]:
    """Create the `__getattr__` of a package, which imports what its file imports below `if TYPE_CHECKING:`.

    `dir` then lists these names, for completion and help.
    """
    module = sys.modules[package]
    text = Path(str(module.__file__)).read_text("utf-8")
    imports = [
        node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom) and node.level and node.module
    ]
    places = {alias.name: "." * node.level + str(node.module) for node in imports for alias in node.names}

    def find(name: str) -> Any:
        """The object of that name, or the module. Raises AttributeError if there is neither."""
        if name in places:
            found = getattr(importlib.import_module(places[name], package), name)
        else:
            try:
                found = importlib.import_module(f"{package}.{name}")
            except ModuleNotFoundError as error:
                if error.name != f"{package}.{name}":
                    raise
                raise AttributeError(
                    f"module {package!r} has no attribute {name!r}", name=name, obj=module
                ) from None  # with both, Python says what was meant
        setattr(module, name, found)
        return found

    vars(module)["__dir__"] = lambda: sorted({*vars(module), *places})
    return find
