"""A sheet held at its left edge and lifted at the middle of its right one. NN paper, section 6.2 (figures 10, 11).

1 x 1 x 0.01 m, neo-Hookean mu 1 kPa, K 100 kPa, rho 1000 kg/m^3. The points within 0.04 m of the middle of the
right edge move by u1 = 0.025 t, u3 = 0.05 t until 2 s, and then stay. The paper shows u3 at 1.5, 2.5, 3.5 and
4.5 s, without numbers. The other edges are free.

The free edges are compressed, and a sheet without bending stiffness wrinkles there as finely as its points allow. So
the field has no limit as the spacing shrinks: explicit finite elements (tools/references/lifted_sheet.py) with 50
and 100 elements along a side differ by 20 and 12 % from 200 of them at 4.5 s (displacements, L2), and this scene by
26 % at a horizon of 3.15 and 18 % at 1.5; mean deflections agree to 0.5 %. With the relaxed energy of tension field
theory in both, `wrinkles="relaxed"`, there is a limit: 50 and 100 elements are at most 5.7 and 2.4 % off 200 of them,
and the scene is within 6 % at 3.15 and 3 % at 1.5, at all four times. Slack points move fast; steps are smaller then.
"""

import numpy as np

from warp_pd import Explicit, Fixed, Measure, Motion, NeoHookean, Sheet, Simulation
from warp_pd.measures import support_force
from warp_pd.papers import force_law, point_areas

SHOWN = (1.5, 2.5, 3.5, 4.5)


def build(
    points: int = 101,
    horizon: float = 3.15,
    weights: str = "auto",
    force: str = "bond_associated",
    wrinkles: str = "resolved",
    damping: float = 0.1,
    duration: float = 4.5,
    frames: int = 90,
    safety: float | None = None,
    patch: float = 0.04,
    areas: str = "auto",
) -> Simulation:
    """Build the scene.

    Args:
        patch: Radius of the patch that is pulled [m].
    """
    if safety is None and wrinkles == "relaxed":
        safety = 0.4
    sheet = Sheet.rectangle(1.0, 1.0, thickness=0.01, density=1000.0, points=points, areas=point_areas(areas, weights))
    pulled = sheet.within((1.0, 0.5), patch)
    return Simulation(
        sheet,
        force=force_law(force, NeoHookean(mu=1e3, bulk=100e3), horizon, weights, wrinkles),
        loads=[
            Fixed(sheet.edges("left")),
            Motion(pulled, times=[0.0, 2.0], x=[0.0, 0.05], y=0.0, z=[0.0, 0.1]),
        ],
        solver=Explicit(duration=duration, frames=frames, damping=damping, safety=safety),
        measures=[
            Measure("largest_u3", "m", lambda built, frame: frame.displacement[:, 2].max()),
            Measure("smallest_u3", "m", lambda built, frame: frame.displacement[:, 2].min()),
            Measure("pull", "N", lambda built, frame: float(np.linalg.norm(support_force(built, pulled)))),
        ],
        section="NN 6.2",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, SHOWN)
    plots.surfaces(folder / "deflection.png", shown, field="u3")
    plots.from_above(folder / "from_above.png", shown, field="u3")
    plots.curves(folder / "pull.png", history, ["pull"], ylabel="pull (N)")
