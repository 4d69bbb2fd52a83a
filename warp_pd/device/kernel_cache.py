"""The folder in which Warp keeps compiled kernels: one that cannot be written, and modules that are damaged."""

from __future__ import annotations

import atexit
import contextlib
import functools
import hashlib
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

from .checks import InputError

_notes: list[str] = []
_loaded: set[tuple[Any, str, int | None]] = set()


def notes() -> list[str]:
    """Notes on the cache for the user, one line each."""
    return list(_notes)


def init_warp() -> None:
    """Initialise Warp; if its cache cannot be written, with a temporary one that ends with the process."""
    import warp as wp

    try:
        wp.init()
    except OSError as error:
        _use_temporary(error)
        wp.init()
    try:
        with tempfile.TemporaryFile(dir=wp.config.kernel_cache_dir):
            pass
    except OSError as error:
        _use_temporary(error)
    _keep_headers()
    _compile_once()
    _leave_adjoints_out()
    _resolve_once()


def _compile_once() -> None:
    """Have Warp write a kernel for a CPU once.

    It writes one on vectors alone twice, for strides that are known and for any. The runs of this package take as long
    with the latter, and a module takes a tenth less to compile.
    """
    try:
        from warp._src import codegen
    except ImportError:
        return
    # A name of Warp's own: a version without it does not look at what is set here.
    codegen.cpu_linear_contiguous_specialization_candidate = lambda adj, block_dim: False


def _leave_adjoints_out() -> None:
    """Have Warp write no adjoint of a function that no kernel differentiates; by itself it writes an empty one."""
    try:
        from warp._src import context

        builder: Any = context.ModuleBuilder
        write = builder._codegen_functions
    except (ImportError, AttributeError):
        # Names of Warp's own: a version without them writes what it likes.
        return

    def wanted(function: Any) -> bool:
        adjoint = function.adj
        try:
            written_by_hand = function.native_snippet is not None or adjoint.custom_reverse_mode
            return bool(written_by_hand or adjoint.used_by_backward_kernel or adjoint.force_adjoint_codegen)
        except AttributeError:
            # The same names of another version.
            return True

    def _codegen_functions(self: Any, functions: Any, *given: Any, **parts: Any) -> str:
        if parts.get("reverse_only"):
            functions = [function for function in functions if wanted(function)]
        return str(write(self, functions, *given, **parts))

    builder._codegen_functions = _codegen_functions


def _resolve_once() -> None:
    """Have Warp look for the overload of a builtin once for the types of its arguments.

    It tries all overloads at every call in every kernel, two fifths of the time in which it writes a kernel. What it
    finds depends on the types alone.
    """
    try:
        from warp._src import codegen

        writer: Any = codegen.Adjoint
        resolve, reference = writer.resolve_func, codegen.Reference
    except (ImportError, AttributeError):
        # Names of Warp's own: a version without them looks as it likes.
        return
    found: dict[Any, Any] = {}

    def known(given: Any) -> Any:
        if isinstance(given, type):
            return given
        return (given.value_type,) if type(given) is reference and isinstance(given.value_type, type) else None

    def resolve_func(adj: Any, func: Any, arg_types: Any, kwarg_types: Any, min_outputs: Any) -> Any:
        types = tuple(map(known, arg_types))
        if kwarg_types or None in types or not func.is_builtin():
            return resolve(adj, func, arg_types, kwarg_types, min_outputs)
        key = (func, types, min_outputs)
        if key not in found:
            found[key] = resolve(adj, func, arg_types, kwarg_types, min_outputs)
        return found[key]

    writer.resolve_func = resolve_func


def _keep_headers() -> None:
    """Keep Warp's precompiled headers for a CPU beside the kernels.

    Warp has them made anew by every thread of every process that compiles, which takes a core 1.3 s. Clang writes them
    under another name first, compares them with the headers and the processor, and does without those that do not fit.
    """
    import warp as wp

    try:
        from warp._src import build, context

        native = Path(build.warp_home) / "native" / "builtin.h"
        target = context._get_cpu_target_hash("-march=native")
        runtime: Any = context.runtime
        state = native.stat()
    except (ImportError, AttributeError, OSError):
        # These names are Warp's own: a version without them makes its headers as it likes.
        return
    made_for = hashlib.sha256(f"{native} {state.st_mtime_ns} {state.st_size} {target}".encode()).hexdigest()[:8]

    def folder() -> str:
        path = Path(wp.config.kernel_cache_dir or "") / f"wp_headers_{made_for}"
        path.mkdir(parents=True, exist_ok=True)
        return str(path)

    if runtime.llvm is not None:
        runtime.get_clang_pch_dir = folder


def _use_temporary(error: OSError) -> None:
    """Compile into a temporary folder, which has what can be read of the cache."""
    import warp as wp

    given = wp.config.kernel_cache_dir or os.environ.get("WARP_CACHE_PATH")
    folder = Path(tempfile.mkdtemp(prefix="warp_pd_kernels_"))
    atexit.register(functools.partial(shutil.rmtree, folder, ignore_errors=True))
    wp.config.kernel_cache_dir = str(folder)
    if given is not None:
        with contextlib.suppress(OSError):
            _link(Path(given), folder)
    _notes.append(
        f"kernels: the cache {str(given)!r} cannot be written ({error.strerror}), so kernels are compiled into a "
        "temporary folder, in every process again; set WARP_CACHE_PATH to a folder that can be written"
    )


def _link(given: Path, folder: Path) -> None:
    """Link the files of a cache from another folder, where more can be added."""
    for module in given.iterdir():
        if module.is_dir():
            (folder / module.name).mkdir()
            for file in module.iterdir():
                (folder / module.name / file.name).symlink_to(file.resolve())


def is_loaded(module: Any, device: Any, block_dim: int | None) -> bool:
    """Whether `load_module` has loaded a module in this process; what changed it since then, Warp loads at a launch."""
    return (module, device.alias, block_dim) in _loaded


def load_module(module: Any, device: Any, block_dim: int | None) -> None:
    """Compile or load a Warp module; one that is damaged in the cache is compiled again.

    Raises:
        InputError: if the cache cannot take it.
    """
    import warp as wp

    try:
        module.load(device, block_dim)
        _loaded.add((module, device.alias, block_dim))
        return
    except Exception:  # Warp raises no narrower one for a file that it cannot load.
        folder = Path(wp.config.kernel_cache_dir or "") / module.get_module_identifier(block_dim)
        if not folder.is_dir():
            # It was not in the cache: what failed is its compilation.
            _require_room(folder.parent)
            raise
    shutil.rmtree(folder, ignore_errors=True)
    module.mark_modified()
    module.load(device, block_dim)
    _loaded.add((module, device.alias, block_dim))


def _require_room(cache: Path) -> None:
    try:
        with tempfile.TemporaryFile(dir=cache) as file:
            file.write(bytes(1_000_000))
    except OSError as error:
        raise InputError(
            f"kernels: the cache {str(cache)!r} cannot take another one ({error.strerror}); expected WARP_CACHE_PATH "
            "to name a folder with room"
        ) from None
