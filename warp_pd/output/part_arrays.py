"""Arrays in HDF5 files, of which one reads some rows."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np

from ..device.checks import InputError


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write arrays under another name, and move the file into place when it is whole."""
    part = path.with_name(path.name + ".part")
    with h5py.File(part, "w", locking=False) as file:
        for name, values in arrays.items():
            file[name] = values
    os.replace(part, path)


def read_rows(path: Path, name: str, rows: slice, axis: int) -> np.ndarray:
    """Some rows of an array, along an axis.

    Raises:
        InputError: for a file that is missing or damaged.
    """
    try:
        with h5py.File(path, "r", locking=False) as file:
            return np.asarray(file[name][(slice(None),) * axis + (rows,)])
    except (OSError, KeyError, RuntimeError) as error:
        raise InputError(f"resume: {str(path)!r} is missing or damaged ({type(error).__name__})") from None
