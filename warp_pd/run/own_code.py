"""Code of a user's in a scene: its functions and classes, and the values that they read from outside."""

from __future__ import annotations

import dis
import functools
import hashlib
import sys
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from types import CodeType, FunctionType, MethodType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from .scene import Scene

PLAIN = (bool, int, float, complex, str, bytes, type(None), np.ndarray, np.generic)
# What changes a variable of an enclosing scope: it is a state of the function, such as a counter, and no setting.
STORES = ("STORE_DEREF", "STORE_GLOBAL")
# What reads a variable of the module, and what an attribute.
LOADS, ATTRIBUTES = ("LOAD_GLOBAL", "LOAD_NAME"), ("LOAD_ATTR", "LOAD_METHOD")


def own_code(scene: Scene) -> Iterator[tuple[str, Any]]:
    """Names such as "measures.w.factor", with hashes of functions and classes and the values that they read.

    They are those of the measures and, in all parts, of whatever is not of the package. Values that cannot be compared
    between two processes, such as open files, are left out.
    """
    reader = _Reader(scene)
    for measure in scene.measures:
        yield from reader.of(f"measures.{measure.name}", measure.value)
    for name in ("force", "loads", "contact", "damage", "solver"):
        yield from reader.of(name, getattr(scene, name))


class _Reader:
    """Reads parts, functions and classes, each once; `_seen` keeps them, as their ids may otherwise be used again."""

    def __init__(self, scene: Scene) -> None:
        # These are compared anyway.
        self._seen: dict[int, Any] = {id(part): part for part in (scene, scene.sheet)}

    def of(self, name: str, found: Any) -> Iterator[tuple[str, Any]]:
        """What of a user's is in a part, a function, a class, or a list of them."""
        if isinstance(found, PLAIN) or id(found) in self._seen:
            return
        self._seen[id(found)] = found
        if isinstance(found, list | tuple | dict):
            items = found.items() if isinstance(found, dict) else enumerate(found)
            for key, item in items:
                yield from self.of(f"{name}.{key}", item)
        elif isinstance(found, MethodType):
            yield from self._read(f"{name}.self", found.__self__)
            yield from self.of(name, found.__func__)
        elif isinstance(found, functools.partial):
            yield from self._read(f"{name}.arguments", [*found.args, *sorted(found.keywords.items())])
            yield from self.of(name, found.func)
        elif isinstance(found, FunctionType):
            yield from self._function(name, found)
        elif isinstance(found, type):
            if _is_own(found.__module__):
                yield from self._class(name, found)
        elif isinstance(getattr(found, "func", None), FunctionType):
            # A function or kernel of Warp.
            yield from self.of(name, found.func)
        elif is_dataclass(found):
            yield from self.of(name, type(found))
            for f in fields(found):
                yield from self.of(f"{name}.{f.name}", getattr(found, f.name))
        elif callable(found):
            yield from self.of(name, type(found))
            hidden = not _is_own(type(found).__module__)
            for key, value in getattr(found, "__dict__", {}).items():
                # Hidden attributes of others, such as caches, may change with every call.
                if not (hidden and key.startswith("_")) or key == "__wrapped__":
                    yield from self._read(f"{name}.{key}", value)

    def _read(self, name: str, value: Any) -> Iterator[tuple[str, Any]]:
        """A value that code reads: itself if it is plain, or what is in it."""
        if _is_plain(value):
            # Arrays in a list are compared by all of their numbers.
            yield name, [*value.items()] if isinstance(value, dict) else value
        elif id(value) in self._seen or isinstance(value, type) or not _is_record(value):
            yield from self.of(name, value)
        else:
            self._seen[id(value)] = value
            yield from self.of(name, type(value))
            for key, inner in vars(value).items():
                yield from self._read(f"{name}.{key}", inner)

    def _function(self, name: str, function: FunctionType) -> Iterator[tuple[str, Any]]:
        code, own = function.__code__, _is_own(function.__module__)
        if own:
            yield name, f"code {_hash_of(code)}, Python {sys.version_info[0]}.{sys.version_info[1]}"
        looked_up, stored = _names(code, LOADS), _names(code, STORES)
        defaults = {"defaults": function.__defaults__, **(function.__kwdefaults__ or {})}
        read = {key: value for key, value in defaults.items() if value}
        for key, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
            try:
                read[key] = cell.cell_contents
            except ValueError:
                continue
        if own:
            read |= {key: function.__globals__[key] for key in sorted(looked_up & function.__globals__.keys())}
        for key, value in read.items():
            if isinstance(value, ModuleType):
                if _is_own(value.__name__):
                    for each in sorted(_names(code, ATTRIBUTES) & vars(value).keys()):
                        yield from self._read(f"{name}.{key}.{each}", getattr(value, each))
            elif key not in stored:
                yield from self._read(f"{name}.{key}", value)

    def _class(self, name: str, found: type) -> Iterator[tuple[str, Any]]:
        for base in found.__bases__:
            yield from self.of(f"{name}.{base.__name__}", base)
        for key, value in vars(found).items():
            inner = getattr(value, "fget", None) or getattr(value, "__func__", value)
            if isinstance(inner, FunctionType) and inner.__module__ == found.__module__:
                yield from self.of(f"{name}.{key}", inner)
            elif not key.startswith("__") and _is_plain(value):
                yield f"{name}.{key}", value


def _is_plain(value: Any) -> bool:
    """Whether a value is the same text or array in two processes."""
    if isinstance(value, dict):
        return all(_is_plain(key) and _is_plain(item) for key, item in value.items())
    if isinstance(value, list | tuple):
        return all(map(_is_plain, value))
    return isinstance(value, PLAIN) and not (isinstance(value, np.ndarray) and value.dtype.hasobject)


def _is_record(value: Any) -> bool:
    """Whether a value is a dataclass with a dictionary, or an object of a user's class or of types.SimpleNamespace."""
    if not hasattr(value, "__dict__") or callable(value):
        return False
    return is_dataclass(value) or isinstance(value, SimpleNamespace) or _is_own(type(value).__module__)


def _is_own(module: str) -> bool:
    """Whether a module is a user's: a script, a notebook, or a file that is neither of this package nor installed."""
    root = module.partition(".")[0]
    if module == "__main__":
        return True
    if root in sys.stdlib_module_names or root == __package__.partition(".")[0]:
        return False
    file = getattr(sys.modules.get(module), "__file__", None) or ""
    return not ("site-packages" in file or "dist-packages" in file)


def _names(code: CodeType, operations: tuple[str, ...]) -> set[str]:
    """Names that these operations use in a function and in those within it."""
    within = [_names(inner, operations) for inner in code.co_consts if isinstance(inner, CodeType)]
    return {x.argval for x in dis.get_instructions(code) if x.opname in operations}.union(*within)


def _hash_of(code: CodeType) -> str:
    """Hash of what a function does: neither its place in the file nor its comments change it."""
    text = hashlib.sha1(code.co_code)
    for names in (code.co_names, code.co_varnames, code.co_freevars):
        text.update(repr(names).encode())
    for value in code.co_consts:
        # Text of a set depends on the process.
        inner = sorted(map(repr, value)) if isinstance(value, frozenset) else value
        text.update((_hash_of(value) if isinstance(value, CodeType) else repr(inner)).encode())
    return text.hexdigest()[:12]
