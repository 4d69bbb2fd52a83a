"""The trained network of the neural law: weights, scaling, material and training range, in one file."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ...device.checks import InputError, user_code
from ...device.npz import read_arrays
from ...materials import Material, capabilities, shear_modulus

VERSION = 1
# Size of a network, at most.
MOST_BYTES = 1_000_000_000
INPUTS, OUTPUTS = 4, 2
DEFAULT = Path(__file__).with_name("neo_hookean_100.npz")
# Two materials count as the same if the numbers that decide their stress over mu agree to this.
SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Network:
    """A multilayer perceptron with tanh between its layers, and the material and range of its training.

    The inputs are q = (ln lambda, theta^2, ln det F, ln(C33 det F^2)), shifted and scaled. The scaled outputs o give T
    = (o_1, theta o_2), which is even and odd in theta, as reflection symmetry requires. The last input, the logarithm
    of the volume change, is redundant in uniform deformation (stretch, rotation and det F determine the state).

    Attributes:
        weights: One matrix per layer, shape (outputs, inputs).
        biases: One vector per layer, shape (outputs,).
        input_mean: Subtracted from q, shape (4,).
        input_scale: Divisor of the difference, shape (4,).
        output_scale: Factor on the outputs, shape (2,).
        material: Name of the material's class.
        ratios: The ratios of constants that determine its stress divided by mu.
        stretches: Smallest and largest principal stretch of the training data.
        report: Training parameters and errors.
    """

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]
    input_mean: np.ndarray
    input_scale: np.ndarray
    output_scale: np.ndarray
    material: str
    ratios: dict[str, float]
    stretches: tuple[float, float]
    report: dict[str, Any] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Number of weights and biases."""
        return sum(w.size + b.size for w, b in zip(self.weights, self.biases, strict=True))

    def folded(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Layers (weights, biases) that include the scaling of inputs and outputs."""
        return _folded(self, 0.0)

    def sigmoids(self) -> tuple[tuple[tuple[float, ...], ...], ...]:
        """The layers of `folded` for 1 / (1 + exp y) instead of tanh between them: columns of the weights, biases.

        Since tanh y = 1 - 2 / (1 + exp 2y), the hidden layers are multiplied by 2, and each layer but the first has its
        inputs x replaced by 1 - 2 x. A neuron then takes an exponential, a sum and a reciprocal.
        """
        layers = [(2.0 * w, 2.0 * b) for w, b in self.folded()[:-1]] + self.folded()[-1:]
        layers = layers[:1] + [(-2.0 * w, b + w.sum(axis=1)) for w, b in layers[1:]]
        return tuple(tuple(map(tuple, [*w.T.tolist(), b.tolist()])) for w, b in layers)

    def evaluate(self, features: np.ndarray) -> np.ndarray:
        """T along and across the bond, shape (B, 2), for `features` (lambda, theta, C33, det F), shape (B, 4)."""
        x = inputs(features)
        layers = self.folded()
        for w, b in layers[:-1]:
            x = np.tanh(x @ w.T + b)
        x = x @ layers[-1][0].T + layers[-1][1]
        return np.column_stack([x[:, 0], features[:, 1] * x[:, 1]])

    def require_material(self, material: Material, name: str) -> None:
        """Check that the network was trained for the material of a simulation."""
        ratios = ratios_of(material)
        same = type(material).__name__ == self.material and set(ratios) == set(self.ratios)
        if not same or any(abs(ratios[k] - self.ratios[k]) > SAME * abs(self.ratios[k]) for k in ratios):
            raise InputError(
                f"material = {_material(type(material).__name__, ratios)}: expected "
                f"{_material(self.material, self.ratios)}, for which network {name!r} was trained; "
                f"tools/train_neural_law.py trains one for another material"
            )

    def save(self, path: Path) -> None:
        """Write the file atomically."""
        facts = {
            "version": VERSION,
            "material": self.material,
            "ratios": self.ratios,
            "stretches": self.stretches,
            "report": self.report,
        }
        arrays = {f"weights_{k}": w for k, w in enumerate(self.weights)}
        arrays |= {f"biases_{k}": b for k, b in enumerate(self.biases)}
        arrays |= {name: getattr(self, name) for name in ("input_mean", "input_scale", "output_scale")}
        arrays["facts"] = np.frombuffer(json.dumps(facts).encode(), np.uint8)
        aside = path.with_name(path.name + ".part")
        with aside.open("wb") as stream:
            np.savez(stream, **arrays)  # type: ignore[arg-type]
        os.replace(aside, path)


def unit_of_stress(material: Material) -> float:
    """What forces of a network are divided by [Pa]: mu of a material with `ratios`, else its shear modulus at rest."""
    known = capabilities(material)
    return known.mu if known.ratios is not None and known.mu is not None else shear_modulus(material)


def ratios_of(material: Material) -> dict[str, float]:
    """The ratios of constants that determine the stress over its unit."""
    known = capabilities(material).ratios
    if known is not None:
        return dict(known)
    unit = unit_of_stress(material)
    # Exponents are no stresses; a network is for the same numbers anyway.
    return {f"constant {i + 1} / unit": c / unit for i, c in enumerate(material.constants)}


def inputs(features: np.ndarray) -> np.ndarray:
    """Return q for (lambda, theta, C33, det F), both of shape (B, 4)."""
    stretch, angle, c33, det = features.T
    return np.column_stack([np.log(stretch), angle**2, np.log(det), np.log(c33) + 2.0 * np.log(det)])


def load(path: str | Path) -> Network:
    """Load a network from its file.

    Raises:
        InputError: if the file is missing, damaged or of another version, a weight is not finite, or the layers do not
            fit together.
    """
    path = Path(path)
    said = f"network = {str(path)!r}"
    if not path.is_file():
        raise InputError(f"{said}: the file does not exist; expected a file written by tools/train_neural_law.py")
    arrays = read_arrays(said, path, MOST_BYTES)
    with user_code(lambda error: f"{said}: the file is damaged or not a network ({type(error).__name__})"):
        facts = json.loads(bytes(arrays.pop("facts")))
        version = facts["version"]
    if version != VERSION:
        raise InputError(f"{said}: expected a network of version {VERSION}, got version {version!r}; train it again")
    layers = sum(name.startswith("weights_") for name in arrays)
    with user_code(lambda error: f"{said}: the file is damaged or not a network ({type(error).__name__})"):
        network = Network(
            weights=tuple(arrays[f"weights_{k}"] for k in range(layers)),
            biases=tuple(arrays[f"biases_{k}"] for k in range(layers)),
            input_mean=arrays["input_mean"],
            input_scale=arrays["input_scale"],
            output_scale=arrays["output_scale"],
            material=facts["material"],
            ratios=facts["ratios"],
            stretches=(float(facts["stretches"][0]), float(facts["stretches"][1])),
            report=facts["report"],
        )
        require_sound(network, said)
    return network


@dataclass(frozen=True, eq=False)
class PlainNetwork:
    """A multilayer perceptron with tanh between its layers and the inputs and outputs of the paper (NN figure 4).

    Its file is an .npz of arrays `w0`, `b0`, `w1` and so on, as any tool can write them, and of the means and scales
    below, which may be left out.

    Attributes:
        weights: One matrix per layer, shape (outputs, inputs).
        biases: One vector per layer, shape (outputs,).
        input_mean: Subtracted from (lambda, theta, C33, det F), shape (4,).
        input_scale: Divisor of the difference, shape (4,).
        output_mean: Added to the scaled outputs, shape (2,).
        output_scale: Factor on the outputs, the force along and across the bond over mu, shape (2,).
    """

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]
    input_mean: np.ndarray
    input_scale: np.ndarray
    output_mean: np.ndarray
    output_scale: np.ndarray

    def folded(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Layers (weights, biases) that include the scaling of inputs and outputs."""
        return _folded(self, self.output_mean)


def _folded(network: Network | PlainNetwork, output_mean: np.ndarray | float) -> list[tuple[np.ndarray, np.ndarray]]:
    layers = list(zip(network.weights, network.biases, strict=True))
    w, b = layers[0]
    layers[0] = (w / network.input_scale, b - w @ (network.input_mean / network.input_scale))
    w, b = layers[-1]
    layers[-1] = (w * network.output_scale[:, None], b * network.output_scale + output_mean)
    return layers


def plain(path: str | Path) -> PlainNetwork | None:
    """Load a plain network; None for a file that is none, such as one of `Network.save`.

    Raises:
        InputError: if a weight is not finite, or the layers do not fit together.
    """
    path = Path(path)
    if not path.is_file():
        return None
    said = f"network = {str(path)!r}"
    arrays = read_arrays(said, path, MOST_BYTES)
    if "w0" not in arrays:
        return None
    layers = sum(re.fullmatch(r"w\d+", name) is not None for name in arrays)
    with user_code(lambda error: f"{said}: the file is damaged or not a network ({type(error).__name__})"):
        found = PlainNetwork(
            weights=tuple(np.asarray(arrays[f"w{k}"], dtype=float) for k in range(layers)),
            biases=tuple(np.asarray(arrays[f"b{k}"], dtype=float).ravel() for k in range(layers)),
            input_mean=np.broadcast_to(arrays.get("input_mean", 0.0), INPUTS),
            input_scale=np.broadcast_to(arrays.get("input_scale", 1.0), INPUTS),
            output_mean=np.broadcast_to(arrays.get("output_mean", 0.0), OUTPUTS),
            output_scale=np.broadcast_to(arrays.get("output_scale", 1.0), OUTPUTS),
        )
        require_sound(found, said)
    return found


@cache
def default() -> Network:
    """The network of the package: neo-Hookean, bulk/mu 100, principal stretches 0.8 to 4."""
    return load(DEFAULT)


def require_sound(network: Network | PlainNetwork, said: str) -> None:
    """Check that layers fit together and numbers are finite. Raises InputError if they do not."""
    width = INPUTS
    if len(network.weights) < 2:
        raise InputError(f"{said}: it has {len(network.weights)} layers, expected 2 or more")
    for k, (w, b) in enumerate(zip(network.weights, network.biases, strict=True)):
        if w.ndim != 2 or w.shape[1] != width or b.shape != (w.shape[0],):
            raise InputError(
                f"{said}: layer {k} has weights {w.shape} and biases {b.shape}: expected (n, {width}) and (n,)"
            )
        if not np.isfinite(w).all() or not np.isfinite(b).all():
            raise InputError(f"{said}: layer {k} has a weight that is not finite; expected finite numbers")
        width = w.shape[0]
    if width != OUTPUTS:
        raise InputError(f"{said}: it has {width} outputs, expected {OUTPUTS}")
    for name, size in (("input_mean", INPUTS), ("input_scale", INPUTS), ("output_scale", OUTPUTS)):
        values = getattr(network, name)
        if values.shape != (size,) or not np.isfinite(values).all() or (name != "input_mean" and (values <= 0.0).any()):
            raise InputError(f"{said}: {name} = {values.tolist()!r}, expected {size} finite scales")


def _material(name: str, ratios: Mapping[str, float]) -> str:
    return f"{name}({', '.join(f'{key} = {value:g}' for key, value in ratios.items())})"
