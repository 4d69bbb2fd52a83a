"""What a user would pick instead, on the same work, in one run: error against a converged solution, over time.

    python -m tools.peers                                  # this CPU; sets up the peers' environment at the first call
    python -m tools.peers --problems strip --codes newton  # a part; names may be shortened to their beginning
    python -m tools.peers --device cuda:0 --python PATH    # the codes that have a GPU path, in an environment of yours
    python -m tools.peers --only-page                      # from the numbers that exist

The peers (tools/peers/requirements.txt) are installed in runs/peers/venv and nowhere else. Every run is a process of
its own on one core. It solves the problem twice, and the second time counts: without imports and compilation, with all
set-up. Its CPU time is user and system time. Every call adds or replaces rows in docs/peers.json, and renews the tables
and pictures of docs/peers.md.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import venv
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

TOOLS = Path(__file__).resolve().parents[1]
if not __package__ or __package__ != "peers":
    # As the other tools, which are scripts: their folder in place of this one or of the checkout.
    sys.path[0] = str(TOOLS)

import numpy as np  # noqa: E402
from study import (  # noqa: E402
    DOCS,
    RUNS,
    at_least_one,
    device_title,
    load_rows,
    provenance,
    renew,
    run_tool,
    save_rows,
    study_parser,
)

from peers.codes import CODES, Code  # noqa: E402
from peers.elements import rubber  # noqa: E402
from peers.page import sections  # noqa: E402
from peers.problems import PROBLEMS  # noqa: E402
from peers.references import Draped, Reference  # noqa: E402
from warp_pd import InputError  # noqa: E402

PAGE, NUMBERS, WORK = DOCS / "peers.md", DOCS / "peers.json", RUNS / "peers"
HERE = Path(__file__).resolve().parent
# CPU seconds after which a run is ended.
LIMIT = 300
Row = dict[str, Any]


def environment() -> Path:
    """The Python of the peers' environment, which is made if it is not there."""
    folder = WORK / "venv"
    python, done = folder / "bin" / "python", folder / "installed"
    wanted = (HERE / "requirements.txt").read_text("utf-8")
    if not done.is_file() or done.read_text("utf-8") != wanted:
        print(f"installing tools/peers/requirements.txt in {folder}")
        venv.create(folder, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "-q", "-r", HERE / "requirements.txt"], check=True)
        done.write_text(wanted, "utf-8")
    return python


def measure(code: Code, problem: str, settings: Row, device: str, python: Path) -> Row:
    """Run one code with one setting; the row has its errors and times, or why it has none."""
    with tempfile.TemporaryDirectory() as folder:
        return _measured(code, problem, settings, device, python, Path(folder) / "out.npz")


def _measured(code: Code, problem: str, settings: Row, device: str, python: Path, out: Path) -> Row:
    own = code.adapter == "this_code"
    libraries = str(python.parents[1] / "lib")
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    core = max(os.sched_getaffinity(0))
    command = [
        sys.executable if own else str(python), str(HERE / "worker.py"),
        settings.get("adapter", code.adapter), problem,
        json.dumps({**settings, "device": device}), str(out),
    ]  # fmt: skip
    row: Row = {"problem": problem, "code": code.name, "points": settings["points"], "device": device_title(device)}

    def on_one_core() -> None:
        os.sched_setaffinity(0, {core})
        resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT + 5))

    done = subprocess.run(
        command, env={**os.environ, **threads, "LD_LIBRARY_PATH": libraries}, capture_output=True, text=True,
        check=False, preexec_fn=on_one_core,
    )  # fmt: skip
    if done.returncode == -signal.SIGXCPU:
        return {**row, "failed": f"not done after {LIMIT} s of CPU time"}
    if done.returncode:
        return {**row, "failed": (done.stderr.strip().splitlines() or ["no output"])[-1][:160]}
    found = np.load(out)
    row |= json.loads(str(found["told"]))
    if PROBLEMS[problem].cut:
        ratio = row["release_ratio"] = PROBLEMS[problem].release_ratio(row["stretch"])
        return {**row, "error": abs(ratio - 1.0)}
    if not np.isfinite(found["displacement"]).all():
        return {**row, "failed": "diverged"}
    row["error"] = reference(problem, rubber, device).error(found["places"], found["displacement"])
    if code.material and not PROBLEMS[problem].bending:
        row["own_error"] = reference(problem, code.material, device).error(found["places"], found["displacement"])
    return row


@cache
def reference(problem: str, material: Any, device: str) -> Reference | Draped:
    """Converged finite elements, or this code's finest run."""
    if PROBLEMS[problem].bending:
        return Draped(PROBLEMS[problem], device, WORK / "reference")
    return Reference(PROBLEMS[problem], material, WORK / "reference")


def chosen(names: Sequence[str]) -> list[Code]:
    """Codes whose names begin so; a whole name is one code."""
    whole = {code.name for code in CODES}
    return [c for c in CODES if any(c.name == n or (n not in whole and c.name.startswith(n)) for n in names)]


def parsed(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Options of the command line."""
    parser = study_parser(__doc__, device="cpu", out=PAGE, only_page=False, missing=False)
    parser.add_argument("--problems", nargs="+", default=list(PROBLEMS), choices=list(PROBLEMS), metavar="PROBLEM")
    parser.add_argument("--codes", nargs="+", default=[""], metavar="CODE", help="their names, or beginnings of them")
    parser.add_argument("--most-points", type=at_least_one, default=10**9, help="leave out larger runs")
    parser.add_argument("--python", type=Path, help="Python that has the peers; by default one is set up")
    options = parser.parse_args(arguments)
    if options.python and not options.python.is_file():
        raise InputError(f"--python {options.python}: expected a Python that has the peers")
    for name in options.codes:
        if not any(code.name.startswith(name) for code in CODES):
            raise InputError(f"--codes {name}: expected the beginning of one of {[code.name for code in CODES]}")
    if options.device != "cpu" and not any(code.gpu for code in chosen(options.codes)):
        raise InputError(f"--device {options.device}: expected cpu, as none of these codes has a GPU path here")
    return options


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what is asked for, keep its numbers, make the page."""
    options = parsed(arguments)
    numbers = options.out.with_suffix(".json")
    rows = load_rows(numbers)
    if not options.only_page:
        python = options.python or environment()
        on_gpu = options.device != "cpu"
        title = device_title(options.device)
        for code in (c for c in chosen(options.codes) if c.gpu or not on_gpu):
            for problem in (p for p in options.problems if p in code.runs):
                for settings in code.runs[problem]:
                    key = (problem, code.name, settings["points"], title)
                    known = [r for r in rows if (r["problem"], r["code"], r["points"], r["device"]) == key]
                    if settings["points"] > options.most_points or (options.missing and known):
                        continue
                    row = measure(code, problem, settings, options.device, python)
                    row |= {"made": provenance(title)}
                    if not PROBLEMS[problem].cut:
                        row["reference_change"] = reference(problem, rubber, options.device).change
                    print({k: v for k, v in row.items() if k not in ("made", "device")}, flush=True)
                    rows = [r for r in rows if r not in known] + [row]
                    save_rows(numbers, rows)
    renew(options.out, sections(rows, options.out))


if __name__ == "__main__":
    run_tool(main)
