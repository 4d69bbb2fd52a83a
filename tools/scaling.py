"""Time of a step and memory of one sheet on several processes.

    python tools/scaling.py --processes 1 2 --points 301 --horizon 2.015 [--weak] [--cloud] [--device cpu]
    python tools/scaling.py --processes 2 --points 10000 --device cuda --out FOLDER [--stride 16] [--no-restart]

A square lattice under pressure, or with --cloud a jittered cloud. With --weak every process has a square of so many
points along x; otherwise all share one. A step is the slope between the least times of --repeats runs of --steps and
of five times as many, without set-up; `cpu_us` is that of the busiest process, for a machine that others use. `bits` is
the same in all runs of one sheet. With --out there is one run, which writes its files there. Memory is the most of any
process. The page docs/scaling.md has the results.
"""

from __future__ import annotations

import argparse
import functools
import hashlib
import json
import os
import resource
import subprocess
import sys
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np
import warp as wp

from warp_pd import (
    BondAssociated,
    CriticalStretch,
    Explicit,
    Fixed,
    MooneyRivlin,
    Pressure,
    Result,
    Sheet,
    Simulation,
    TearingEnergy,
)

# A quarter of the stable step of a sheet, times its intervals [s].
STEP = 0.0125
# Steps of the longer runs over those of the shorter ones, and steps of these, so that they take longer than a graph
# takes to be captured.
LONGER = 5
STEPS = {"cpu": 50, "cuda": 2000}


def scene(options: argparse.Namespace, processes: int, steps: int) -> Simulation:
    """A rectangle of square cells, held at its left edge, or a jittered cloud."""
    intervals = options.points - 1
    rows = intervals * (processes if options.weak else 1) + 1
    made = functools.partial(Sheet.filled, jitter=0.2) if options.cloud else Sheet.rectangle
    sheet = made(1.0, (rows - 1) / intervals, thickness=1e-3, density=1000.0, points=(options.points, rows))
    law = BondAssociated(MooneyRivlin(5e4, 0.0), horizon=options.horizon, weights="plain")
    damage = TearingEnergy(1e4) if options.field else CriticalStretch(5.0) if options.tears else None
    step = STEP / intervals
    solver = Explicit(step * steps, frames=1, step=step)
    return Simulation(sheet, law, solver, loads=[Fixed(sheet.edges("left")), Pressure(1.0)], damage=damage)


def timed(options: argparse.Namespace, processes: int, steps: int) -> tuple[Result, float, float]:
    """A run, and its seconds: of its steps by the clock, and of this processor with its set-up."""
    files: dict[str, Any] = {}
    if options.out is not None:
        files = {"out": options.out, "usd": False, "view": False, "pictures": False, "overwrite": True}
        files |= {"stride": options.stride, "restarts": not options.no_restart}
    cpu = process_time()
    result = scene(options, processes, steps).run(device=options.device, **files)
    stepping = result.summary["points"] * result.summary["steps"] / result.summary["point_steps_per_s"]
    return result, stepping, process_time() - cpu


def here(options: argparse.Namespace) -> None:
    """Measure in this process, one of those that torchrun started, and print a line of JSON."""
    processes, begun = int(os.environ.get("WORLD_SIZE", "1")), most_memory()
    # It compiles, too.
    begin = perf_counter()
    result = timed(options, processes, options.steps)[0]
    wall = perf_counter() - begin
    row: dict[str, Any] = {}
    if options.out is None:
        # The least slope would be one whose shorter run was disturbed.
        runs = [[timed(options, processes, n * options.steps)[1:] for n in (1, LONGER)] for _ in range(options.repeats)]
        short, long = np.min(runs, axis=0)
        row["step_us"], row["cpu_us"] = (1e6 * (long - short) / ((LONGER - 1) * options.steps)).tolist()
    device = wp.get_device(str(result.built.context.device))
    row |= {
        "points": result.summary["points"], "steps": result.summary["steps"], "status": result.status,
        "setup_s": result.summary["setup_s"], "compile_s": result.summary["compile_s"], "wall_s": wall,
        "host_bytes": most_memory() - begun,
        "device_bytes": wp.get_mempool_used_mem_high(device) if device.is_cuda else 0,
    }  # fmt: skip
    if int(os.environ.get("RANK", "0")) == 0:
        row["bits"] = hashlib.sha1(result.frame.displacement.tobytes()).hexdigest()[:12]
    # One write, which no other process can divide.
    os.write(sys.stdout.fileno(), f"{json.dumps(row)}\n".encode())


def most_memory() -> int:
    """Most memory that this process has had [bytes]."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def together(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """One row of all processes: that of the first, with the most of any where it is a cost."""
    first = next(row for row in rows if "bits" in row)
    costs = [name for name in first if name.endswith(("_us", "_s", "_bytes"))]
    return {"processes": len(rows), **first, **{name: max(row[name] for row in rows) for name in costs}}


def main() -> None:
    """Start the processes, or be one of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--processes", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--points", type=int, default=301, help="along a side")
    parser.add_argument("--horizon", type=float, default=2.015, help="in spacings")
    parser.add_argument("--steps", type=int, help="of the shorter runs; 50 on a CPU and 2000 on GPUs by default")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--weak", action="store_true", help="a square for each process")
    parser.add_argument("--tears", action="store_true", help="bonds can break")
    parser.add_argument("--field", action="store_true", help="a damage field")
    parser.add_argument("--cloud", action="store_true", help="a jittered cloud")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--out", type=Path, help="folder of the files of a single run")
    parser.add_argument("--stride", type=int, default=1, help="of the points in the files")
    parser.add_argument("--no-restart", action="store_true", help="write no restart files")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.steps is None:
        options.steps = STEPS[options.device.partition(":")[0]]
    if options.here:
        here(options)
        return
    for number in options.processes:
        start = [sys.executable]
        if number > 1:
            start += ["-m", "torch.distributed.run", "--standalone", "--nproc-per-node", str(number)]
        command = [*start, __file__, *sys.argv[1:], "--here"]
        said = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
        print(json.dumps(together([json.loads(line) for line in said.splitlines() if line[:1] == "{"])), flush=True)


if __name__ == "__main__":
    main()
