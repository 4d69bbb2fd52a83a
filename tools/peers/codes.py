"""The codes, the ladder of settings of each, and what it cannot do."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from peers.elements import newton_membrane

Settings = dict[str, Any]


@dataclass(frozen=True)
class Code:
    """One way to use one code.

    Attributes:
        name: In tables.
        adapter: Module of `peers.adapters`; settings may name another.
        how: What it does, in words.
        runs: Problem -> settings, from coarse to fine.
        cannot: Problem -> why it has no row of numbers.
        gpu: Whether it has a GPU path.
        material: Its own material, if it is not that of the problem and finite elements can have it.
    """

    name: str
    adapter: str
    how: str
    runs: dict[str, list[Settings]]
    cannot: dict[str, str] = field(default_factory=dict)
    gpu: bool = False
    material: Any = None


def ladder(*points: int, **settings: Any) -> list[Settings]:
    """The same settings for several numbers of points along the shorter side."""
    return [{"points": n, **settings} for n in points]


def settling(*points: int, keep: float, step: float, **settings: Any) -> list[Settings]:
    """Settings of newton: steps in proportion to the spacing [s], damped alike, until 50 of them move less than
    1e-4 of the displacement, or 3000.

    Args:
        points: Along the shorter side.
        keep: Part of a velocity that a step leaves, with 25 points.
        step: With 25 points [s].
        settings: Others.
    """
    ending = {"between": 50, "tolerance": 1e-4, "most": 3000}
    return [
        {"points": n, "step": step * 24 / (n - 1), "keep": keep ** (24 / (n - 1)), **ending, **settings} for n in points
    ]


STATIC = ("pressure", "strip")
NO_TEAR = {"tear": "no rupture"}
UNBENT = {"drape": "no bending stiffness"}
BY_HAND = {"tear": "elements do not tear by themselves"}
FLAT = {
    **dict.fromkeys(("drum", "pressure"), "no pressure that follows the sheet"),
    **dict.fromkeys(("ball", "drape"), "not run: another Poisson's ratio, no bending"),
    "strip": "not run: Poisson's ratio 1/3",
}
vbd = settling(13, 25, 49, keep=0.97, step=1e-4, solver="vbd", iterations=5)
xpbd = settling(13, 25, 49, keep=0.97, step=1e-4, solver="xpbd", iterations=4)
example = ladder(25, solver="vbd", iterations=10, step=1 / 600, keep=0.97, between=50, tolerance=1e-4, most=2000)
# In time, without damping: as many steps as make 6 ms.
drum = [
    {**s, "keep": 1.0, "tolerance": 0.0, "most": n, "between": n, "step": 6e-3 / n}
    for s, n in zip(vbd, (30, 60, 120), strict=True)
]
springs = [{**s, "solver": "xpbd", "iterations": 4} for s in drum]
# A fall until it rests: time [s] and damping [1/s].
FALL = {"duration": 1.5, "damping": 15.0, "horizon": 1.5}


def falling(*points: int, step: float, **settings: Any) -> list[Settings]:
    """Settings of newton with a ball; steps [s]."""
    more = {"adapter": "newton_ball", "stiffness": 1e3, **FALL, **settings}
    return [{"points": n, "step": step, **more} for n in points]


def slower(*points: int) -> list[Settings]:
    """Settings of this code's tear: the finer, the more slowly G / Gc grows [1/s], as it grows while the tear runs."""
    return [{"points": n, "horizon": 2.015, "rate": 0.12 * (24 / n) ** 2} for n in points]


def with_ball(solver: str, step: float) -> dict[str, list[Settings]]:
    """Settings of newton in the problems with a ball; `step` of the draped sheet [s]."""
    given = {"solver": solver, "iterations": 10}
    return {
        "ball": [s for n in (13, 25, 49) for s in falling(n, step=1e-4 * 24 / (n - 1), **given)],
        "drape": falling(25, step=step, **given),
    }


