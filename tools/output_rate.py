"""What writing frames leaves of the step rate: the same run with and without files.

    python tools/output_rate.py --device cuda:0 --points 1000     # a million points, files in a temporary folder

A fixed neo-Hookean sheet under pressure, which can tear, float32. Without files there is one frame, the last; with
them every frame is copied from the device and written to frames.vtkhdf by a thread, beside the steps of the next.
USD is left out: usdview's files of so many points are not meant for it.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from stamp import device_name, one_line, stamp

from warp_pd import BondAssociated, CriticalStretch, Explicit, Fixed, NeoHookean, Pressure, Sheet, Simulation
from warp_pd.device.context import find_device

SAFETY = 0.5
# Small against the shear modulus times thickness over the side: the sheet must not inflate, however long it runs.
PRESSURE = 0.5


def simulation(points: int, horizon: float, duration: float, frames: int) -> Simulation:
    """A sheet under pressure with so many frames."""
    sheet = Sheet.rectangle(1.0, 1.0, thickness=0.01, density=1000.0, points=points)
    return Simulation(
        sheet,
        force=BondAssociated(NeoHookean(mu=1e3, bulk=100e3), horizon=horizon),
        loads=[Fixed(sheet.edges("all")), Pressure(PRESSURE)],
        damage=CriticalStretch(3.0),
        solver=Explicit(duration=duration, frames=frames, damping=0.1, safety=SAFETY),
    )


def march(case: Simulation, device: str, out: str | None) -> tuple[int, float]:
    """Steps, and seconds without set-up and compilation.

    Raises:
        RuntimeError: if the run does not finish: its rate would mean nothing.
    """
    result = case.run(device=device, precision=32, out=out, usd=False)
    summary = result.summary
    if result.status != "finished":
        raise RuntimeError(f"the run ended {result.status}: {summary['message']}")
    return summary["steps"], summary["wall_s"] - summary["setup_s"] - summary["compile_s"]


def main() -> None:
    """Print one line a run, and what is left of the rate."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", type=device_name)
    parser.add_argument("--points", type=int, default=200, help="along a side")
    parser.add_argument("--horizon", type=float, default=3.15)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--steps", type=int, default=500, help="steps a frame")
    parser.add_argument("--stand", help="name of the commit, where there is no repository")
    options = parser.parse_args()
    device = find_device(options.device)
    trial = simulation(options.points, options.horizon, 1e-6, 1).run(device=str(device), precision=32)
    duration = SAFETY * trial.summary["stable_dt"] * options.steps * options.frames
    print(f"{options.points}^2 points, horizon {options.horizon:g}, {stamp(device.name, options.stand)}")
    rates = []
    with tempfile.TemporaryDirectory() as folder:
        for frames, out in ((1, None), (options.frames, None), (options.frames, folder)):
            case = simulation(options.points, options.horizon, duration, frames)
            steps, seconds = march(case, str(device), out)
            rates.append(steps / seconds)
            size = sum(p.stat().st_size for p in Path(folder).glob("*"))
            kept = f", {size / 1e9:.1f} GB of files" if out else ""
            print(f"{frames} frames{kept}: {steps} steps in {seconds:.2f} s, {steps / seconds:.4g} steps/s", flush=True)
    print(f"copied frames leave {100 * rates[1] / rates[0]:.1f} %, written ones {100 * rates[2] / rates[0]:.1f} %")


if __name__ == "__main__":
    one_line(main)
