"""The communicator between the processes of a run; this default is for a single process."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from .device.fields import Array, FieldRegister, Stored
from .device.launches import Call, Stage
from .families.partition import Partition
from .geometry.sheet import Sheet
from .geometry.triangulation import CoarseLattice
from .kernels.effects import Kernel

T = TypeVar("T")

# Environment variable of the processes that this package's launcher started: it reports itself that one has ended.
LAUNCHER_REPORTS = "WARP_PD_LAUNCHER_REPORTS"


class LostError(RuntimeError):
    """Another process of this run has ended."""


class Communicator:
    """Communicator of a single process; for several processes see distributed/communicator.py.

    Every process calls the same methods in the same order.

    Attributes:
        rank: Number of this process, from 0, the root.
        size: Number of processes.
        partition: The part of the sheet in this process; None for a single process.
    """

    rank: int = 0
    size: int = 1
    partition: Partition | None = None

    @property
    def is_root(self) -> bool:
        """Whether this process writes files and reports progress."""
        return self.rank == 0

    def root(self, work: Callable[[], T]) -> T | None:
        """Run `work` in the root, which may request whole arrays, and raise its errors in all; None in the others."""
        return work()

    def barrier(self, work: Callable[[], T]) -> T:
        """Run `work` in all processes and wait for all; an error in one process is raised in all."""
        return work()

    def root_first(self, work: Callable[[], T]) -> T:
        """Run `work` in the root, then in all others."""
        return work()

    def broadcast(self, value: T) -> T:
        """The value of the root."""
        return value

    def gather(self, value: T) -> list[T]:
        """The values of all processes, by rank, in every process."""
        return [value]

    def any(self, flag: bool) -> bool:
        """Whether `flag` is set in any process."""
        return flag

    def minimum(self, value: float) -> float:
        """The minimum of `value` over all processes."""
        return value

    def set_partition(self, partition: Partition) -> None:
        """Set the partition of this process and announce it to the others."""
        self.partition = partition

    def partition_sheet(self, sheet: Sheet, horizon: float, layers: int) -> Partition:
        """The partition of a whole sheet for this process.

        Args:
            sheet: The whole sheet.
            horizon: In its spacings.
            layers: Layers of further points (neighbours in triangles) around the halo.
        """
        raise NotImplementedError("a single process has the whole sheet")

    def sheet_here(self, sheet: Sheet, partition: Partition) -> Sheet:
        """The points of a partition of a whole sheet, as a sheet."""
        raise NotImplementedError("a single process has the whole sheet")

    def tables_here(self, sheet: Sheet, partition: Partition, settings: tuple[float, Any, str]) -> Any:
        """Families and weights of the points of a partition; settings and result as for `laws.weight_tables`."""
        raise NotImplementedError("a single process has the whole sheet")

    def add_exchanges(self, stages: Sequence[Stage], fields: FieldRegister) -> None:
        """Let the stages of a simulation exchange what they need, once all are composed."""
        return None

    def register_fields(self, fields: list[Stored]) -> None:
        """Register the fields that the root may request."""
        return None

    def gather_field(
        self, stored: Stored, index: int, partition: Partition, coarse: CoarseLattice | None
    ) -> np.ndarray:
        """Copy a field of the whole sheet to the host; only allowed within `root`.

        Args:
            stored: The field in this process.
            index: Its index among the registered fields.
            partition: The part of the sheet in this process.
            coarse: The points of a point field to copy; None for all.
        """
        raise NotImplementedError("a single process already has all fields")

    def exchange(self, fields: Sequence[Stored], partition: Partition) -> Call:
        """Return a function that fills the ghost points of the fields with the values of their owners."""
        raise NotImplementedError("a single process has no ghost points")

    def launch_on_scattered_blocks(
        self, context: Any, stage: Stage, launch: tuple[str, Kernel, int], arrays: Mapping[str, Array | None],
        sums: Mapping[str, Array], outputs: Sequence[str], others: Mapping[str, Any],
    ) -> None:  # fmt: skip
        """`Context.launch_on_blocks` where the points of a block are in several processes."""
        raise NotImplementedError("a single process already has all blocks")

    def gather_blocks(self, mine: Array, everything: Array, partition: Partition) -> Call:
        """Return a function that fills an array [rows, blocks] of the whole sheet with the blocks of all processes."""
        raise NotImplementedError("a single process already has all blocks")
