"""Error against run time: all force laws, horizons, spacings, precisions and solvers, against finite elements.

    python tools/error_vs_time                              # this CPU; takes long, see --points
    python tools/error_vs_time --fast                       # a minute: a few small cases
    python tools/error_vs_time --device cuda:0 --scenes pressure tension --repeats 3
    OMP_NUM_THREADS=1 taskset -c 0 python tools/error_vs_time --cpu-time --scenes pressure --points 13 26 51 101
    python tools/error_vs_time --only-page                  # from the numbers that exist

Time is that of a whole run without files, with set-up and without compilation: the median of repeated runs.
Point-steps are points times force evaluations (time steps, or products of Newton's method). Every call adds or replaces
rows in the file of its device in docs/error-vs-time/, and makes docs/error-vs-time.md and its pictures from all files.
With --numbers elsewhere and without --out it only prints the front.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from study import DOCS, provenance, study_parser, write_page

from warp_pd.device.cores import available_cores
from warp_pd.interfaces.context import find_device

from .page import FOLDER, page
from .results import Row, load
from .studies import STUDIES
from .sweep import sweep
from .tables import front_table


def parsed(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Options of the command line."""
    parser = study_parser(__doc__, device=None, out=None, only_page=False, commit=None)
    scenes = [s.scene for s in STUDIES]
    laws = sorted({law for study in STUDIES for law in study.laws})
    parser.add_argument("--scenes", nargs="+", default=scenes, choices=scenes)
    parser.add_argument("--laws", nargs="*", default=[], choices=laws, metavar="LAW", help="only these")
    parser.add_argument("--points", type=int, nargs="+", default=[26, 51, 101, 201, 401], help="along a side")
    parser.add_argument("--horizon", type=float, nargs="+", default=[1.5, 2.015, 3.15, 4.15], help="in spacings")
    parser.add_argument("--precision", type=int, nargs="+", default=[32, 64])
    parser.add_argument("--tear-points", type=int, nargs="+", default=[30, 60], help="of double_notch, 30 times 2^n")
    parser.add_argument("--repeats", type=int, default=3, help="runs of each case, at most")
    parser.add_argument("--enough", type=float, default=10.0, help="seconds after which a case is not repeated")
    parser.add_argument(
        "--limit", type=float, default=120.0, help="seconds that a run may take; finer sheets are left out"
    )
    parser.add_argument("--cpu-time", action="store_true", help="CPU time on one core, for a machine that others use")
    parser.add_argument("--fast", action="store_true", help="a few small cases")
    parser.add_argument("--numbers", type=Path, default=DOCS / FOLDER, help="folder of the numbers")
    parser.add_argument("--missing", action="store_true", help="run only what the numbers do not have yet")
    options = parser.parse_args(arguments)
    if options.fast:
        options.points, options.horizon, options.precision = [11, 21], [2.015, 3.15], [64]
        options.repeats, options.scenes = 1, ["pressure"]
        options.laws = options.laws or ["published", "corrected", "bond_based"]
    if options.out is None and options.numbers == DOCS / FOLDER:
        options.out = DOCS / f"{FOLDER}.md"
    if options.cpu_time and available_cores() != 1:
        parser.error("--cpu-time: start it with OMP_NUM_THREADS=1 taskset -c 0 python tools/error_vs_time --cpu-time")
    return options


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, keep the numbers, and make the page."""
    options = parsed(arguments)
    rows: list[Row] = []
    if not options.only_page:
        device = find_device(options.device)
        made = provenance(device.name, options.commit)
        for study in STUDIES:
            if study.scene in options.scenes:
                rows += sweep(study, options, str(device), made)
    if options.out is not None:
        write_page(options.out, page(load(options.numbers), options.out.parent))
    else:
        print("\n".join(front_table(rows or load(options.numbers))))
