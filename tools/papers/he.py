"""HE: Bang, dissertation, University of Arizona, 2016."""

from __future__ import annotations

import json
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import brentq
from study import ROOT

from papers.rows import Example, Row, Values, run_scene, where_passed
from warp_pd.papers.hyperelastic_bonds import (
    MODES,
    PUBLISHED,
    bond_energy,
    deformed,
    exact_traction,
    round_family,
    terms,
)
from warp_pd.scenes import stretch as scene

WHOLE, HOLED = (1.5, 2.0, 2.5, 3.0, 3.5, 4.0), (1.5, 2.0, 2.5, 3.0)
DEFECTS = ("hole", "crack", "inclusion")
SECTION = {"equibiaxial": "5.1", "planar": "5.2", "uniaxial": "5.3"}
# Compressive constants of eq. 77b: A, B, D over c0.
COMPRESSION = (-109 / 14, -239 / 16, 5 / 18)
ACROSS = {"equibiaxial": lambda s: s, "planar": lambda _: 1.0, "uniaxial": lambda s: s**-0.5}
STEP = 1e-4
RADIUS, SIDE = scene.RADIUS, scene.SIDE


def constants(_device: str | None) -> Values:
    """The force of a bond that is not stretched, over c0."""
    a, b, d = COMPRESSION
    found = {f"at rest, {mode}": p[0] - sum(p[1:]) for mode, p in PUBLISHED.items()}
    return found | {"at rest, compression": a - 0.5 * b - 2.0 * d}


def uniform(_device: str | None) -> Values:
    """Pull of an infinite sheet off the exact one (%): the printed force, both sets of constants, and the energy."""
    directions = round_family()
    a, b, d = COMPRESSION
    squeezed = (a, 0.5 * b, 0.0, 2.0 * d)

    def energy(mode: str, stretch: float) -> float:
        s, cosine = deformed(directions, stretch, ACROSS[mode](stretch))
        return float(bond_energy(PUBLISHED[mode], s, cosine).mean())

    def pull(stretch: float, across: float, both: bool) -> np.ndarray:
        s, cosine = deformed(directions, stretch, across)
        p = np.where((s < 1.0) & both, np.reshape(squeezed, (4, 1)), np.reshape(PUBLISHED["uniaxial"], (4, 1)))
        t = (p * terms(s)).sum(axis=0) * cosine**2 / s
        return np.asarray((2.0 * directions**2 * (stretch, across) * t[:, None]).mean(axis=0))

    found: Values = {}
    for s in WHOLE:
        for mode in MODES:
            slope = (energy(mode, s + STEP) - energy(mode, s - STEP)) / (2.0 * STEP)
            true = exact_traction(mode, s) * (2.0 if mode == "equibiaxial" else 1.0)
            found[f"energy, {mode} at {s:g}"] = slope / true - 1.0
        for kind, both in (("tension", False), ("both", True)):
            width = brentq(lambda across, s=s, both=both: pull(s, across, both)[1], 0.3, 1.1)
            found[f"{kind} at {s:g}"] = pull(s, width, both)[0] / exact_traction("uniaxial", s) - 1.0
    return found


def exact(mode: str, defect: str, stretch: float) -> float | None:
    """Force on the edge [N]: exact without a defect, else that of finite elements."""
    if defect == "none":
        return scene.MU * SIDE * scene.THICKNESS * exact_traction(mode, stretch)
    return scene.ELEMENTS[defect][mode].get(stretch)


def stretched(mode: str, defect: str, device: str | None, **settings: Any) -> Values:
    """Forces over the exact ones at the paper's stretches, and the shape of the defect, from one run."""
    stretches = WHOLE if defect == "none" else HOLED
    found, result = run_scene("stretch", device, mode=mode, defect=defect, stretch=stretches[-1], **settings)
    names = ["edge_force", "stretch_across"] + ["opening_x", "opening_y"] * (defect in ("hole", "crack"))
    found |= where_passed(result, "stretch", stretches, tuple(names))
    for s in stretches:
        true, force = exact(mode, defect, s), found.get(f"edge_force at {s:g}")
        if true and force:
            found[f"off at {s:g}"] = force / true - 1.0
        if f"opening_x at {s:g}" in found:
            along, across = (RADIUS, RADIUS) if defect == "hole" else (0.0, 0.5 * scene.CRACK)
            x, y = along + found[f"opening_x at {s:g}"], across + found[f"opening_y at {s:g}"]
            found[f"axes at {s:g}"] = x / y
    return found


def elements() -> Values:
    """Ratio of the axes of the opened holes in finite elements."""
    stored = json.loads((ROOT / "tests" / "references" / "stretch.json").read_text("utf-8"))
    return {
        f"he.{mode} at {s}": (RADIUS + found["opening_x"]["value"]) / (RADIUS + found["opening_y"]["value"])
        for mode in MODES
        for s, found in stored["hole"][mode].items()
    }


