"""Run the configurations of a study, from coarse to fine."""

from __future__ import annotations

import argparse
import statistics
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from time import process_time

from study import Row, device_title, load_rows, provenance, save_rows, whole

from warp_pd import Frame, InputError
from warp_pd.context import find_device
from warp_pd.interfaces import DivergedError, Writer

from .studies import ELEMENTS, Configuration, Study, configurations, simulation_of

# A finer sheet is expected to take so many times longer. It is left out if that is over the limit.
GROWTH = 6.0
# What --cpu-time adds to the name of the device.
ONE_CORE = ", one core"
FAILED: Row = {"scalar": None, "field": None, "seconds": 0.0, "spread": 0.0, "setup": 0.0, "point_steps": 0.0}


class Collector(Writer):
    """Keeps the frames at some times."""

    def __init__(self, times: Sequence[float]) -> None:
        self.times = times
        self.frames: dict[float, Frame] = {}

    def write(self, frame: Frame) -> None:
        """Keep the frame if it is asked for."""
        for time in self.times:
            if abs(frame.time - time) < 1e-6:
                self.frames[time] = frame


def measure_elements(run: Configuration, options: argparse.Namespace) -> Row:
    """Solve with finite elements; times are CPU time."""
    from .elements import SCENES

    def solve() -> tuple[float, Row]:
        begin = process_time()
        solved = SCENES[run.scene](run.points, ELEMENTS[run.law] == 9)
        seconds, sheet = process_time() - begin, solved.membrane
        scalar, field = solved.errors()
        work = float(len(sheet.nodes) * sheet.iterations)
        return seconds, {
            "status": "finished", "scalar": scalar, "field": field, "setup": 0.0, "point_steps": work
        }  # fmt: skip

    return repeated(solve, options)


def measure(study: Study, run: Configuration, options: argparse.Namespace) -> Row:
    """Run the scene. CPU time has the scene's own set-up in it.

    A run before the counted ones compiles and loads: `compile_s` does not know all that a first run waits for.
    """

    def solve() -> tuple[float, Row]:
        collector, begin = Collector(study.times), process_time()
        result = whole(
            simulation_of(study, run).run(device=options.device, precision=run.precision, writers=[collector])
        )
        summary = result.summary
        seconds = process_time() - begin if options.cpu_time else summary["wall_s"] - summary["compile_s"]
        ended = result.status == "finished"
        scalar, field = study.errors(result, collector.frames) if ended else (None, None)
        evaluations: int = summary["steps"]
        if run.solver == "newton":
            evaluations = summary["solve"].get("products", 0) + summary["solve"]["iterations"]
        return seconds, {
            "status": result.status, "scalar": scalar, "field": field, "setup": summary["setup_s"],
            "point_steps": float(summary["points"]) * float(evaluations),
        }  # fmt: skip

    solve()
    return repeated(solve, options)


def repeated(solve: Callable[[], tuple[float, Row]], options: argparse.Namespace) -> Row:
    """The row of the last of up to --repeats runs, which end after --enough seconds, with their median time."""
    times: list[float] = []
    row: Row = {}
    while len(times) < options.repeats and sum(times) < options.enough:
        seconds, row = solve()
        times.append(seconds)
    median = statistics.median(times)
    return {**row, "seconds": median, "spread": (max(times) - min(times)) / median}


def case_of(row: Row) -> Configuration:
    """What a row is of."""
    return Configuration(**{name: row[name] for name in Configuration.__dataclass_fields__})


def merged(known: Sequence[Row], more: Sequence[Row]) -> list[Row]:
    """Rows with others added; one of the same run and device is replaced."""
    return list({(row["device"], case_of(row)): row for row in [*known, *more]}.values())


def sweep(study: Study, options: argparse.Namespace) -> list[Row]:
    """Run every configuration from coarse to fine, until the next one would pass the limit; saves them in groups."""
    device = device_title(options.device) + (ONE_CORE if options.cpu_time else "")
    made, rows = provenance(device), []
    known = {case_of(row) for row in load_rows(options.numbers) if row["device"] == device} if options.missing else ()
    on_cpu = not find_device(options.device).is_cuda
    for coarse in configurations(study, options.horizon, options.precision, elements=on_cpu):
        if options.laws and coarse.law not in options.laws:
            continue
        found: list[Row] = []
        for points in sorted(options.points or study.points):
            run = replace(coarse, points=points)
            if run in known:
                continue
            try:
                row = measure_elements(run, options) if run.law in ELEMENTS else measure(study, run, options)
            except (InputError, DivergedError, ArithmeticError) as error:
                row = {**FAILED, "status": str(error)}
            if row["status"] == "stopped":
                sys.exit("interrupted; earlier results are kept, --missing goes on from there")
            found.append({**asdict(run), **row, "device": device, "made": made})
            print(describe(found[-1]), flush=True)
            if row["seconds"] * GROWTH > options.limit:
                break
        save_rows(options.numbers, merged(load_rows(options.numbers), found))
        rows += found
    return rows


def describe(row: Row) -> str:
    """One line of progress."""
    errors = row["status"]
    if row["scalar"] is not None:
        field = "" if row["field"] is None else f" {100 * row['field']:.4f} %"
        errors = f"{100 * row['scalar']:+.4f} %{field}"
    case = f"{row['scene']} {row['law']} {row['horizon']:g} {row['points']} f{row['precision']} {row['solver']}"
    return f"{case}: {errors} in {row['seconds']:.3g} s"
