"""CPU cores of this machine, and the start of Warp."""

from __future__ import annotations

import contextlib
import functools
import gc
import os
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from .checks import InputError
from .kernel_cache import init_warp, is_loaded, load_module

# Device files of an NVIDIA GPU on Linux, also under Windows; what Warp's native library prints without a driver.
NVIDIA_DEVICES, NO_DRIVER = ("/dev/nvidiactl", "/dev/dxg"), b"Could not find or load the NVIDIA CUDA driver"
STDERR = 2
# Threads that compile for a GPU: four of them take 0.4 times as long as one. More do not help, nor do processes: the
# compiler (NVRTC) reads one program at a time, and processes take a second to start.
GPU_COMPILERS = 4

_pool: ThreadPoolExecutor | None = None
_cuda_was_there = False


def _after_fork() -> None:
    """In a forked child: no thread of the pool came along, nor does CUDA work if its parent had begun to use it."""
    global _pool, _cuda_was_there  # noqa: PLW0603 - one pool per process
    _pool = None
    _cuda_was_there = _cuda_was_there or _warp_has_cuda()


def _warp_has_cuda() -> bool:
    warp = sys.modules.get("warp")
    return _init_warp.cache_info().currsize > 0 and warp is not None and bool(warp.is_cuda_available())


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def require_no_cuda_of_parent(device: str) -> None:
    """Raise InputError in a forked process whose parent had begun to use CUDA."""
    if _cuda_was_there:
        raise InputError(
            f"device = {device!r}: CUDA does not work in a process forked from one that uses it; expected the start "
            "method 'spawn' or 'forkserver' of multiprocessing, or device 'cpu'"
        )


@contextlib.contextmanager
def no_collection() -> Iterator[None]:
    """Context without garbage collection, which may free an earlier CUDA graph; a capture forbids that."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def available_cores() -> int:
    """Number of CPU cores that this process may use; processes started by torchrun divide the cores."""
    present = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
    return max(1, present // int(os.environ.get("LOCAL_WORLD_SIZE", "1")))


def cores() -> ThreadPoolExecutor:
    """Thread pool with one thread per core, for work that releases the interpreter lock."""
    global _pool  # noqa: PLW0603 - one pool per process
    if _pool is None:
        _pool = ThreadPoolExecutor(available_cores(), thread_name_prefix="warp_pd")
    return _pool


@contextlib.contextmanager
def compilers(device: Any) -> Iterator[ThreadPoolExecutor]:
    """Threads that compile for a device: those of `cores` on a CPU, a few for a GPU."""
    if device.is_cpu:
        yield cores()
        return
    with ThreadPoolExecutor(min(GPU_COMPILERS, available_cores())) as pool:
        yield pool


def load_kernel(kernel: Any, device: Any) -> None:
    """Compile or load a kernel in one of these threads."""
    loading = begin_loading(kernel, device)
    if loading is not None:
        loading.result()


def begin_loading(kernel: Any, device: Any) -> Future[Any] | None:
    """Begin to compile or load a kernel in these threads, without waiting; None if it is there."""
    block_dim = 1 if device.is_cpu else None
    if is_loaded(kernel.module, device, block_dim):
        return None
    return cores().submit(load_module, kernel.module, device, block_dim)


def start_warp() -> None:
    """Initialise Warp with only warnings and errors reported."""
    import warp as wp

    wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)
    _init_warp()


@functools.cache
def _init_warp() -> None:
    """Initialise Warp once per process."""
    # Else graphs of Warp take no account of the priority of side streams (device/graph.py): what runs there would wait
    # until the launch beside it has no blocks left to start.
    os.environ.setdefault("CUDA_GRAPHS_USE_NODE_PRIORITY", "1")
    with _without_driver_warning():
        init_warp()


@contextlib.contextmanager
def _without_driver_warning() -> Iterator[None]:
    """Context that suppresses Warp's warning about a missing NVIDIA driver on machines without an NVIDIA device."""
    if os.name != "posix" or any(os.path.exists(path) for path in NVIDIA_DEVICES):
        yield
        return
    with contextlib.suppress(OSError, ValueError, AttributeError):
        sys.stderr.flush()
    try:
        kept = os.dup(STDERR)
    except OSError:
        # There is no standard error to keep it from.
        yield
        return
    with tempfile.TemporaryFile() as said:
        os.dup2(said.fileno(), STDERR)
        try:
            yield
        finally:
            os.dup2(kept, STDERR)
            os.close(kept)
            said.seek(0)
            for line in said:
                if NO_DRIVER not in line:
                    with contextlib.suppress(OSError):
                        os.write(STDERR, line)
