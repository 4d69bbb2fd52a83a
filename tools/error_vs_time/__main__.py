"""Error against run time: all force laws, horizons, spacings, precisions and solvers, against finite elements.

    OMP_NUM_THREADS=1 taskset -c 0 python tools/error_vs_time --cpu-time        everything, on one core; an hour
    OMP_NUM_THREADS=1 taskset -c 0 python tools/error_vs_time --cpu-time --scenes pure_shear_tear --laws membrane_q4
    python tools/error_vs_time --device cuda:0 --points 101 201 401             on a GPU
    python tools/error_vs_time --fast                                           a minute: a few small cases
    python tools/error_vs_time --only-page                                      from the numbers that exist

Time is that of a whole run without files, with set-up and without compilation: the median of repeated runs.
Point-steps are points times force evaluations (time steps, or products of Newton's method). Every call adds or replaces
rows in docs/error-vs-time/numbers.json, and renews the tables and the picture of docs/error-vs-time.md from all rows;
with --out those of another page. With --numbers elsewhere and without --out it only prints the front.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

if not __package__:
    # The folder tools/, in place of this one.
    sys.path[0] = str(Path(__file__).resolve().parents[1])

from study import DOCS, RUNS, at_least_one, load_rows, renew, run_tool, study_parser

from error_vs_time.studies import STUDIES
from error_vs_time.sweep import sweep
from error_vs_time.tables import front_table, sections
from warp_pd.device.cores import available_cores

NUMBERS, PAGE = DOCS / "error-vs-time" / "numbers.json", DOCS / "error-vs-time.md"


def parsed(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Options of the command line."""
    parser = study_parser(__doc__, device=None, out=None, only_page=False, missing=False)
    scenes = [s.scene for s in STUDIES]
    laws = sorted({law for study in STUDIES for law in study.laws})
    parser.add_argument("--scenes", nargs="+", default=scenes, choices=scenes)
    parser.add_argument("--laws", nargs="*", default=[], choices=laws, metavar="LAW", help="only these")
    parser.add_argument(
        "--points", type=at_least_one, nargs="+", default=[], help="along a side; by default those of studies.py"
    )
    parser.add_argument("--horizon", type=float, nargs="+", default=[], help="in spacings, likewise")
    parser.add_argument("--precision", type=int, choices=[32, 64], nargs="+", default=[], help="in bits, likewise")
    parser.add_argument("--repeats", type=at_least_one, default=3, help="runs of each case, at most")
    parser.add_argument("--enough", type=float, default=10.0, help="seconds after which a case is not repeated")
    parser.add_argument(
        "--limit", type=float, default=60.0, help="seconds that a run may take; finer sheets are left out"
    )
    parser.add_argument("--cpu-time", action="store_true", help="CPU time on one core, for a machine that others use")
    parser.add_argument("--fast", action="store_true", help="a few small cases, not for the page")
    parser.add_argument("--numbers", type=Path, default=NUMBERS, help="file of the numbers")
    options = parser.parse_args(arguments)
    if options.fast:
        # Small cases are no rows of the page.
        options.numbers = RUNS / "error-vs-time.json" if options.numbers == NUMBERS else options.numbers
        options.points, options.horizon, options.precision = [11, 21], [2.015], [64]
        options.repeats, options.scenes = 1, ["pressure"]
        options.laws = options.laws or ["published", "corrected", "bond_based"]
    if options.out is None and options.numbers == NUMBERS:
        options.out = PAGE
    if options.cpu_time and available_cores() != 1:
        parser.error("--cpu-time: start it with OMP_NUM_THREADS=1 taskset -c 0 python tools/error_vs_time --cpu-time")
    return options


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, keep the numbers, and renew the page."""
    options = parsed(arguments)
    rows = []
    if not options.only_page:
        rows = [row for study in STUDIES if study.scene in options.scenes for row in sweep(study, options)]
    if options.out is not None:
        renew(options.out, sections(load_rows(options.numbers), options.out))
    else:
        print("\n".join(front_table(rows or load_rows(options.numbers))))


if __name__ == "__main__":
    run_tool(main)
