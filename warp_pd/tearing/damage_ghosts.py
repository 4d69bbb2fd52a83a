"""Ghost points of a damage field on several processes.

The damage and its driving energy are exchanged once every other step. The sweeps then also run over ghost points. Each
sweep invalidates one more layer of them, from the outside; after LAYERS sweeps the layers next to the own points are
still correct.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from ..context import Context
from ..device.fields import Array, to_host
from ..device.launches import Call, Stage
from ..geometry.couplings import gradient_couplings
from ..kernels.tearing.damage_step import ghost_kernel

# Layers of ghost points around the halo, and the number of sweeps after which the damage is exchanged again.
LAYERS = 8


class DamageGhosts:
    """Additional launches and data of a damage field on one of several processes."""

    def __init__(self, owner: str, context: Context) -> None:
        assert context.partition is not None
        self.owner, self.context, self.partition = owner, context, context.partition
        self.own = self.partition.owned
        self._list = ghost_kernel(context.bits)

    def areas(self, represented: np.ndarray) -> np.ndarray:
        """Areas represented by the bonds of each point [m^2], (N,); ghost points get the areas of their owners."""
        known = np.where(self.partition.near, represented, self.context.sheet.areas)
        areas = self.context.array("represented_area", self.owner, wp.float64, known, own_exchange=True)
        self._exchange(areas).function()
        return to_host(areas)

    def couplings(self) -> tuple[np.ndarray, np.ndarray]:
        """Neighbours and couplings of the local points, as in `gradient_couplings`; other points are left out."""
        neighbours, couplings = gradient_couplings(self.context.whole, self.partition.points)
        there, places = self.partition.here(neighbours.ravel())
        found = np.tile(np.arange(neighbours.shape[1], dtype=np.int32), (len(neighbours), 1))
        found.flat[there] = places
        left = np.zeros(couplings.shape)
        left.flat[there] = couplings.ravel()[there]
        return found, left

    def add_listing(self, stage: Stage, threads: int, **arrays: Any) -> None:
        """Add the launch that lists ghost points; `threads` are those of a GPU, `arrays` the kernel's arguments."""
        # Warp's atomic operations are not atomic between CPU threads, so one thread does all.
        threads = threads if self.context.device.is_cuda else 1
        stage.launch(
            self.owner, self._list, threads, stride=threads, own_begin=self.own.start, own_end=self.own.stop, **arrays
        )

    def add_exchange(self, stage: Stage, *arrays: Array) -> None:
        """Add the exchange of point arrays."""
        stage.call(self._exchange(*arrays))

    def _exchange(self, *arrays: Array) -> Call:
        stored = [next(s for s in self.context.fields if s.array is array) for array in arrays]
        return self.context.communicator.exchange(stored, self.partition)
