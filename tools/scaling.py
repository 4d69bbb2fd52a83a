"""Steps per second of one sheet on several processes, and what they exchange.

    python tools/scaling.py --processes 1 2 --points 301 --horizon 2.015 [--weak] [--in-line] [--device cpu]

A square lattice under pressure, or with --cloud a jittered cloud. With --weak every process has a square of so many
points along x; otherwise all share one. On GPUs exchanges run beside the interior, with --in-line one after the other;
`bits` is the same in all runs of one sheet. The page docs/scaling.md has the results.

    python tools/scaling.py --largest 1e8 --steps 100 --processes 2 --device cuda --out FOLDER [--stride 16]

A run of a square of so many points to its end, --steps with frames at 0, half and the end: memory a point of the whole
sheet on device and host, the most of any process, and seconds of set-up, of a step and of a frame.
"""

from __future__ import annotations

import argparse
import functools
import hashlib
import json
import resource
import subprocess
import sys
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import warp as wp

from warp_pd import BondAssociated, CriticalStretch, Explicit, Fixed, MooneyRivlin, Pressure, Sheet, Simulation
from warp_pd.device.cores import start_warp
from warp_pd.device.launches import Call
from warp_pd.interfaces import exchange
from warp_pd.run import restart
from warp_pd.run.built import compose
from warp_pd.run.processes import communicator_here, is_first, processes_here
from warp_pd.run.recorder import Recorder
from warp_pd.run.scene_context import partition_of
from warp_pd.solvers.explicit import BuiltExplicit
from warp_pd.solvers.stable_step import StableStep

# Stable step of a sheet times its intervals, from below [s].
STABLE = 0.05


def scene(points: int, rows: int, horizon: float, tears: bool, cloud: bool) -> Simulation:
    """A rectangle of square cells, held at its left edge, or a jittered cloud."""
    height = (rows - 1) / (points - 1)
    made = functools.partial(Sheet.filled, jitter=0.2) if cloud else Sheet.rectangle
    sheet = made(1.0, height, thickness=1e-3, density=1000.0, points=(points, rows))
    law = BondAssociated(MooneyRivlin(5e4, 0.0), horizon=horizon, weights="plain")
    damage = CriticalStretch(5.0) if tears else None
    return Simulation(sheet, law, Explicit(1.0), loads=[Fixed(sheet.edges("left")), Pressure(1.0)], damage=damage)


