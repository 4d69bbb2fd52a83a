"""A flat glove blank of latex, from an SVG file, is pulled at its fingers.

`glove.svg` is a hand of 153 x 185 mm; the document specifies its size. The sheet of 0.25 mm latex (neo-Hookean, mu 0.4
MPa) is held at the cuff, and the tips of all five fingers are pulled away from the palm by 30 mm. No bond crosses the
gaps between fingers. There is no closed form; the forces of the fingers converge as the spacing decreases.
"""

from pathlib import Path

import numpy as np

from warp_pd import (
    BondAssociated,
    Fixed,
    Measure,
    MooneyRivlin,
    Motion,
    Newton,
    Outcome,
    Sheet,
    Simulation,
    read_outline,
)
from warp_pd.device.checks import positive
from warp_pd.measures import support_force

THICKNESS, DENSITY, MU = 0.25e-3, 950.0, 0.4e6
OUTLINE = Path(__file__).with_name("glove.svg")
# How far along a finger its tip is held [m].
TIP = 0.008


def build(
    spacing: float = 3e-3,
    horizon: float = 2.015,
    pull: float = 0.03,
    load_steps: int = 4,
) -> Simulation:
    """Build the scene.

    Args:
        spacing: Spacing of the points [m].
        pull: Displacement of the fingertips [m].
    """
    rings = read_outline(OUTLINE, unit="document", tolerance=0.01 * positive("spacing", spacing))
    sheet = Sheet.outline(rings.boundary, holes=rings.holes, spacing=spacing, thickness=THICKNESS, density=DENSITY)
    cuff = sheet.edges("outline side 1")
    fingers = fingertips(sheet, cuff)
    return Simulation(
        sheet,
        force=BondAssociated(MooneyRivlin(0.5 * MU), horizon=horizon),
        loads=[
            Fixed(cuff),
            Fixed(np.setdiff1d(np.arange(sheet.size), np.concatenate([cuff, *(tip for tip, _ in fingers)])), "z"),
            *(
                Motion(tip, [0.0, 1.0], x=[0.0, pull * way[0]], y=[0.0, pull * way[1]], z=[0.0, 0.0])
                for tip, way in fingers
            ),
        ],
        solver=Newton(load_steps=load_steps),
        measures=[
            Measure(f"finger_{number}", "N", lambda built, frame, tip=tip, way=way: support_force(built, tip)[:2] @ way)
            for number, (tip, way) in enumerate(fingers, start=1)
        ],
        outcomes=[Outcome("middle_finger", "N", lambda history: history[-1]["finger_3"])],
        section="from a file",
        pictures=pictures,
    )


def fingertips(sheet, cuff):
    """Points of each fingertip, from the thumb, and the unit vector from the palm to it.

    Tips are the points of the edge that are furthest from the palm, 30 mm from each other, away from the cuff.
    """
    points, palm = sheet.points, sheet.points.mean(axis=0)
    away = np.linalg.norm(points - palm, axis=1)
    rim = sheet.edges("all")
    rim = rim[np.linalg.norm(points[rim] - points[cuff].mean(axis=0), axis=1) > 0.06]
    tips = []
    for _ in range(5):
        top = rim[np.argmax(away[rim])]
        way = (points[top] - palm) / away[top]
        near = sheet.within(tuple(points[top]), 0.02)
        tips.append((near[(points[near] - points[top]) @ way > -TIP], way))
        rim = rim[np.linalg.norm(points[rim] - points[top], axis=1) > 0.03]
    return sorted(tips, key=lambda tip: np.arctan2(*tip[1]))


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [history[0]["time"], history[-1]["time"]])
    plots.from_above(folder / "glove.png", shown, field="u2")
