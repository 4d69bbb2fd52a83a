"""A sheet with a crack is stretched equally along x and y. VE paper, sections 6.3, 6.7 (figures 12 to 14, 22 to 25).

0.5 x 0.5 x 0.01 m, a crack of 0.1 m along y in the middle, polyurea of table 2, 100 x 100 points, horizon 3.015.

By default the crack does not grow (figures 12 and 13: stretches of 1.5 and 4, no Prony term; figures 22 and 23: viscous
= True, stretch = 1.5 and 2.5, at 0.15 /s): as in visco_hole, in static equilibrium or with exaggerated density.

With failure = True the crack grows: rate 205 /s without Prony term, 159.4 /s with it, Gc 6.69 N/m, density 1100 kg/m^3
(not given). The sheet starts with the velocity of uniform stretching: pulled only at its edges, it could not follow
them (51 m/s against waves of some 35 m/s). The paper shows damage at 22, 23, 24 and 25 ms (hyperelastic) and 25, 29,
30 and 31 ms (visco-hyperelastic), stretches of 5 and more. Its numbers do not allow that: the first bonds of a
uniform sheet have released Gc / Nc at a stretch of 1.0013 by the published law, which is under tension from the start,
and of 1.017 by the stress-free one: after 6 and 85 microseconds. With moduli in MPa the printed number would be 6.69
MN/m, and that fits: with `energy`, 6.69e6 N/m by default, the published law begins to tear at 20.6 to 21.0 ms, and at
26 ms with the Prony term (40 to 60 points).

Material that snaps at such stretches is pushed together by its recoil, where a real sheet wrinkles. In the stress-free
law it stiffens as 1/width^4, faster than the step follows, and the run diverges some milliseconds after tears begin.
`wrinkles` = "relaxed", the default without a Prony term, gives the sheet the energy of tension field theory; it runs to
its end. With "resolved", the default with one, it resists compression, and needs steps a quarter as long. A
`roughness`, in spacings, lets it buckle.
"""

import math

import numpy as np

from warp_pd import (
    BondAssociated,
    CriticalEnergy,
    Explicit,
    Fixed,
    Measure,
    Newton,
    Outcome,
    Prony,
    Relaxation,
    Sheet,
    Simulation,
    Visco,
    ViscoBondBased,
    Yeoh,
)
from warp_pd.device.checks import InputError, not_negative, one_of, positive
from warp_pd.interfaces import Solver
from warp_pd.materials import WRINKLES, with_wrinkles
from warp_pd.measures import TearLine, time_above
from warp_pd.parts import stretching_edges
from warp_pd.shapes.roughness import rough_surface

SIZE, THICKNESS, CRACK = 0.5, 0.01, 0.1
POLYUREA = Yeoh(c10=0.1996e6, c20=0.0170e6)
TERM = Prony(c10=0.01733e6, c20=0.0015e6, time=0.9466, exponent=1.6665)
# Opening [m] and nominal stress [Pa] of the crack that does not grow, without Prony term: tests/references/visco.json.
OPENING = {1.5: 0.098503, 2.5: 0.198402, 4.0: 0.326706}
STRESS = {1.5: 0.68105e6, 2.5: 2.52826e6, 4.0: 9.19155e6}
# Time between frames of a crack that runs [s]: the printed times are frames.
FRAME = 0.25e-3
SHOWN = {False: (0.022, 0.023, 0.024, 0.025), True: (0.025, 0.029, 0.030, 0.031)}


