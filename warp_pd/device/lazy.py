"""Lazy import of the names of a package, so that `import warp_pd` is fast."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping
from typing import Any


def lazy(package: str, offered: Mapping[str, str]) -> Callable[[str], Any]:
    """Create the `__getattr__` of a package; `offered` lists the public names of each of its modules."""
    places = {name: module for module, names in offered.items() for name in names.split()}

    def find(name: str) -> Any:
        """The object of that name, or the module. Raises AttributeError if there is neither."""
        if name in places:
            found = getattr(importlib.import_module(f"{package}.{places[name]}"), name)
        else:
            try:
                found = importlib.import_module(f"{package}.{name}")
            except ModuleNotFoundError as error:
                if error.name != f"{package}.{name}":
                    raise
                raise AttributeError(f"module {package!r} has no attribute {name!r}") from None
        setattr(sys.modules[package], name, found)
        return found

    return find
