"""BA: Yang, Chen and Liu, Eng. Fract. Mech. 2024, 110131."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from study import whole

from papers.rows import Example, Row, Values, run_scene, scene_values
from warp_pd import BondAssociated, Fixed, Gent, Motion, Pressure, Relaxation, Sheet, Simulation

# The text leaves open which area a point on an edge has, and where the edges are held.
READINGS: dict[str, dict[str, Any]] = {
    "whole": {},
    "shared": {"areas": "shared"},
    "corrected": {"weights": "corrected"},
}
SIDE = 0.1


def in_cells(loaded: str, points: int, device: str | None) -> Values:
    """BA 6.1 or 6.2 with points in the centres of cells, held in layers outside the sheet as wide as the horizon."""
    pulled = loaded == "tension"
    sheet = Sheet.rectangle(
        SIDE, SIDE, thickness=1e-3, density=1e3, points=points, centred=True, layers=(4, 0 if pulled else 4)
    )
    x, y = sheet.points.T
    if pulled:
        right = np.flatnonzero(x > SIDE)
        held = [Fixed(np.flatnonzero(x < 0.0)), Motion(right, times=[0.0, 1.0], x=[0.0, SIDE], y=0.0, z=0.0)]
    else:
        held = [Fixed(np.flatnonzero((abs(x - 0.5 * SIDE) > 0.5 * SIDE) | (abs(y - 0.5 * SIDE) > 0.5 * SIDE)))]
        held.append(Pressure(5.0))
    law = BondAssociated(Gent(1e3, 2e5, 160.0), horizon=3.15, weights="published")
    solver = Relaxation(ramp_steps=12 * points) if pulled else Relaxation()
    frame = whole(Simulation(sheet, law, solver, loads=held).run(device=device)).frame
    if pulled:
        return {"edge_contraction": float(frame.displacement[sheet.nearest(0.5 * SIDE, 0.0), 1])}
    return {"center_deflection": float(frame.displacement[sheet.nearest(0.5 * SIDE, 0.5 * SIDE), 2])}


def oblong(points: tuple[int, int], device: str | None) -> Values:
    """BA 6.1 with other numbers of points along x and y, at a horizon of 3.15 of the finer spacings."""
    sheet = Sheet.rectangle(SIDE, SIDE, thickness=1e-3, density=1e3, points=points, areas="whole")
    loads = [
        Fixed(sheet.edges("left")),
        Motion(sheet.edges("right"), times=[0.0, 1.0], x=[0.0, SIDE], y=0.0, z=0.0),
    ]
    horizon = 3.15 * SIDE / (max(points) - 1) / sheet.spacing
    law = BondAssociated(Gent(1e3, 2e5, 160.0), horizon=horizon, weights="published")
    solver = Relaxation(ramp_steps=12 * max(points), tolerance=1e-4)
    frame = Simulation(sheet, law, solver, loads=loads).run(device=device).frame
    return {"edge_contraction": float(frame.displacement[sheet.nearest(0.5 * SIDE, 0.0), 1])}


def off_plane(device: str | None) -> Values:
    """BA 6.4 without and with the force of eq. 45, and without it at an eighth of the step."""
    found = {}
    for kind, settings in (
        ("without", {"boundary_force": 0.0}), ("with", {}), ("short", {"boundary_force": 0.0, "safety": 0.06})
    ):  # fmt: skip
        values = scene_values("off_plane_load", device, **settings)
        found |= {f"{kind}: {name}": value for name, value in values.items()}
    if found.get("without: lift") and found.get("with: lift"):
        found["lift ratio"] = found["with: lift"] / found["without: lift"]
    return found


def double_notch(device: str | None, **settings: Any) -> Values:
    """BA 6.3: how far the crack leaves the middle line, in spacings."""
    found = scene_values("double_notch", device, **settings)
    if found.get("crack_deviation") is not None:
        found["deviation in spacings"] = found["crack_deviation"] / (0.01 / 29.0)
    return found


def torn(device: str | None, **settings: Any) -> Values:
    """BA 6.5: how far the tear has come when it is two spacings off its line."""
    found, result = run_scene("off_plane_tear", device, **settings)
    rows = [] if result is None else result.history
    straight = [row["crack_reach"] for row in rows if row["crack_deviation"] < 2.0 * SIDE / 79.0]
    return found | ({"straight": max(straight)} if straight else {})


def _examples() -> dict[str, Example]:
    found: dict[str, Example] = {}
    for name, points in (("6.1", 200), ("6.2", 101)):
        scene = "tension" if name == "6.1" else "pressure"
        for reading, settings in READINGS.items():
            found[f"ba.{name}.{reading}"] = partial(scene_values, scene, points=points, **settings)
        found[f"ba.{name}.cells"] = partial(in_cells, scene, points - points % 2)
    found["ba.6.1.400"] = partial(scene_values, "tension", points=400)
    found["ba.6.1.100"] = partial(scene_values, "tension", points=101)
    found["ba.6.1.cells-100"] = partial(in_cells, "tension", 100)
    found["ba.6.1.oblong"] = partial(oblong, (36, 71))
    found["ba.6.1.oblong-x"] = partial(oblong, (71, 36))
    plain = {"weights": "auto", "wrinkles": "relaxed"}
    found["ba.6.3"] = double_notch
    found["ba.6.3.plain"] = partial(double_notch, roughness=1e-3, **plain)
    found["ba.6.4"] = off_plane
    found["ba.6.5"] = torn
    found["ba.6.5.corrected"] = partial(torn, weights="corrected", wrinkles="relaxed")
    return found


EXAMPLES = _examples()


def _spread(name: str, where: str, quantity: str, printed: str, value: float, measure: str) -> list[Row]:
    """A printed number under all readings."""
    texts = {
        "whole": "points on the edges, one area each",
        "shared": "points on the edges, with half areas",
        "cells": "points in cells, held in layers outside",
        "corrected": "corrected weights, not the paper's",
    }
    return [
        Row(f"ba.{name}.{reading}", where, quantity, printed, measure, text, value=value, scale=1e3)
        for reading, text in texts.items()
    ]


ROWS = [
    *_spread("6.1", "6.1", "contraction of the edge (mm), 200 points", "14.06", 14.06e-3, "edge_contraction"),
    Row("ba.6.1.400", "6.1", "contraction of the edge (mm), 400 points", "14.06", "edge_contraction",
        "points on the edges, one area each", value=14.06e-3, scale=1e3),
    Row("ba.6.1.100", "6.1", "contraction of the edge (mm), 101 points", "14.06", "edge_contraction",
        "points on the edges, one area each", value=14.06e-3, scale=1e3),
    Row("ba.6.1.cells-100", "6.1", "contraction of the edge (mm), 100 points", "14.06", "edge_contraction",
        "points in cells, held in layers outside", value=14.06e-3, scale=1e3),
    Row("ba.6.1.oblong", "6.1", "contraction of the edge (mm), 36 x 71 points", "14.06", "edge_contraction",
        "twice as many points across, as 200 and 400", value=14.06e-3, scale=1e3),
    Row("ba.6.1.oblong-x", "6.1", "contraction of the edge (mm), 71 x 36 points", "14.06", "edge_contraction",
        "twice as many points along", value=14.06e-3, scale=1e3),
    Row("elements", "6.1", "contraction in finite elements (mm)", "13.57", "ba.6.1", "nine nodes, converged to 1e-5",
        value=13.57e-3, scale=1e3),
    Row("ba.6.1.whole", "6.1", "contraction against finite elements (%)", "3.60", "edge_contraction, error",
        "points on the edges, one area each", value=0.036, within=0.1, scale=100.0),
    *_spread("6.2", "6.2", "deflection of the centre (mm)", "16.19", 16.19e-3, "center_deflection"),
    Row("elements", "6.2", "deflection in finite elements (mm)", "15.62", "ba.6.2", "nine nodes, converged to 1e-6",
        value=15.62e-3, scale=1e3),
    Row("ba.6.2.whole", "6.2", "deflection against finite elements (%)", "3.60", "center_deflection, error",
        "points on the edges, one area each", value=0.036, within=0.1, scale=100.0),
    Row("ba.6.3", "6.3, figure 10", "pieces at the end", "2", "pieces", "as published, flat", low=2.0),
    Row("ba.6.3", "6.3, figure 10", "deviation of the crack from the middle line (spacings)", "horizontal",
        "deviation in spacings", "as published, flat", high=2.0),
    Row("ba.6.3.plain", "6.3, figure 10", "pieces at the end", "2", "pieces", "plain weights, tension field", low=2.0),
    Row("ba.6.3.plain", "6.3, figure 10", "deviation of the crack from the middle line (spacings)", "horizontal",
        "deviation in spacings", "plain weights, tension field", high=2.0),
    Row("ba.6.4", "6.4, figure 12", "corner points leave the surface by (spacings)", "some nodes do",
        "without: largest_corner_distance", "without the force of eq. 45, one area a point", low=0.2),
    Row("ba.6.4", "6.4, figure 13", "corner points leave the surface by (spacings)", "brought back",
        "with: largest_corner_distance", "A = 1e16 N/m^7, along the normal, one area a point", high=0.1),
    Row("ba.6.4", "6.4", "lift with the force over lift without", "almost unchanged", "lift ratio",
        "A = 1e16 N/m^7, along the normal, one area a point", low=0.99, high=1.01),
    Row("ba.6.4", "6.4", "steps to the end, at an eighth of the step", "converges without the force", "short: steps",
        "without the force of eq. 45, one area a point", low=1.0),
    Row("ba.6.4", "6.4", "corner points leave the surface by (spacings), at an eighth of the step", "-",
        "short: largest_corner_distance", "without the force of eq. 45, one area a point"),
    Row("ba.6.5", "6.5, figure 15", "straight for (mm)", "some distance", "straight", "one area a point",
        low=5e-3, scale=1e3),
    Row("ba.6.5.corrected", "6.5, figure 15", "straight for (mm)", "some distance", "straight",
        "corrected weights, tension field", low=5e-3, scale=1e3),
]  # fmt: skip
