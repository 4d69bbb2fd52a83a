"""Rubber known from uniaxial tension, and pure shear if it was tested, is stretched both ways: what is its stress?

A disc of 50 mm radius and 1 mm thickness is clamped at its rim. As in such tests, the stress follows from the pressure,
the curvature 1/R and the stretch l at the pole: nominal stress p R l / (2 h). Rubbers of which only uniaxial tension is
known are stretched as flat squares, as in their tests.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator
from study import whole
from treloar import DATA, tests

from validation import spread
from validation.comparison import Comparison
from warp_pd import (
    ArcLength,
    BondAssociated,
    Fixed,
    Measure,
    Motion,
    Newton,
    Pressure,
    Sheet,
    Simulation,
    Yeoh,
)
from warp_pd.fitting import UniformTests, fit, nominal_stress
from warp_pd.measures import support_force
from warp_pd.shapes.curves import Circle

RADIUS, THICKNESS = 0.05, 1e-3
START = {"c10": 0.2e6, "c20": -1e3, "c30": 40.0}
FOLDER = Path(DATA).parent
FILES = {"treloar": DATA, "kawabata": FOLDER / "kawabata.csv", "meunier": FOLDER / "meunier.csv"}


@lru_cache
def rubber(name: str, with_equibiaxial: bool = False) -> Yeoh:
    """Yeoh's law from the tests of a source."""
    curves = [curve for curve in tests(FILES[name]) if with_equibiaxial or curve.control != "equibiaxial"]
    return Yeoh(*map(float, fit(UniformTests(Yeoh, curves), list(START), start=START, max_evaluations=200).values))


