"""Reading of .npz files, which may be damaged or come from elsewhere."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from .checks import InputError, user_code

# Arrays of a file; a run or a network has a few dozen.
MOST_ARRAYS = 1000


def read_arrays(where: str, path: Path, most: int) -> dict[str, np.ndarray]:
    """All arrays of a file of at most `most` bytes after decompression, without any Python objects in it.

    Raises:
        InputError: in one line that begins with `where`, if the file is larger or cannot be read.
    """
    with user_code(lambda error: f"{where}: the file is damaged ({type(error).__name__})"):
        with zipfile.ZipFile(path) as archive:
            sizes = [entry.file_size for entry in archive.infolist()]
        if len(sizes) > MOST_ARRAYS or sum(sizes) > most:
            raise InputError(
                f"{where}: it has {len(sizes)} arrays of {sum(sizes) / 1e6:.3g} MB: expected at most {MOST_ARRAYS} of "
                f"{most / 1e6:.3g} MB"
            )
        with np.load(path, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
