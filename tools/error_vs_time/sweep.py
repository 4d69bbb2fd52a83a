"""Run the configurations of a study, from coarse to fine."""

from __future__ import annotations

import argparse
import statistics
import sys
from collections.abc import Sequence
from dataclasses import replace
from time import process_time

from warp_pd import Frame, InputError
from warp_pd.interfaces import History, Writer
from warp_pd.interfaces.context import find_device
from warp_pd.run.divergence import DivergedError
from warp_pd.run.runner import FINISHED, STOPPED

from .results import Row, load, save
from .studies import ELEMENTS, Configuration, Study, configurations, simulation_of

# A finer sheet is expected to take so many times longer. It is left out if that is over the limit.
GROWTH = 6.0
# What --cpu-time adds to the name of the device.
ONE_CORE = ", one core"


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


def measure_elements(run: Configuration, device: str, repeats: int, enough: float, made: str) -> Row:
    """Solve with finite elements; times are CPU time."""
    from .elements import SCENES

    times: list[float] = []
    while len(times) < repeats and sum(times) < enough:
        begin = process_time()
        solved = SCENES[run.scene](run.points, ELEMENTS[run.law] == 9)
        times.append(process_time() - begin)
    scalar, field = solved.errors()
    median = statistics.median(times)
    sheet = solved.membrane
    return Row(
        run, FINISHED, scalar, field, median, (max(times) - min(times)) / median, 0.0, 0.0,
        float(len(sheet.nodes) * sheet.iterations), device, made,
    )  # fmt: skip


def measure(
    study: Study, run: Configuration, device: str, repeats: int, enough: float, made: str, finer: History,
    cpu_time: bool = False,
) -> Row:  # fmt: skip
    """Run once, and again up to `repeats` times until that has taken more than `enough` seconds.

    CPU time has the scene's own set-up in it, and a run before the counted ones, which compiles or loads the kernels.
    """
    if cpu_time:
        simulation_of(study, run).run(device=device, precision=run.precision)
    times: list[float] = []
    compiling = 0.0
    while len(times) < repeats and sum(times) < enough:
        collector, begin = Collector(study.times), process_time()
        result = simulation_of(study, run).run(device=device, precision=run.precision, writers=[collector])
        summary = result.summary
        times.append(process_time() - begin if cpu_time else summary["wall_s"] - summary["compile_s"])
        compiling = max(compiling, summary["compile_s"])
    scalar = field = None
    if result.status == FINISHED:
        scalar, field = study.errors(result, collector.frames, finer)
    evaluations: int = summary["steps"]
    if run.solver == "newton":
        evaluations = summary["solve"].get("products", 0) + summary["solve"]["iterations"]
    median = statistics.median(times)
    return Row(
        case=run,
        status=result.status,
        scalar=scalar,
        field=field,
        seconds=median,
        spread=(max(times) - min(times)) / median,
        setup=summary["setup_s"],
        compile=compiling,
        point_steps=float(summary["points"]) * float(evaluations),
        device=summary["device"] + (ONE_CORE if cpu_time else ""),
        made=made,
    )


def sweep(study: Study, options: argparse.Namespace, device: str, made: str) -> list[Row]:
    """Run every configuration from coarse to fine, until the next one would pass the limit; saves them in groups."""
    name, rows = find_device(device).name + (ONE_CORE if options.cpu_time else ""), []
    known = {row.case for row in load(options.numbers) if row.device == name} if options.missing else set()
    finer: History = []
    if study.finer is not None:
        finest = 2 * max(options.tear_points)
        fine = replace(study.finer, points=finest)
        finer = simulation_of(study, fine).run(device=device, precision=fine.precision).history
        made += f", reference {finest} points"
    for coarse in configurations(study, options.horizon, options.precision):
        if options.laws and coarse.law not in options.laws:
            continue
        found: list[Row] = []
        for points in sorted(options.points if study.finer is None else options.tear_points):
            run = replace(coarse, points=points)
            if run in known:
                continue
            try:
                if run.law in ELEMENTS:
                    row = measure_elements(run, name, options.repeats, options.enough, made)
                else:
                    row = measure(
                        study, run, device, options.repeats, options.enough, made, finer, options.cpu_time
                    )  # fmt: skip
            except (InputError, DivergedError) as error:
                row = Row(run, str(error), None, None, 0.0, 0.0, 0.0, 0.0, 0.0, name, made)
            if row.status == STOPPED:
                sys.exit("interrupted; earlier results are kept, --missing goes on from there")
            found.append(row)
            print(describe(row), flush=True)
            if row.seconds * GROWTH > options.limit:
                break
        save(options.numbers, found)
        rows += found
    return rows


def describe(row: Row) -> str:
    """One line of progress."""
    c = row.case
    errors = row.status
    if row.scalar is not None and row.field is not None:
        errors = f"{100 * row.scalar:+.4f} % {100 * row.field:.4f} %"
    return f"{c.scene} {c.law} {c.horizon:g} {c.points} f{c.precision} {c.solver}: {errors} in {row.seconds:.3g} s"
