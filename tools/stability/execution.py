"""Run the cases, several processes at a time."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from time import perf_counter

import numpy as np

from warp_pd import InputError

from .cases import CASES
from .laws import Trial
from .verdicts import CLEAN, NONE, Cell, Finding, NotApplicableError

# Name of a case, and where it runs.
Task = tuple[str, Trial]


def run_cell(name: str, trial: Trial) -> Cell:
    """Run the case of that name in both precisions."""
    begin, case = perf_counter(), next(case for case in CASES if case.name == name)
    found = {}
    for bits in (32, 64):
        try:
            found[bits] = case.find(replace(trial, bits=bits))
        except NotApplicableError as reason:
            found[bits] = Finding(NONE, None, str(reason))
        except InputError as error:
            found[bits] = Finding(CLEAN, None, f"refused: {error}")
    single, double = found[32], found[64]
    return Cell(
        verdict=single.verdict,
        number=single.number,
        remark=single.remark,
        double=double.number,
        double_verdict=double.verdict,
        difference=difference(single, double),
        seconds=perf_counter() - begin,
        unit=single.unit,
    )


def difference(single: Finding, double: Finding) -> float | None:
    """Largest difference of the fields over the largest value; without fields, the difference of the numbers."""
    if single.field is not None and double.field is not None:
        return float(np.abs(single.field - double.field).max() / max(np.abs(double.field).max(), 1e-300))
    if single.number is not None and double.number is not None:
        return abs(single.number - double.number)
    return None


def run_all(tasks: Sequence[Task], jobs: int) -> Iterator[tuple[Task, Cell]]:
    """Run cases in so many processes; yields each when it is done."""
    if jobs == 1:
        yield from ((task, run_cell(*task)) for task in tasks)
        return
    # A forked process could not use CUDA.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, context, initializer=end_with_parent) as pool:
        running = {pool.submit(run_cell, *task): task for task in tasks}
        try:
            for future in as_completed(running):
                yield running[future], future.result()
        finally:
            pool.shutdown(cancel_futures=True)


def end_with_parent() -> None:
    """End this process when the one that started it is killed."""
    parent = multiprocessing.parent_process()

    def wait() -> None:
        if parent is not None:
            parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
