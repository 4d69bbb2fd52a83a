"""Page, pictures and the line of the README, from the numbers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from study import DOCS, ROOT, Row, load_rows, picture, renew, table, write_page

from validation import bulges, crack_paths, cracks, inflated, printed, relaxation, spread, tears
from validation.comparison import Comparison

NUMBERS, PICTURE = DOCS / "validation" / "numbers.json", DOCS / "validation" / "rows.png"
SPREAD, SPREAD_PICTURE = DOCS / "validation" / "spread.json", DOCS / "validation" / "spread.png"
PAGE, README = DOCS / "validation.md", ROOT / "README.md"
Runs = list[Row]
# All rows, by name, in the order of the page.
ROWS = {
    row.name: row
    for part in (bulges, relaxation, inflated, printed, tears, cracks, crack_paths)
    for row in (make() for make in part.ROWS)
}


def records(path: Path = NUMBERS) -> dict[str, Runs]:
    """Runs of all rows, by name in the order of the page; the one at full size last."""
    found = sorted(load_rows(path), key=lambda run: run["full"])
    runs = {name: [run for run in found if run["row"] == name] for name in ROWS}
    return {name: of for name, of in runs.items() if of}


def percent(value: float | None) -> str:
    """A ratio in a cell."""
    return "-" if value is None else f"{100.0 * value:.1f} %"


def numbers(values: list[float | None]) -> str:
    """Ordinates in a cell: three at most."""
    chosen = values if len(values) <= 3 else [values[0], values[len(values) // 2], values[-1]]
    return ", ".join("none" if value is None else f"{value:.3g}" for value in chosen)


def cells(row: Comparison, runs: Runs) -> list[str]:
    """One line of the table."""
    run = runs[-1]
    ours, theirs = numbers(run["ours"][-1]), numbers(run["theirs"])
    deviation = percent(run["deviation"]) if row.counts else "(bound)"
    title = f"[{row.title}](#{row.name})"
    scatter = "" if row.scatter == "-" else f" ({row.scatter})"
    return [title, row.kind, row.blind, ours, theirs + scatter, deviation, percent(run["change"])]


def compared(found: dict[str, Runs]) -> dict[str, float]:
    """Deviations of the rows that have one, from the run at full size if there is one."""
    deviations = {name: runs[-1]["deviation"] for name, runs in found.items() if ROWS[name].counts}
    return {name: value for name, value in deviations.items() if value is not None}


def summary(found: dict[str, Runs]) -> str:
    """The line of the README: only rows with a deviation count as compared."""
    known = compared(found)
    tests = sum(ROWS[name].kind == "test" for name in known)
    blind = [known[name] for name in known if ROWS[name].blind == "yes"]
    worst = max(known, key=lambda name: known[name])
    bounds = sum(not ROWS[name].counts for name in found)
    failed = len(found) - bounds - len(known)
    median, median_of_blind = (percent(float(np.median(values))) for values in (list(known.values()), blind))
    fails = f"ours fails in {failed} more, and {bounds}" if failed else f"{bounds} more"
    return (
        f"Against {len(known)} published results ({tests} tests, {len(known) - tests} formulas, laws and "
        f"computations), no constant tuned: median deviation {median}, the worst {percent(known[worst])} "
        f"({ROWS[worst].title[0].lower()}{ROWS[worst].title[1:]}); {len(blind)} of them were blind, median "
        f"{median_of_blind}; {fails} give a bound: [validation](docs/validation.md)."
    )


def section(row: Comparison) -> list[str]:
    """The paragraph of a row."""
    text = (
        f'<a id="{row.name}"></a> `{row.name}`: {row.source} ({row.seen}): {row.measured}. '
        f"Constants: {row.constants}. *{row.verdict}*"
    )
    return [text, ""]


def made(found: dict[str, Runs]) -> str:
    """Points and device of the rows, by their names."""
    runs: dict[str, dict[str, list[str]]] = {}
    for name, (*_, run) in found.items():
        runs.setdefault(run["made"], {}).setdefault(", ".join(map(str, run["points"])), []).append(name)
    each = []
    for device, by_points in runs.items():
        rows = (f"{points} ({', '.join(names)})" for points, names in by_points.items())
        each.append(f"{device}: {'; '.join(rows)}")
    return f"Points of the rows. {'. '.join(each)}."


def draw(path: Path, found: dict[str, Runs]) -> None:
    """One panel a row: theirs, and ours at all spacings."""
    columns = 4
    with picture(path, -(-len(found) // columns), columns, size=(3.0, 2.3)) as axes:
        for panel, (name, runs) in zip(axes.flat, found.items(), strict=False):
            row, run = ROWS[name], runs[-1]
            words = isinstance(run["at"][0], str)
            at = np.arange(len(run["at"])) if words else np.array(run["at"])
            panel.plot(at, run["theirs"], "ko-" if len(at) > 1 and not words else "ko", ms=4, label="theirs")
            for points, ours in zip(run["points"], run["ours"], strict=True):
                panel.plot(
                    at,
                    np.array(ours, float),
                    "x-" if len(at) > 1 and not words else "x",
                    ms=5,
                    label=f"ours, {points} points",
                )
            if words:
                panel.set_ylim(0.0, 1.5 * max(run["theirs"]))
                panel.set_xticks(at, run["at"], fontsize=7)
                panel.set_xlim(-0.5, len(at) - 0.5)
            panel.set_title(row.title, fontsize=8)
            panel.set_xlabel(row.labels[0], fontsize=7)
            panel.set_ylabel(row.labels[1], fontsize=7)
            panel.tick_params(labelsize=7)
            panel.legend(fontsize=6)
        for panel in list(axes.flat)[len(found) :]:
            panel.remove()


def sections(found: dict[str, Runs]) -> dict[str, list[str]]:
    """Lines of the page by heading."""
    head = ["row", "theirs is a", "blind", "ours", "theirs (scatter)", "median deviation", "last change"]
    rows = table(head, [cells(ROWS[name], runs) for name, runs in found.items()])
    each = [line for name in found for line in section(ROWS[name])]
    return {
        "## Numbers": [*rows, "", made(found), "", "![Ours beside theirs, redrawn](validation/rows.png)"],
        "## Row by row": each,
        "### Fits": spread.section(load_rows(SPREAD)),
    }


def make() -> None:
    """Renew page, picture and the line of the README."""
    # The only use of an image library.
    from small_pictures import limit, shrunk

    found = records()
    draw(PICTURE, found)
    PICTURE.write_bytes(shrunk(PICTURE, limit(PICTURE)))
    spread.draw(SPREAD_PICTURE, load_rows(SPREAD))
    SPREAD_PICTURE.write_bytes(shrunk(SPREAD_PICTURE, limit(SPREAD_PICTURE)))
    renew(PAGE, sections(found))
    line = re.compile(r"^Against \d+ published .*\n", re.MULTILINE)
    write_page(README, line.sub(lambda _: summary(found) + "\n", README.read_text("utf-8")))
