"""Training of the neural law's network: data from uniform deformations (NN algorithm 1), Levenberg-Marquardt."""

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
import warp as wp

from warp_pd import InputError
from warp_pd.kernels.effects import unstaged
from warp_pd.kernels.numeric import FunctionFactory, PairFactory, constants_of, numeric
from warp_pd.materials import Material, capabilities, padded_constants
from warp_pd.papers.neural.networks import INPUTS, OUTPUTS, Network, inputs, ratios_of, unit_of_stress
from warp_pd.papers.neural.torch_network import bond_network

# Errors are relative to the force on the bond, or to this fraction of mu where that is smaller: the force passes zero.
FLOOR = 0.1
# Training goes on as long as the validation error falls by this fraction within `patience` steps.
MIN_GAIN = 1e-3
MIN_DAMPING, MAX_DAMPING = 1e-12, 1e12
FRACTIONS = (0.7, 0.15, 0.15)


@dataclass(frozen=True, eq=False)
class TrainingData:
    """Uniform states, and the resulting bond forces.

    Attributes:
        states: Principal stretches and angle of the bond to the first of them, shape (B, 3).
        features: (lambda, theta, C33, det F), shape (B, 4).
        forces: T along and across the bond divided by mu, shape (B, 2).
    """

    states: np.ndarray
    features: np.ndarray
    forces: np.ndarray

    def part(self, rows: np.ndarray) -> "TrainingData":
        """Some of the rows."""
        return TrainingData(self.states[rows], self.features[rows], self.forces[rows])


@dataclass(frozen=True)
class Training:
    """Training parameters.

    Attributes:
        stretches: Smallest and largest principal stretch, the same in both directions.
        samples: Number of states.
        seed: Random seed for the states, the split and the initial weights.
        hidden: Width of each hidden layer.
        steps: Maximum number of Levenberg-Marquardt steps.
        patience: Number of steps without a better validation error after which training stops.
    """

    stretches: tuple[float, float] = (0.8, 4.0)
    samples: int = 10_000
    seed: int = 0
    hidden: tuple[int, ...] = (16, 16)
    steps: int = 150
    patience: int = 20

    def __post_init__(self) -> None:
        if not 0.0 < self.stretches[0] < 1.0 < self.stretches[1]:
            raise InputError(f"stretches = {self.stretches!r}: expected two positive numbers with 1 in between")


@functools.cache
def training_samples(material: PairFactory, volume: FunctionFactory) -> wp.Kernel:
    """Kernel that turns uniform states and bond directions into rows of training data (NN algorithm 1), float64.

    Args:
        material: Factory of (stress, energy).
        volume: Factory of (G, constants) -> J^2 - 1.
    """
    types = numeric(64)
    real, vec2, vec3, vec4, mat22 = types.real, types.vec2, types.vec3, types.parameters, types.mat22
    stress, _ = material(64)
    volume_change = volume(64)
    Constants = constants_of(stress)

    @unstaged
    def samples(
        states: wp.array(dtype=vec3),
        constants: Constants,
        unit: real,
        first: int,
        features: wp.array(dtype=vec4),
        pairs: wp.array(dtype=vec2),
    ):
        """States are (principal stretch 1, principal stretch 2, angle of the bond to direction 1)."""
        i = wp.tid() + first
        s = states[i]
        x = vec2(wp.cos(s[2]), wp.sin(s[2]))
        y = vec2(s[0] * x[0], s[1] * x[1])
        zero = real(0.0)
        G = mat22(s[0] * s[0] - real(1.0), zero, zero, s[1] * s[1] - real(1.0))
        S = stress(G, constants)
        P = vec2(s[0] * S[0, 0] * x[0], s[1] * S[1, 1] * x[1]) / unit
        det = s[0] * s[1]
        c33 = (real(1.0) + volume_change(G, constants)) / (det * det)
        stretch = wp.length(y)
        angle = wp.atan2(x[0] * y[1] - x[1] * y[0], wp.dot(x, y))
        features[i] = vec4(stretch, angle, c33, det)
        pairs[i] = vec2(wp.dot(P, y) / stretch, (P[1] * y[0] - P[0] * y[1]) / stretch)

    return samples


def training_data(material: Material, states: np.ndarray) -> TrainingData:
    """Training data for uniform states, from the material's stress.

    Args:
        material: A material with `volume`.
        states: Principal stretches and angle of the bond to the first of them, shape (B, 3).
    """
    types, n, volume = numeric(64), len(states), capabilities(material).volume
    assert volume is not None
    kernel = training_samples(material.functions, volume)
    features = wp.zeros(n, dtype=types.parameters, device="cpu")
    forces = wp.zeros(n, dtype=types.vec2, device="cpu")
    given: Any = wp.array(np.ascontiguousarray(states), dtype=types.vec3, device="cpu")
    numbers = padded_constants(material)
    constants = types.constants(len(numbers))(*numbers)
    unit = unit_of_stress(material)
    wp.launch(kernel, dim=n, inputs=[given, constants, unit, 0], outputs=[features, forces], device="cpu")
    return TrainingData(states, features.numpy(), forces.numpy())


