"""One run of one code, in a process of its own, as `python -m tools.peers` starts it.

    PYTHON tools/peers/worker.py ADAPTER PROBLEM '{"points": 26}' OUT.npz

The adapter solves the problem twice: the second time counts, without imports and compilation. The file has the
places of its points and their displacements, or the stretch at which a cut grows, and, as JSON, times and versions.
"""

from __future__ import annotations

import importlib
import json
import resource
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

sys.path[0] = str(Path(__file__).resolve().parents[1])

import numpy as np  # noqa: E402

from peers.problems import PROBLEMS  # noqa: E402

# Seconds above which a run is not repeated: compilation is then a small part of it.
LONG = 60.0


def cpu_seconds() -> float:
    """User and system time of this process and its children so far [s]."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


def peak_memory() -> int:
    """Largest resident memory of this process [bytes]. That of getrusage has the parent's in it."""
    lines = Path("/proc/self/status").read_text("utf-8").splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))


def main(adapter: str, problem: str, settings: Mapping[str, Any], out: str) -> None:
    """Run it, and write what came out."""
    solve = importlib.import_module(f"peers.adapters.{adapter}").solve
    runs = []
    while len(runs) < 2 and not (runs and runs[0]["cpu"] > LONG):
        cpu, wall = cpu_seconds(), time.perf_counter()
        found = solve(PROBLEMS[problem], settings)
        runs.append({"cpu": cpu_seconds() - cpu, "wall": time.perf_counter() - wall})
    told = {
        **found.get("told", {}), **runs[-1], "runs": len(runs),
        "memory": peak_memory(),
    }  # fmt: skip
    if settings["device"] != "cpu":
        import warp

        told["memory"] = warp.get_mempool_used_mem_high(settings["device"])
    fields = {name: found[name] for name in ("places", "displacement") if name in found}
    np.savez(out, told=json.dumps(told), **fields)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], json.loads(sys.argv[3]), sys.argv[4])
