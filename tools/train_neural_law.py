"""Train the network of the neural force law for a material, and report how good it is.

    python tools/train_neural_law.py --out my_law.npz --bulk 50e3
    python tools/train_neural_law.py --out gent.npz --material gent --lock 160 --stretches 0.6 5
    python tools/train_neural_law.py --out warp_pd/forces/neo_hookean_100.npz --steps 300     # the shipped one

Writes the model file, and beside it a folder of the same name with `parity.png`, `error_by_stretch.png` and
`report.md`: errors on the held-out 15 % and on a dense sample that training never saw, and the worst cases. Errors
are relative to the force on the bond, or to 0.1 mu where that is smaller. `Neural(material, network="my_law.npz")` and
`warp-pd run SCENE --force my_law.npz` use the file. Needs torch.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from stamp import one_line, stamp
from tqdm import tqdm

from warp_pd import Gent, NeoHookean
from warp_pd.forces.network import Network
from warp_pd.forces.training import (
    FLOOR,
    Training,
    TrainingData,
    determination,
    relative_errors,
    sampled_states,
    train,
    training_data,
)
from warp_pd.runner import write_aside

DENSE = 100_000


def parity(path: Path, network: Network, data: TrainingData) -> None:
    """Forces of the network over those of the law, both components."""
    import matplotlib.pyplot as plt

    found = network.evaluate(data.features)
    figure, axes = plt.subplots(1, 2, figsize=(9.0, 4.2), layout="constrained")
    for c, name in enumerate(("along the bond", "across the bond")):
        axes[c].plot(data.forces[:, c], found[:, c], ".", markersize=2)
        ends = [data.forces[:, c].min(), data.forces[:, c].max()]
        axes[c].plot(ends, ends, "k-", linewidth=0.6)
        axes[c].set(title=name, xlabel="law, T / mu", ylabel="network, T / mu")
        axes[c].grid(alpha=0.3)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def error_by_stretch(path: Path, data: TrainingData, errors: np.ndarray) -> None:
    """Largest and mean relative error in bins of the bond's stretch, and over both principal stretches."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(10.0, 4.2), layout="constrained")
    stretch = data.features[:, 0]
    edges = np.linspace(stretch.min(), stretch.max(), 33)
    which = np.clip(np.digitize(stretch, edges) - 1, 0, len(edges) - 2)
    middle = 0.5 * (edges[1:] + edges[:-1])
    for name, function in (("largest", np.max), ("mean", np.mean)):
        values = [function(errors[which == b]) if (which == b).any() else np.nan for b in range(len(middle))]
        axes[0].semilogy(middle, values, label=name)
    axes[0].set(xlabel="bond stretch", ylabel="relative error")
    axes[0].grid(alpha=0.3)
    axes[0].legend()
    first, second, _ = data.states.T
    drawn = axes[1].hexbin(first, second, errors, reduce_C_function=np.max, gridsize=40, bins="log")
    axes[1].set(xlabel="principal stretch 1", ylabel="principal stretch 2")
    figure.colorbar(drawn, ax=axes[1], label="largest relative error")
    figure.savefig(path, dpi=120)
    plt.close(figure)


def report(network: Network, training: Training, dense: TrainingData, errors: np.ndarray) -> str:
    """Markdown text with the numbers and the worst cases."""
    facts = network.report
    along, across = determination(network.evaluate(dense.features), dense.forces)
    held_along, held_across = facts["r2_along_across"]
    ratios = ", ".join(f"{key} = {value:g}" for key, value in network.ratios.items())
    lines = [
        f"# Network of the neural law: {network.material}, {ratios}",
        "",
        f"Trained {facts['made']}. Principal stretches {training.stretches[0]:g} to {training.stretches[1]:g}, "
        f"{training.samples} samples (70 / 15 / 15 %), seed {training.seed}, hidden layers {list(training.hidden)}, "
        f"{network.size} weights, "
        f"{facts['steps']} steps.",
        "",
        f"Relative error: |T - T_law| / max(|T_law|, {FLOOR:g} mu).",
        "",
        "| | R^2 along | R^2 across | largest relative error | rms |",
        "|---|---|---|---|---|",
        f"| held-out 15 % | {held_along:.8f} | {held_across:.8f} | {facts['largest_relative_error']:.2e} | "
        f"{facts['rms_relative_error']:.2e} |",
        f"| dense sample, {len(errors)} | {along:.8f} | {across:.8f} | {errors.max():.2e} | "
        f"{np.sqrt((errors**2).mean()):.2e} |",
        "",
        "Worst cases of the dense sample:",
        "",
        "| stretch 1 | stretch 2 | direction (degrees) | bond stretch | rotation (degrees) | T law | T network "
        "| error |",
        "|---|---|---|---|---|---|---|---|",
    ]
    found = network.evaluate(dense.features)
    for i in errors.argsort()[-8:][::-1]:
        (first, second, angle), row = dense.states[i], dense.features[i]
        lines.append(
            f"| {first:.4f} | {second:.4f} | {np.degrees(angle):.2f} | {row[0]:.4f} | {np.degrees(row[1]):.2f} "
            f"| {dense.forces[i, 0]:.5f}, {dense.forces[i, 1]:.5f} | {found[i, 0]:.5f}, {found[i, 1]:.5f} "
            f"| {errors[i]:.2e} |"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Train, report, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="Model file to write, ending in .npz.")
    parser.add_argument("--material", choices=["neo_hookean", "gent"], default="neo_hookean")
    parser.add_argument("--mu", type=float, default=1e3, help="Shear modulus [Pa]; only bulk / mu matters.")
    parser.add_argument("--bulk", type=float, default=100e3, help="Bulk modulus [Pa].")
    parser.add_argument("--lock", type=float, default=160.0, help="Jm of the Gent material.")
    parser.add_argument("--stretches", type=float, nargs=2, default=[0.8, 4.0])
    parser.add_argument("--samples", type=int, default=10_000)
    parser.add_argument("--hidden", type=int, nargs="+", default=[16, 16])
    parser.add_argument("--steps", type=int, default=150, help="Most steps; training stops early when it is done.")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    material: Any = NeoHookean(given.mu, given.bulk)
    if given.material == "gent":
        material = Gent(given.mu, given.bulk, given.lock)
    training = Training(
        stretches=(given.stretches[0], given.stretches[1]), samples=given.samples, seed=given.seed,
        hidden=tuple(given.hidden), steps=given.steps,
    )  # fmt: skip
    if given.out.suffix != ".npz":
        parser.error(f"--out {given.out}: allowed are names that end in .npz")
    bar = tqdm(total=training.steps, unit="step")
    done = 0

    def progress(step: int, steps: int, error: float) -> None:
        nonlocal done
        done = step
        bar.update(step - bar.n)
        bar.set_postfix_str(f"validation error {error:.2e}")

    network, _ = train(material, training, progress)
    bar.close()
    network = replace(network, report=network.report | {"made": stamp("CPU, float64"), "steps": done})
    network.save(given.out)
    dense = training_data(material, sampled_states(training.stretches, DENSE, training.seed + 1))
    errors = relative_errors(network.evaluate(dense.features), dense.forces)
    folder = given.out.with_suffix("")
    folder.mkdir(exist_ok=True)
    parity(folder / "parity.png", network, dense)
    error_by_stretch(folder / "error_by_stretch.png", dense, errors)
    text = report(network, training, dense, errors)
    write_aside(folder / "report.md", text)
    print(text)


if __name__ == "__main__":
    one_line(main)