@lru_cache
def equibiaxial(name: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Stretches above 1.1 and nominal stresses [Pa] of the source. Below it a reading of the data is a tenth off."""
    curve = next(curve for curve in tests(FILES[name]) if curve.control == "equibiaxial")
    chosen = np.asarray(curve.at) > 1.1
    return tuple(np.asarray(curve.at)[chosen].tolist()), tuple(np.asarray(curve.values)[chosen].tolist())


def bulge(material: Yeoh, points: int, most: float, device: str | None) -> tuple[np.ndarray, np.ndarray]:
    """Stretch and nominal stress [Pa] at the pole of an inflated disc, up to the stretch `most` or a little less."""
    sheet = Sheet.outline(
        Circle((0.0, 0.0), RADIUS), spacing=2.0 * RADIUS / (points - 1), thickness=THICKNESS, density=1000.0
    )
    load = 2.0 * float(nominal_stress(material, "equibiaxial", np.array([most]))[0]) * THICKNESS / (RADIUS * most)
    near = np.flatnonzero(np.hypot(*sheet.points.T) < 5.2 * sheet.spacing)
    at_rest = np.hypot(*sheet.points[near].T)

    def pole(built, frame):
        """Stretch and curvature [1/m]: coefficients of an even and an odd polynomial in the radius."""
        u = frame.displacement[near]
        radius = np.hypot(*(sheet.points[near] + u[:, :2]).T)
        stretch = np.linalg.lstsq(np.column_stack([at_rest, at_rest**3, at_rest**5]), radius, rcond=None)[0][0]
        even = np.column_stack([radius**0, radius**2, radius**4, radius**6])
        return stretch, -2.0 * np.linalg.lstsq(even, u[:, 2], rcond=None)[0][1]

    def stress(built, frame):
        stretch, curvature = pole(built, frame)
        return load * frame.time * stretch / (2.0 * curvature * THICKNESS) if frame.time else 0.0

    result = whole(
        Simulation(
            sheet,
            force=BondAssociated(material, horizon=1.5, weights="corrected"),
            loads=[Fixed(sheet.edges("all")), Pressure(load)],
            solver=ArcLength(increment=0.04, most_steps=80, modes=0),
            measures=[
                Measure("stretch", "-", lambda built, frame: pole(built, frame)[0]),
                Measure("stress", "Pa", stress),
            ],
        ).run(device=device, usd=False, pictures=False)
    )
    rows = np.array([(row["stretch"], row["stress"]) for row in result.history])
    return rows[:, 0], rows[:, 1]


def stresses(name: str, points: int, device: str | None) -> Sequence[float]:
    """Nominal stress [MPa] at the stretches of the source."""
    at, _ = equibiaxial(name)
    stretch, stress = bulge(rubber(name), points, at[-1], device)
    curve = PchipInterpolator(stretch, stress)
    return [float("nan") if x > stretch.max() else 1e-6 * float(curve(x)) for x in at]


def reasons(name: str, points: int, device: str | None) -> Mapping[str, float]:
    """How far the bulge is from its own law, and the law from the test, also if it was fitted to all three tests."""
    at, theirs = equibiaxial(name)
    law, best = (nominal_stress(rubber(name, known), "equibiaxial", np.array(at)) for known in (False, True))
    off = np.abs(1e6 * np.array(stresses(name, points, device)) / law - 1.0)
    return {
        "bulge against its own law": float(np.median(off)),
        "law against the test": float(np.median(np.abs(law / theirs - 1.0))),
        "law fitted to all three tests": float(np.median(np.abs(best / theirs - 1.0))),
    }


@lru_cache
def uniaxial_rubber(name: str) -> Yeoh:
    """Yeoh's law from uniaxial tension alone."""
    return spread.fitted(spread.curves(name), "Yeoh", ["uniaxial"])


def square(name: str, points: int, device: str | None) -> Sequence[float]:
    """Nominal stress [MPa] on a square sheet that is pulled equally both ways, at the stretches of the source."""
    side = 2.0 * RADIUS
    sheet = Sheet.rectangle(side, side, thickness=THICKNESS, density=1000.0, points=points)
    travel = [0.0, *(side * (np.asarray(spread.curves(name)["equibiaxial"].at) - 1.0)).tolist()]
    times, right = np.linspace(0.0, 1.0, len(travel)), sheet.edges("right")
    result = whole(
        Simulation(
            sheet,
            force=BondAssociated(uniaxial_rubber(name), horizon=2.015),
            loads=[
                Fixed(np.arange(sheet.size), "z"),
                Fixed(sheet.edges("left"), "x"),
                Fixed(sheet.edges("bottom"), "y"),
                Motion(right, times=times, x=travel),
                Motion(sheet.edges("top"), times=times, y=travel),
            ],
            solver=Newton(load_steps=len(travel) - 1),
            measures=[Measure("pull", "N", lambda built, frame: abs(support_force(built, right)[0]))],
        ).run(device=device, usd=False, pictures=False)
    )
    # A law that softens may have no uniform equilibrium that is stable: stresses that are not reached have no value.
    found = [1e-6 * row["pull"] / (side * THICKNESS) for row in result.history[1:]]
    return [*found, *[float("nan")] * (len(travel) - 1 - len(found))]


def flat(name: str) -> Comparison:
    """The comparison with a source that has uniaxial and equibiaxial tension of flat sheets."""
    curve = spread.curves(name)["equibiaxial"]
    stresses = tuple((1e-6 * np.asarray(curve.values)).tolist())
    return Comparison(
        name, tuple(np.asarray(curve.at).tolist()), stresses, 2.0 * RADIUS, (6, 11), (6, 11), partial(square, name)
    )


def row(name: str) -> Comparison:
    """The comparison with a source that has all three tests."""
    at, theirs = equibiaxial(name)
    return Comparison(
        name, at, tuple(1e-6 * value for value in theirs), 2.0 * RADIUS, (21, 31), (21, 31, 46),
        partial(stresses, name), partial(reasons, name),
    )  # fmt: skip


ROWS: tuple[Callable[[], Comparison], ...] = (
    *(partial(row, name) for name in FILES),
    *(partial(flat, name) for name in ("james", "kawamura")),
)
