"""A slit in a stretched sheet is mended by a patch, glued over it; the patch holds, or comes off.

A sheet, 0.1 m square and 1 mm thick, mu 0.1 MPa, has a slit of 30 mm across the pull. A patch of the same rubber, 50 mm
square, on a grid of its own that is turned by 15 degrees, is glued over the slit; then the sheet is stretched along y
between two clamps. With `energy` = 0 the glue holds, and the slit opens `slit_opening`, as far as the patch lets it;
without a patch (`patch` = 0) it opens freely. Glue with an energy breaks beside the slit and at the rim of the patch.
Numbers of a peel are in the scene `peel`; this one shows how a joint over an area is written.
"""

import numpy as np

from warp_pd import (
    BondAssociated,
    Explicit,
    Fixed,
    Joint,
    Measure,
    Motion,
    NeoHookean,
    Outcome,
    Place,
    Sheet,
    Simulation,
    placed,
    together,
)
from warp_pd.device.checks import InputError, not_negative, positive
from warp_pd.measures import support_force, worst_balance

MU, SIDE, SLIT, THICKNESS, DENSITY = 1e5, 0.1, 0.03, 1e-3, 1000.0


def build(
    points: int = 41,
    horizon: float = 2.015,
    patch: float = 0.05,
    degrees: float = 15.0,
    energy: float = 4.0,
    stretch: float = 1.3,
    duration: float = 0.5,
    damping: float = 50.0,
    frames: int = 50,
) -> Simulation:
    """Build the scene.

    Args:
        points: Points along the sheet.
        patch: Side of the patch [m]; 0 for none.
        degrees: Angle by which it is turned [degrees].
        energy: Energy of its glue [J/m^2]; 0 for glue that holds.
        stretch: Stretch of the sheet at the end [-].
    """
    if not_negative("patch", patch) > 0.6 * SIDE:
        raise InputError(f"patch = {patch:g}: expected at most {0.6 * SIDE:g} m, so that it lies on the sheet")
    sheet = Sheet.rectangle(SIDE, SIDE, thickness=THICKNESS, density=DENSITY, points=points)
    middle = 0.5 * SIDE
    sheet = sheet.cut((middle - 0.5 * SLIT, middle + 1e-6), (middle + 0.5 * SLIT, middle + 1e-6))
    across = abs(sheet.points[:, 0] - middle) < 0.6 * sheet.spacing
    lip = [sheet.points[:, 1] <= middle + 1e-6, sheet.points[:, 1] > middle + 1e-6]
    lower, upper = (
        int(p[np.argmin(abs(sheet.points[p, 1] - middle))]) for p in (np.flatnonzero(across & own) for own in lip)
    )
    glue, start, edges = [], None, [sheet.edges(name) for name in ("bottom", "top")]
    if patch > 0.0:
        count = max(4, round(patch / sheet.spacing) + 1)
        piece = Sheet.rectangle(
            patch, patch, thickness=THICKNESS, density=DENSITY, points=count, origin=2 * (-0.5 * patch,)
        )
        sheet = together(sheet, piece)
        start = placed(sheet, Place(), Place((middle, middle, 0.0), degrees=degrees))
        glue = [Joint(sheet.edges("sheet 2"), sheet.edges("sheet 1"), energy=not_negative("energy", energy) or None)]
        edges = [sheet.edges("sheet 1")[edge] for edge in edges]
    bottom, top = edges
    way = (positive("stretch", stretch) - 1.0) * SIDE

    def opening(built, frame):
        """Distance of the lips in the middle of the slit, over that of its points at rest [m]."""
        return frame.displacement[upper, 1] - frame.displacement[lower, 1]

    return Simulation(
        sheet,
        force=BondAssociated(NeoHookean(MU, 100.0 * MU), horizon=horizon),
        loads=[
            Fixed(bottom),
            Motion(top, [0.0, positive("duration", duration)], x=0.0, y=[0.0, way], z=0.0),
            Fixed(np.setdiff1d(np.arange(sheet.size), np.union1d(bottom, top)), "z"),
            *glue,
        ],
        initial_displacement=start,
        solver=Explicit(duration, frames=frames, damping=damping),
        measures=[
            Measure("load", "N", lambda built, frame: support_force(built, top)[1]),
            Measure("slit_opening", "m", opening),
        ],
        outcomes=[Outcome("worst_energy_balance", "1", worst_balance)],
        section="own sheet",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    field = "joint_damage" if "joint_damage" in history[0] else "u2"
    shown = plots.frames_at(folder, [history[len(history) // 2]["time"], history[-1]["time"]])
    plots.from_above(folder / "patch.png", shown, field=field)
    plots.curves(folder / "load.png", history, ["load"], ylabel="force (N)")
    plots.curves(folder / "opening.png", history, ["slit_opening"], ylabel="opening of the slit (m)")
