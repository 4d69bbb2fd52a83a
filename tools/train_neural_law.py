"""Train the network of the neural force law for a material, and report its errors.

    python tools/train_neural_law.py --out my_law.npz --material "NeoHookean(1e3, 50e3)"
    python tools/train_neural_law.py --out yeoh.npz --material "Yeoh(500, 20)" --stretches 0.6 5
    python tools/train_neural_law.py --out warp_pd/papers/neural/neo_hookean_100.npz --steps 300  # the default network

Writes the model file, and beside it my_law.md: the errors on the held-out 15 % and on a dense sample that training
never saw, and the worst cases. Errors are relative to the force on the bond, or to 0.1 mu where the force is smaller.
The file can be used as `Neural(material, network="my_law.npz")` and as `warp-pd run SCENE --force my_law.npz`. Training
needs torch.
"""

from __future__ import annotations

import argparse
import ast
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from network_training import (
    FLOOR,
    Training,
    TrainingData,
    determination,
    relative_errors,
    sampled_states,
    train,
    training_data,
)
from study import provenance, run_tool, study_parser, table, write_page
from tqdm import tqdm

import warp_pd
from warp_pd import InputError
from warp_pd.materials import check_material
from warp_pd.papers.neural.networks import Network

# States of the dense sample.
DENSE = 100_000


def report(network: Network, training: Training, dense: TrainingData, errors: np.ndarray) -> str:
    """Markdown text with the numbers and the worst cases."""
    facts = network.report
    along, across = determination(network.evaluate(dense.features), dense.forces)
    held_along, held_across = facts["r2_along_across"]
    held = (facts["largest_relative_error"], facts["rms_relative_error"])
    sampled = (errors.max(), np.sqrt((errors**2).mean()))
    ratios = ", ".join(f"{key} = {value:g}" for key, value in network.ratios.items())
    lines = [
        f"# Network of the neural law: {network.material}, {ratios}",
        "",
        f"Trained on {facts['made']}. Principal stretches {training.stretches[0]:g} to {training.stretches[1]:g}, "
        f"{training.samples} samples (70 / 15 / 15 %), seed {training.seed}, hidden layers {list(training.hidden)}, "
        f"{network.size} weights, {facts['steps']} steps.",
        "",
        f"Relative error: |T - T_law| / max(|T_law|, {FLOOR:g} mu).",
        "",
        *table(
            ["", "R^2 along", "R^2 across", "largest relative error", "rms"],
            [
                ["held-out 15 %", f"{held_along:.8f}", f"{held_across:.8f}", *map("{:.2e}".format, held)],
                [f"dense sample, {len(errors)}", f"{along:.8f}", f"{across:.8f}", *map("{:.2e}".format, sampled)],
            ],
        ),
        "",
        "Worst cases of the dense sample:",
        "",
        *worst_cases(network, dense, errors),
    ]
    return "\n".join(lines) + "\n"


def worst_cases(network: Network, dense: TrainingData, errors: np.ndarray) -> list[str]:
    """Table of the eight states with the largest errors."""
    head = [
        "stretch 1", "stretch 2", "direction (degrees)", "bond stretch", "rotation (degrees)", "T law", "T network",
        "error",
    ]  # fmt: skip
    found, rows = network.evaluate(dense.features), []
    for i in errors.argsort()[-8:][::-1]:
        (first, second, angle), features = dense.states[i], dense.features[i]
        rows.append([
            f"{first:.4f}", f"{second:.4f}", f"{np.degrees(angle):.2f}", f"{features[0]:.4f}",
            f"{np.degrees(features[1]):.2f}", *(f"{T[i, 0]:.5f}, {T[i, 1]:.5f}" for T in (dense.forces, found)),
            f"{errors[i]:.2e}",
        ])  # fmt: skip
    return table(head, rows)


def material_named(text: str) -> Any:
    """Type of the option --material: the call of a class of the package with numbers."""
    try:
        call = ast.parse(text, mode="eval").body
        assert isinstance(call, ast.Call) and isinstance(call.func, ast.Name)
        given = [ast.literal_eval(value) for value in call.args]
        named = {word.arg: ast.literal_eval(word.value) for word in call.keywords}
        found = getattr(warp_pd, call.func.id)(*given, **named)
        check_material(found, "functions", "--material")
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    except (SyntaxError, AssertionError, AttributeError, TypeError, ValueError):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a material such as 'Yeoh(500, 20)'") from None
    return found


def main() -> None:
    """Train, report, write."""
    parser = study_parser(__doc__)
    parser.add_argument("--out", type=Path, required=True, help="model file to write, ending in .npz")
    parser.add_argument(
        "--material", type=material_named, default="NeoHookean(1e3, 100e3)", help="a material of the package, such as "
        "'Gent(1e3, 100e3, 160)'; forces of the network are in units of its shear modulus"
    )  # fmt: skip
    parser.add_argument("--stretches", type=float, nargs=2, default=[0.8, 4.0], help="least and largest")
    parser.add_argument("--samples", type=int, default=10_000)
    parser.add_argument("--hidden", type=int, nargs="+", default=[16, 16], help="width of each hidden layer")
    parser.add_argument("--steps", type=int, default=150, help="at most; training stops when it no longer improves")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    material = options.material
    training = Training(
        stretches=(options.stretches[0], options.stretches[1]), samples=options.samples, seed=options.seed,
        hidden=tuple(options.hidden), steps=options.steps,
    )  # fmt: skip
    if options.out.suffix != ".npz":
        parser.error(f"--out {options.out}: expected a name that ends in .npz")
    bar = tqdm(total=training.steps, unit="step")
    done = 0

    def progress(step: int, steps: int, error: float) -> None:
        nonlocal done
        done = step
        bar.update(step - bar.n)
        bar.set_postfix_str(f"validation error {error:.2e}")

    network, _ = train(material, training, progress)
    bar.close()
    made = provenance("CPU, float64")
    network = replace(network, report=network.report | {"made": made, "steps": done})
    options.out.parent.mkdir(parents=True, exist_ok=True)
    network.save(options.out)
    dense = training_data(material, sampled_states(training.stretches, DENSE, training.seed + 1))
    errors = relative_errors(network.evaluate(dense.features), dense.forces)
    text = report(network, training, dense, errors)
    write_page(options.out.with_suffix(".md"), text)
    print(text)


if __name__ == "__main__":
    run_tool(main)
