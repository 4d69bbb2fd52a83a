"""Results that are the same for the same input, kept from run to run of a process."""

from __future__ import annotations

import copy
import dataclasses
import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")

# Bytes that are kept at most; what takes more than half of them is not kept.
MOST = 2**26


class ResultCache:
    """The results of one function, the last ones used, by the content of its arguments.

    What is kept is a copy, whose arrays are read-only: neither a run nor an argument that changes later changes it.
    """

    def __init__(self, most: int = MOST) -> None:
        self.most, self.nbytes = most, 0
        self._results: OrderedDict[bytes, tuple[Any, int]] = OrderedDict()
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._results)

    def result(self, make: Callable[..., T], *arguments: Any) -> T:
        """Return make(*arguments), or what it returned for arguments of the same content."""
        key = content(arguments)
        if key is None:
            return make(*arguments)
        with self._lock:
            if key in self._results:
                self._results.move_to_end(key)
                return self._results[key][0]  # type: ignore[no-any-return]
        made = make(*arguments)
        size = sum(array.nbytes for array in arrays_of(made))
        if 2 * size > self.most:
            return made
        made = copy.deepcopy(made)
        for array in arrays_of(made):
            array.flags.writeable = False
        with self._lock:
            self.nbytes += size - self._results.pop(key, (None, 0))[1]
            self._results[key] = made, size
            while self.nbytes > self.most:
                self.nbytes -= self._results.popitem(last=False)[1][1]
        return made


def content(value: Any) -> bytes | None:
    """A hash of what a value contains; None for one with functions or objects that it cannot read."""
    found = hashlib.blake2b(digest_size=32)
    try:
        for part in _parts(value):
            found.update(part)
    except TypeError:
        return None
    return found.digest()


def _parts(value: Any) -> Iterator[bytes]:
    """What a value contains, piece by piece, each with its type and length. Raises TypeError for other values."""
    if isinstance(value, np.ndarray):
        if value.dtype.hasobject:
            raise TypeError("an array of objects")
        yield f"array {value.dtype.str} {value.shape}".encode()
        yield value.tobytes()
    elif value is None or isinstance(value, (bool, int, float, str, np.generic)):
        yield f"{type(value).__name__} {value!r};".encode()
    elif isinstance(value, (tuple, list)):
        yield f"{type(value).__name__} {len(value)}:".encode()
        for each in value:
            yield from _parts(each)
    elif isinstance(value, Mapping):
        yield f"mapping {len(value)}:".encode()
        for key, each in value.items():
            yield from _parts(key)
            yield from _parts(each)
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield f"{type(value).__module__}.{type(value).__qualname__}:".encode()
        for each in dataclasses.fields(value):
            yield from _parts(vars(value)[each.name])
    else:
        raise TypeError(type(value).__name__)


def arrays_of(value: Any) -> Iterator[np.ndarray]:
    """The arrays of a result: of tuples, lists, mappings and dataclasses."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, (tuple, list)):
        for each in value:
            yield from arrays_of(each)
    elif isinstance(value, Mapping):
        for each in value.values():
            yield from arrays_of(each)
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        for each in dataclasses.fields(value):
            yield from arrays_of(vars(value)[each.name])
