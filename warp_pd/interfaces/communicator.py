"""The communicator of the processes that compute one sheet together; by default one process alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from ..device.fields import Array, Stored
from ..device.launches import Call
from ..families.partition import Partition
from ..geometry.triangulation import CoarseLattice

T = TypeVar("T")

# Environment variable of the processes that this package's launcher started: it reports itself that one has ended.
LAUNCHER_REPORTS = "WARP_PD_LAUNCHER_REPORTS"


class LostError(RuntimeError):
    """Another process of this run has ended."""


class Communicator:
    """One process alone, which does everything itself. Several: see run/distributed/communicator.py.

    Every process calls the same methods in the same order.

    Attributes:
        rank: Number of this process, from 0, the root.
        size: Number of processes.
        partition: The part of the sheet that this process has; None if there is one process alone.
    """

    rank: int = 0
    size: int = 1
    partition: Partition | None = None

    @property
    def is_root(self) -> bool:
        """Whether this process writes files and reports progress."""
        return self.rank == 0

    def root(self, work: Callable[[], T]) -> T | None:
        """Do work in the root, which may ask for whole arrays; None in the others. If it fails, it fails in all."""
        return work()

    def barrier(self, work: Callable[[], T]) -> T:
        """Do work in all processes and wait for all; if it fails in one, it fails in all."""
        return work()

    def root_first(self, work: Callable[[], T]) -> T:
        """Do work in the root, then in all others."""
        return work()

    def broadcast(self, value: T) -> T:
        """The value of the root."""
        return value

    def gather(self, value: T) -> list[T]:
        """The values of all processes, by rank; every process gets them."""
        return [value]

    def any(self, flag: bool) -> bool:
        """Whether a flag is set in any process."""
        return flag

    def minimum(self, value: float) -> float:
        """The least of the numbers of all processes."""
        return value

    def set_partition(self, partition: Partition) -> None:
        """Take a part of the sheet, and tell the others."""
        self.partition = partition

    def register_fields(self, fields: list[Stored]) -> None:
        """Know the fields that the root may ask for."""
        return None

    def gather_field(
        self, stored: Stored, index: int, partition: Partition, coarse: CoarseLattice | None
    ) -> np.ndarray:
        """A copy of a field of the whole sheet on the host; within `root` only.

        Args:
            stored: The field here.
            index: Its number among the registered fields.
            partition: What is here.
            coarse: The points to copy, of a field of points; None: all.
        """
        raise NotImplementedError("one process alone has all fields")

    def exchange(self, fields: Sequence[Stored], partition: Partition) -> Call:
        """A call that fills the ghost points of some fields with the values of their owners."""
        raise NotImplementedError("one process alone has no ghost points")

    def gather_to_blocks(self, pairs: Sequence[tuple[Array, Array]], partition: Partition) -> Call:
        """A call that fills the second array of each pair (points of own blocks) from the owners of the points."""
        raise NotImplementedError("one process alone has all blocks")

    def gather_blocks(self, mine: Array, everything: Array, partition: Partition) -> Call:
        """A call that fills an array [rows, blocks] of the whole sheet with the blocks of all processes."""
        raise NotImplementedError("one process alone has all blocks")
