"""Compare with what others measured or computed: the rows of docs/validation.md.

    python -m tools.validation notch                             one row, at a size for two cores: minutes
    python -m tools.validation --full --device cuda:0            all rows at full size, on a GPU
    python -m tools.validation spread                            fits of four laws to uniaxial tension, on a CPU
    python -m tools.validation --only-page                       page and pictures from the numbers that exist

Every call adds or replaces rows in docs/validation/numbers.json (fits: spread.json beside it), and renews the page, its
pictures and the line of the README from all of them. With --numbers FOLDER/numbers.json it does not: it writes there.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

if __name__ == "__main__":
    # tools/ in place of its own folder: the tools import each other as scripts.
    sys.path[0] = str(Path(__file__).resolve().parents[1])

from study import load_rows, run_tool, save_rows, study_parser

from validation import spread
from validation.comparison import UnfinishedError, measured
from validation.page import NUMBERS, ROWS, make

FITS = "spread"


def parsed(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Options of the command line."""
    parser = study_parser(__doc__, device=None, only_page=False)
    parser.add_argument("rows", nargs="*", metavar="ROW", help=f"of {', '.join([*ROWS, FITS])}; by default all")
    parser.add_argument("--full", action="store_true", help="at full size")
    parser.add_argument("--numbers", type=Path, default=NUMBERS, help="file of the numbers")
    options = parser.parse_args(arguments)
    for name in set(options.rows) - {*ROWS, FITS}:
        parser.error(f"ROW = {name!r}: expected one of {', '.join([*ROWS, FITS])}")
    if options.only_page and options.rows:
        parser.error(f"--only-page {' '.join(options.rows)}: expected no ROW, as the page is made from all numbers")
    return options


def main(arguments: Sequence[str] | None = None) -> None:
    """Run rows, keep their numbers, renew the page."""
    options = parsed(arguments)
    unfinished: list[str] = []
    for name in [] if options.only_page else options.rows or [*ROWS, FITS]:
        if name == FITS:
            save_rows(options.numbers.with_name("spread.json"), spread.run())
            continue
        try:
            found = measured(ROWS[name], options.full, options.device)
        except UnfinishedError as error:
            print(f"{name}: not kept: {error}", file=sys.stderr, flush=True)
            unfinished.append(name)
            continue
        others = [run for run in load_rows(options.numbers) if (run["row"], run["full"]) != (name, options.full)]
        save_rows(options.numbers, [*others, found])
        print(f"{name}: {found['ours'][-1]} against {found['theirs']} ({found['seconds']} s)", flush=True)
    if options.numbers == NUMBERS:
        make()
    if unfinished:
        sys.exit(f"{len(unfinished)} of the rows have no new numbers: {', '.join(unfinished)}")


if __name__ == "__main__":
    run_tool(main)
