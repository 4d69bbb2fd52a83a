"""Tables and lists of the page."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from study import table

from .advice import ADVICE
from .cases import CASES
from .laws import LAWS
from .verdicts import CLEAN, NONE, SMALLER, STABLE, Cell, Table, two_digits


def law_names(cells: Table) -> list[str]:
    """Laws that have run, in order."""
    return [law for law in LAWS if any(law in row for row in cells.values())]


def cell_table(cells: Table, text: Callable[[Cell], str]) -> list[str]:
    """Cases down, laws across; empty where nothing has run."""
    laws, numbers = law_names(cells), {case.name: case.number for case in CASES}
    rows = [
        [name, numbers[name], *(text(row[law]) if law in row else "" for law in laws)] for name, row in cells.items()
    ]
    return table(["case", "number", *laws], rows)


def verdict_table(cells: Table) -> list[str]:
    """The verdicts in float32."""
    return cell_table(cells, Cell.text)


def difference_table(cells: Table) -> list[str]:
    """The differences of float32 from float64."""
    return cell_table(cells, lambda c: "" if c.difference is None else two_digits(c.difference))


def remarks(cells: Table) -> list[str]:
    """Remarks of the cells that are not simply stable, one line each."""
    said: dict[tuple[str, str], list[str]] = {}
    none: dict[str, tuple[str, dict[str, None], dict[str, None]]] = {}
    for name, row in cells.items():
        for law, c in row.items():
            if c.remark in c.text() or (c.verdict == STABLE and "steps" not in c.remark):
                continue
            if c.verdict == NONE:
                # Reasons that differ only in numbers are told once.
                _, names, laws = none.setdefault(re.sub(r"\d\S*", "", c.remark), (c.remark, {}, {}))
                names[name] = laws[law] = None
                continue
            # Points and times differ from law to law; the cause is after the colon.
            reason = c.remark.split("likely cause: ")[-1] if c.verdict == CLEAN else c.remark
            said.setdefault((c.verdict, reason), []).append(f"{name}, {law}")
    lines = [f"- {verdict}, {reason}: {'; '.join(places)}" for (verdict, reason), places in said.items()]
    return lines + [
        f"- {NONE}, {reason}: {'; '.join(names)}: {', '.join(laws)}" for reason, names, laws in none.values()
    ]


def limits(cells: Table) -> list[str]:
    """Which laws hold where, one line per group of cases."""
    lines = []
    for group, advice in ADVICE.items():
        rows = {name: row for name, row in cells.items() if name.startswith(group)}
        if rows:
            held = "; ".join(laws_that_hold(rows, group))
            lines.append(f"- **{group.rstrip(' =')}** holds {held}. {advice}")
    return lines


def laws_that_hold(rows: Table, group: str) -> list[str]:
    """Texts like "with plain, corrected*", "in part with nodal (...)" and "not with neural"."""
    every, some, none = [], [], []
    for law in LAWS:
        asked = [name for name, row in rows.items() if law in row and row[law].verdict != NONE]
        good = [name for name in asked if rows[name][law].verdict in (STABLE, SMALLER)]
        shown = law + ("*" if any(rows[name][law].verdict == SMALLER for name in asked) else "")
        if good and len(good) == len(rows):
            every.append(shown)
        elif good:
            some.append(f"{shown} ({'; '.join(name[len(group) :].lstrip(' :°,') for name in good)})")
        elif asked:
            none.append(law)
    groups = (("with", every), ("in part with", some), ("not with", none))
    return [f"{how} {', '.join(laws)}" for how, laws in groups if laws]


def origins(cells: Table) -> list[str]:
    """Device, date and commit of the cells, one line each."""
    lines = []
    for made in dict.fromkeys(c.made for row in cells.values() for c in row.values()):
        rows: Sequence[list[str]] = [[law for law, c in row.items() if c.made == made] for row in cells.values()]
        counts = {law: sum(law in row for row in rows) for law in LAWS}
        laws = {n: ", ".join(law for law in LAWS if counts[law] == n) for n in sorted({*counts.values()} - {0})}
        seconds = sum(c.seconds for row in cells.values() for c in row.values() if c.made == made)
        lines.append(f"- {made}: {'; '.join(f'cases of {names}: {n}' for n, names in laws.items())}; {seconds:.0f} s.")
    return lines


def progress(name: str, law: str, found: Cell) -> str:
    """One line about a cell that is done."""
    return (
        f"{name:34s} {law:12s} {found.text():40s} f64 {found.double} diff {found.difference} "
        f"{found.seconds:.1f} s {found.remark[:150]}"
    )
