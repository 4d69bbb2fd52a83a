"""Energy of an undamped oscillation under each force law: those without a potential need not conserve it.

    python tools/energy_drift.py                     # prints a table and draws docs/energy-drift.png
    python tools/energy_drift.py --device cuda:0 --points 51 --duration 20

A sheet with fixed edges, stretched by 10 %, starts with the velocity of its first mode and is left alone, undamped.
The laws without a potential have no strain energy to report. What is followed for all of them is the same number:
kinetic energy plus the nodal energy h sum a Psi(F), F of whole families, of the frame, less that of the start, over
the kinetic energy of the start. It is 1 at first; energy that goes into motion finer than a family feels leaves it, so
a law with a potential keeps it near or below 1. Only forces that do net work around a cycle can raise it steadily.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from stamp import device_name, one_line, stamp

from warp_pd import BondAssociated, Explicit, Fixed, Frame, NeoHookean, Neural, Nodal, Sheet, Simulation
from warp_pd.forces import ForceLaw
from warp_pd.launches import run_once

DOCS = Path(__file__).resolve().parents[1] / "docs"
MATERIAL = NeoHookean(mu=1e3, bulk=100e3)
LAWS: dict[str, ForceLaw] = {
    "bond-associated plain": BondAssociated(MATERIAL, horizon=3.15, weights="plain"),
    "bond-associated published": BondAssociated(MATERIAL, horizon=3.15, weights="published"),
    "closed form": Neural(MATERIAL, evaluation="closed_form"),
    "neural (b) fused": Neural(MATERIAL, evaluation="fused"),
    "nodal": Nodal(MATERIAL),
}


def oscillation(law: ForceLaw, points: int, duration: float, stretch: float, speed: float) -> Simulation:
    """The sheet of NN 6.1, stretched, with the velocity of its first mode."""
    sheet = Sheet.rectangle(1.0, 1.0, thickness=0.01, density=1000.0, points=points)
    x, y = sheet.points.T
    stretched = np.column_stack([stretch * (x - 0.5), stretch * (y - 0.5), np.zeros(sheet.size)])
    velocity = np.zeros((sheet.size, 3))
    velocity[:, 2] = speed * np.sin(np.pi * x) * np.sin(np.pi * y)
    velocity[sheet.edges("all")] = 0.0
    return Simulation(
        sheet,
        force=law,
        loads=[Fixed(sheet.edges("all"))],
        initial_displacement=stretched,
        initial_velocity=velocity,
        solver=Explicit(duration=duration, frames=round(40 * duration), safety=0.2, precision=64),
    )


class TotalEnergy:
    """Writer that follows kinetic plus nodal energy, over the kinetic energy of the start."""

    def __init__(self, simulation: Simulation) -> None:
        self.built = Simulation(simulation.sheet, Nodal(MATERIAL), Explicit(1.0)).build("cpu", 64)
        self.built.workspace.compile()
        self.mass = simulation.sheet.areas * simulation.sheet.thickness * simulation.sheet.density
        self.free = np.setdiff1d(np.arange(simulation.sheet.size), simulation.sheet.edges("all"))
        self.totals: list[float] = []
        self.start = 0.0

    def write(self, frame: Frame) -> None:
        """Add the frame's."""
        self.built.state.displacement.assign(frame.displacement)
        run_once(self.built.workspace.device, self.built.workspace.stages["frame"])
        kinetic = 0.5 * float((self.mass[:, None] * frame.velocity**2)[self.free].sum())
        total = kinetic + float(self.built.strain_energy.numpy().sum())
        if not self.totals:
            self.start, self.first = kinetic, total
        self.totals.append(1.0 + (total - self.first) / self.start)

    def save(self) -> None:
        """Nothing to save."""

    def close(self) -> None:
        """Nothing to close."""


def main() -> None:
    """Run every law, print the table, draw the energies."""
    import matplotlib.pyplot as plt

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", type=device_name, default="cpu")
    parser.add_argument("--points", type=int, default=21)
    parser.add_argument("--duration", type=float, default=20.0, help="[s]; a period is about 2 s.")
    parser.add_argument("--stretch", type=float, default=0.1)
    parser.add_argument("--speed", type=float, default=0.5, help="Of the middle at the start [m/s].")
    given = parser.parse_args()
    figure, axes = plt.subplots(figsize=(9.0, 4.5), layout="constrained")
    print("| law | first tenth | last tenth | largest | own balance error | status |")
    print("|---|---|---|---|---|---|")
    device: Any = None
    for name, law in LAWS.items():
        simulation = oscillation(law, given.points, given.duration, given.stretch, given.speed)
        energy = TotalEnergy(simulation)
        result = simulation.run(device=given.device, writers=[energy])
        device = result.built.workspace.device.name
        totals = np.array(energy.totals)
        tenth = max(1, len(totals) // 10)
        balance = result.history[-1].get("balance_error")
        shown = "no potential" if balance is None else f"{balance:+.1e}"
        print(
            f"| {name} | {totals[:tenth].mean():.3f} | {totals[-tenth:].mean():.3f} | {totals.max():.3f} | {shown} "
            f"| {result.status} at {result.history[-1]['time']:.3g} s |",
            flush=True,
        )
        axes.plot([row["time"] for row in result.history], totals, label=name, linewidth=1.0)
    axes.set(xlabel="time (s)", ylabel="kinetic + nodal energy over the start's", ylim=(0.0, 2.0))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    figure.savefig(DOCS / "energy-drift.png", dpi=120)
    plt.close(figure)
    print(f"\n{given.points} x {given.points} points, {given.duration:g} s, {stamp(device)}.")


if __name__ == "__main__":
    one_line(main)
