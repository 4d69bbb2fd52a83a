"""Messages between processes within a step: parts of fields, from device to device."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import torch
import torch.distributed as dist
import warp as wp

from ..communicator import LostError
from ..device.fields import Array

SIGNED = {torch.uint16: torch.int16, torch.uint32: torch.int32, torch.uint64: torch.int64}


@contextlib.contextmanager
def lost_processes_reported() -> Iterator[None]:
    """Context manager that turns a communication error into a one-line LostError.

    Raises:
        LostError: if another process has ended.
    """
    try:
        yield
    except (RuntimeError, dist.DistBackendError) as error:
        text = re.sub(r"\[[^]]*\]:?\d*\s*", "", str(error).splitlines()[0])[:80].strip(" .")
        raise LostError(
            f"processes: another process of this run ended ({text}); --resume continues from the last restart file"
        ) from None


def _signed(array: Array) -> Any:
    """A tensor view of an array; unsigned integers become signed, because NCCL supports only unsigned bytes."""
    tensor = wp.to_torch(array)
    return tensor.view(SIGNED.get(tensor.dtype, tensor.dtype))


class Message:
    """The parts of one field that this process exchanges with another process."""

    def __init__(self, source: Array, target: Array, rank: int, mine: np.ndarray, theirs: np.ndarray, tag: int) -> None:
        """Share the arrays, (N,) or (members, N), with Torch.

        Entries `mine` of `source` go to the process `rank`; entries `theirs` of `target`, usually the same array, come
        from it. `tag` distinguishes the fields of one exchange.
        """
        self.rank, self.tag, self.points = rank, tag, len(mine)
        self._source, self._target = _signed(source), _signed(target)
        self._leaving, self._arriving = _place(source, mine), _place(target, theirs)
        # Rows of points are sent and received where they lie.
        self.outgoing = _in_place(self._source, self._leaving)
        self.incoming = _in_place(self._target, self._arriving)

    def pack(self) -> list[Any]:
        """Pack the data and return the send and receive operations."""
        if not _same_storage(self.outgoing, self._source):
            self.outgoing.copy_(self._source[self._leaving])
        found = []
        if self.outgoing.numel():
            found.append(dist.P2POp(dist.isend, self.outgoing, self.rank, tag=self.tag))
        if self.incoming.numel():
            found.append(dist.P2POp(dist.irecv, self.incoming, self.rank, tag=self.tag))
        return found

    def unpack(self) -> None:
        """Copy the received values into the target array, unless they arrived there directly."""
        if not _same_storage(self.incoming, self._target):
            self._target[self._arriving] = self.incoming


class LocalCopy:
    """The values that stay in this process when points are gathered to blocks."""

    def __init__(self, source: Array, target: Array, mine: np.ndarray, theirs: np.ndarray) -> None:
        self._source, self._target = _signed(source), _signed(target)
        self._from, self._to = _place(source, mine), _place(target, theirs)

    def copy(self) -> None:
        """Copy the values."""
        self._target[self._to] = self._source[self._from]


def _place(array: Array, points: np.ndarray) -> tuple[Any, ...]:
    """Index of points in a field: a slice if they are consecutive, otherwise a tensor of indices."""
    place: Any = torch.from_numpy(np.asarray(points, np.int64)).to(wp.device_to_torch(array.device))
    if len(points) and (np.diff(points) == 1).all():
        place = slice(int(points[0]), int(points[-1]) + 1)
    # The points last: bonds and words of bits are [members, points].
    return (slice(None), place) if array.ndim == 2 else (place,)


def _in_place(tensor: Any, place: tuple[Any, ...]) -> Any:
    """A view of the part of the field if it is contiguous, otherwise a buffer for a copy."""
    part = tensor[place]
    return part if part.is_contiguous() and isinstance(place[-1], slice) else torch.empty_like(part).contiguous()


def _same_storage(part: Any, tensor: Any) -> bool:
    return bool(part.untyped_storage().data_ptr() == tensor.untyped_storage().data_ptr())


class Exchange:
    """Sends and receives parts of several fields in one batch.

    Attributes:
        nbytes: Bytes that this process sends.
    """

    def __init__(self, messages: list[Message], device: Any, copies: Sequence[LocalCopy] = ()) -> None:
        self.messages, self.device, self.copies = messages, device, copies
        self.nbytes = sum(message.outgoing.nbytes for message in messages)

    def __call__(self) -> None:
        """Run the exchange on Warp's stream."""
        with lost_processes_reported(), stream_of(self.device):
            operations = [operation for message in self.messages for operation in message.pack()]
            for part in self.copies:
                part.copy()
            for request in dist.batch_isend_irecv(operations) if operations else []:
                request.wait()
            for message in self.messages:
                message.unpack()


def stream_of(device: Any) -> Any:
    """Context in which Torch uses Warp's current stream, also during a graph capture."""
    if not device.is_cuda:
        return contextlib.nullcontext()
    return torch.cuda.stream(wp.stream_to_torch(wp.get_stream(device)))
