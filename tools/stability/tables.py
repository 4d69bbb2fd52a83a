"""Tables and lists of the page, from rows of a case, a law and what was found."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from study import Row, table

from .cases import CASES
from .laws import LAWS
from .verdicts import CLEAN, NONE, SMALLER, STABLE, two_digits


def sections(rows: Sequence[Row]) -> dict[str, list[str]]:
    """Sections of the page that are made of numbers, by heading."""
    return {
        "## Where the numbers come from": origins(rows),
        "## Verdicts, float32": case_table(rows, verdict_of),
        "## Float32 against float64": case_table(
            rows, lambda row: "" if row["difference"] is None else two_digits(row["difference"])
        ),
        "## Remarks": remarks(rows),
    }


def verdict_of(row: Row) -> str:
    """Content of the cell in the table."""
    if row["verdict"] == NONE:
        return "n/a"
    shown = "" if row["number"] is None else f" {row['unit']}{two_digits(row['number'])}"
    at = f" {row['remark']}" if row["verdict"] == SMALLER and row["remark"].startswith("at ") else ""
    mark = "" if row["verdict"] == row["double_verdict"] else f" (float64: {row['double_verdict']})"
    return f"{row['verdict']}{at}{':' if shown else ''}{shown}{mark}"


def case_table(rows: Sequence[Row], text: Callable[[Row], str]) -> list[str]:
    """Cases down, laws across; empty where nothing has run."""
    cells = {(row["case"], row["law"]): text(row) for row in rows}
    laws = [law for law in LAWS if any(law == known for _, known in cells)]
    shown = [case for case in CASES if any(case.name == known for known, _ in cells)]
    lines = [[case.name, case.number, *(cells.get((case.name, law), "") for law in laws)] for case in shown]
    return table(["case", "number", *laws], lines)


def remarks(rows: Sequence[Row]) -> list[str]:
    """Remarks of the cells that are not simply stable, one line for each reason."""
    places: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row["remark"] in verdict_of(row) or (row["verdict"] == STABLE and "steps" not in row["remark"]):
            continue
        # Points and times differ from law to law; the cause is after the colon.
        reason = row["remark"].split("likely cause: ")[-1] if row["verdict"] == CLEAN else row["remark"]
        # Reasons why a case does not apply that differ only in numbers are told once.
        reason = re.sub(r"= \d\S*", "= ...", reason) if row["verdict"] == NONE else reason
        places.setdefault((row["verdict"], reason), []).append(f"{row['case']}, {row['law']}")
    return [f"- {verdict}, {reason}: {'; '.join(where)}" for (verdict, reason), where in places.items()]


def origins(rows: Sequence[Row]) -> list[str]:
    """Device, date and commit of the cells, one line each."""
    lines = []
    for made in dict.fromkeys(row["made"] for row in rows):
        some = [row for row in rows if row["made"] == made]
        laws = ", ".join(law for law in LAWS if any(law == row["law"] for row in some))
        seconds = sum(row["seconds"] for row in some)
        lines.append(f"- {made}: {len(some)} cells of {laws}; {seconds:.0f} s.")
    return lines