EXAMPLES: dict[str, Example] = {
    "he.3": constants,
    "he.3.uniform": uniform,
    **{f"he.{SECTION[mode]}": partial(stretched, mode, "none") for mode in MODES},
    **{
        f"he.{SECTION[mode]}.{defect}": partial(stretched, mode, defect)
        for mode in MODES
        for defect in DEFECTS
    },
    **{
        f"he.5.grid.{points}": partial(stretched, "equibiaxial", "none", points=points) for points in (50, 150, 200)
    },
}  # fmt: skip


def _deviation(mode: str, printed: dict[float, str], bounds: tuple[float, float]) -> list[Row]:
    return [
        Row(f"he.{SECTION[mode]}", f"{SECTION[mode]}, figures", f"force at {s:g}, off the exact one (%)", text,
            f"off at {s:g}", "constants of the mode's final force density", low=bounds[0], high=bounds[1], scale=100.0)
        for s, text in printed.items()
    ]  # fmt: skip


ROWS = [
    Row("he.3", "3.1, eq. 35", "force of an equibiaxial bond at rest over c0", "0 by the energy",
        "at rest, equibiaxial", low=-1e-9, high=1e-9),
    Row("he.3", "3.2, eq. 58", "force of a planar bond at rest over c0", "0 by the energy", "at rest, planar",
        low=-1e-9, high=1e-9),
    Row("he.3", "3.3, eq. 77a", "force of a uniaxial bond at rest over c0, tension", "0 by the energy",
        "at rest, uniaxial", low=-0.02, high=0.02),
    Row("he.3", "3.3, eq. 77b", "force of a uniaxial bond at rest over c0, compression", "0 by the energy",
        "at rest, compression", low=-0.02, high=0.02),
    *_deviation("equibiaxial", {1.5: "1.75 off its elements", 4.0: "3.0 off its elements"}, (-0.03, 0.03)),
    *_deviation("planar", dict.fromkeys(WHOLE, "about 5 off its elements"), (-0.065, 0.065)),
    *_deviation("uniaxial", dict.fromkeys(WHOLE, "1.5 to 10 off its elements"), (-0.10, 0.10)),
    *(
        Row("he.3.uniform", f"{SECTION[mode]}, figures", f"force at {s:g}, off the exact one (%)", text,
            f"energy, {mode} at {s:g}", "gradient of the printed energy", low=-bound, high=bound, scale=100.0)
        for mode, text, bound in (("planar", "about 5 off its elements", 0.05),
                                  ("uniaxial", "1.5 to 10 off its elements", 0.10))
        for s in WHOLE
    ),
    *(
        Row("he.3.uniform", "5.3, figures", f"force at {s:g}, off the exact one (%)", "1.5 to 10 off its elements",
            f"{kind} at {s:g}", reading, low=-0.10, high=0.10, scale=100.0)
        for kind, reading in (("tension", "infinite sheet, constants of tension (eq. 82)"),
                              ("both", "infinite sheet, eq. 77b where bonds shorten"))
        for s in WHOLE
    ),
    *(
        Row(f"he.{SECTION[mode]}.{defect}", f"{SECTION[mode]}.{1 + DEFECTS.index(defect)}",
            f"{mode}, {defect}: force at {s:g}, off elements (%)", "good agreement", f"off at {s:g}",
            low=-0.05, high=0.05, scale=100.0)
        for mode in MODES for defect in DEFECTS for s in HOLED
    ),
    *(
        Row("he.5.1.hole", "5.1.1", f"axes of the hole at {s:g}, x over y", "a circle", f"axes at {s:g}",
            "a staircase of cells", low=0.98, high=1.02)
        for s in HOLED
    ),
    Row("he.5.1.crack", "5.1.2", "axes of the crack at 3, x over y", "almost a circle", "axes at 3", low=0.8, high=1.2),
    *(
        Row("he.5.2.hole", "5.2.1", f"axes of the hole at {s:g}, x over y", "an ellipse along x", f"axes at {s:g}",
            "a staircase of cells", low=1.1)
        for s in HOLED
    ),
    *(
        Row("he.5.3.hole", "5.3.1", f"axes of the hole at {s:g}, x over y", "an ellipse along x", f"axes at {s:g}",
            "a staircase of cells", low=1.1)
        for s in HOLED
    ),
    *(
        Row(f"he.5.grid.{points}", "5.3, convergence", f"force at 4, {points} points, off the exact one (%)",
            "almost identical", "off at 4", low=-0.01, high=0.01, scale=100.0)
        for points in (50, 150, 200)
    ),
]  # fmt: skip
