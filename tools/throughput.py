"""Time a step: sizes, horizons, precisions, and the cost of each feature.

python tools/throughput.py --device cuda:0 --out throughput.md           everything, a few minutes on a GPU
python tools/throughput.py --points 101 --horizon 2.015 3.15             a few cases
warp-pd bench                                                            the same few cases from the command line
"""

from __future__ import annotations

import dataclasses

from study import find_device, provenance, renew, run_tool, save_rows, study_parser

from warp_pd.run import bench
from warp_pd.run.bench import Case


def feature_cases(points: int, horizon: float) -> list[Case]:
    """Every feature alone, all together, damaged sheets, a hole, the cloud, the reference kernels."""
    alone = [Case(points, horizon, features=(feature,)) for feature in bench.FEATURES]
    torn = [Case(points, horizon, features=("rupture",), damaged=fraction) for fraction in (0.01, 1.0)]
    torn += [Case(points, horizon, features=(bench.DAMAGE_FIELD,), damaged=part) for part in (0.0, 0.01, 0.05)]
    return [
        Case(points, horizon),
        *alone,
        Case(points, horizon, features=bench.FEATURES),
        *torn,
        Case(points, horizon, layout="hole"),
        Case(points, horizon, layout="cloud"),
        Case(points, horizon, fast=False),
    ]


def main() -> None:
    """Measure and print. Write the page and the numbers if there is --out."""
    parser = study_parser(__doc__, device=None, out=None, commit=None)
    parser.add_argument("--points", type=int, nargs="*", default=[32, 100, 316, 1000, 3163], help="along a side")
    parser.add_argument("--horizon", type=float, nargs="*", default=[1.5, 2.015, 3.15], help="in spacings")
    parser.add_argument("--precision", type=int, nargs="*", default=[32, 64])
    parser.add_argument("--features-at", type=int, nargs="*", default=[100, 1000], help="points of the feature tables")
    parser.add_argument("--seconds", type=float, default=1.0, help="measured time of each case")
    options = parser.parse_args()
    device = find_device(options.device)
    sizes = [Case(n, m, bits) for bits in options.precision for m in options.horizon for n in options.points]
    groups = {"Sizes": sizes}
    for points in options.features_at:
        for horizon in options.horizon:
            groups[f"Features, {points} x {points} points, horizon {horizon:g}"] = feature_cases(points, horizon)
    made = provenance(device.name, options.commit)
    sections = {
        "# Time of a step": [
            f"Measured on {made}: variational bond-associated law, Gent material, plain weights. A step holds forces, "
            "loads and integration. Times are the median of nine measurements. The spread is half the range of the "
            "middle half."
        ]
    }
    rows = []
    for title, cases in groups.items():
        measured = []
        for case in cases:
            measured.append(bench.measure(case, str(device), options.seconds))
            print(bench.table(measured[-1:]).splitlines()[-1], flush=True)
        sections[f"## {title}"] = [bench.table(measured)]
        rows += [{**dataclasses.asdict(timing), "made": made} for timing in measured]
    if options.out is not None:
        renew(options.out, sections)
        save_rows(options.out.with_suffix(".json"), rows)


if __name__ == "__main__":
    run_tool(main)
