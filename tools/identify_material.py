"""Fit Yeoh and Prony constants to stress-stretch data, by least squares over all curves at once.

    python tools/identify_material.py data.csv                       constants of the law Visco
    python tools/identify_material.py --recover                      recovers tables 1 and 2 of VE from synthetic curves

The file has the columns stretch and stress (first Piola stress [Pa] along the pulled direction), and rate [1/s], the
rate of that stretch. Rows of one rate are one curve, in order, from stretch 1 on. A rate of 0 means equilibrium. With
a column time [s] instead of rate, the file is one curve. VE section 2.3 and appendix A fit equilibrium first and then
one fast curve. Here all curves are fitted together, each with its own largest stress as its scale.

Only curves at two or more rates tell phi_ref and eta apart. The published data (Amin et al. 2006, Roland et al. 2007)
are not part of this project.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from study import run_tool, study_parser, table

from warp_pd import InputError, Prony, Yeoh
from warp_pd.materials.analytic_response import LOADINGS, nominal_stress, second_stress, width_stretch

TABLES = {
    "table 1, high-damping rubber": (0.1438e6, 0.1438e6, 0.0587e6, 0.0562e6, 0.8673, 0.1),
    "table 2, polyurea": (0.1996e6, 0.0170e6, 0.01733e6, 0.0015e6, 0.9466, 1.6665),
}
# Rates of the synthetic curves: equilibrium, and rates that show the relaxation times.
RATES = {"table 1, high-damping rubber": (0.0, 0.024, 0.24, 0.88), "table 2, polyurea": (0.0, 0.15, 0.6, 1.5)}
NAMES = ("c10", "c20", "Prony c10", "Prony c20", "phi_ref", "eta")
NOISES = (0.0, 0.002, 0.01)
# Substeps of each interval of the data.
SUBSTEPS = 4
# Bounds of the logarithms: moduli in Pa, phi_ref, eta.
BOUNDS = np.log([[1e-3] * 4 + [1e-9, 1e-4], [1e15] * 4 + [1e9, 10.0]])


@dataclass(frozen=True, eq=False)
class Curve:
    """One test.

    Attributes:
        time: [s], shape (n,), rising; None for equilibrium.
        stretch: shape (n,), 1 at the first time.
        stress: First Piola stress [Pa], shape (n,).
    """

    time: np.ndarray | None
    stretch: np.ndarray
    stress: np.ndarray


def model(constants: Sequence[float], curve: Curve, loading: str) -> np.ndarray:
    """First Piola stress [Pa] of the six constants along a curve, shape (n,)."""
    c10, c20, viscous_c10, viscous_c20, time, exponent = constants
    if curve.time is None:
        return curve.stretch * second_stress(c10, c20, curve.stretch, width_stretch(loading, curve.stretch))
    position = np.arange((len(curve.time) - 1) * SUBSTEPS + 1) / SUBSTEPS
    stretch = np.interp(position, np.arange(len(curve.time)), curve.stretch)
    times = np.interp(position, np.arange(len(curve.time)), curve.time)
    term = Prony(viscous_c10, viscous_c20, time=time, exponent=exponent)
    return nominal_stress(Yeoh(c10, c20), (term,), times, stretch, width_stretch(loading, stretch))[::SUBSTEPS]


def identify(curves: Sequence[Curve], loading: str = "uniaxial", start: Sequence[float] | None = None) -> np.ndarray:
    """The six constants (c10, c20, Prony c10, Prony c20, phi_ref, eta) in Pa, s and 1, shape (6,).

    All stay positive, so that the material is stable and cannot create energy.

    Args:
        curves: One or more; at least one is not equilibrium.
        loading: "uniaxial", "equibiaxial" or "planar".
        start: First guess; by default a tenth of the stiffness of the data relaxes.

    Raises:
        InputError: without a curve in time.
    """
    if all(curve.time is None for curve in curves):
        raise InputError("curves are equilibrium only: expected at least one curve at a rate above 0")
    scales = [np.abs(curve.stress).max() for curve in curves]

    def residuals(logarithms: np.ndarray) -> np.ndarray:
        constants = np.exp(logarithms)
        return np.concatenate(
            [(model(constants, c, loading) - c.stress) / scale for c, scale in zip(curves, scales, strict=True)]
        )

    if start is None:
        longest = max(curves, key=lambda c: float(np.abs(c.stretch - 1.0).max()))
        stiffness = abs(np.gradient(longest.stress, longest.stretch)[0]) / 6.0
        starts = [(stiffness, 0.1 * stiffness, 0.1 * stiffness, 0.01 * stiffness, 1.0, eta) for eta in (0.1, 1.0)]
    else:
        starts = [tuple(start)]
    found = [least_squares(residuals, np.log(s), bounds=BOUNDS, xtol=1e-12, ftol=1e-12, max_nfev=200) for s in starts]
    return np.exp(min(found, key=lambda f: float(f.cost)).x)


def synthetic(
    constants: Sequence[float], rates: Sequence[float], noise: float, seed: int = 0, last_stretch: float = 2.5
) -> list[Curve]:
    """Uniaxial curves of known constants, with normal noise as a share of the largest stress of each."""
    rng = np.random.default_rng(seed)
    stretch = np.linspace(1.0, last_stretch, 61)
    curves = []
    for rate in rates:
        time = np.abs(stretch - 1.0) / rate if rate > 0.0 else None
        curve = Curve(time, stretch, np.zeros_like(stretch))
        stress = model(constants, curve, "uniaxial")
        curves.append(Curve(time, stretch, stress + noise * np.abs(stress).max() * rng.normal(size=stress.shape)))
    return curves


def read(path: Path) -> list[Curve]:
    """Curves of a CSV file in the format above.

    Raises:
        InputError: for a file that cannot be read, or a curve that does not start at stretch 1 and rise in time.
    """
    try:
        columns = np.atleast_1d(np.genfromtxt(path.read_text().splitlines() or ["-"], delimiter=",", names=True))
        stretch, stress = columns["stretch"], columns["stress"]
        timed = "time" in (columns.dtype.names or ())
        rates = np.ones(len(stretch)) if timed else columns["rate"]
        known = np.isfinite([stretch, stress, columns["time"] if timed else rates]).all()
    except (OSError, ValueError, TypeError):
        known = False
    if not known:
        raise InputError(f"file = {str(path)!r}: expected numbers in the columns stretch, stress, and rate or time")
    curves = []
    for rate in np.unique(rates):
        mine = rates == rate
        time = None if rate == 0.0 else columns["time"] if timed else np.abs(stretch[mine] - 1.0) / rate
        curves.append(Curve(time, stretch[mine], stress[mine]))
        starts_at_one = mine.sum() > 5 and abs(stretch[mine][0] - 1.0) < 1e-6
        if not starts_at_one or (time is not None and not (np.diff(time) > 0.0).all()):
            raise InputError(
                f"file = {str(path)!r}: expected six rows or more a curve, from stretch 1 on, with rising times"
            )
    return curves


def main() -> None:
    """Fit a file, or recover the tables."""
    parser = study_parser(__doc__)
    parser.add_argument("file", type=Path, nargs="?")
    parser.add_argument("--loading", choices=LOADINGS, default="uniaxial")
    parser.add_argument("--recover", action="store_true", help="tables 1 and 2 of VE, without and with noise")
    options = parser.parse_args()
    if options.recover:
        rows = []
        for (name, wanted), noise in itertools.product(TABLES.items(), NOISES):
            found = identify(synthetic(wanted, RATES[name], noise))
            errors = [f"{100.0 * (f / known - 1.0):+.2f} %" for f, known in zip(found, wanted, strict=True)]
            rows.append([name, f"{100.0 * noise:g} %", *errors])
        print("\n".join(table(["table", "noise", *NAMES], rows)))
        return
    if options.file is None:
        parser.error("expected a file, or --recover")
    curves = read(options.file)
    for name, value in zip(NAMES, identify(curves, options.loading), strict=True):
        print(f"{name:10s} {value:12.6g} {'Pa' if name.endswith('0') else ''}".rstrip())
    if sum(curve.time is not None for curve in curves) < 2:
        print("the curves are at fewer than two rates: phi_ref and eta cannot be told apart")


if __name__ == "__main__":
    run_tool(main)