def measure(arguments: argparse.Namespace) -> None:
    """Time the steps in this process, one of those that torchrun started; the first prints a line of JSON."""
    if arguments.in_line:
        exchange.has_streams = lambda device: False
    communicator, device = communicator_here(arguments.device)
    start_warp()
    begun = _most_memory()
    many = processes_here()
    rows = (arguments.points - 1) * (many if arguments.weak else 1) + 1
    made = scene(arguments.points, rows, arguments.horizon, arguments.tears, arguments.cloud)
    begin = perf_counter()
    if many > 1:
        communicator.set_partition(communicator.barrier(lambda: partition_of(made, communicator)))
    built = compose(made, device, communicator=communicator)
    communicator.root_first(built.context.compile)
    setup, memory = perf_counter() - begin, _most_memory() - begun
    built.context.run("setup")
    built.solver._set_step(1e-6, 0.0)  # type: ignore[attr-defined]
    steps = built.context.sequence("step", repeat=10)
    steps.run()
    wp.synchronize()
    calls = [item for item in built.context.stages["step"] if isinstance(item, Call)]
    best, busy, talking = [], [], []
    for _ in range(arguments.repeats):
        communicator.any(False)
        begin, cpu = perf_counter(), process_time()
        for _ in range(arguments.steps // 10):
            steps.run()
        wp.synchronize()
        best.append((perf_counter() - begin) / arguments.steps)
        busy.append((process_time() - cpu) / arguments.steps)
        if not built.context.device.is_cuda:
            begin = perf_counter()
            for _ in range(arguments.steps):
                for call in calls:
                    call.function()
            talking.append((perf_counter() - begin) / arguments.steps)
    partition = built.context.partition
    row = {
        "processes": many, "points": made.sheet.size, "horizon": arguments.horizon, "step_us": 1e6 * min(best),
        "cpu_us": -1e6 * communicator.minimum(-min(busy)), "exchange_us": 1e6 * min(talking, default=0.0),
        "setup_s": setup,
        "bytes": sum(getattr(call.function, "nbytes", 0) for call in calls),
        "own": made.sheet.size if partition is None else partition.owned.stop - partition.owned.start,
        "here": built.context.sheet.size, "device_bytes": built.context.fields.nbytes,
        # On a CPU with the arrays of the device.
        "host_bytes": -communicator.minimum(-memory),
    }  # fmt: skip
    found = communicator.root(lambda: built.to_host(built.state.displacement))
    if found is not None:
        row["bits"] = hashlib.sha1(found.tobytes()).hexdigest()[:12]
        print(json.dumps(row), flush=True)


def largest(arguments: argparse.Namespace) -> None:
    """Run a large sheet in this process, one of those that torchrun started; the first prints a line of JSON."""
    communicator, _ = communicator_here(arguments.device)
    start_warp()
    side = round(arguments.largest**0.5)
    # A quarter of the stable step.
    step = 0.25 * STABLE / (side - 1)
    begun, begin = _most_memory(), perf_counter()
    made = scene(side, side, arguments.horizon, arguments.tears, False)
    made.solver = Explicit(step * arguments.steps, frames=2, step=step)
    seconds: dict[str, list[float]] = {"frame": [], "save": [], "omega": [], "_take": []}
    calls = ((Recorder, "frame"), (restart, "save"), (StableStep, "omega"), (BuiltExplicit, "_take"))
    for kind, name in calls:
        _timed(kind, name, seconds[name])
    result = made.run(
        out=arguments.out, device=arguments.device, usd=False, view=False, pictures=False, stride=arguments.stride,
        restarts=not arguments.no_restart, overwrite=True, fields=arguments.fields,
    )  # fmt: skip
    built, size = result.built, made.sheet.size
    warp_device = built.context.device
    high = wp.get_mempool_used_mem_high(warp_device) if warp_device.is_cuda else 0
    taken = warp_device.total_memory - warp_device.free_memory if warp_device.is_cuda else 0
    most = {
        "host_bytes_a_point": _most_memory() - begun, "device_arrays_a_point": built.context.fields.nbytes,
        "device_high_water_a_point": high, "device_taken_a_point": taken,
    }  # fmt: skip
    # The first steps wait for the capture of their graph.
    steps = result.summary["steps"]
    each = seconds["_take"][-1] / (steps / 2)
    row = {
        "processes": processes_here(), "points": size, "status": result.status, "steps": steps,
        "setup_s": result.summary["setup_s"], "compile_s": result.summary["compile_s"],
        "step_s": each, "estimate_s": seconds["omega"], "frame_s": seconds["frame"],
        "restart_s": seconds["save"], "wall_s": perf_counter() - begin, "stable_step_s": result.summary["stable_dt"],
        "step_given_s": step,
        **{name: round(-communicator.minimum(-value) / size, 2) for name, value in most.items()},
    }  # fmt: skip
    if communicator.is_root:
        files_bytes = sum(p.stat().st_size for p in Path(arguments.out).rglob("*") if p.is_file())
        print(json.dumps({**row, "files_bytes_a_point": round(files_bytes / size, 2)}), flush=True)


def _timed(kind: type, name: str, seconds: list[float]) -> None:
    """Note how long the calls of a method take."""
    method = getattr(kind, name)

    @functools.wraps(method)
    def call(*given: Any) -> Any:
        begin = perf_counter()
        found = method(*given)
        wp.synchronize()
        seconds.append(round(perf_counter() - begin, 3))
        if is_first():
            print(f"{name}: {seconds[-1]} s", file=sys.stderr, flush=True)
        return found

    setattr(kind, name, call)


def _most_memory() -> int:
    """Most memory that this process has had [bytes]."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def main() -> None:
    """Start the processes, or be one of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--processes", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--points", type=int, default=301)
    parser.add_argument("--horizon", type=float, default=2.015)
    parser.add_argument("--steps", type=int, default=50, help="by default 50; the page has 100 with --largest")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--weak", action="store_true")
    parser.add_argument("--in-line", action="store_true")
    parser.add_argument("--tears", action="store_true")
    parser.add_argument("--cloud", action="store_true")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--largest", type=float)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--stride", type=int, default=1)
    parser.add_argument("--no-restart", action="store_true")
    parser.add_argument("--fields", nargs="*")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.here:
        if arguments.largest:
            largest(arguments)
        else:
            measure(arguments)
        return
    for number in arguments.processes:
        start = [sys.executable]
        if number > 1:
            start += ["-m", "torch.distributed.run", "--nproc-per-node", str(number)]
        subprocess.run([*start, __file__, *sys.argv[1:], "--here"], check=True)


if __name__ == "__main__":
    main()
