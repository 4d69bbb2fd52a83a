"""Running Warp kernels on all cores of the host, to build tables."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import warp as wp

from ..device.cores import available_cores, cores, load_kernel, start_warp

# Fewest rows that are worth a thread.
ROWS = 4096


def on_host(values: np.ndarray, dtype: Any) -> Any:
    """Wrap a NumPy array as a Warp array on the same memory."""
    start_warp()
    return wp.array(np.ascontiguousarray(values), dtype=dtype, device="cpu", copy=False)


def run_on_host(kernel: wp.Kernel, rows: int, read: list[Any], written: list[Any]) -> None:
    """Run a kernel with the given inputs and outputs for `rows` rows on all cores."""
    parts = min(available_cores(), max(1, rows // ROWS))
    bounds = np.linspace(0, rows, parts + 1).astype(int)
    load_kernel(kernel, wp.get_device("cpu"))
    commands: list[Any] = [
        wp.launch(kernel, dim=int(end - begin), inputs=[*read, int(begin), *written], device="cpu", record_cmd=True)
        for begin, end in itertools.pairwise(bounds)
    ]
    for _ in cores().map(lambda command: command.launch(), commands):
        pass
