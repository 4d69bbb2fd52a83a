"""What a row of the table is: a printed number or statement, ours, and a verdict that follows from both."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from study import build_scene, whole

from warp_pd.interfaces import DivergedError
from warp_pd.papers.as_published import as_published
from warp_pd.run.result import Result

Values = dict[str, Any]
# What a quantity is read at, as in "force at 1.5, off the exact one (%)" or "crack at Ux = 2.1e-4 m".
READ_AT = re.compile(r"(?:(?<= at )|(?<= = ))[\d.]+(?:e-\d+)?")
# The spacing of ours, at the end of a quantity.
OF_POINTS = re.compile(r", ([\d x]+ points)$")
# The numbers of an example, computed on a device; None is the default one.
Example = Callable[[str | None], Values]


@dataclass(frozen=True)
class Row:
    """A number that a paper prints, or a statement that a number can decide.

    Attributes:
        example: Key of the example whose run gives our number, such as "ba.6.1".
        where: Section and figure, equation or table of the paper.
        quantity: What it is, with its unit.
        printed: What the paper prints.
        name: Our number's name among the values of the example.
        reading: What our number rests on, where the text leaves something open.
        value: The printed number, in the unit of `name`; None for statements.
        within: Largest relative difference at which a number matches.
        low: Least value of `name` for which a statement holds.
        high: Largest such value.
        scale: What our number is multiplied by before it is shown.
    """

    example: str
    where: str
    quantity: str
    printed: str
    name: str
    reading: str = "as published"
    value: float | None = None
    within: float = 0.01
    low: float = -math.inf
    high: float = math.inf
    scale: float = 1.0

    def cells(self, found: Mapping[str, Any] | None) -> list[str]:
        """The row as text: where, quantity, printed, ours, reading, difference, verdict."""
        ours, difference, verdict = self.judged(found)
        return [self.where, self.quantity, self.printed, ours, self.reading, difference, verdict]

    def judged(self, found: Mapping[str, Any] | None) -> tuple[str, str, str]:
        """Our number, its difference from the printed one, and the verdict; `found` holds the example's values."""
        if found is None:
            return "-", "", "not run"
        value = found.get(self.name)
        # Numbers of a run that did not end are no results, but for whether it ends.
        why = "" if self.name == "converges" else str(found.get("why", ""))
        if why or not isinstance(value, int | float) or not math.isfinite(value):
            return "-", "", (why or "no number").partition(";")[0].replace("|", "\\|")
        ours = f"{value * self.scale:.5g}"
        if self.value is None and math.isinf(self.low) and math.isinf(self.high):
            return ours, "", "nothing to compare"
        if self.value is None:
            return ours, "", "matches" if self.low <= value <= self.high else "differs"
        off = value / self.value - 1.0
        return (
            ours,
            f"{100.0 * off:{'+.2g' if abs(off) < 1.0 else '+.0f'}} %",
            "matches" if abs(off) <= self.within else "differs",
        )


def merged(rows: Sequence[list[str]]) -> list[list[str]]:
    """Rows of a table in which neighbours that differ in what they are read at alone are one."""
    groups: list[list[list[str]]] = []
    for row in rows:
        if groups and READ_AT.search(row[1]) and _kind(row) == _kind(groups[-1][0]):
            groups[-1].append(row)
        else:
            groups.append([row])
    return [_together(group) for group in groups]


def _kind(row: list[str]) -> tuple[str, str, str, str]:
    where, quantity, printed, _, reading, _, _ = row
    return where, READ_AT.sub("", quantity, count=1), printed, reading


def _together(group: list[list[str]]) -> list[str]:
    if len(group) == 1:
        return group[0]
    where, quantity, printed, _, reading, _, _ = group[0]
    read_at = [found[0] for row in group if (found := READ_AT.search(row[1]))]
    ours, differences, verdicts = (
        values[:1] if len(set(values)) == 1 else values for values in ([row[i] for row in group] for i in (3, 5, 6))
    )
    return [
        where, READ_AT.sub(", ".join(read_at), quantity, count=1), printed, ", ".join(ours), reading,
        ", ".join(differences), ", ".join(verdicts),
    ]  # fmt: skip


def by_quantity(rows: Sequence[list[str]]) -> list[str]:
    """Lines of a page: where, quantity, printed, and ours by reading; the range of three or more that are alike."""
    found: dict[tuple[str, str, str], list[tuple[str, str]]] = {}
    for where, named, printed, ours, read, difference, verdict in merged(rows):
        quantity, points = OF_POINTS.sub("", named), OF_POINTS.findall(named)
        reading = ", ".join([*points, *([] if read == "as published" else [read])])
        why = verdict.replace("differs", "").partition(" (")[0] if ours == "-" else ""
        number = "" if ours == "-" else ", ".join(n if len(n) < 6 else f"{float(n):#.4g}" for n in ours.split(", "))
        words = ": ".join(filter(None, (reading, why or difference)))
        found.setdefault((where, quantity, printed), []).append((number, f" ({words})" if words else ""))
    return [
        f"- {where}: {quantity}: {printed}; here {_here(readings)}"
        for (where, quantity, printed), readings in found.items()
    ]


def _here(readings: Sequence[tuple[str, str]]) -> str:
    numbers = [float(number) for number, _ in readings if number and "," not in number]
    if len(numbers) > 2 and len(numbers) == len(readings) and max(numbers) < 1.2 * min(numbers):
        return f"{min(numbers):.4g} to {max(numbers):.4g} ({len(numbers)} readings)"
    return "; ".join(number + words if number else words.strip(" ()") for number, words in readings)


def run_scene(scene: str, device: str | None, **settings: Any) -> tuple[Values, Result | None]:
    """Measures and outcomes of a scene as published, with what `settings` replaces, and the result.

    "NAME, error" is relative to finite elements or an exact solution. `why` says why a run did not end.
    """
    try:
        result = whole(build_scene(scene, as_published(scene, settings)).run(device=device, usd=False, pictures=False))
    except DivergedError as error:
        return {"why": str(error)}, None
    found: Values = {"steps": result.summary["steps"]}
    for name, entry in result.summary["measures"].items():
        found[name] = entry["value"]
        if entry.get("error") is not None:
            found[f"{name}, error"] = entry["error"]
    if result.status != "finished":
        found["why"] = result.summary["message"] or result.status
    return found, result


def scene_values(scene: str, device: str | None, **settings: Any) -> Values:
    """The first part of `run_scene`."""
    return run_scene(scene, device, **settings)[0]


def where_passed(result: Result | None, along: str, wanted: tuple[float, ...], names: tuple[str, ...]) -> Values:
    """Columns of a history at the rows nearest to values of another column: `names` at 1.5 and so on."""
    found: Values = {}
    for value in () if result is None else wanted:
        row = min(result.history, key=lambda row: abs(row[along] - value))
        if abs(row[along] - value) < 1e-3 * abs(value):
            found |= {f"{name} at {value:g}": row[name] for name in names}
    return found
