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
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from study import provenance, study_parser

from warp_pd.interfaces.context import find_device
from warp_pd.run.folder import write_atomically

from . import execution
from .cases import CASES
from .laws import LAWS, RUBBER, Trial
from .page import page
from .results import in_order, load, require_device, save
from .tables import progress
from .verdicts import Table


def parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Options of the command line."""
    parser = study_parser(__doc__, device=None, jobs=1, out=None, only_page=False, commit=None)
    parser.add_argument("--missing", action="store_true", help="run only what the numbers do not have yet")
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


def write(out: Path, cells: Table) -> None:
    """Write the page and the numbers."""
    save(out.with_suffix(".json"), cells)
    write_atomically(out, page(cells, out.with_suffix(".json").name))


def main(arguments: Sequence[str] | None = None) -> Table:
    """Run the cases, print a line for each, write the page and the numbers; returns the cells of the page."""
    options = parsed(arguments)
    cells: Table = {} if options.out is None else load(options.out.with_suffix(".json"))
    if not options.only_page:
        cells = run(options, cells)
    if options.out is not None:
        write(options.out, cells)
        print(f"wrote {options.out}")
    return cells


def run(options: argparse.Namespace, cells: Table) -> Table:
    """Run the chosen cases and add them to the cells of earlier calls.

    Raises:
        InputError: if those are of another device.
    """
    device = str(find_device(options.device).name)
    if options.out is not None:
        require_device(cells, device, options.out.with_suffix(".json"))
    for law in options.laws:
        # A law that cannot be made at all is an error of this tool, not a case that does not apply.
        LAWS[law](RUBBER)
    made = f"{provenance(device, options.commit)}, long runs of up to {options.seconds:g} s"
    made += ", short" if options.fast else ""
    tasks = [
        (case.name, Trial(law, 32, options.device, options.steps, options.seconds, options.fast))
        for case in options.cases
        for law in options.laws
        if not (options.missing and law in cells.get(case.name, {}))
    ]
    for (name, trial), found in execution.run_all(tasks, options.jobs):
        cells.setdefault(name, {})[trial.law] = replace(found, made=made)
        cells = in_order(cells)
        print(progress(name, trial.law, found), flush=True)
        if options.out is not None:
            write(options.out, cells)
    return cells
