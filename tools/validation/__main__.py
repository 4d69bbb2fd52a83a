"""Compare with what others measured or computed: the rows of docs/validation.md.

    python -m tools.validation notch                             one row, at a size for two cores: minutes
    python -m tools.validation --full --device cuda:0            all rows at full size, on a GPU
    python -m tools.validation --only-page                       page and pictures from the numbers that exist

Each row writes docs/validation/NAME.json; every call renews the page, its pictures and the line of the README.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

if __name__ == "__main__":
    # tools/ in place of its own folder: the tools import each other as scripts.
    sys.path[0] = str(Path(__file__).resolve().parents[1])

from study import run_tool, study_parser

from validation.comparison import measured
from validation.page import NUMBERS, make, records
from validation.rows import NAMES, row


def parsed(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Options of the command line."""
    parser = study_parser(__doc__, device=None, only_page=False)
    parser.add_argument("rows", nargs="*", metavar="ROW", help=f"of {', '.join(NAMES)}; by default all")
    parser.add_argument("--full", action="store_true", help="at full size")
    parser.add_argument("--numbers", type=Path, default=NUMBERS, help="folder of the numbers")
    options = parser.parse_args(arguments)
    for name in set(options.rows) - set(NAMES):
        parser.error(f"ROW = {name!r}: expected one of {', '.join(NAMES)}")
    return options


def main(arguments: Sequence[str] | None = None) -> None:
    """Run rows, keep their numbers, renew the page."""
    options = parsed(arguments)
    for name in [] if options.only_page else options.rows or NAMES:
        known = records(options.numbers).get(name, {})
        found = measured(row(name), options.full, options.device)
        options.numbers.mkdir(parents=True, exist_ok=True)
        text = json.dumps({**known, "full" if options.full else "small": found}, indent=1)
        (options.numbers / f"{name}.json").write_text(text + "\n")
        print(f"{name}: {found['ours'][-1]} against {found['theirs']} ({found['seconds']} s)", flush=True)
    if options.numbers == NUMBERS:
        make()


if __name__ == "__main__":
    run_tool(main)