def build(
    points: int = 40,
    horizon: float = 3.015,
    law: str = "stress_free",
    viscous: bool = False,
    failure: bool = False,
    stretch: float = 1.5,
    rate: float | None = None,
    energy: float = 6.69e6,
    density: float | None = None,
    roughness: float = 1e-2,
    load_steps: int = 6,
    tolerance: float | None = None,
    safety: float | None = None,
    wrinkles: str = "auto",
) -> Simulation:
    """Build the scene.

    Args:
        law: "stress_free", or "published", which is under tension when undeformed.
        viscous: Whether the rubber has a Prony term; the sheet then moves in time.
        failure: Whether bonds break.
        rate: Rate of stretching [1/s]; None: 0.15, with failure 205, or 159.4 with a Prony term.
        energy: Tearing energy Gc of the bonds [N/m].
        density: Density [kg/m^3]; None: 2e6, and 1100 with failure.
        wrinkles: "relaxed": the energy of tension field theory; "resolved"; "auto": resolved with a Prony term.
    """
    if positive("stretch", stretch) <= 1.0:
        raise InputError(f"stretch = {stretch!r}: expected a stretch greater than 1")
    published = one_of("law", law, ("stress_free", "published")) == "published"
    if rate is None:
        rate = (159.4 if viscous else 205.0) if failure else 0.15
    if density is None:
        density = 1100.0 if failure else 2e6
    positive("rate", rate)
    positive("density", density)
    positive("energy", energy)
    not_negative("roughness", roughness)
    moving = viscous or failure
    duration = SHOWN[viscous][-1] if failure else (stretch - 1.0) / rate if viscous else 1.0
    last = 1.0 + rate * duration if failure else stretch
    # The published law's stress at a point depends on the complete families of its neighbours.
    outside = math.ceil(positive("horizon", horizon)) * (2 if published else 1)
    layers = (outside, outside)
    sheet = Sheet.rectangle(
        SIZE,
        SIZE,
        thickness=THICKNESS,
        density=density,
        points=points + points % 2,
        origin=(-0.25, -0.25),
        layers=layers,
    ).cut((0.0, -0.5 * CRACK), (0.0, 0.5 * CRACK))
    if one_of("wrinkles", wrinkles, ("auto", *WRINKLES)) == "auto":
        wrinkles = "relaxed" if failure and not published and not viscous else "resolved"
    if wrinkles == "relaxed" and (published or viscous):
        raise InputError("wrinkles = 'relaxed': expected 'resolved' with law 'published' or a Prony term")
    if safety is None:
        # The sheet stiffens by a factor of ten and more while it tears, faster than the stable step is updated.
        crushed = failure and not published and wrinkles == "resolved"
        safety = 0.005 if crushed else 0.02 if failure else 0.5
    material = with_wrinkles(POLYUREA, wrinkles)
    prony = (TERM,) if viscous else ()
    solver: Solver = Newton(tolerance=tolerance, load_steps=load_steps)
    if moving:
        solver = Explicit(
            duration,
            frames=round(duration / FRAME) if failure else 20,
            damping=0.0 if failure else 2.0 * rate,
            safety=safety,
        )
    elif published:
        solver = Relaxation(tolerance=tolerance, load_steps=load_steps, ramp_steps=10 * points)
    force = (
        ViscoBondBased(POLYUREA, horizon, prony=prony) if published
        else Visco(material, horizon=horizon, prony=prony) if moving
        else BondAssociated(material, horizon=horizon)
    )  # fmt: skip
    spacing = sheet.spacing
    faces = [sheet.nearest(side * 0.5 * spacing, 0.0) for side in (-1.0, 1.0)]
    edge = sheet.where(lambda x, y: np.maximum(np.abs(x), np.abs(y)) > 0.5 * SIZE - 1e-3 * spacing)
    layer = sheet.where(lambda x, y: (x > 0.5 * SIZE - 1e-9) & (np.abs(y) < 0.5 * SIZE + 1e-9))
    line = TearLine(sheet)

    def opening(built, frame):
        return frame.displacement[faces[1], 0] - frame.displacement[faces[0], 0]

    def stress(built, frame):
        return -built.to_numpy(built.state.force)[layer, 0].sum() / (SIZE * THICKNESS)

    opened, pulled = (None, None) if moving else (OPENING.get(stretch), STRESS.get(stretch))
    source = "membrane finite elements"
    measures = [
        Measure("stretch", "1", lambda built, frame: 1.0 + (last - 1.0) * frame.time / duration),
        Measure("crack_opening", "m", opening, opened, source),
        Measure("nominal_stress", "Pa", stress, pulled, source),
    ]
    outcomes = []
    if failure:
        measures.append(Measure("crack_length", "m", lambda built, frame: line.length(frame.intact_faces)))
        begin, figure = SHOWN[viscous][0], "VE figure 24" if viscous else "VE figure 14"
        outcomes = [Outcome("damage_begins", "s", time_above("largest_damage", 0.0), begin, figure),
                    Outcome("half_damaged", "s", time_above("mean_damage", 0.5))]  # fmt: skip
    return Simulation(
        sheet,
        force=force,
        loads=[
            Fixed(edge if failure else range(sheet.size), "z"),
            *stretching_edges(sheet, 0.5 * SIZE, [0.0, duration], [1.0, last]),
        ],
        damage=CriticalEnergy(energy, spared=edge) if failure else None,
        solver=solver,
        initial_velocity=np.column_stack([rate * sheet.points, np.zeros(sheet.size)]) if moving else None,
        initial_displacement=rough_surface(sheet, roughness, 0, edge) if failure else None,
        measures=measures,
        outcomes=outcomes,
        section="VE 6.3 and 6.7",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    if "mean_damage" in history[0]:
        times = SHOWN[history[-1]["time"] > 0.028]
        shown = plots.frames_at(folder, times)
        plots.reference(folder / "damage.png", shown, field="damage", limits=(0.0, 1.0))
        plots.from_above(folder / "deformed.png", shown[-1:], field="damage", limits=(0.0, 1.0))
        plots.curves(folder / "damage_history.png", history, ["largest_damage", "mean_damage"], ylabel="damage")
        return
    shown = plots.frames_at(folder, [history[-1]["time"]])
    plots.from_above(folder / "displacement_x.png", shown, field="u1")
    plots.from_above(folder / "displacement_y.png", shown, field="u2")
    plots.curves(
        folder / "opening.png", history, ["crack_opening"], ylabel="opening (m)", against="stretch", xlabel="stretch"
    )  # fmt: skip
