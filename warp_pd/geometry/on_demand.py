"""Arrays of a shape that are computed when they are asked for, and forgotten afterwards.

A large lattice would hold 48 bytes a point on every process: positions, areas and triangles follow from its rows and
columns.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from ..device.cores import cores

# Entries that are computed at once.
CHUNK = 2**18
# Entries that NumPy sums up at once, for all this module knows.
LEAF = 2**18
# So many chunks are computed one after the other.
SERIAL_CHUNKS = 4


def for_each_chunk(first: int, last: int, work: Callable[[int], None], size: int | None = None) -> None:
    """Call `work` with the begin of each chunk from first to last, on all cores if there are many.

    Args:
        first: First entry.
        last: The one after the last.
        work: What is called.
        size: Entries of a chunk.
    """
    begins = range(first, last, size or CHUNK)
    for _ in cores().map(work, begins) if len(begins) > SERIAL_CHUNKS else map(work, begins):
        pass


def mean_of(values: Stored) -> float:
    """The mean that NumPy finds of an array, to the last bit, without the whole of one that is computed on demand."""
    if isinstance(values, np.ndarray):
        return float(values.mean())
    length = len(values)
    # NumPy halves what it sums up, the lower half of whole eights, until few are left.
    ends = _leaves(0, length)
    sums = np.empty(len(ends))

    def add(number: int) -> None:
        sums[number] = np.add.reduce(values.run(*ends[number]))

    for _ in cores().map(add, range(len(ends))):
        pass
    found = iter(sums.tolist())

    def total(number: int) -> float:
        if number <= LEAF:
            return float(next(found))
        low = number // 2 - number // 2 % 8
        return total(low) + total(number - low)

    return total(length) / length


def _leaves(begin: int, number: int) -> list[tuple[int, int]]:
    if number <= LEAF:
        return [(begin, begin + number)]
    low = number // 2 - number // 2 % 8
    return _leaves(begin, low) + _leaves(begin + low, number - low)


class OnDemand:
    """An array that is computed when it is asked for."""

    def __init__(
        self, length: int, of: Callable[[np.ndarray], np.ndarray],
        run: Callable[[int, int], np.ndarray] | None = None,
    ) -> None:  # fmt: skip
        """Compute nothing yet.

        Args:
            length: Number of entries.
            of: Entries at some indices, as an array.
            run: Entries from a first index to one before a last, if there is a faster way than by `of`.
        """
        self._length, self.of = length, of
        self.run = run or (lambda begin, end: of(np.arange(begin, end)))
        self._whole: weakref.ref[np.ndarray] | None = None

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, indices: np.ndarray) -> np.ndarray:
        """Entries at some indices, none below zero."""
        few = self.of(indices[:0])
        found = np.empty((len(indices), *few.shape[1:]), few.dtype)
        for begin in range(0, len(indices), CHUNK):
            found[begin : begin + CHUNK] = self.of(indices[begin : begin + CHUNK])
        return found

    def span(self, first: int, last: int) -> np.ndarray:
        """Entries first to last - 1."""
        few = self.of(np.arange(0))
        found = np.empty((last - first, *few.shape[1:]), few.dtype)

        def fill(begin: int) -> None:
            end = min(begin + CHUNK, last)
            found[begin - first : end - first] = self.run(begin, end)

        for_each_chunk(first, last, fill)
        return found

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """All entries, for functions of NumPy."""
        return np.array(self.whole(), dtype=dtype, copy=copy)

    def whole(self) -> np.ndarray:
        """All entries, the same array as long as anyone holds it."""
        found = None if self._whole is None else self._whole()
        if found is None:
            found = self.span(0, self._length)
            key = id(found)
            self._whole = weakref.ref(found, lambda _: _origins.pop(key, None))
            _origins[key] = self
        return found

    def remaining(self, numbers: np.ndarray | None) -> np.ndarray:
        """Those of some numbers, rising, that may still be there; None: all that are."""
        return np.arange(self._length) if numbers is None else numbers

    def left_out(self) -> np.ndarray | None:
        """Numbers of the entries that were left out, rising; None: unknown."""
        return np.zeros(0, np.int64)

    def at(self, numbers: np.ndarray) -> np.ndarray:
        """Entries of some numbers."""
        return self[numbers]

    def without(self, numbers: np.ndarray) -> Without:
        """The array without the entries of some numbers, rising."""
        return Without(self, numbers)


class Without(OnDemand):
    """The entries of another array without some.

    Attributes:
        source: The other array.
        gone: Indices of the entries that are left out, rising.
    """

    source: OnDemand
    gone: np.ndarray

    def __init__(self, source: OnDemand, gone: np.ndarray) -> None:
        self.source, self.gone = source, gone
        # Number of entries left before each of those that are gone.
        before = gone - np.arange(len(gone))
        super().__init__(len(source) - len(gone), lambda i: source.of(i + np.searchsorted(before, i, side="right")))

    def remaining(self, numbers: np.ndarray | None) -> np.ndarray:
        """Those of some numbers, rising, that may still be there; None: all that are."""
        return np.setdiff1d(self.source.remaining(numbers), self.gone, assume_unique=True)

    def left_out(self) -> np.ndarray | None:
        """Numbers of the entries that were left out, rising; None: unknown."""
        return self.gone

    def at(self, numbers: np.ndarray) -> np.ndarray:
        """Entries of some numbers."""
        return self.source[numbers]

    def without(self, numbers: np.ndarray) -> Without:
        """The array without the entries of some numbers, rising."""
        return Without(self.source, np.union1d(self.gone, numbers))


class InMemory:
    """An array, with the methods of one that is computed on demand."""

    def __init__(self, array: np.ndarray) -> None:
        self._array = array

    def remaining(self, numbers: np.ndarray | None) -> np.ndarray:
        """Those of some numbers, rising, that may still be there; None: all that are."""
        # An array does not know which entries were left out before.
        return np.arange(len(self._array))

    def left_out(self) -> np.ndarray | None:
        """Numbers of the entries that were left out, rising; None: unknown."""
        return None

    def at(self, numbers: np.ndarray) -> np.ndarray:
        """Entries of some numbers."""
        return np.asarray(self._array[numbers])

    def without(self, numbers: np.ndarray) -> np.ndarray:
        """The array without the entries of some numbers, rising."""
        return np.delete(self._array, numbers, 0)


class Entries(Protocol):
    """Entries of an array by their numbers, some of which can be left out.

    Numbers of an array on demand count the entries before any was left out.
    """

    def remaining(self, numbers: np.ndarray | None) -> np.ndarray:
        """Those of some numbers, rising, that may still be there; None: all that are."""

    def left_out(self) -> np.ndarray | None:
        """Numbers of the entries that were left out, rising; None: unknown."""

    def at(self, numbers: np.ndarray) -> np.ndarray:
        """Entries of some numbers."""

    def without(self, numbers: np.ndarray) -> Stored:
        """The array without the entries of some numbers, rising."""


Stored = np.ndarray | OnDemand
# What each whole array that still exists was computed by.
_origins: dict[int, OnDemand] = {}


def entries(value: Stored) -> Entries:
    """The entries of an array, whether it is in memory or computed on demand."""
    return value if isinstance(value, OnDemand) else InMemory(value)


class StoredField:
    """A field of a dataclass that holds an array, or what computes it; reading it gives the array."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, instance: Any, owner: type) -> Any:
        if instance is None:
            return self
        value = vars(instance)[self._name]
        return value.whole() if isinstance(value, OnDemand) else value

    def __set__(self, instance: Any, value: Stored) -> None:
        # A copy of a shape takes what computes the array, not the array.
        vars(instance)[self._name] = value if isinstance(value, OnDemand) else _origins.get(id(value), value)
