"""Columns of HDF5 files, which grow. They get open groups of a file, whose types HDF5 does not export."""

from __future__ import annotations

from typing import Any

import numpy as np

# HDF5 splits a column's table of chunks when it has taken in 64 more; a kill in that split would cost the
# file. Chunks of many frames make splits rare.
_CHUNK_BYTES = 2**20
# HDF5 takes no chunk of 4 GB.
_MOST_BYTES = 2**30


def create_column(
    group: Any,
    name: str,
    dtype: Any,
    row_shape: tuple[int, ...] = (),
    rows_per_frame: int = 1,
) -> None:
    """A column without rows that can grow."""
    row_bytes = np.dtype(dtype).itemsize * int(np.prod(row_shape, dtype=int))
    # A whole number of frames, at most 16 of them, so that a short run of a small sheet makes a small file.
    frames = min(max(_CHUNK_BYTES // (row_bytes * max(rows_per_frame, 1)), 1), 16)
    rows = min(max(frames * rows_per_frame, 64), _MOST_BYTES // row_bytes)
    group.create_dataset(name, (0, *row_shape), dtype, maxshape=(None, *row_shape), chunks=(rows, *row_shape))


def add_rows(column: Any, rows: Any) -> None:
    """Add rows at the end."""
    held = len(column)
    column.resize(held + len(rows), axis=0)
    column[held:] = rows


def columns(group: Any) -> list[Any]:
    """All columns in a group and in the groups inside it."""
    found: list[Any] = []
    for member in group.values():
        found.extend(columns(member) if hasattr(member, "values") else [member])
    return found


def shorten(column: Any, rows: int) -> None:
    """Remove all but the first rows."""
    if len(column) > rows:
        column.resize(rows, axis=0)
