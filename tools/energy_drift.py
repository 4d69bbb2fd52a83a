"""Follow the energy of an undamped oscillation under each force law.

    python tools/energy_drift.py                     # prints a table and draws docs/energy-drift.png
    python tools/energy_drift.py --device cuda:0 --points 51 --duration 20

A sheet with fixed edges is stretched by 10 %, starts with the velocity of its first mode, and oscillates undamped.
A law without a potential need not conserve energy and has no strain energy to report. So the same number is followed
for all laws: kinetic energy plus the nodal energy h sum a Psi(F), with F of the undamaged families, less that of the
start, over the kinetic energy of the start. It is 1 at first. Energy that goes into motion finer than a family leaves
this number, so a law with a potential keeps it near or below 1. Only forces that do net work around a cycle can raise
it steadily.
"""

from __future__ import annotations

import numpy as np
from study import DOCS, provenance, run_tool, study_parser, table, table_row

from warp_pd import BondAssociated, Explicit, Fixed, Frame, NeoHookean, Neural, Nodal, Sheet, Simulation
from warp_pd.interfaces import Law, Writer
from warp_pd.interfaces.context import find_device

MATERIAL = NeoHookean(mu=1e3, bulk=100e3)
LAWS: dict[str, Law] = {
    "bond-associated plain": BondAssociated(MATERIAL, horizon=3.15, weights="plain"),
    "bond-associated published": BondAssociated(MATERIAL, horizon=3.15, weights="published"),
    "closed form": Neural(MATERIAL, evaluation="closed_form"),
    "neural (b) fused": Neural(MATERIAL, evaluation="fused"),
    "nodal": Nodal(MATERIAL),
}
HEAD = ["law", "first tenth", "last tenth", "largest", "own balance error", "status"]


def oscillation(law: Law, points: int, duration: float, stretch: float, speed: float) -> Simulation:
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
        solver=Explicit(duration=duration, frames=max(1, round(40 * duration)), safety=0.2, precision=64),
    )


class TotalEnergy(Writer):
    """Follows kinetic plus nodal energy, over the kinetic energy of the start.

    Attributes:
        totals: One number per frame.
    """

    def __init__(self, simulation: Simulation) -> None:
        self.built = Simulation(simulation.sheet, Nodal(MATERIAL), Explicit(1.0)).build("cpu", 64)
        self.built.context.compile()
        self.mass = simulation.sheet.areas * simulation.sheet.thickness * simulation.sheet.density
        self.free = np.setdiff1d(np.arange(simulation.sheet.size), simulation.sheet.edges("all"))
        self.totals: list[float] = []
        self.start = 0.0

    def write(self, frame: Frame) -> None:
        """Add the number of this frame."""
        self.built.state.displacement.assign(frame.displacement)
        self.built.context.run("frame")
        kinetic = 0.5 * float((self.mass[:, None] * frame.velocity**2)[self.free].sum())
        energy = self.built.law.strain_energy
        assert energy is not None
        total = kinetic + float(energy.numpy().sum())
        if not self.totals:
            self.start, self.first = kinetic, total
        self.totals.append(1.0 + (total - self.first) / self.start)


def main() -> None:
    """Run every law, print the table, draw the energies."""
    import matplotlib.pyplot as plt

    parser = study_parser(__doc__, device="cpu", out=DOCS / "energy-drift.png", commit=None)
    parser.add_argument("--points", type=int, default=21, help="along a side")
    parser.add_argument("--duration", type=float, default=20.0, help="[s]; a period is about 2 s")
    parser.add_argument("--stretch", type=float, default=0.1, help="of the start, less 1")
    parser.add_argument("--speed", type=float, default=0.5, help="of the centre at the start [m/s]")
    options = parser.parse_args()
    figure, axes = plt.subplots(figsize=(9.0, 4.5), layout="constrained")
    print(*table(HEAD, []), sep="\n")
    for name, law in LAWS.items():
        simulation = oscillation(law, options.points, options.duration, options.stretch, options.speed)
        energy = TotalEnergy(simulation)
        result = simulation.run(device=options.device, writers=[energy])
        totals = np.array(energy.totals)
        tenth = max(1, len(totals) // 10)
        balance = result.history[-1].get("balance_error")
        cells = [
            name, f"{totals[:tenth].mean():.3f}", f"{totals[-tenth:].mean():.3f}", f"{totals.max():.3f}",
            "no potential" if balance is None else f"{balance:+.1e}",
            f"{result.status} at {result.history[-1]['time']:.3g} s",
        ]  # fmt: skip
        print(table_row(cells), flush=True)
        axes.plot([r["time"] for r in result.history], totals, label=name, linewidth=1.0)
    axes.set(xlabel="time (s)", ylabel="kinetic + nodal energy over the start's", ylim=(0.0, 2.0))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(options.out, dpi=120)
    plt.close(figure)
    measured = provenance(find_device(options.device).name, options.commit)
    print(f"\n{options.points} x {options.points} points, {options.duration:g} s, {measured}.")


if __name__ == "__main__":
    run_tool(main)
