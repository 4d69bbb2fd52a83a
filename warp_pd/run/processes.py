"""Whether torchrun started this process as one of several, and the crew that they are."""

from __future__ import annotations

import os
from collections.abc import Sequence

from ..checks import InputError
from ..device.crew import Crew


def processes_here() -> int:
    """Number of processes that torchrun started together with this one; 1 if it did not."""
    return int(os.environ.get("WORLD_SIZE", "1")) if "TORCHELASTIC_RUN_ID" in os.environ else 1


def is_first() -> bool:
    """Whether this process speaks for all."""
    return processes_here() == 1 or os.environ.get("RANK", "0") == "0"


def crew_here(device: str | None) -> tuple[Crew, str | None]:
    """The crew of this process, and the device that it takes.

    Args:
        device: What the user asked for: "cuda" and None are a GPU each.
    """
    if processes_here() == 1:
        return Crew(), device
    from ..torch_backend.processes import TorchCrew, own_device

    mine = own_device(device)
    return TorchCrew(cuda=mine is not None and mine.startswith("cuda")), mine


def launch(processes: int, arguments: Sequence[str]) -> int:
    """Run `warp-pd` with some arguments in several processes; the exit code.

    Raises:
        InputError: without Torch.
    """
    try:
        from ..torch_backend.launch import launch as start
    except ImportError:
        raise InputError("--processes: expected torch to be installed; pip install warp-pd[neural]") from None
    return start(processes, arguments)
