"""Run the cases with every law, in both precisions."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np
from study import Row, device_title, in_processes, provenance, save_rows

from warp_pd import InputError

from .cases import CASES
from .laws import LAWS, RUBBER, Trial
from .tables import verdict_of
from .verdicts import CLEAN, NONE, Finding, NotApplicableError


def run_case(name: str, trial: Trial) -> Row:
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
    return {
        "case": name, "law": trial.law, "verdict": single.verdict, "number": single.number, "remark": single.remark,
        "double": double.number, "double_verdict": double.verdict, "difference": difference(single, double),
        "seconds": perf_counter() - begin, "unit": single.unit,
    }  # fmt: skip


def difference(single: Finding, double: Finding) -> float | None:
    """Largest difference of the fields over the largest value; without fields, the difference of the numbers."""
    if single.field is not None and double.field is not None:
        return float(np.abs(single.field - double.field).max() / max(np.abs(double.field).max(), 1e-300))
    if single.number is not None and double.number is not None:
        return abs(single.number - double.number)
    return None


def in_order(rows: Sequence[Row]) -> list[Row]:
    """The rows in the order of the cases and laws; of two with the same, the later one."""
    cases, laws = [case.name for case in CASES], list(LAWS)
    last = {(row["case"], row["law"]): row for row in rows}
    return sorted(last.values(), key=lambda row: (cases.index(row["case"]), laws.index(row["law"])))


def run(options: argparse.Namespace, rows: list[Row]) -> list[Row]:
    """Run the chosen cases and add them to the rows of earlier calls.

    Raises:
        InputError: if those are of another device.
    """
    device = device_title(options.device)
    for row in rows:
        if not row["made"].startswith(f"{device},"):
            raise InputError(f"--out: its numbers were made on {row['made']}; expected another page for {device!r}")
    for law in options.laws:
        # A law that cannot be made at all is an error of this tool, not a case that does not apply.
        LAWS[law](RUBBER)
    made = f"{provenance(device, options.commit)}, long runs of up to {options.seconds:g} s"
    made += ", short" if options.fast else ""
    known = {(row["case"], row["law"]) for row in rows} if options.missing else set()
    tasks = [
        (case.name, Trial(law, 32, options.device, options.steps, options.seconds, options.fast))
        for case in options.cases
        for law in options.laws
        if (case.name, law) not in known
    ]
    for _, found in in_processes(run_case, tasks, options.jobs):
        rows = in_order([*rows, {**found, "made": made}])
        print(
            f"{found['case']:34s} {found['law']:12s} {verdict_of(found):40s} f64 {found['double']} "
            f"diff {found['difference']} {found['seconds']:.1f} s {found['remark'][:150]}",
            flush=True,
        )
        if options.out is not None:
            save_rows(options.out.with_suffix(".json"), rows)
    return rows
