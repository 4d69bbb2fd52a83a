"""One sheet on several processes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..run import COMMUNICATORS
from .launch import processes_here

if TYPE_CHECKING:
    from ..interfaces.communicator import Communicator


def _joined(device: str | None) -> tuple[Communicator, str | None] | None:
    if processes_here() == 1:
        return None
    from .communicator import TorchCommunicator, own_device

    mine = own_device(device)
    return TorchCommunicator(cuda=mine is not None and mine.startswith("cuda")), mine


COMMUNICATORS.append(_joined)
