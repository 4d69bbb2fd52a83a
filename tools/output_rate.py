"""Measure how much of the step rate is left when frames are written: the same run with and without files.

    python tools/output_rate.py --device cuda:0 --points 1000     # a million points, files in a temporary folder

The case is a fixed neo-Hookean sheet under pressure that can tear, in float32. The run without files has a single
frame, the last. In the other runs every frame is copied from the device, and a thread writes it to frames.vtkhdf while
the next steps run. USD is left out: usdview is not meant for files of so many points.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from study import provenance, run_tool, study_parser

from warp_pd import BondAssociated, CriticalStretch, Explicit, Fixed, NeoHookean, Pressure, Sheet, Simulation
from warp_pd.interfaces.context import find_device
from warp_pd.run.divergence import DivergedError

SAFETY = 0.5
# Small against the shear modulus times thickness over side: the sheet must not inflate, however long it runs.
PRESSURE = 0.5


def simulation(points: int, horizon: float, duration: float, frames: int) -> Simulation:
    """A sheet under pressure."""
    sheet = Sheet.rectangle(1.0, 1.0, thickness=0.01, density=1000.0, points=points)
    return Simulation(
        sheet,
        force=BondAssociated(NeoHookean(mu=1e3, bulk=100e3), horizon=horizon),
        loads=[Fixed(sheet.edges("all")), Pressure(PRESSURE)],
        damage=CriticalStretch(3.0),
        solver=Explicit(duration=duration, frames=frames, damping=0.1, safety=SAFETY),
    )


def steps_and_seconds(case: Simulation, device: str, out: str | None) -> tuple[int, float]:
    """Steps of a run, and its seconds without set-up and compilation.

    Raises:
        DivergedError: if the run does not finish: its rate would mean nothing.
    """
    result = case.run(device=device, precision=32, out=out, usd=False)
    summary = result.summary
    if result.status != "finished":
        raise DivergedError(f"the run ended {result.status}: {summary['message']}")
    return summary["steps"], summary["wall_s"] - summary["setup_s"] - summary["compile_s"]


def main() -> None:
    """Print one line a run, and the share of the rate that is left."""
    parser = study_parser(__doc__, device=None, commit=None)
    parser.add_argument("--points", type=int, default=200, help="along a side")
    parser.add_argument("--horizon", type=float, default=3.15, help="in spacings")
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--steps", type=int, default=500, help="steps a frame")
    options = parser.parse_args()
    device = find_device(options.device)
    trial = simulation(options.points, options.horizon, 1e-6, 1).run(device=str(device), precision=32)
    duration = SAFETY * trial.summary["stable_dt"] * options.steps * options.frames
    measured = provenance(device.name, options.commit)
    print(f"{options.points}^2 points, horizon {options.horizon:g}, {measured}")
    rates = []
    with tempfile.TemporaryDirectory() as folder:
        for frames, out in ((1, None), (options.frames, None), (options.frames, folder)):
            case = simulation(options.points, options.horizon, duration, frames)
            steps, seconds = steps_and_seconds(case, str(device), out)
            rates.append(steps / seconds)
            size = sum(p.stat().st_size for p in Path(folder).glob("*"))
            kept = f", {size / 1e9:.1f} GB of files" if out else ""
            print(f"{frames} frames{kept}: {steps} steps in {seconds:.2f} s, {steps / seconds:.4g} steps/s", flush=True)
    copied, written = (100.0 * rate / rates[0] for rate in rates[1:])
    print(f"copied frames leave {copied:.1f} %, written frames {written:.1f} %")


if __name__ == "__main__":
    run_tool(main)
