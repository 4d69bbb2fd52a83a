"""Verdicts and numbers of every force law on stiff and extreme cases.

    python tools/stability --out docs/stability.md               # all cases; the longest runs stop after --seconds
    python tools/stability --fast                                # short versions and one law, for CI
    python tools/stability --device cuda:0 --jobs 16 --seconds 20 --commit HASH --out docs/stability-gpu.md
    python tools/stability --only "units" "ball"                 # cases whose name contains one of these
    python tools/stability --laws visco --out docs/stability.md  # adds what it runs to the page, or replaces it

Every case runs in float32 and in float64. The numbers are saved in the JSON beside the page as they come. A call that
was stopped can go on with --missing. A page is of one device. Verdicts:

    stable                      at the default share of the estimated step, 0.9
    stable with a smaller step  the share is the remark of the number
    diverges cleanly            the run ends with a message, or the input is refused; no NaN or Inf is written
    wrong                       finite, but against physics: energy, objectivity, a value
    does not apply              the law has no such thing; the remark says why
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

if not __package__:
    # The folder tools/, in place of this one.
    sys.path[0] = str(Path(__file__).resolve().parents[1])

from study import Row, load_rows, renew, run_tool, study_parser

from stability.cases import CASES
from stability.laws import LAWS
from stability.sweep import run
from stability.tables import sections


def parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Options of the command line."""
    parser = study_parser(__doc__, device=None, jobs=1, out=None, only_page=False, missing=False, commit=None)
    parser.add_argument("--fast", action="store_true", help="fewer cases and shorter runs")
    parser.add_argument("--only", nargs="*", default=[""], help="cases whose name contains one of these")
    parser.add_argument("--laws", nargs="*", choices=list(LAWS), help="by default all; with --fast corrected")
    parser.add_argument("--steps", type=int, default=1_000_000, help="of the oscillation; the spin takes a tenth")
    parser.add_argument("--seconds", type=float, default=10.0, help="after which a long run stops")
    options = parser.parse_args(arguments)
    options.laws = options.laws or (["corrected"] if options.fast else list(LAWS))
    options.cases = [c for c in CASES if (c.fast or not options.fast) and any(part in c.name for part in options.only)]
    if not options.cases:
        parser.error(f"--only = {options.only}: expected parts of the names of cases, such as 'K/mu'")
    for name in ("missing", "only_page"):
        if getattr(options, name) and options.out is None:
            parser.error(f"--{name.replace('_', '-')}: expected with --out, which has the numbers beside it")
    return options


def main(arguments: Sequence[str] | None = None) -> list[Row]:
    """Run the cases, print a line for each, renew the page; returns the rows of the page."""
    options = parsed(arguments)
    rows = [] if options.out is None else load_rows(options.out.with_suffix(".json"))
    if not options.only_page:
        rows = run(options, rows)
    if options.out is not None:
        renew(options.out, sections(rows))
    return rows


if __name__ == "__main__":
    run_tool(main)