def sampled_states(stretches: tuple[float, float], samples: int, seed: int) -> np.ndarray:
    """Principal stretches and directions that fill the range, evenly in ln lambda but denser towards its ends.

    Returns:
        Array of shape (samples, 3). Directions cover a quarter turn; the others follow by mirroring or by exchanging
        the two stretches.
    """
    from scipy.stats import qmc

    unit = qmc.Halton(3, seed=seed).random(samples)
    least, most = stretches
    unit[:, :2] = 0.5 - 0.5 * np.cos(np.pi * unit[:, :2])
    return np.column_stack([least * (most / least) ** unit[:, :2], 0.5 * np.pi * unit[:, 2]])


def split(samples: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Row indices for training, validation and the final test: 70, 15 and 15 %."""
    order = np.random.default_rng(seed).permutation(samples)
    first, second = round(FRACTIONS[0] * samples), round((FRACTIONS[0] + FRACTIONS[1]) * samples)
    return order[:first], order[first:second], order[second:]


def relative_errors(found: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """|T - T_wanted| / max(|T_wanted|, FLOOR), with forces divided by mu, shape (B,)."""
    size = np.maximum(np.linalg.norm(wanted, axis=1), FLOOR)
    return np.asarray(np.linalg.norm(found - wanted, axis=1) / size)


def determination(found: np.ndarray, wanted: np.ndarray) -> list[float]:
    """Coefficient of determination R^2 of each component."""
    return [
        float(1.0 - ((found[:, c] - wanted[:, c]) ** 2).sum() / ((wanted[:, c] - wanted[:, c].mean()) ** 2).sum())
        for c in range(OUTPUTS)
    ]


def train(
    material: Material, training: Training, progress: Callable[[int, int, float], None] | None = None
) -> tuple[Network, dict[str, TrainingData]]:
    """Train a network for a material.

    Args:
        material: A material with `volume`.
        training: Training parameters.
        progress: Callback (step, maximum number of steps, validation error).

    Returns:
        The network with the smallest validation error, and the data by name: "training", "validation", "test".
    """
    data = training_data(material, sampled_states(training.stretches, training.samples, training.seed))
    return train_on(data, material, training, progress)


def train_on(
    data: TrainingData,
    material: Material,
    training: Training,
    progress: Callable[[int, int, float], None] | None = None,
) -> tuple[Network, dict[str, TrainingData]]:
    """As `train`, on data of any origin.

    Args:
        data: The rows.
        material: The material that the network is for: it gives C33, and the unit of the forces.
        training: Training parameters; its `samples` are not used.
        progress: As for `train`.
    """
    torch.manual_seed(training.seed)
    rows = split(len(data.states), training.seed)
    parts = {name: data.part(r) for name, r in zip(("training", "validation", "test"), rows, strict=True)}
    empty = _empty(material, training, parts["training"])
    module = bond_network(_layers(training.hidden))
    scaled = {name: _scaled(part, empty) for name, part in parts.items() if name != "test"}

    def errors(out: Any, name: str) -> Any:
        """Relative errors along and across the bond, shape (B, 2), of the outputs of the layers."""
        _, angle, forces, size = scaled[name]
        out = out * torch.from_numpy(empty.output_scale)
        return (torch.stack([out[:, 0], angle * out[:, 1]], 1) - forces) / size

    fit = LevenbergMarquardt(module.layers, lambda out: errors(out, "training"), scaled["training"][0])
    best, best_error, since = copy_of(module), float("inf"), 0
    for step in range(training.steps):
        if not fit.step():
            break
        with torch.no_grad():
            error = float((errors(module.layers(scaled["validation"][0]), "validation") ** 2).sum(1).mean()) ** 0.5
        if progress is not None:
            progress(step + 1, training.steps, error)
        since = 0 if error < (1.0 - MIN_GAIN) * best_error else since + 1
        if error < best_error:
            best, best_error = copy_of(module), error
        if since >= training.patience:
            break
    network = at_rest(replace(empty, weights=best[0], biases=best[1]))
    return replace(network, report=_report(network, parts, training)), parts


class LevenbergMarquardt:
    """Levenberg-Marquardt minimisation of a sum of squares (the paper's Matlab tool uses the same method).

    For networks of a few hundred weights it reaches errors a hundred times smaller than L-BFGS, which stalls because
    the normal matrix is ill-conditioned; here it is solved exactly.

    Args:
        layers: A torch.nn.Sequential, trained in place.
        errors: Function from the outputs of the layers, (B, 2), to the errors, (B, 2), row by row.
        inputs: Inputs of the layers, shape (B, 4).
    """

    def __init__(self, layers: Any, errors: Callable[[Any], Any], inputs: Any) -> None:
        self.layers, self.errors, self.inputs = layers, errors, inputs
        self.shapes = {name: p.shape for name, p in layers.named_parameters()}
        self.weights = torch.nn.utils.parameters_to_vector(layers.parameters()).detach()
        self.damping = 1e-2
        self.size = self._sum(self.weights)

    def step(self) -> bool:
        """Take one step that reduces the sum, and return whether one was found."""
        residual, jacobian = self._linearised()
        normal, slope = jacobian.T @ jacobian, jacobian.T @ residual
        scale = normal.diagonal().clamp(min=1e-12 * float(normal.diagonal().max()))
        while self.damping < MAX_DAMPING:
            factor, failed = torch.linalg.cholesky_ex(normal + self.damping * torch.diag(scale))
            if not int(failed):
                trial = self.weights - torch.cholesky_solve(slope[:, None], factor)[:, 0]
                size = self._sum(trial)
                if size < self.size:
                    self.weights, self.size, self.damping = trial, size, max(self.damping / 5.0, MIN_DAMPING)
                    torch.nn.utils.vector_to_parameters(trial, self.layers.parameters())
                    return True
            self.damping *= 3.0
        return False

    def _named(self, weights: Any) -> dict[str, Any]:
        parts = weights.split([shape.numel() for shape in self.shapes.values()])
        return {name: part.view(shape) for (name, shape), part in zip(self.shapes.items(), parts, strict=True)}

    def _sum(self, weights: Any) -> float:
        with torch.no_grad():
            out = torch.func.functional_call(self.layers, self._named(weights), (self.inputs,))
            return float((self.errors(out) ** 2).sum())

    def _linearised(self) -> tuple[Any, Any]:
        """Errors, shape (2 B,), and their derivatives by the weights, shape (2 B, W)."""

        def layers(weights: Any, row: Any) -> Any:
            return torch.func.functional_call(self.layers, self._named(weights), (row[None],))[0]

        with torch.no_grad():
            out = self.layers(self.inputs)
            errors = self.errors(out)
            by_weights = torch.func.vmap(torch.func.jacrev(layers), (None, 0))(self.weights, self.inputs)
            # Errors are linear in what the layers give, component by component.
            slope = torch.stack([self.errors(out + shift) - errors for shift in torch.eye(2, dtype=out.dtype)], 2)
            return errors.reshape(-1), torch.einsum("boc,bcw->bow", slope, by_weights).reshape(errors.numel(), -1)


def at_rest(network: Network) -> Network:
    """The network with its last bias adjusted so that an undeformed bond has no force."""
    rest = np.array([[1.0, 0.0, 1.0, 1.0]])
    biases = [b.copy() for b in network.biases]
    biases[-1][0] -= network.evaluate(rest)[0, 0] / network.output_scale[0]
    return replace(network, biases=tuple(biases))


def copy_of(module: Any) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    """Weights and biases of the linear layers of a module."""
    layers = [layer for layer in module.layers if hasattr(layer, "weight")]
    weights = tuple(layer.weight.detach().numpy().copy() for layer in layers)
    return weights, tuple(layer.bias.detach().numpy().copy() for layer in layers)


def _layers(hidden: tuple[int, ...]) -> Any:
    layers: list[Any] = []
    width = INPUTS
    for size in hidden:
        layers += [torch.nn.Linear(width, size, dtype=torch.float64), torch.nn.Tanh()]
        width = size
    return torch.nn.Sequential(*layers, torch.nn.Linear(width, OUTPUTS, dtype=torch.float64))


def _empty(material: Material, training: Training, data: TrainingData) -> Network:
    """A network with its scaling, without layers."""
    q = inputs(data.features)
    scale = q.std(axis=0)
    # The volume change hardly varies in uniform deformation. Scaled by its spread it would learn to stand for the
    # stretches, which it does not where bonds differ from their family.
    scale[3] = 1.0
    ratio = data.forces[:, 1] / np.where(np.abs(data.features[:, 1]) > 1e-6, data.features[:, 1], np.inf)
    return Network(
        weights=(),
        biases=(),
        input_mean=q.mean(axis=0),
        input_scale=scale,
        output_scale=np.array([data.forces[:, 0].std(), ratio.std()]),
        material=type(material).__name__,
        ratios=ratios_of(material),
        stretches=training.stretches,
    )


def _scaled(data: TrainingData, network: Network) -> tuple[Any, Any, Any, Any]:
    """Inputs of the layers, angles, forces, and reference values of the relative errors, as tensors."""
    q = (inputs(data.features) - network.input_mean) / network.input_scale
    size = np.maximum(np.linalg.norm(data.forces, axis=1), FLOOR)
    arrays = (q, data.features[:, 1], data.forces, size[:, None])
    return tuple(torch.from_numpy(np.ascontiguousarray(a)) for a in arrays)  # type: ignore[return-value]


def _report(network: Network, parts: dict[str, TrainingData], training: Training) -> dict[str, Any]:
    """Training parameters, and errors on the held-out data."""
    test = parts["test"]
    found = network.evaluate(test.features)
    errors = relative_errors(found, test.forces)
    return {
        "samples": training.samples,
        "seed": training.seed,
        "r2_along_across": determination(found, test.forces),
        "largest_relative_error": float(errors.max()),
        "rms_relative_error": float(np.sqrt((errors**2).mean())),
        "floor_over_mu": FLOOR,
    }
