"""Processes of the command line: starting one or several (torchrun), and ending them."""

from __future__ import annotations

import os
from collections.abc import Sequence

from ..device.checks import InputError
from ..device.cores import available_cores, start_warp
from . import processes_here

# More would wait for each other, and fill the memory with copies of Torch.
PROCESSES_PER_CORE = 4


def is_first() -> bool:
    """Whether this is the first process, the only one that prints."""
    return processes_here() == 1 or os.environ.get("RANK", "0") == "0"


def launch(gpus: int, processes: int, device: str | None, arguments: Sequence[str]) -> int:
    """Run `warp-pd` with the given arguments in several processes, each on a GPU if `gpus` > 1; the exit code."""
    _require_room(gpus, processes, device)
    try:
        from .launcher import launch as start
    except ImportError:
        raise InputError("--processes: expected torch to be installed; pip install warp-pd[neural]") from None
    return start(max(gpus, processes), arguments)


def _require_room(gpus: int, processes: int, device: str | None) -> None:
    import warp as wp

    start_warp()
    present, most = wp.get_cuda_device_count(), PROCESSES_PER_CORE * available_cores()
    if gpus > 1 and (processes > 1 or device not in (None, "cuda")):
        given = f"processes = {processes}" if processes > 1 else f"device = {device!r}"
        raise InputError(f"gpus = {gpus}, {given}: expected only one of them")
    if gpus > max(present, 1):
        raise InputError(
            f"gpus = {gpus}: expected at most {present}, the GPUs of this machine, or --processes with --device cpu"
        )
    if processes > most:
        raise InputError(f"processes = {processes}: expected at most {most}, {PROCESSES_PER_CORE} per core")
