"""Train the network of the neural law on measured curves, without a formula, and compare it with them.

    python tools/train_on_curves.py --out treloar.npz
    python tools/train_on_curves.py --out treloar.npz --data tests/references/treloar.csv --without planar

Uniaxial and equibiaxial curves tell the whole stress of their states, so the forces of bonds in every direction; planar
ones the forces of bonds along the pull. The curves are interpolated, which is all that is assumed. Takes a minute, and
torch. The network serves incompressible sheets: `Neural(MooneyRivlin(0.5 * MU), network="treloar.npz")`, MU as printed.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from network_training import Training, TrainingData, train_on
from scipy.interpolate import PchipInterpolator
from study import run_tool, study_parser, table
from treloar import DATA, LOADINGS, tests

from warp_pd import InputError, MooneyRivlin
from warp_pd.fitting import Curve
from warp_pd.papers.neural.networks import Network, unit_of_stress

# Widths at a stretch s across the pull.
ACROSS = {"uniaxial": lambda s: s**-0.5, "planar": np.ones_like, "equibiaxial": lambda s: s}
STATES, DIRECTIONS = 80, 19


def rubber(curves: Sequence[Curve]) -> MooneyRivlin:
    """What gives C33 and the unit of the forces: a third of the slope of the uniaxial curve at its first point."""
    curve = next(curve for curve in curves if curve.control == "uniaxial")
    first = np.flatnonzero(curve.at > 1.0)[0]
    s = curve.at[first]
    return MooneyRivlin(0.5 * float(curve.values[first] / (s - s**-2)))


def rows(x: np.ndarray, y: np.ndarray, along: np.ndarray, across: np.ndarray, angle: np.ndarray) -> TrainingData:
    """Bonds at an angle to the pull, in states of stretches x, y with first Piola stress (along, across)."""
    image = np.stack([x * np.cos(angle), y * np.sin(angle)])
    force = np.stack([along * np.cos(angle), across * np.sin(angle)])
    stretch = np.hypot(*image)
    turn = np.arctan2(
        np.cos(angle) * image[1] - np.sin(angle) * image[0], (image * [np.cos(angle), np.sin(angle)]).sum(0)
    )
    det = x * y
    features = np.column_stack([stretch, turn, det**-2, det])
    pairs = np.column_stack([(force * image).sum(0), force[1] * image[0] - force[0] * image[1]]) / stretch[:, None]
    return TrainingData(np.column_stack([x, y, angle]), features, pairs)


def curve_data(curve: Curve, unit: float) -> TrainingData:
    """Bonds in the states of a curve, undeformed ones too."""
    above = curve.at > 1.0
    at, values = np.append(1.0, curve.at[above]), np.append(0.0, curve.values[above])
    stress = PchipInterpolator(at, values / unit)
    s = np.exp(np.linspace(0.0, np.log(at[-1]), STATES))
    angle = np.zeros(1) if curve.control == "planar" else np.linspace(0.0, 0.5 * np.pi, DIRECTIONS)
    s, angle = (values.ravel() for values in np.meshgrid(s, angle))
    pull = stress(s)
    return rows(s, ACROSS[curve.control](s), pull, pull * (curve.control == "equibiaxial"), angle)


def together(parts: Sequence[TrainingData]) -> TrainingData:
    """One set of rows."""
    return TrainingData(
        *(np.concatenate([getattr(p, name) for p in parts]) for name in ("states", "features", "forces"))
    )


def trained(curves: Sequence[Curve], hidden: tuple[int, ...] = (16, 16), steps: int = 150) -> Network:
    """A network that is trained on all curves."""
    material = rubber(curves)
    data = together([curve_data(curve, unit_of_stress(material)) for curve in curves])
    largest = max(float(curve.at.max()) for curve in curves)
    training = Training(stretches=(largest**-0.5, largest), hidden=hidden, steps=steps)
    return train_on(data, material, training)[0]


def stress(network: Network, loading: str, stretch: np.ndarray, unit: float) -> np.ndarray:
    """First Piola stress along the pull [Pa]: the force on bonds along it."""
    zero = np.zeros_like(stretch)
    features = rows(stretch, ACROSS[loading](stretch), zero, zero, zero).features
    return unit * network.evaluate(features)[:, 0]


def errors(network: Network, curves: Sequence[Curve], unit: float) -> dict[str, float]:
    """Root mean square error of each curve over its largest stress."""
    found = {}
    for curve in curves:
        off = stress(network, curve.control, curve.at, unit) - curve.values
        found[curve.control] = float(np.sqrt((off**2).mean()) / curve.values.max())
    return found


def main() -> None:
    """Train, compare, write."""
    parser = study_parser(__doc__)
    parser.add_argument("--out", type=Path, required=True, help="model file to write, ending in .npz")
    parser.add_argument(
        "--data", type=Path, default=DATA, help="CSV file with columns as in tests/references/treloar.csv"
    )
    # The uniaxial curve gives the unit of the forces.
    others = [name for name in LOADINGS if name != "uniaxial"]
    parser.add_argument("--without", nargs="+", choices=others, default=[], help="curves to predict")
    options = parser.parse_args()
    if options.out.suffix != ".npz":
        raise InputError(f"--out {options.out}: expected a name that ends in .npz")
    curves = tests(options.data)
    used = [curve for curve in curves if curve.control not in options.without]
    network, unit = trained(used), unit_of_stress(rubber(curves))
    network.save(options.out)
    print(f"MU = {unit:.6g} Pa\n")
    found = errors(network, curves, unit)
    print("\n".join(table(list(found), [[f"{100.0 * value:.2f} %" for value in found.values()]])))


if __name__ == "__main__":
    run_tool(main)
