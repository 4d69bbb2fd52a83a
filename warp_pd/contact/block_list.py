"""Lists of marked points or triangles on a device, divided among blocks of threads."""

from __future__ import annotations

from typing import Any

import warp as wp

from ..context import Context
from ..device.fields import Array
from ..device.launches import Stage
from ..kernels.contact.block_lists import list_marked
from ..kernels.effects import Kernel

# Number of threads per block on a GPU that work on a list, or make a long one, and maximum number of blocks; more would
# not run at once. A short list takes no other number, for which Warp's header would be compiled anew.
LANES, LISTING, MOST_BLOCKS = 256, 1024, 128


class BlockList:
    """List of marked points or triangles, in parts that belong to blocks of threads (kernels/contact/block_lists.py).

    Attributes:
        blocks: Number of blocks.
        size: Entries per block, a multiple of 32.
        entries: Room for a list of each block, int32.
        listed: Number of entries in each list, int32.
        counts, arrived: Room for `sum_of_blocks`.
    """

    def __init__(self, name: str, owner: str, marks: Array, context: Context) -> None:
        self._name, self._owner, self._marks = name, owner, marks
        self._cuda, self._context = context.device.is_cuda, context
        self.blocks = min(MOST_BLOCKS, -(-marks.size // LANES))
        self.size = 32 * -(-marks.size // (32 * self.blocks))
        self.entries = context.array(f"{name}_entries", owner, wp.int32, shape=self.blocks * self.size, per="table")
        self.listed = self.room("listed", wp.int32)
        self.counts = self.room("counts", wp.int32)
        self.arrived = context.array(f"{name}_arrived", owner, wp.int32, shape=1, per="once")

    def room(self, what: str, dtype: Any) -> Array:
        """An array with an entry for each block."""
        return self._context.array(f"{self._name}_{what}", self._owner, dtype, shape=self.blocks, per="block")

    def add(self, stage: Stage) -> None:
        """Add the launch that makes the list."""
        made = {"entries": self.entries, "counts": self.listed}
        self.launch(stage, list_marked, LANES if self.size <= LANES else LISTING, marks=self._marks, **made)

    def launch(self, stage: Stage, kernel: Kernel, lanes: int = LANES, /, **arguments: Any) -> None:
        """Add a launch of a kernel on all blocks."""
        # On a CPU a block has one thread.
        threads = self.blocks * (lanes if self._cuda else 1)
        stage.launch(self._owner, kernel, threads, block_dim=lanes, block=self.size, **arguments)
