"""Loading of scenes, by name or from a Python file with a function `build`."""

from __future__ import annotations

import ast
import contextlib
import functools
import hashlib
import importlib
import importlib.machinery
import importlib.util
import inspect
import pkgutil
import re
import sys
import traceback
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import CodeType
from typing import Any

from ..device.checks import InputError, kind_and_text, suggestion, user_code
from ..device.cores import no_collection
from .arguments import converted, is_plain, plain
from .scene_text import WrittenBuild


def scene_names() -> list[str]:
    """Names of the scenes that come with the package."""
    package = importlib.import_module("warp_pd.scenes")
    return sorted(m.name for m in pkgutil.iter_modules(package.__path__) if not m.name.startswith("_"))


def require_scene(name: str) -> None:
    """Check that a scene exists, without importing it."""
    if not name.endswith(".py"):
        names = scene_names()
        if name not in names:
            file = f"{name}.py"
            hint = suggestion(file, [file]) if Path(file).is_file() else suggestion(name, names)
            raise InputError(f"scene = {name!r}: expected a name from `warp-pd list`, or a Python file, *.py{hint}")
    elif not Path(name).is_file():
        raise InputError(f"scene = {name!r}: the file does not exist")


def load_scene(name: str) -> Any:
    """Import the module of a scene, given its name or the path of a Python file with a function `build`."""
    require_scene(name)
    # A fifth of the time to import Warp is garbage collection, and all of Warp stays.
    with no_collection():
        return _load_file(Path(name)) if name.endswith(".py") else importlib.import_module(f"warp_pd.scenes.{name}")


class _FromSource(importlib.machinery.SourceFileLoader):
    """Loads a file as it is: byte code passes for that of any file of the same size from the same second."""

    def get_code(self, fullname: str) -> CodeType:
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)


def _load_file(path: Path) -> Any:
    # A name that hides no other module.
    name = f"warp_pd_scene_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path, loader=_FromSource(name, str(path)))
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # As Python does for a script, so that the file can import modules in its folder.
    folder = str(path.resolve().parent)
    if folder not in sys.path:
        sys.path.insert(0, folder)
    with user_code(functools.partial(_said_in, path)):
        try:
            # Dataclasses look for their module there.
            sys.modules[module.__name__] = module
            spec.loader.exec_module(module)
        except SyntaxError as error:
            line = "" if error.lineno is None else f"line {error.lineno}: "
            raise InputError(f"scene = {str(path)!r}: {line}{error.msg}") from None
    if not callable(getattr(module, "build", None)):
        raise InputError(f"scene = {str(path)!r}: the file has no function build(...) that returns a Simulation")
    return module


def _said_in(path: Path, error: Exception) -> str:
    """One-line message on an error in a scene's file, with the last line number of that file in the traceback."""
    steps = traceback.extract_tb(error.__traceback__)
    lines = [step.lineno for step in steps if Path(step.filename).resolve() == path.resolve()]
    where = f"line {lines[-1]}: " if lines else ""
    return f"scene = {str(path)!r}: {where}{kind_and_text(error)}{_meant(error)}"


def _meant(error: Exception) -> str:
    """The parameter that a mistyped keyword of a class or function of the package may mean, as text; or ""."""
    found = re.match(r"([\w.]+)\(\) got an unexpected keyword argument '(\w+)'", str(error))
    # From version 3.13 on Python says what was meant.
    if not isinstance(error, TypeError) or found is None or "Did you mean" in str(error):
        return ""
    import warp_pd

    called: Any = warp_pd
    for name in found[1].removesuffix(".__init__").split("."):
        called = getattr(called, name, None)
    if called is None:
        return ""
    names = [name for name in inspect.signature(called).parameters if name != "self"]
    return suggestion(found[2], names) or f"; expected one of {', '.join(names)}"


def require_settings(name: str, settings: Mapping[str, Any], values: bool = True) -> None:
    """Check settings against the text of a scene's file, without importing it and with it Warp.

    Names and types are checked, and with `values` also what the text checks of them: see `scene_text.WrittenBuild`. A
    file whose parameters cannot be told from its text is checked by `build_scene` alone.
    """
    require_scene(name)
    written = WrittenBuild.of(scene_file(name))
    if written is None:
        return
    given = _values(name, settings, written.parameters)
    if values:
        written.check(given)


def written_parameters(name: str) -> Mapping[str, inspect.Parameter] | None:
    """The parameters of a scene's `build` by the text of its file; None if that does not tell."""
    written = WrittenBuild.of(scene_file(name))
    return None if written is None else written.parameters


def scene_file(name: str) -> Path:
    """The file of a scene, given its name or its Python file."""
    return (
        Path(name)
        if name.endswith(".py")
        else Path(importlib.import_module("warp_pd.scenes").__path__[0], f"{name}.py")
    )


def _values(name: str, settings: Mapping[str, Any], parameters: Mapping[str, inspect.Parameter]) -> dict[str, Any]:
    """The arguments of a scene's `build` from its settings."""
    values = {key: converted(key, value, parameters) for key, value in settings.items()}
    missing = [
        key
        for key, p in parameters.items()
        if p.default is p.empty and p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY) and key not in values
    ]
    if missing:
        raise InputError(f"scene = {name!r}: {missing[0]} has no default: expected --set {missing[0]}=VALUE")
    return values


def build_scene(name: str, settings: dict[str, Any]) -> Any:
    """Build the simulation of a scene; `settings` maps arguments of its `build` to text or numbers."""
    from ..run.scene import Scene

    scene = load_scene(name)
    parameters = inspect.signature(scene.build).parameters
    values = _values(name, settings, parameters)
    own = name.endswith(".py")
    with user_code(functools.partial(_said_in, Path(name))) if own else contextlib.nullcontext():
        simulation = scene.build(**values)
    if not isinstance(simulation, Scene):
        raise InputError(f"scene = {name!r}: build returned {type(simulation).__name__}; expected a Simulation")
    simulation.check()
    simulation.scene = Path(name).stem
    simulation.file = str(Path(name).resolve()) if own else None
    used = {key: values.get(key, p.default) for key, p in parameters.items()}
    simulation.settings = {key: plain(value) for key, value in used.items() if is_plain(value)}
    simulation.sources = sources_of(Path(scene.__file__))
    return simulation


def sources_of(file: Path) -> dict[str, str]:
    """Hashes of a scene's file and of the modules that it imports from its folder, by file name.

    Comments and blank lines do not affect the hashes.
    """
    found: dict[str, str] = {}
    waiting = [file]
    while waiting:
        path = waiting.pop()
        if path.name not in found and path.is_file():
            found[path.name], imported = _hash_and_imports(path.read_bytes())
            waiting += [file.with_name(f"{name}.py") for name in imported]
    return dict(sorted(found.items()))


@functools.lru_cache(maxsize=64)
def _hash_and_imports(source: bytes) -> tuple[str, tuple[str, ...]]:
    tree = ast.parse(source)
    return hashlib.sha1(ast.dump(tree).encode()).hexdigest()[:12], tuple(_imported(tree))


def _imported(tree: ast.Module) -> Iterator[str]:
    """Last components of all imported names; some of them may be modules in the same folder."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield from (alias.name.rpartition(".")[2] for alias in node.names)
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module.rpartition(".")[2]
