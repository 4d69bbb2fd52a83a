"""Tables and sentences of the page."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np
from study import table

from .results import Row
from .studies import ELEMENTS, STUDIES, Configuration

# The publications' own choice, which the page compares with.
PUBLISHED = {"law": "published", "horizon": 3.15, "points": 101}
TARGETS = (0.03, 0.01, 0.003, 0.001)
# Errors at which finite elements and this code are compared.
ELEMENT_TARGETS = (0.01, 0.001, 0.0001)


def with_errors(rows: Sequence[Row]) -> list[Row]:
    """Rows that have an error."""
    return [row for row in rows if row.field is not None and np.isfinite(row.field)]


def field_of(row: Row) -> float:
    """Error of the field."""
    assert row.field is not None
    return row.field


def scalar_of(row: Row) -> float:
    """Size of the error of the scalar."""
    assert row.scalar is not None
    return abs(row.scalar)


def seconds_of(row: Row) -> float:
    """Time of the run [s]."""
    return row.seconds


def front(rows: Sequence[Row], error: Callable[[Row], float], cost: Callable[[Row], float]) -> list[Row]:
    """Rows that no other row beats in both error and cost, by rising cost."""
    best: list[Row] = []
    for row in sorted(with_errors(rows), key=lambda r: (cost(r), error(r))):
        if not best or error(row) < error(best[-1]):
            best.append(row)
    return best


def name_of(run: Configuration) -> str:
    """A run in words, without its scene."""
    if run.law in ELEMENTS:
        return f"finite elements, {ELEMENTS[run.law]} nodes each, {run.points} along a side"
    return f"{run.law}, {run.horizon:g}, {run.points} points, {run.solver}, float{run.precision}"


def front_table(rows: Sequence[Row]) -> list[str]:
    """The front of field error over time."""
    cells = [
        [
            name_of(row.case), f"{100 * field_of(row):.3g} %", f"{100 * (row.scalar or 0.0):+.3g} %",
            f"{row.seconds:.3g}", f"{row.point_steps:.2g}",
        ]
        for row in front(rows, field_of, seconds_of)
    ]  # fmt: skip
    return table(["fastest up to this error", "field", "scalar", "time s", "point-steps"], cells)


def published_text(rows: Sequence[Row]) -> str:
    """How much better other settings are than the published ones, at equal time and at equal error."""
    mine = [r for r in with_errors(rows) if all(getattr(r.case, k) == v for k, v in PUBLISHED.items())]
    if not mine:
        return (
            "There is no result of the published settings (published weights, horizon 3.15, 101 points) here. They "
            "diverge, or were left out: see the text of the scene, the list below, or the limit of time."
        )
    row = min(mine, key=seconds_of)
    in_time = min((r for r in with_errors(rows) if r.seconds <= row.seconds), key=field_of)
    as_good = min((r for r in with_errors(rows) if field_of(r) <= field_of(row)), key=seconds_of)
    return (
        f"The published settings (published weights, horizon 3.15, 101 points; {row.case.solver}, "
        f"float{row.case.precision}) have a field error of {100 * field_of(row):.3g} % in {row.seconds:.3g} s. In no "
        f"more time, {name_of(in_time.case)} has {100 * field_of(in_time):.3g} %, "
        f"{field_of(row) / field_of(in_time):.3g} times less. For no larger an error, {name_of(as_good.case)} takes "
        f"{as_good.seconds:.3g} s, {row.seconds / as_good.seconds:.3g} times less."
    )


def orders(rows: Sequence[Row]) -> list[str]:
    """Observed orders of the field error in the spacing, from the most precise runs of each law and horizon.

    Empty if no law was run at two spacings.
    """
    groups: dict[tuple[str, float], dict[int, Row]] = {}
    for row in sorted(with_errors(rows), key=lambda r: (r.case.precision, r.case.solver != "newton")):
        groups.setdefault((row.case.law, row.case.horizon), {}).setdefault(row.case.points, row)
        if row.case.precision == 64:
            groups[row.case.law, row.case.horizon][row.case.points] = row
    cells = []
    for (law, horizon), found in sorted(groups.items()):
        ladder = [found[n] for n in sorted(found)]
        if len(ladder) < 2:
            continue
        rates = [
            np.log(field_of(a) / field_of(b)) / np.log((b.case.points - 1) / (a.case.points - 1))
            for a, b in itertools.pairwise(ladder)
        ]
        errors = ", ".join(f"{r.case.points}: {100 * field_of(r):.3g} %" for r in ladder)
        cells.append([law, f"{horizon:g}", errors, ", ".join(f"{rate:.1f}" for rate in rates)])
    return table(["law", "horizon", "points: field error", "orders"], cells) if cells else []


def choices(rows: Sequence[Row]) -> list[str]:
    """The fastest run with a field error of at most 3, 1, 0.3 and 0.1 %, by scene and device."""
    cells = []
    for study, device in itertools.product(STUDIES, sorted({row.device for row in rows})):
        here = [row for row in with_errors(rows) if row.case.scene == study.scene and row.device == device]
        for target in TARGETS:
            reached = [row for row in here if field_of(row) <= target]
            if reached:
                best = min(reached, key=seconds_of)
                cells.append([study.scene, device, f"{100 * target:g} %", name_of(best.case), f"{best.seconds:.3g}"])
    return table(["scene", "device", "error", "fastest", "time s"], cells)


def against_elements(rows: Sequence[Row]) -> list[str]:
    """The fastest run of this code and of finite elements to some errors of the field, where a device has both."""
    cells = []
    for study, device in itertools.product(STUDIES, sorted({row.device for row in rows})):
        here = [row for row in with_errors(rows) if row.case.scene == study.scene and row.device == device]
        kinds = [[r for r in here if (r.case.law in ELEMENTS) == wanted] for wanted in (True, False)]
        if not all(kinds):
            continue
        for target in ELEMENT_TARGETS:
            found = [[r for r in kind if field_of(r) <= target] for kind in kinds]
            best = [min(some, key=seconds_of) if some else None for some in found]
            times = ["-" if row is None else f"{name_of(row.case)}: {row.seconds:.3g} s" for row in best]
            both = best[0] is not None and best[1] is not None
            factor = f"{best[1].seconds / best[0].seconds:.1f}" if both else "-"  # type: ignore[union-attr]
            cells.append([study.scene, device, f"{100 * target:g} %", *times, factor])
    return table(["scene", "device", "error", "finite elements", "this code", "times as long"], cells)


def failures(rows: Sequence[Row]) -> list[str]:
    """Lines of the runs without an error."""
    return [f"- {name_of(r.case)}: {r.status}" for r in rows if r.field is None]
