"""Several processes that compute one sheet together, by torch.distributed: NCCL on GPUs, Gloo on CPUs.

`torchrun` starts them. Halos and sums go from device to device; files, errors and progress through the first process.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import pickle
import re
from collections.abc import Callable, Iterator, Sequence
from datetime import timedelta
from typing import Any, TypeVar

import numpy as np
import torch
import torch.distributed as dist
import warp as wp

from ..checks import InputError
from ..cores import start_warp
from ..device.crew import Crew, LostError
from ..device.fields import Array, Stored, to_host
from ..device.launches import Call, Touched
from ..families.share import BLOCK, Share
from .step import capture, release_graphs

T = TypeVar("T")

# A frame may be long, and the first process may draw pictures meanwhile: a process that died is noticed otherwise.
PATIENCE = timedelta(hours=24)
SIGNED = {torch.uint16: torch.int16, torch.uint32: torch.int32, torch.uint64: torch.int64}


@contextlib.contextmanager
def _talking() -> Iterator[None]:
    """Context of what needs the other processes.

    Raises:
        LostError: if one of them has ended.
    """
    try:
        yield
    except (RuntimeError, dist.DistBackendError) as error:
        text = re.sub(r"\[[^]]*\]:?\d*\s*", "", str(error).splitlines()[0])[:80].strip(" .")
        raise LostError(
            f"processes: another process of this run ended ({text}); --resume goes on from the last restart file"
        ) from None


def _part() -> None:
    if dist.is_initialized():
        # NCCL waits for the graphs that hold its work.
        release_graphs()
        dist.destroy_process_group()


class TorchCrew(Crew):
    """The processes that torchrun started.

    Attributes:
        device: The Torch device of this process.
    """

    def __init__(self, cuda: bool) -> None:
        """Meet the others.

        Args:
            cuda: Whether the sheet is on GPUs, one a process.
        """
        if cuda:
            torch.cuda.set_device(int(os.environ.get("LOCAL_RANK", "0")))
            # An exchange goes before the launches of the interior that fill the device meanwhile.
            os.environ.setdefault("TORCH_NCCL_HIGH_PRIORITY", "1")
        with _talking():
            if not dist.is_initialized():
                backend = "cpu:gloo,cuda:nccl" if cuda else "gloo"
                dist.init_process_group(backend, timeout=PATIENCE)
                # Threads of Gloo that still wait would end the process by SIGABRT.
                atexit.register(_part)
            self.rank, self.size = dist.get_rank(), dist.get_world_size()
        # One of several processes of a machine each takes its share of the cores; Torch works on one.
        torch.set_num_threads(1)

    def together(self, work: Callable[[], T]) -> T:
        """Do work in all processes; the error of one is raised in all."""
        result, error = None, None
        try:
            result = work()
        except LostError:
            raise
        except (Exception, KeyboardInterrupt) as caught:
            error = caught
        errors: list[Any] = [None] * self.size
        with _talking():
            dist.all_gather_object(errors, None if error is None else _sendable(error))
        first = next((rank for rank, text in enumerate(errors) if text is not None), None)
        if first is not None:
            raise error if first == self.rank and error is not None else pickle.loads(errors[first])
        return result  # type: ignore[return-value]

    def lead(self, work: Callable[[], T]) -> T | None:
        """Do work in the first process, while the others answer what it asks for."""
        if not self.leads:
            self._serve()
            return None
        try:
            result = work()
        except LostError:
            raise
        except (Exception, KeyboardInterrupt) as error:
            self._tell(("end", _sendable(error)))
            raise
        self._tell(("end", None))
        return result

    def _tell(self, message: Any) -> Any:
        """The message that the first process gives."""
        told = [message]
        with _talking():
            dist.broadcast_object_list(told, src=0)
        return told[0]

    def _serve(self) -> None:
        while True:
            what, value = self._tell(None)
            if what == "end":
                if value is not None:
                    raise pickle.loads(value)
                return
            index, name = value
            if self.share is None or self.register[index].name != name:
                raise RuntimeError(f"field {name!r}: expected the same fields in all processes")
            self._send_own(self.register[index], self.share)

    def divide(self, share: Share) -> None:
        """Take a share of the sheet, and tell the others."""
        self.share = share
        self._routes = {near: self._find_routes(share, near) for near in (False, True)}

    def bind(self, register: list[Stored]) -> None:
        """Know the fields that the first process may ask for."""
        self.register = register

    def whole(self, stored: Stored, index: int, share: Share | None) -> np.ndarray:
        """A copy of a field of the whole sheet on the host; within `lead` only."""
        if share is None or stored.field.per not in ("point", "bond", "face", "block"):
            return to_host(stored.array)
        self._tell(("field", (index, stored.name)))
        return self._send_own(stored, share)

    def _send_own(self, stored: Stored, share: Share) -> np.ndarray:
        """Bring the own parts of a field together in the first process, which returns the whole."""
        per, values = stored.field.per, to_host(stored.array)
        places: Any = None
        if per in ("point", "bond"):
            values = values[share.own] if per == "point" else values[:, share.own]
        if per == "face":
            places = share.faces
        parts: Any = [None] * self.size if self.leads else None
        with _talking():
            dist.gather_object((np.ascontiguousarray(values), places), parts)
        if parts is None:
            return values
        whole = np.concatenate([part for part, _ in parts], axis=-1 if per == "block" else int(per == "bond"))
        if per == "face":
            at = np.concatenate([where for _, where in parts])
            found = np.empty_like(whole)
            found[at] = whole
            return found
        return whole

    def in_turn(self, work: Callable[[], T]) -> T:
        """Do work in the first process, then in all others, which find what it left."""
        found = self.lead(work)
        return self.together(lambda: work() if found is None else found)

    def any(self, flag: bool) -> bool:
        """Whether a flag is set in any process."""
        return self._reduced(float(flag), dist.ReduceOp.MAX) > 0.0

    def least(self, value: float) -> float:
        """The least of a number of all processes."""
        return self._reduced(value, dist.ReduceOp.MIN)

    def _reduced(self, value: float, operation: Any) -> float:
        number = torch.tensor([value], dtype=torch.float64)
        with _talking():
            dist.all_reduce(number, operation)
        return float(number[0])

    def spread(self, value: T) -> T:
        """The value that the first process has."""
        return self._tell(value)  # type: ignore[no-any-return]

    def exchange(self, fields: Sequence[Stored], share: Share) -> Call:
        """A call that fills the halo of some fields with what its owners have."""
        messages = [
            _Message(stored.array, rank, mine, theirs, tag)
            for tag, stored in enumerate(fields)
            for rank, mine, theirs in self._routes[stored.field.per == "bond"]
        ]
        exchange = _Exchange(messages, fields[0].array.device)
        addresses = frozenset(int(stored.array.ptr) for stored in fields)
        names = ", ".join(stored.name for stored in fields)
        threads = sum(message.points for message in messages)
        touched = Touched(addresses, frozenset(), addresses)
        return Call(f"exchange {names}", "processes", threads, exchange, capture, touched)

    def _find_routes(self, share: Share, near: bool) -> list[tuple[int, np.ndarray, np.ndarray]]:
        """For each other process: its number, own points here that it needs, points here that it owns.

        Args:
            share: What is here.
            near: Whether only points whose families are whole there count: others have none to hold bonds.
        """
        outside = share.near.copy() if near else np.ones(len(share.points), bool)
        outside[share.own] = False
        halos: list[Any] = [None] * self.size
        with _talking():
            dist.all_gather_object(halos, share.points[outside])
        wanted, owner = np.flatnonzero(outside), share.owner_of(share.points[outside])
        begin, end = share.bounds[share.rank], share.bounds[share.rank + 1]
        routes = []
        for rank, asked in enumerate(halos):
            mine = asked[(asked >= begin) & (asked < end)] - begin + share.own.start
            theirs = wanted[owner == rank]
            if len(mine) or len(theirs):
                routes.append((rank, mine, theirs))
        return routes

    def gather_blocks(self, mine: Array, everything: Array, share: Share) -> Call:
        """A call that fills an array [rows, blocks] of the whole sheet with the blocks of all processes."""
        starts = -(-share.bounds // BLOCK)
        widest = int(np.diff(starts).max())
        source, target = wp.to_torch(mine), wp.to_torch(everything)
        packed = torch.zeros((source.shape[0], widest), dtype=source.dtype, device=source.device)
        parts = [torch.zeros_like(packed) for _ in range(self.size)]

        def gather() -> None:
            with _talking(), _stream(mine.device):
                packed[:, : source.shape[1]] = source
                dist.all_gather(parts, packed)
                for part, first, last in zip(parts, starts[:-1], starts[1:], strict=True):
                    target[:, first:last] = part[:, : last - first]

        touched = Touched(frozenset([int(mine.ptr)]), frozenset(), frozenset([int(everything.ptr)]))
        return Call("gather blocks", "processes", int(starts[-1]), gather, capture, touched)


class _Message:
    """What goes between this process and another one for one field."""

    def __init__(self, array: Array, rank: int, mine: np.ndarray, theirs: np.ndarray, tag: int) -> None:
        """Share the array with Torch.

        Args:
            array: The field, of points or [members, points].
            rank: The other process.
            mine: Own points that it needs.
            theirs: Points here that it owns.
            tag: Tells the fields of one exchange apart.
        """
        self.rank, self.tag, self.points = rank, tag, len(mine)
        # The points last: bonds and words of bits are [members, points].
        tensor = wp.to_torch(array)
        # NCCL has no unsigned integers but bytes.
        self._tensor = tensor.view(SIGNED.get(tensor.dtype, tensor.dtype))
        self._leaving, self._arriving = (
            (slice(None), part) if array.ndim == 2 else (part,) for part in (self._part(mine), self._part(theirs))
        )
        # Rows of points are sent and received where they lie.
        self.outgoing, self.incoming = self._lying(self._leaving), self._lying(self._arriving)

    def _part(self, points: np.ndarray) -> Any:
        """Consecutive points as a slice, others as a tensor of indices."""
        if len(points) and int(points[-1] - points[0]) == len(points) - 1:
            return slice(int(points[0]), int(points[-1]) + 1)
        return torch.from_numpy(np.asarray(points, np.int64)).to(self._tensor.device)

    def _lying(self, place: Any) -> Any:
        """The part of the field itself if it is in one piece, otherwise room for a copy of it."""
        part = self._tensor[place]
        return part if part.is_contiguous() and isinstance(place[0], slice) else torch.empty_like(part).contiguous()

    def pack(self) -> list[Any]:
        """The operations that send and receive."""
        if not self._shares(self.outgoing):
            self.outgoing.copy_(self._tensor[self._leaving])
        found = []
        if self.outgoing.numel():
            found.append(dist.P2POp(dist.isend, self.outgoing, self.rank, tag=self.tag))
        if self.incoming.numel():
            found.append(dist.P2POp(dist.irecv, self.incoming, self.rank, tag=self.tag))
        return found

    def unpack(self) -> None:
        """Put what came where it belongs."""
        if not self._shares(self.incoming):
            self._tensor[self._arriving] = self.incoming

    def _shares(self, part: Any) -> bool:
        return bool(part.untyped_storage().data_ptr() == self._tensor.untyped_storage().data_ptr())


class _Exchange:
    """Sends and receives the halo of some fields at once.

    Attributes:
        nbytes: What this process sends.
    """

    def __init__(self, messages: list[_Message], device: Any) -> None:
        self.messages, self.device = messages, device
        self.nbytes = sum(message.outgoing.nbytes for message in messages)

    def __call__(self) -> None:
        """Exchange, on Warp's stream."""
        with _talking(), _stream(self.device):
            operations = [operation for message in self.messages for operation in message.pack()]
            for request in dist.batch_isend_irecv(operations) if operations else []:
                request.wait()
            for message in self.messages:
                message.unpack()


