"""Starts several processes of a command by torchrun."""

from __future__ import annotations

import logging
import sys
import uuid
from collections.abc import Sequence

from torch.distributed.elastic.multiprocessing.api import SignalException
from torch.distributed.elastic.multiprocessing.errors import ChildFailedError
from torch.distributed.launcher.api import LaunchConfig, elastic_launch

INTERRUPTED = 130


def launch(processes: int, arguments: Sequence[str]) -> int:
    """Run `python -m warp_pd` with some arguments in several processes of this machine; the exit code of the first.

    Args:
        processes: Their number.
        arguments: Of each.
    """
    # They say in one line themselves what went wrong.
    logging.getLogger("torch.distributed.elastic").setLevel(logging.CRITICAL)
    config = LaunchConfig(
        min_nodes=1, max_nodes=1, nproc_per_node=processes, run_id=uuid.uuid4().hex, rdzv_backend="c10d",
        rdzv_endpoint="localhost:0", local_addr="localhost", max_restarts=0, monitor_interval=0.2,
    )  # fmt: skip
    try:
        elastic_launch(config, sys.executable)("-m", "warp_pd", *arguments)
    except ChildFailedError as error:
        # A process that was killed has minus the number of the signal.
        codes = [failure.exitcode for failure in error.failures.values()]
        return next((code for code in codes if code > 0), 1)
    except SignalException:
        return INTERRUPTED
    return 0
