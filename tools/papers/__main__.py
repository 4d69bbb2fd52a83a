"""Every number that the five papers print, beside ours.

    python -m tools.papers --only ve.equations nn.4             # seconds
    python -m tools.papers --device cuda:0                      # everything, at the papers' sizes
    python -m tools.papers --missing                            # what docs/papers/printed.json does not have yet
    python -m tools.papers --only-page                          # renew the pages from what there is
    python -m tools.papers --list                               # examples by key

An example is a scene as `warp-pd run SCENE --as-published` has it, or with one thing replaced where the paper leaves it
open. Its numbers are written as soon as they are there, so that a call can be repeated after an interruption.
`--only ba.6.1` runs all examples whose key begins so. From them docs/papers/printed.csv is made, one table of all rows,
and the section *Every printed number* of docs/papers/ba.md and so on, which shows what does not match.
"""

from __future__ import annotations

import csv
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

TOOLS = Path(__file__).resolve().parents[1]
if not __package__ or __package__ != "papers":
    # As the other tools, which are scripts: their folder in place of this one or of the checkout.
    sys.path[0] = str(TOOLS)

from study import DOCS, device_title, provenance, renew, run_tool, study_parser, table  # noqa: E402

from papers import ba, he, im, nn, ve  # noqa: E402
from papers.rows import Row, by_quantity  # noqa: E402
from papers.store import load, save  # noqa: E402
from warp_pd import InputError  # noqa: E402

PAPERS = {"ba": ba, "nn": nn, "im": im, "he": he, "ve": ve}
NUMBERS = DOCS / "papers" / "printed.json"
HEADING = "## Every printed number"
NOTHING = ("nothing to compare", "no number")
HEAD = ["where", "quantity", "printed", "here", "reading", "difference", "verdict"]
# Membrane finite elements of the project, by what they are compared with: docstrings of the scenes, tools/references.
ELEMENTS = {
    "ba.6.1": 13.5432e-3, "ba.6.2": 15.6799e-3, "nn.6.1.static": 0.302585, "nn.6.1.dynamic at 0.25": 0.0633,
    "nn.6.1.dynamic at 0.5": 0.2592, "nn.6.1.dynamic at 0.75": 0.634, "nn.6.1.dynamic at 1": 0.432,
}  # fmt: skip


def examples() -> dict[str, Any]:
    """All examples, by key."""
    return {key: example for paper in PAPERS.values() for key, example in paper.EXAMPLES.items()}


def chosen(prefixes: Sequence[str]) -> list[str]:
    """Keys of the examples that begin with one of the prefixes, in their order."""
    known = examples()
    for prefix in prefixes:
        if not any(_begins(key, prefix) for key in known):
            raise InputError(f"--only {prefix}: expected the beginning of a key of --list")
    return list(
        dict.fromkeys(key for prefix in prefixes for key in known if _begins(key, prefix)) if prefixes else known
    )


def _begins(key: str, prefix: str) -> bool:
    return key == prefix or key.startswith(prefix + ".")


def judged(row: Row, found: dict[str, Any]) -> list[str]:
    """Cells of a row of the table."""
    if row.example == "elements":
        return row.cells(ELEMENTS)
    return row.cells(found[row.example]["values"] if row.example in found else None)


def pages(found: dict[str, Any], folder: Path) -> None:
    """Write all rows to printed.csv, and renew the section of every paper's page: what does not match."""
    with (folder / "printed.csv").open("w", encoding="utf-8", newline="") as file:
        lines = csv.writer(file, lineterminator="\n")
        lines.writerow(["paper", *HEAD, "made"])
        for name, paper in PAPERS.items():
            made = {key: example["made"] for key, example in found.items()}
            lines.writerows([name, *judged(row, found), made.get(row.example, "")] for row in paper.ROWS)
    for name, paper in PAPERS.items():
        run = [(row, judged(row, found)) for row in paper.ROWS if row.example in (*found, "elements")]
        silent = sum(cells[-1] in NOTHING for _, cells in run)
        other = [cells for _, cells in run if cells[-1] not in ("matches", *NOTHING)]
        made_on = sorted({found[row.example]["made"] for row, _ in run if row.example in found})
        words = (
            f"{len(paper.ROWS)} numbers and statements: {len(run) - len(other) - silent} match, {len(other)} do not "
            f"(below, as printed and here), {silent} have nothing to compare with, {len(paper.ROWS) - len(run)} have "
            f"no run yet ([all](printed.csv); `python -m tools.papers --only {name}`; {'; '.join(made_on)})."
        )
        renew(folder / f"{name}.md", {HEADING: [words, "", *by_quantity(other)]})


def main() -> None:
    """Run the chosen examples, keep their numbers, renew the pages."""
    parser = study_parser(__doc__, device=None, out=NUMBERS, only_page=False, missing=False)
    parser.add_argument("--only", nargs="+", default=[], help="beginnings of keys, such as ba.6.1")
    parser.add_argument("--skip", nargs="+", default=[], help="beginnings of keys that are not run")
    parser.add_argument("--list", action="store_true", help="print the keys and run nothing")
    options = parser.parse_args()
    keys = chosen(options.only)
    if options.list:
        print("\n".join(keys))
        return
    found = load(options.out)
    made = provenance(device_title(options.device))
    for key in () if options.only_page else keys:
        if (options.missing and key in found) or any(_begins(key, prefix) for prefix in options.skip):
            continue
        start = time.perf_counter()
        values = examples()[key](options.device)
        found[key] = {"values": values, "seconds": round(time.perf_counter() - start, 1), "made": made}
        save(options.out, found)
        print(f"{key}: {found[key]['seconds']:g} s", *([values["why"]] if "why" in values else []), flush=True)
    if options.out == NUMBERS:
        found = load(NUMBERS)
        pages(found, DOCS / "papers")
        ve.rate_picture(DOCS / "papers" / "ve-rates.png")
        im.relaxation_picture(DOCS / "papers" / "im-relaxation.png", found)
    else:
        rows = [row for name in PAPERS for row in PAPERS[name].ROWS if row.example in keys or not options.only]
        print("\n".join(table(HEAD, [judged(row, found) for row in rows])))


if __name__ == "__main__":
    run_tool(main)
