"""Time a step: sizes, horizons, precisions, and what each feature costs.

python tools/throughput.py --device cuda:0 --out docs/throughput.md      everything, a few minutes on a GPU
python tools/throughput.py --points 101 --horizon 2.015 3.15             a few cases
warp-pd bench                                                            the same few cases from the command line
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from pathlib import Path

from stamp import device_name, one_line, stamp

from warp_pd import bench
from warp_pd.device.context import find_device


def main() -> None:
    """Measure and print; write page and numbers if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", type=device_name)
    parser.add_argument("--points", type=int, nargs="*", default=[32, 100, 316, 1000, 3163], help="along a side")
    parser.add_argument("--horizon", type=float, nargs="*", default=[1.5, 2.015, 3.15])
    parser.add_argument("--precision", type=int, nargs="*", default=[32, 64])
    parser.add_argument("--features-at", type=int, nargs="*", default=[100, 1000], help="points of the feature tables")
    parser.add_argument("--seconds", type=float, default=1.0, help="measured time of each case")
    parser.add_argument("--out", type=Path, help="page to write; numbers go beside it as JSON")
    parser.add_argument("--stand", help="name of the commit, where there is no repository")
    options = parser.parse_args()
    device = find_device(options.device)
    copied = bench.copy_rate(device, 1024 if device.is_cuda else 64)
    counted = {bits: bench.arithmetic_rate(device, bits) for bits in (32, 64)} if device.is_cuda else None
    groups = {"Sizes": bench.sweep(options.points, options.horizon, options.precision)}
    for points in options.features_at:
        for horizon in options.horizon:
            groups[f"Features, {points} x {points} points, horizon {horizon:g}"] = bench.feature_cases(points, horizon)
    lines = [
        "# Time of a step",
        "",
        f"Measured by `tools/throughput.py` {stamp(device.name, options.stand)}.",
        "Variational bond-associated law, Gent, plain weights; forces, loads and integration of whole steps. Median of",
        "nine measurements; spread: half the range of the middle half. Copying an array on this device moves",
        f"{copied / 1e9:.0f} GB/s, read and written.",
        *([f"Multiply-adds a second: {counted[32]:.2e} in float32, {counted[64]:.2e} in float64."] if counted else []),
        "",
    ]
    timings = []
    for title, cases in groups.items():
        measured = []
        for case in cases:
            measured.append(bench.measure(case, str(device), options.seconds))
            print(bench.table(measured[-1:], copied, counted).splitlines()[-1], flush=True)
        lines += [f"## {title}", "", bench.table(measured, copied, counted), ""]
        timings += measured
    if options.out is not None:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text("\n".join(lines))
        rows = [{**dataclasses.asdict(t), "device": device.name, "copy_rate": copied} for t in timings]
        options.out.with_suffix(".json").write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    one_line(main)
