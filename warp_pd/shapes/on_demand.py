"""Arrays of a shape that are computed when they are asked for, and forgotten afterwards.

A large lattice would hold 48 bytes a point on every process: positions, areas and triangles follow from its rows and
columns.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

# Entries that are computed at once.
CHUNK = 2**18


class OnDemand:
    """An array that is computed when it is asked for."""

    def __init__(self, length: int, of: Callable[[np.ndarray], np.ndarray]) -> None:
        """Compute nothing yet.

        Args:
            length: Number of entries.
            of: Entries at some indices, as an array.
        """
        self._length, self.of = length, of
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

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """All entries, for functions of NumPy."""
        return np.array(self.whole(), dtype=dtype, copy=copy)

    def whole(self) -> np.ndarray:
        """All entries, the same array as long as anyone holds it."""
        found = None if self._whole is None else self._whole()
        if found is None:
            few = self.of(np.arange(0))
            found = np.empty((self._length, *few.shape[1:]), few.dtype)
            for begin in range(0, self._length, CHUNK):
                end = min(begin + CHUNK, self._length)
                found[begin:end] = self.of(np.arange(begin, end))
            key = id(found)
            self._whole = weakref.ref(found, lambda _: _origins.pop(key, None))
            _origins[key] = self
        return found

    def remaining(self, numbers: np.ndarray | None) -> np.ndarray:
        """Those of some numbers, rising, that may still be there; None: all that are."""
        return np.arange(self._length) if numbers is None else numbers

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
