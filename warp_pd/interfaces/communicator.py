"""The processes that compute one sheet together, as a simulation sees them; by default one alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from ..device.fields import Array, Stored
from ..device.launches import Call
from ..families.share import Share
from ..geometry.triangulation import CoarseLattice

T = TypeVar("T")

# Set in the processes that a launcher of this package started: it says itself that one of them has ended.
SPEAKS = "WARP_PD_LAUNCHER_SPEAKS"


class LostError(RuntimeError):
    """Another process of this run has ended."""


class Crew:
    """One process alone, which does everything itself. Several: see torch_backend/processes.py.

    Every process calls the same methods in the same order.

    Attributes:
        rank: Number of this process, from 0.
        size: Number of processes.
        share: What this process has of the sheet; None if there is one alone.
    """

    rank: int = 0
    size: int = 1
    share: Share | None = None

    @property
    def leads(self) -> bool:
        """Whether this process writes files and reports progress."""
        return self.rank == 0

    def together(self, work: Callable[[], T]) -> T:
        """Do work in all processes; if it fails in one, all end."""
        return work()

    def lead(self, work: Callable[[], T]) -> T | None:
        """Do work in the first process, which may ask for whole arrays; None in the others. If it fails, all end."""
        return work()

    def in_turn(self, work: Callable[[], T]) -> T:
        """Do work in the first process, then in all others."""
        return work()

    def any(self, flag: bool) -> bool:
        """Whether a flag is set in any process."""
        return flag

    def least(self, value: float) -> float:
        """The least of a number of all processes."""
        return value

    def gather(self, value: T) -> list[T]:
        """What all processes have, by their number."""
        return [value]

    def spread(self, value: T) -> T:
        """The value that the first process has."""
        return value

    def divide(self, share: Share) -> None:
        """Take a share of the sheet, and tell the others."""
        self.share = share

    def bind(self, register: list[Stored]) -> None:
        """Know the fields that the first process may ask for."""
        return None

    def whole(self, stored: Stored, index: int, share: Share, coarse: CoarseLattice | None) -> np.ndarray:
        """A copy of a field of the whole sheet on the host; within `lead` only.

        Args:
            stored: The field here.
            index: Its number in the register.
            share: What is here.
            coarse: The points to copy, of a field of points; None: all.
        """
        raise NotImplementedError("one process alone has all fields")

    def exchange(self, fields: Sequence[Stored], share: Share) -> Call:
        """A call that fills the halo of some fields with what its owners have."""
        raise NotImplementedError("one process alone has no halo")

    def bring(self, pairs: Sequence[tuple[Array, Array]], share: Share) -> Call:
        """A call that fills arrays of the points of own blocks with what their owners have of others."""
        raise NotImplementedError("one process alone has all blocks")

    def gather_blocks(self, mine: Array, everything: Array, share: Share) -> Call:
        """A call that fills an array [rows, blocks] of the whole sheet with the blocks of all processes."""
        raise NotImplementedError("one process alone has all blocks")