def _stream(device: Any) -> Any:
    """Torch on the stream that Warp works on now, that of a capture included."""
    if not device.is_cuda:
        return contextlib.nullcontext()
    return torch.cuda.stream(wp.stream_to_torch(wp.get_stream(device)))


def _sendable(error: BaseException) -> bytes:
    """An error as bytes; one that cannot be sent becomes its text."""
    try:
        data = pickle.dumps(error)
        pickle.loads(data)
    except Exception:
        data = pickle.dumps(RuntimeError(f"{type(error).__name__}: {error}"))
    return data


def own_device(name: str | None) -> str | None:
    """The device of this process: a GPU each, unless it is the CPU.

    Raises:
        InputError: for one GPU of all, more processes than GPUs, or a torch without CUDA.
    """
    if name is not None and name.startswith("cuda:"):
        raise InputError(f"device = {name!r}: expected 'cuda', a GPU for each process, or 'cpu'")
    start_warp()
    if name not in (None, "cuda") or (name is None and not wp.is_cuda_available()):
        return name
    if not torch.cuda.is_available():
        raise InputError(
            f"processes: expected GPUs and a torch that has CUDA, this is {torch.__version__}; or --device cpu"
        )
    processes, present = int(os.environ.get("LOCAL_WORLD_SIZE", "1")), torch.cuda.device_count()
    if processes > present:
        raise InputError(f"processes = {processes}: expected at most {present}, a GPU each, or --device cpu")
    return f"cuda:{os.environ.get('LOCAL_RANK', '0')}"