CODES = [
    Code(
        "this code", "this_code",
        "bond-associated, corrected weights, horizon 1.5 (2.015 for the tear, and for drum and ball on the H200): at "
        "rest Newton's method in float64, in time explicit in float32; the tear with `TearingEnergy`, pulled to 0.96 "
        "Gc in 0.3 s and then slowly",
        {name: ladder(13, 25, 49, 97, horizon=1.5) for name in (*STATIC, "drum", "ball")}
        | {"tear": slower(24, 28, 32), "drape": ladder(25, 49, **FALL)},
        gpu=True,
    ),
    Code(
        "this code, Implicit", "this_code",
        "implicit steps in float64: 2 without inertia of the strip and the pressure, 40 of the drum, 300 of the drape",
        {name: ladder(13, 25, 49, horizon=1.5, steps=2) for name in STATIC}
        | {"drum": ladder(13, 25, 49, horizon=1.5, steps=40), "drape": ladder(25, steps=300, **FALL)},
        {
            "ball": "no free bodies",
            "tear": "not run",
        },
        gpu=True,
    ),
    Code(
        "this code, Relaxation", "this_code", "dynamic relaxation in float64",
        {name: ladder(13, 25, 49, horizon=1.5, relaxed=True) for name in STATIC}
        | {"drape": ladder(25, relaxed=True, **FALL)},
        {**dict.fromkeys(("drum", "ball"), "equilibria alone"), "tear": "not run"},
        gpu=True,
    ),
    Code(
        "scikit-fem, nine nodes", "scikit_fem", "membrane elements of tools/finite_elements.py, Newton's method",
        {name: ladder(13, 25, 49, 97, nodes=9) for name in STATIC},
        {
            **BY_HAND, **UNBENT,
            **dict.fromkeys(
                ("drum", "ball"), "elements of nine nodes do not bear lumped masses well"
            ),
        },
    ),
    Code(
        "scikit-fem, four nodes", "scikit_fem",
        "the same with four nodes an element; in time explicit, central differences",
        {name: ladder(13, 25, 49, 97, nodes=4) for name in STATIC}
        | {name: ladder(13, 25, 49, nodes=4) for name in ("drum", "ball")},
        BY_HAND | UNBENT,
    ),
    Code(
        "FElupe", "felupe_solid",
        "a layer of hexahedra of 27 nodes (it has no membranes); 4 load steps of the strip; under pressure 12, with a "
        "stretch of 10 % that is taken back, as its Newton's method fails from a flat sheet and from a dome",
        {"pressure": ladder(7, 13, 25), "strip": ladder(7, 13, 25)},
        {
            **BY_HAND,
            **dict.fromkeys(("drum", "ball"), "free vibrations alone"),
            "drape": "not run",
        },
    ),
    Code(
        "newton, VBD", "newton_cloth",
        "triangles of a membrane energy of its own, hinges that bend, 5 iterations a step, steps near the explicit "
        "limit, until at rest; 10 iterations and contact of 1 kN/m a point with a ball",
        {"pressure": vbd, "strip": vbd, "drum": drum, **with_ball("vbd", 4e-4)}, NO_TEAR,
        gpu=True, material=newton_membrane,
    ),
    Code(
        "newton, VBD, as in its example", "newton_cloth", "the same with 10 iterations in steps of 1/600 s",
        {"pressure": example, "strip": example, "drape": falling(25, step=1 / 600, iterations=10, solver="vbd")},
        {**NO_TEAR, **dict.fromkeys(("drum", "ball"), "four or six of its steps are the whole time")},
        gpu=True, material=newton_membrane,
    ),
    Code(
        "newton, XPBD", "newton_cloth",
        "springs (it has no triangles), hinges that bend, 4 iterations a step, until at rest; its strip does not come "
        "to rest; 10 iterations and contact by projection with a ball",
        {"pressure": xpbd, "strip": xpbd, "drum": springs, **with_ball("xpbd", 1.5e-4)}, NO_TEAR, gpu=True,
    ),
    Code(
        "LAMMPS, PERI", "lammps_peri",
        "pair_style peri/pmb in one layer of points, horizon 3.015, explicit; critical stretch from Gc by the formula "
        "of plane stress",
        {"tear": ladder(20, 30, 40, horizon=3.015, duration=3.0, most=1.4)}, FLAT,
    ),
]  # fmt: skip
