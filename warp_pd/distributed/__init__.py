"""One sheet on several processes."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from ..run import COMMUNICATORS

if TYPE_CHECKING:
    from ..communicator import Communicator


def processes_here() -> int:
    """Number of processes that torchrun started together with this one; 1 without torchrun."""
    return int(os.environ.get("WORLD_SIZE", "1")) if "TORCHELASTIC_RUN_ID" in os.environ else 1


def _joined(device: str | None) -> tuple[Communicator, str | None] | None:
    if processes_here() == 1:
        return None
    from .communicator import TorchCommunicator, own_device

    mine = own_device(device)
    return TorchCommunicator(cuda=mine is not None and mine.startswith("cuda")), mine


COMMUNICATORS.append(_joined)
