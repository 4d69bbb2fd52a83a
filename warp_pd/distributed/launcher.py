"""Starts several processes of a command with torchrun."""

from __future__ import annotations

import logging
import os
import signal
import sys
import uuid
from collections.abc import Mapping, Sequence

from torch.distributed.elastic.multiprocessing.api import SignalException
from torch.distributed.elastic.multiprocessing.errors import ChildFailedError
from torch.distributed.launcher.api import LaunchConfig, elastic_launch

from ..communicator import LAUNCHER_REPORTS
from ..device.checks import LOST


def launch(processes: int, arguments: Sequence[str]) -> int:
    """Run `python -m warp_pd` with the same arguments in several processes of this machine.

    Returns 0 if all succeed; otherwise the exit code of a process that reported an error, LOST if one was killed, or
    128 and the number of the signal that ended this process.
    """
    # They say in one line themselves what went wrong.
    logging.disable(logging.CRITICAL)
    # The one line that a killed process costs comes from here.
    os.environ[LAUNCHER_REPORTS] = "1"
    config = LaunchConfig(
        min_nodes=1, max_nodes=1, nproc_per_node=processes, run_id=uuid.uuid4().hex, rdzv_backend="c10d",
        rdzv_endpoint="localhost:0", local_addr="localhost", max_restarts=0, monitor_interval=0.2,
    )  # fmt: skip
    try:
        elastic_launch(config, sys.executable)("-m", "warp_pd", *arguments)
    except ChildFailedError as error:
        return _code(
            {rank: int(failure.exitcode) for rank, failure in error.failures.items()}, error.get_first_failure()[0]
        )
    except SignalException as error:
        return 128 + int(error.sigval)
    return 0


def _code(codes: Mapping[int, int], first: int) -> int:
    """Exit code of a failed run; prints which process was killed unless another process reported the error.

    Args:
        codes: Exit codes of the processes that failed; that of a killed one is minus the number of the signal.
        first: The process that failed first. torchrun then ends the others: by SIGTERM, later by SIGKILL.
    """
    said = next((code for code in codes.values() if code > 0 and code != LOST), None)
    if said is not None:
        return said
    killed = {rank: signal.Signals(-code) for rank, code in sorted(codes.items()) if code < 0}
    rank = first if first in killed else next(iter(killed), None)
    ended = "a process of this run ended" if rank is None else f"process {rank} was ended by {killed[rank].name}"
    print(f"warp-pd: {ended}; continue with --resume", file=sys.stderr)
    return LOST
