"""Helpers for file readers: paths, units, and lists of indices in messages."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..device.checks import MAX_SHOWN, InputError, one_of, positive, show

METERS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "in": 0.0254}
UNITS = f"expected {', '.join(repr(name) for name in METERS)} or a number of meters"


def existing_file(path: Any) -> Path:
    """Convert to a Path and check that the file exists."""
    if not isinstance(path, str | os.PathLike):
        raise InputError(f"path = {show(path)}: expected the path of a file")
    found = Path(path)
    if not found.is_file():
        what = "expected a file, not a folder" if found.is_dir() else "the file does not exist"
        raise InputError(f"path = {str(path)!r}: {what}")
    return found


def meters(unit: Any) -> float:
    """Length of a unit [m], given by name or as a number of meters. Raises InputError for any other value."""
    if unit is None:
        raise InputError(f"unit = None: {UNITS}; the file does not say its unit")
    if isinstance(unit, str):
        return METERS[one_of("unit", unit, METERS)]
    return positive("unit", unit)


def listed(indices: np.ndarray, noun: str) -> str:
    """Text like "faces 3, 7, 9" or "edges (3, 4), (7, 9), ... (12 in all)", for indices (K,) or pairs (K, 2)."""
    rows = [f"({', '.join(map(str, row))})" if np.ndim(row) else str(row) for row in indices[:MAX_SHOWN].tolist()]
    more = f", ... ({len(indices)} in all)" if len(indices) > MAX_SHOWN else ""
    return f"{noun if len(indices) == 1 else noun + 's'} {', '.join(rows)}{more}"


def _reason(path: Path, error: Exception) -> str:
    """Why a library could not read a file, and what would be read."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror.lower()
    if isinstance(error, EOFError | RecursionError):
        return "the file ends too early" if isinstance(error, EOFError) else "its elements are nested too deeply"
    expected = f"expected a complete {path.suffix.lower() or 'mesh'} file of a common version"
    if isinstance(error, SyntaxError) and hasattr(error, "position"):
        line, column = error.position
        return f"line {line}, column {column + 1}: expected well-formed XML"
    if isinstance(error, UnicodeDecodeError):
        return f"its byte {error.start} is no text; {expected}"
    if isinstance(error, MemoryError):
        return f"it asks for more memory than there is; {expected}"
    return f"{expected}; write it again, or in another format"


@contextlib.contextmanager
def library_reads(path: Path) -> Iterator[None]:
    """Context in which a library reads a file; what it prints goes to stderr if it could.

    Raises:
        InputError: in place of any error of the library, whose words are those of its own code.
    """
    printed = io.StringIO()
    try:
        # meshio multiplies what may be no number of triangles, to see whether an STL file is binary.
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed), np.errstate(over="ignore"):
            yield
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"path = {str(path)!r}: the file cannot be read: {_reason(path, error)}") from error
    if printed.getvalue():
        print(printed.getvalue().rstrip(), file=sys.stderr)
