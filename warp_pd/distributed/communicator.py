"""The communicator of several processes, using torch.distributed: NCCL on GPUs, Gloo on CPUs.

`torchrun` starts the processes. Halos and sums go from device to device; files, errors and progress go through the
root.
"""

from __future__ import annotations

import atexit
import os
import pickle
from collections.abc import Callable, Sequence
from datetime import timedelta
from typing import Any, TypeVar

import numpy as np
import torch
import torch.distributed as dist
import warp as wp

from ..communicator import LostError
from ..device.checks import InputError
from ..device.cores import start_warp
from ..device.fields import Array, Stored, to_host
from ..device.launches import Call, Touched
from ..families.partition import Partition
from ..geometry.triangulation import CoarseLattice
from ..kernels.block_sums import BLOCK
from ..papers.neural.torch_step import capture, release_graphs
from .divided import DividedSheet
from .messages import Exchange, LocalCopy, Message, lost_processes_reported, stream_of

T = TypeVar("T")

# A frame may be long, and the first process may draw pictures meanwhile: a process that died is noticed otherwise.
PATIENCE = timedelta(hours=24)


def _leave() -> None:
    if dist.is_initialized():
        # NCCL waits for the graphs that hold its work.
        release_graphs()
        dist.destroy_process_group()


class TorchCommunicator(DividedSheet):
    """The group of processes started by torchrun.

    Attributes:
        device: The Torch device of this process.
    """

    def __init__(self, cuda: bool) -> None:
        """Join the process group; `cuda`: the sheet is on GPUs, one per process."""
        if cuda:
            torch.cuda.set_device(int(os.environ.get("LOCAL_RANK", "0")))
            # An exchange goes before the launches of the interior that fill the device meanwhile.
            os.environ.setdefault("TORCH_NCCL_HIGH_PRIORITY", "1")
        with lost_processes_reported():
            if not dist.is_initialized():
                backend = "cpu:gloo,cuda:nccl" if cuda else "gloo"
                dist.init_process_group(backend, timeout=PATIENCE)
                # Threads of Gloo that still wait would end the process by SIGABRT.
                atexit.register(_leave)
            self.rank, self.size = dist.get_rank(), dist.get_world_size()
        # Processes on one machine divide its cores among them; Torch uses one core in each.
        torch.set_num_threads(1)

    def barrier(self, work: Callable[[], T]) -> T:
        """Run `work` in all processes and wait for all; an error in one process is raised in all."""
        result, error = None, None
        try:
            result = work()
        except LostError:
            raise
        except (Exception, KeyboardInterrupt) as caught:
            error = caught
        errors: list[Any] = [None] * self.size
        with lost_processes_reported():
            dist.all_gather_object(errors, None if error is None else _pickled(error))
        first = next((rank for rank, text in enumerate(errors) if text is not None), None)
        if first is not None:
            raise error if first == self.rank and error is not None else pickle.loads(errors[first])
        return result  # type: ignore[return-value]

    def root(self, work: Callable[[], T]) -> T | None:
        """Run `work` in the root while the other processes answer its requests for fields."""
        if not self.is_root:
            self._serve()
            return None
        try:
            result = work()
        except LostError:
            raise
        except (Exception, KeyboardInterrupt) as error:
            self._broadcast(("end", _pickled(error)))
            raise
        self._broadcast(("end", None))
        return result

    def _broadcast(self, value: Any) -> Any:
        found = [value]
        with lost_processes_reported():
            dist.broadcast_object_list(found, src=0)
        return found[0]

    def _serve(self) -> None:
        while True:
            what, value = self._broadcast(None)
            if what == "end":
                if value is not None:
                    raise pickle.loads(value)
                return
            index, name, coarse = value
            if self.partition is None or self._fields[index].name != name:
                raise RuntimeError(f"field {name!r}: expected the same fields in all processes")
            self._send_own(self._fields[index], self.partition, coarse)

    def set_partition(self, partition: Partition) -> None:
        """Set the partition of this process and announce it to the others."""
        self.partition = partition
        # Points whose families are complete in the receiving process have bond data; the further layers have only what
        # their owner exchanges itself.
        whole = np.ones(len(partition.points), bool)
        masks = {"bond": partition.near, "point": partition.halo, "own": whole}
        self._routes = {kind: self._find_routes(partition, mask) for kind, mask in masks.items()}

    def register_fields(self, fields: list[Stored]) -> None:
        """Register the fields that the root may request."""
        self._fields = fields

    def gather_field(
        self, stored: Stored, index: int, partition: Partition, coarse: CoarseLattice | None
    ) -> np.ndarray:
        """Copy a field of the whole sheet to the host; only allowed within `root`."""
        if stored.field.per not in ("point", "bond", "face", "block"):
            return to_host(stored.array)
        self._broadcast(("field", (index, stored.name, coarse)))
        return self._send_own(stored, partition, coarse)

    def _send_own(self, stored: Stored, partition: Partition, coarse: CoarseLattice | None) -> np.ndarray:
        """Gather the owned parts of a field in the root, which returns the whole field."""
        per, chosen = stored.field.per, None
        places: Any = None
        if coarse is not None:
            first, own = int(partition.points[0]), partition.owned
            chosen = coarse.points(first + own.start, first + own.stop) - first
        values = to_host(stored.array, chosen)
        if per in ("point", "bond") and coarse is None:
            values = values[partition.owned] if per == "point" else values[:, partition.owned]
            if partition.owners is not None:
                places = partition.points[partition.owned]
        if per == "face":
            places = partition.faces
        parts: Any = [None] * self.size if self.is_root else None
        with lost_processes_reported():
            dist.gather_object((np.ascontiguousarray(values), places), parts)
        if parts is None:
            return values
        axis = values.ndim - 1 if per == "block" else int(per == "bond")
        whole = np.concatenate([part for part, _ in parts], axis=axis)
        if places is None:
            return whole
        found = np.empty_like(whole)
        found[(slice(None),) * axis + (np.concatenate([where for _, where in parts]),)] = whole
        return found

    def root_first(self, work: Callable[[], T]) -> T:
        """Run `work` in the root, then in all others, for example so that they find files that the root has written."""
        found = self.root(work)
        return self.barrier(lambda: work() if found is None else found)

    def any(self, flag: bool) -> bool:
        """Whether `flag` is set in any process."""
        return self._reduced(float(flag), dist.ReduceOp.MAX) > 0.0

    def minimum(self, value: float) -> float:
        """The minimum of `value` over all processes."""
        return self._reduced(value, dist.ReduceOp.MIN)

    def _reduced(self, value: float, operation: Any) -> float:
        number = torch.tensor([value], dtype=torch.float64)
        with lost_processes_reported():
            dist.all_reduce(number, operation)
        return float(number[0])

    def gather(self, value: T) -> list[T]:
        """The values of all processes, by rank."""
        found: list[Any] = [None] * self.size
        with lost_processes_reported():
            dist.all_gather_object(found, value)
        return found

    def broadcast(self, value: T) -> T:
        """The value of the root."""
        return self._broadcast(value)  # type: ignore[no-any-return]

    def exchange(self, fields: Sequence[Stored], partition: Partition) -> Call:
        """Return a function that fills the ghost points of the fields with the values of their owners."""
        messages = [
            Message(stored.array, stored.array, rank, mine, theirs, tag)
            for tag, stored in enumerate(fields)
            for rank, mine, theirs in self._routes["own" if stored.field.own_exchange else stored.field.per]
        ]
        exchange = Exchange(messages, fields[0].array.device)
        addresses = frozenset(int(stored.array.ptr) for stored in fields)
        names = ", ".join(stored.name for stored in fields)
        threads = sum(message.points for message in messages)
        touched = Touched(addresses, frozenset(), addresses)
        return Call(f"exchange {names}", "processes", threads, exchange, capture, touched)

    def _find_routes(self, partition: Partition, mask: np.ndarray) -> list[tuple[int, np.ndarray, np.ndarray]]:
        """For each other process: its rank, the owned points that it needs, and the ghost points that it owns.

        Of the ghost points, only those of the mask, (n,).
        """
        outside = partition.ghost & mask
        halos: list[Any] = [None] * self.size
        with lost_processes_reported():
            dist.all_gather_object(halos, partition.points[outside])
        wanted, owner = np.flatnonzero(outside), partition.owner_of(partition.points[outside])
        routes = []
        for rank, asked in enumerate(halos):
            mine = partition.here(asked[partition.owner_of(asked) == partition.rank])[1]
            # Both sides in the order of the sheet.
            theirs = wanted[owner == rank]
            if len(mine) or len(theirs):
                routes.append((rank, mine, theirs))
        return routes

    def gather_to_blocks(self, pairs: Sequence[tuple[Array, Array]], partition: Partition) -> Call:
        """Return a function that fills the second array of each pair (points of own blocks) from the points' owners."""
        begin, own = int(partition.bounds[partition.rank]), partition.points[partition.owned]
        block_owners, order = partition.block_owner_of(own), np.argsort(own)
        owners = partition.owner_of(np.arange(begin, begin + partition.block_points))
        routes = [
            (rank, partition.owned.start + order[block_owners[order] == rank], np.flatnonzero(owners == rank))
            for rank in range(self.size)
        ]
        messages = [
            Message(source, target, rank, mine, theirs, tag)
            for tag, (source, target) in enumerate(pairs)
            for rank, mine, theirs in routes
            if rank != partition.rank and (len(mine) or len(theirs))
        ]
        _, mine, theirs = routes[partition.rank]
        kept = [LocalCopy(source, target, mine, theirs) for source, target in pairs]
        sources, targets = (frozenset(int(pair[k].ptr) for pair in pairs) for k in (0, 1))
        exchange = Exchange(messages, pairs[0][0].device, kept)
        return Call(
            "gather to blocks", "processes", len(own), exchange, capture, Touched(sources, frozenset(), targets)
        )

    def gather_blocks(self, mine: Array, everything: Array, partition: Partition) -> Call:
        """Return a function that fills an array [rows, blocks] of the whole sheet with the blocks of all processes."""
        starts = -(-partition.bounds // BLOCK)
        widest = int(np.diff(starts).max())
        source, target = wp.to_torch(mine), wp.to_torch(everything)
        packed = torch.zeros((source.shape[0], widest), dtype=source.dtype, device=source.device)
        parts = [torch.zeros_like(packed) for _ in range(self.size)]

        def gather() -> None:
            with lost_processes_reported(), stream_of(mine.device):
                packed[:, : source.shape[1]] = source
                dist.all_gather(parts, packed)
                for part, first, last in zip(parts, starts[:-1], starts[1:], strict=True):
                    target[:, first:last] = part[:, : last - first]

        touched = Touched(frozenset([int(mine.ptr)]), frozenset(), frozenset([int(everything.ptr)]))
        return Call("gather blocks", "processes", int(starts[-1]), gather, capture, touched)


def _pickled(error: BaseException) -> bytes:
    """Pickle an error; an error that cannot be pickled is replaced by its text."""
    try:
        data = pickle.dumps(error)
        pickle.loads(data)
    except Exception:
        data = pickle.dumps(RuntimeError(f"{type(error).__name__}: {error}"))
    return data


def own_device(name: str | None) -> str | None:
    """The device of this process: the CPU or one GPU per process."""
    if name is not None and name.startswith("cuda:"):
        raise InputError(f"device = {name!r}: expected 'cuda' (one GPU per process) or 'cpu'")
    start_warp()
    if name not in (None, "cuda") or (name is None and not wp.is_cuda_available()):
        return name
    if not torch.cuda.is_available():
        raise InputError(
            f"processes: expected GPUs and a PyTorch built with CUDA, got {torch.__version__}; or use --device cpu"
        )
    processes, present = int(os.environ.get("LOCAL_WORLD_SIZE", "1")), torch.cuda.device_count()
    if processes > present:
        raise InputError(f"processes = {processes}: expected at most {present}, one per GPU, or --device cpu")
    return f"cuda:{os.environ.get('LOCAL_RANK', '0')}"
