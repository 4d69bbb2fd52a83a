"""Fit every material to Treloar's three tests at once, and compare with published constants. Prints the table of
docs/fitting.md.

    python tools/treloar.py

Treloar, Trans. Faraday Soc. 40 (1944) 59: uniaxial tension, pure shear and equibiaxial tension of one rubber, tabulated
in tests/references/treloar.csv. Every test counts alike: residuals are divided by its largest stress.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from study import run_tool, study_parser, table

from warp_pd import ArrudaBoyce, Carroll, ExtendedTube, Gent, MooneyRivlin, Ogden, Yeoh
from warp_pd.fitting import Curve, Fit, UniformTests, fit, nominal_stress, read_table

DATA = Path(__file__).parents[1] / "tests" / "references" / "treloar.csv"
LOADINGS = ("uniaxial", "planar", "equibiaxial")
THREE_TERMS = ("mu_1", "alpha_1", "mu_2", "alpha_2", "mu_3", "alpha_3")
# kg/cm^2 in Pa, the unit of Ogden's constants.
KILOGRAM = 98066.5


def ogden(mu1: float, a1: float, mu2: float, a2: float) -> Ogden:
    """Two terms."""
    return Ogden((mu1, mu2), (a1, a2))


def gent(mu: float, lock: float) -> Gent:
    """Nearly incompressible."""
    return Gent(mu, 1e3 * mu, lock)


def neo_hookean(mu: float) -> MooneyRivlin:
    """Incompressible."""
    return MooneyRivlin(0.5 * mu)


MATERIALS: dict[str, tuple[Callable[..., Any], dict[str, float]]] = {
    "neo-Hookean": (neo_hookean, {"mu": 0.3e6}),
    "Mooney-Rivlin": (MooneyRivlin, {"c10": 0.15e6, "c01": 1e3}),
    "Ogden, two terms": (ogden, {"mu1": -1.2e6, "a1": -0.6, "mu2": 12e3, "a2": 4.0}),
    "Ogden, three terms": (Ogden.of, dict(zip(THREE_TERMS, (6.3e5, 1.3, 1.2e3, 5.0, -1e4, -2.0), strict=True))),
    "Gent": (gent, {"mu": 0.3e6, "lock": 90.0}),
    "Arruda-Boyce": (ArrudaBoyce, {"mu": 0.3e6, "lock": 5.0}),
    "Yeoh": (Yeoh, {"c10": 0.2e6, "c20": -1e3, "c30": 40.0}),
    "Carroll": (Carroll, {"a": 0.15e6, "b": 0.3, "c": 0.1e6}),
    "extended tube": (ExtendedTube, {"gc": 0.2e6, "delta": 0.09, "ge": 0.2e6, "beta": 0.2}),
}
# What the laws take; a search that is refused beyond ends before the best fit.
BOUNDS: dict[str, dict[str, tuple[float, float]]] = {
    "Carroll": dict.fromkeys("abc", (0.0, np.inf)),
    "extended tube": {"gc": (0.0, np.inf), "delta": (0.0, 0.7), "ge": (0.0, np.inf), "beta": (1e-3, 1.0)},
}
Stress = Callable[[str, np.ndarray], np.ndarray]


def tests(path: Path = DATA) -> list[Curve]:
    """The three curves."""
    columns = read_table(path).columns
    curves = []
    for loading in LOADINGS:
        stretch, stress = columns[f"{loading}_stretch"], columns[f"{loading}_stress"]
        known = np.isfinite(stretch)
        curves.append(Curve(loading, stretch[known], "nominal_stress", stress[known], name=loading))
    return curves


def fitted(name: str, curves: Sequence[Curve]) -> Fit:
    """A material, fitted to all curves."""
    material, start = MATERIALS[name]
    return fit(UniformTests(material, curves), list(start), start=start, bounds=BOUNDS.get(name), max_evaluations=200)


def ogden_1972(loading: str, stretch: np.ndarray) -> np.ndarray:
    """Ogden, Proc. R. Soc. A 326 (1972) 565: three terms, fitted to these three tests."""
    second = {"uniaxial": -0.5, "planar": -1.0, "equibiaxial": -2.0}[loading]
    terms = ((6.3, 1.3), (0.012, 5.0), (-0.1, -2.0))
    stress = sum(KILOGRAM * mu * (stretch ** (a - 1.0) - stretch ** (second * a - 1.0)) for mu, a in terms)
    return np.asarray(stress)


def arruda_boyce_1993(loading: str, stretch: np.ndarray) -> np.ndarray:
    """Arruda and Boyce, J. Mech. Phys. Solids 41 (1993) 389: C_R = 0.27 MPa, N = 26.5, inverse Langevin function.

    The material of the package has the first five terms of its series instead.
    """
    width = {"uniaxial": stretch**-0.5, "planar": np.ones_like(stretch), "equibiaxial": stretch}[loading]
    rest = {"uniaxial": -2.0, "planar": -3.0, "equibiaxial": -5.0}[loading]
    chain = np.sqrt((stretch**2 + width**2 + (stretch * width) ** -2) / 3.0)
    modulus, links = 0.27e6, 26.5
    slope = modulus * np.sqrt(links) * inverse_langevin(chain / np.sqrt(links)) / (3.0 * chain)
    return np.asarray(slope * (stretch - stretch**rest))


def inverse_langevin(y: np.ndarray) -> np.ndarray:
    """The b with coth b - 1/b = y, by Newton's method from Pade's approximation."""
    b = y * (3.0 - y**2) / (1.0 - y**2)
    for _ in range(50):
        b = b - (1.0 / np.tanh(b) - 1.0 / b - y) / (1.0 / b**2 - 1.0 / np.sinh(np.minimum(b, 300.0)) ** 2)
    return np.asarray(b)


PUBLISHED: Mapping[str, Stress] = {
    "Ogden 1972, three terms": ogden_1972,
    "Arruda and Boyce 1993, Langevin": arruda_boyce_1993,
    "their constants, five terms": lambda loading, stretch: nominal_stress(
        ArrudaBoyce(0.27e6, 26.5**0.5), loading, stretch
    ),
}


def errors(curves: Sequence[Curve], stresses: Sequence[np.ndarray]) -> list[float]:
    """Root mean square of the error over the largest stress of each test, then over all of them."""
    off = [(stress - curve.values) / curve.scale for curve, stress in zip(curves, stresses, strict=True)]
    return [float(np.sqrt((part**2).mean())) for part in (*off, np.concatenate(off))]


def main() -> None:
    """Print the table."""
    study_parser(__doc__).parse_args()
    curves = tests()
    rows = []
    for name in MATERIALS:
        found = fitted(name, curves)
        print(f"{name}\n{found.table()}\n")
        told = zip(found.names, found.values, found.judgement.errors, strict=True)
        # Standard errors that matter.
        constants = ", ".join(f"{n} {v:.4g}" + (f" ± {e:.2g}" if e > 0.1 * abs(v) else "") for n, v, e in told)
        rows.append([f"{name}, fitted", constants, *(f"{100.0 * e:.2f} %" for e in errors(curves, found.model))])
    for name, stress in PUBLISHED.items():
        shown = [stress(curve.control, curve.at) for curve in curves]
        rows.append([name, "", *(f"{100.0 * e:.2f} %" for e in errors(curves, shown))])
    print("\n".join(table(["material", "constants (SI)", *LOADINGS, "all"], rows)))


if __name__ == "__main__":
    run_tool(main)
