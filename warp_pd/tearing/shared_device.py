"""GPUs that several processes share."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from ..device.checks import InputError


def refuse_shared_device(device: Any) -> None:
    """Check that no other process can be on a GPU at the same moment.

    Blocks that wait for each other must all be on the GPU. MPS lets kernels of several processes on it at once, so that
    each can hold the room that the others wait for, for ever. Without MPS processes take turns.
    """
    pipe = Path(os.environ.get("CUDA_MPS_PIPE_DIRECTORY", "/tmp/nvidia-mps"), "control")
    if device.is_cuda and pipe.exists():
        raise InputError(
            f"device = {device.alias!r}: NVIDIA's MPS shares it (there is {str(pipe)!r}); a damage field could wait "
            "for ever: expected a GPU without MPS, on which processes take turns"
        )
