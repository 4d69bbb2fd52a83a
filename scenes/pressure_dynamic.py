"""A neo-Hookean sheet with fixed edges under suddenly applied pressure. NN paper, section 6.1 (figure 8).

1 x 1 x 0.01 m, mu 1 kPa, K 100 kPa, rho 1000 kg/m^3, all edges fixed; a follower pressure of 20 Pa from t = 0, mass
damping 0.1 /s, to 1 s. Waves run in from the edges and meet in the middle: finite elements (`under_pressure(100)` of
tools/references/lifted_sheet.py) give 0.0633, 0.2592, 0.634 and 0.432 m as the largest deflection at 0.25, 0.5, 0.75
and 1 s, accurate to 0.5, 0.5, 1 and 0.2 %; the paper's colour bars end at 0.06, 0.26, 0.62 and 0.44 m.

The neural law and its closed form (`--force neural`, `closed_form`) are 0.2 % off at 1 s. With the paper's weights and
one area a point (`--weights published`) they hold the paper's 5 %; with half areas on edges (`--set areas=shared`) they
do not.
"""

from warp_pd import Explicit, Fixed, Measure, NeoHookean, Outcome, Pressure, Sheet, Simulation
from warp_pd.measures import at_time, largest
from warp_pd.papers import force_law, point_areas

LARGEST = {0.25: 0.06334, 0.5: 0.25916, 0.75: 0.6338, 1.0: 0.4318}


def build(
    points: int = 101,
    horizon: float = 3.15,
    weights: str = "auto",
    areas: str = "auto",
    force: str = "bond_associated",
    pressure: float = 20.0,
    damping: float = 0.1,
    duration: float = 1.0,
    frames: int = 100,
    safety: float = 0.5,
) -> Simulation:
    sheet = Sheet.rectangle(1.0, 1.0, thickness=0.01, density=1000.0, points=points, areas=point_areas(areas, weights))
    published = pressure == 20.0 and damping == 0.1
    return Simulation(
        sheet,
        force=force_law(force, NeoHookean(mu=1e3, bulk=100e3), horizon, weights),
        loads=[Fixed(sheet.edges("all")), Pressure(pressure)],
        solver=Explicit(duration=duration, frames=frames, damping=damping, safety=safety),
        measures=[Measure("deflection", "m", lambda built, frame: frame.displacement[:, 2].max())],
        outcomes=[
            Outcome("largest_deflection", "m", largest("deflection")),
            *(
                Outcome(
                    f"largest_deflection_at_{time:g}_s",
                    "m",
                    at_time("deflection", time),
                    reference if published else None,
                    "membrane finite elements, Q4, explicit",
                )
                for time, reference in LARGEST.items()
                if time <= duration
            ),
        ],
        section="NN 6.1",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, list(LARGEST))
    plots.surfaces(folder / "deflection.png", shown, field="u3")
    plots.curves(
        folder / "largest_deflection.png",
        history,
        ["deflection"],
        ylabel="largest displacement along z (m)",
        marks=[(t, u) for t, u in LARGEST.items() if t <= history[-1]["time"]],
        marks_label="finite elements",
    )
