"""What this machine runs on: its cores, and Warp."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

_pool: ThreadPoolExecutor | None = None


def available_cores() -> int:
    """Number of CPU cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)


def cores() -> ThreadPoolExecutor:
    """Threads, one per core, for work that releases the interpreter lock."""
    global _pool  # noqa: PLW0603 - one pool per process
    if _pool is None:
        _pool = ThreadPoolExecutor(available_cores(), thread_name_prefix="warp_pd")
    return _pool


def start_warp() -> None:
    """Start Warp; it then reports nothing but warnings and errors."""
    import warp as wp

    wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)
    wp.init()
