"""A rubber sheet stretched in its plane, with or without a hole, a crack or an inclusion. HE thesis, chapter 5.

0.5 x 0.5 x 0.01 m, incompressible neo-Hookean, E 0.109 GPa, mu = E/3; hole and inclusion of radius 0.08 m, crack of
0.16 m along y. `mode` sets how the edges move at the stretch l:

    equibiaxial   all four edges move apart by l;      planar   left and right do, the other two keep their distance;
    uniaxial      left and right move apart, the other two are free.

The bond-based laws, `bond_based` as published and `bond_based_refitted`, are made for one mode each; `law` gives them
the constants of another mode. They need points at the centres of cells and layers of points outside the sheet as wide
as the horizon (HE section 4.3), which move as in a uniform stretch: in the direction across the edge (`grip` =
roller) or in both (`clamp`). `bond_associated` needs no mode and no layers; its points lie on the
edges, those of the hole, the crack and the inclusion too. The default of 32 points takes seconds, uniaxial half a
minute; the paper takes `--points 100` (equibiaxial, planar) and `--points 50` (uniaxial). The crack's gap of 5 mm is
the spacing of those 100 points: here it has none. `inclusion` is rigid, `stiff_inclusion` the same rubber 100 times as
stiff. Cracks grow with `critical_stretch`, which the thesis leaves to future work.

The scene reports the force on the right edge at the last stretch, next to the exact one of the sheet without defect or
that of membrane finite elements, edges on rollers. A uniaxial sheet with a defect is compressed across the pull over
17 to 58 % of its area: a real one wrinkles there, and plane solutions, these and the paper's, stop being physical.
"""

from dataclasses import replace

import numpy as np

from warp_pd import (
    BondAssociated,
    BondNeoHookean,
    Circle,
    CriticalStretch,
    Fixed,
    HyperelasticBonds,
    InputError,
    Measure,
    Mirror,
    MooneyRivlin,
    Motion,
    Newton,
    Relaxation,
    Sheet,
    Simulation,
)
from warp_pd.device.checks import count, finite, one_of, positive
from warp_pd.interfaces import Law, Solver
from warp_pd.measures import TearLine, support_force
from warp_pd.papers.hyperelastic_bonds import MODES, exact_traction

SIDE, THICKNESS, MU, DENSITY = 0.5, 0.01, 0.109e9 / 3.0, 1000.0
HALF, RADIUS, CRACK = 0.5 * SIDE, 0.08, 0.16
HORIZON = {"equibiaxial": 3.015, "planar": 3.015, "uniaxial": 9.015}
STIFF = 100.0
# Force on the right edge of the sheet with a defect [N], edges on rollers, by mode and stretch: tests/references.
ELEMENTS = {
    "hole": {
        "equibiaxial": {1.5: 202.989e3, 2.0: 301.244e3, 2.5: 383.708e3, 3.0: 462.646e3},
        "planar": {1.5: 176.584e3, 2.0: 282.806e3, 2.5: 371.988e3, 3.0: 455.026e3},
        "uniaxial": {1.5: 158.435e3, 2.0: 266.067e3, 2.5: 358.133e3, 3.0: 443.769e3},
    },
    "crack": {
        "equibiaxial": {1.5: 224.788e3, 2.0: 328.240e3, 2.5: 416.542e3, 3.0: 501.741e3},
        "planar": {1.5: 194.404e3, 2.0: 309.358e3, 2.5: 405.159e3, 3.0: 494.512e3},
        "uniaxial": {1.5: 171.207e3, 2.0: 288.238e3, 2.5: 388.196e3, 3.0: 481.055e3},
    },
    "inclusion": {
        "equibiaxial": {1.5: 267.664e3, 2.0: 390.422e3, 2.5: 500.324e3, 3.0: 607.952e3},
        "planar": {1.5: 239.798e3, 2.0: 375.293e3, 2.5: 491.787e3, 3.0: 602.748e3},
        "uniaxial": {1.5: 214.282e3, 2.0: 355.243e3, 2.5: 476.959e3, 3.0: 591.566e3},
    },
}
# The uniaxial sheet without defect in grips that hold its width, likewise.
GRIPPED = {1.5: 200.42e3, 2.0: 326.49e3, 2.5: 432.34e3, 3.0: 530.80e3, 3.5: 625.99e3, 4.0: 719.51e3}
DEFECTS, GRIPS = ("none", "hole", "crack", "inclusion", "stiff_inclusion"), ("roller", "clamp")
LAYERS = ("uniform", "mirror")
LAWS = ("bond_based", "bond_based_refitted", "bond_associated")


def build(
    points: int = 32,
    horizon: float | None = None,
    mode: str = "equibiaxial",
    defect: str = "none",
    stretch: float = 3.0,
    force: str = "bond_based",
    law: str = "auto",
    grip: str = "roller",
    weights: str = "auto",
    solver: str = "auto",
    tolerance: float | None = None,
    critical_stretch: float | None = None,
    layers: str = "uniform",
) -> Simulation:
    """Build the scene.

    Args:
        critical_stretch: Stretch at which the bonds of bond-based laws break [-], in load steps of 0.02; None: never.
        defect: none, hole, crack, inclusion or stiff_inclusion.
        law: Mode whose constants the bonds use; auto: the scene's.
        grip: Held directions at the edges: roller, only across the edge; clamp, both.
        layers: Motion of the layers outside: uniform, as in a uniform stretch; mirror, as mirror images of the sheet
            (HE eqs. 98, 99).
    """
    one_of("mode", mode, MODES)
    one_of("defect", defect, DEFECTS)
    one_of("law", law, ("auto", *MODES))
    one_of("grip", grip, GRIPS)
    one_of("layers", layers, LAYERS)
    if not 1.0 < finite("stretch", stretch) <= 4.0:
        raise InputError(f"stretch = {stretch!r}: expected a stretch greater than 1 and at most 4")
    bonds = one_of("force", force, LAWS) != "bond_associated"
    if not bonds and law != "auto":
        raise InputError(f"law = {law!r}: expected 'auto' with force 'bond_associated', which has no mode")
    if not bonds and layers != "uniform":
        raise InputError(f"layers = {layers!r}: expected 'uniform' with force 'bond_associated', which has none")
    if bonds and weights != "auto":
        raise InputError(f"weights = {weights!r}: expected 'auto' with force {force!r}")
    if critical_stretch is not None and not bonds:
        raise InputError(f"critical_stretch = {critical_stretch!r}: expected None with force 'bond_associated'")
    if horizon is None:
        horizon = HORIZON[mode] if bonds else 2.015
    positive("horizon", horizon)
    if bonds:
        sheet = with_defect(whole_sheet(points, horizon, mode), defect)
    else:
        sheet = outlined(points, defect)
    edge = sheet.where(lambda x, y: (x >= HALF * (1.0 - 1e-9)) & (np.abs(y) <= HALF * (1.0 + 1e-9)))
    chosen: Law
    if bonds:
        fit = "published" if force == "bond_based" else "refitted"
        chosen = HyperelasticBonds(BondNeoHookean(MU, mode if law == "auto" else law, fit), horizon=horizon)
    else:
        chosen = BondAssociated(MooneyRivlin(0.5 * MU), horizon=horizon, weights=weights)
    # One frame per 0.5 of stretch, where it divides evenly.
    steps = max(1, round((stretch - 1.0) / (0.5 if critical_stretch is None else 0.02)))
    solvers: dict[str, Solver] = {
        "newton": Newton(tolerance=tolerance, load_steps=steps),
        "relaxation": Relaxation(
            tolerance=tolerance, load_steps=steps, ramp_steps=10 * points,
            # At a crack in 100 x 100 points the bond laws diverge at 0.9 times the estimated step.
            safety=0.5 if bonds and defect == "crack" else 0.9,
        ),
    }  # fmt: skip
    solvers["auto"] = solvers["relaxation" if bonds or "inclusion" in defect else "newton"]
    # The points of the sheet nearest to the middle line along y.
    near = np.abs(sheet.points[:, 0]) < 0.6 * sheet.spacing
    middle = np.flatnonzero(near & (np.abs(sheet.points[:, 1]) <= HALF * (1.0 + 1e-9)))
    extent = np.ptp(sheet.points[middle, 1])
    even = {"equibiaxial": stretch, "planar": 1.0, "uniaxial": stretch**-0.5}[mode]
    value, source = reference(mode, defect, grip, stretch)
    if critical_stretch is not None:
        value = None
    line = TearLine(sheet)
    growing = [
        Measure("crack_growth", "m", lambda built, frame: line.length(frame.intact_faces)),
        Measure("pieces", "1", lambda built, frame: line.pieces(frame.intact_faces)),
    ] * (critical_stretch is not None)
    outside = sheet.where(lambda x, y: np.maximum(np.abs(x), np.abs(y)) > HALF * (1.0 + 1e-9))
    return Simulation(
        sheet,
        force=chosen,
        loads=[
            *supports(sheet, mode, grip, stretch, torn=critical_stretch is not None, moves=layers == "uniform"),
            *([mirrored(sheet, mode, grip, stretch)] if layers == "mirror" else []),
        ],
        solver=solvers[one_of("solver", solver, solvers)],
        measures=[
            Measure("stretch", "1", lambda built, frame: 1.0 + (stretch - 1.0) * frame.time),
            Measure("edge_force", "N", lambda built, frame: support_force(built, edge)[0], value, source),
            Measure(
                "stretch_across",
                "1",
                lambda built, frame: np.ptp(sheet.points[middle, 1] + frame.displacement[middle, 1]) / extent,
                even if defect == "none" and grip == "roller" else None,
                "exact, incompressible neo-Hookean",
            ),
            *openings(sheet, defect),
            *growing,
        ],
        damage=None if critical_stretch is None else CriticalStretch(critical_stretch, spared=outside),
        section="HE 5",
        pictures=pictures,
        notes=["compressed across the pull: a real sheet wrinkles there, plane solutions stop being physical"]
        if mode == "uniaxial" and defect != "none"
        else [],
    )


def openings(sheet: Sheet, defect: str) -> list[Measure]:
    """Displacement from the centre [m] of a hole's rim on the x and y axes, or of a crack's face and tip.

    On a sheet of cells the nearest points are used, up to 0.7 spacings away.
    """
    if defect not in ("hole", "crack"):
        return []
    side, top = (RADIUS if defect == "hole" else 0.0, 0.0), (0.0, RADIUS if defect == "hole" else 0.5 * CRACK)
    apart = np.hypot(*(sheet.points - np.array(side)).T)
    near, tip = np.flatnonzero(apart < apart.min() + 1e-3 * sheet.spacing), sheet.nearest(*top)
    return [
        Measure("opening_x", "m", lambda built, frame: frame.displacement[near, 0].max()),
        Measure("opening_y", "m", lambda built, frame: frame.displacement[tip, 1]),
    ]


def whole_sheet(points: int, horizon: float, mode: str) -> Sheet:
    """The sheet of bond-based laws without defect, centred at the origin: points in cells, layers of points outside."""
    layers = int(horizon + 1e-6)
    return Sheet.rectangle(
        SIDE, SIDE, thickness=THICKNESS, density=DENSITY, points=points, origin=(-HALF, -HALF), centred=True,
        layers=(layers, layers if mode != "uniaxial" else 0),
    )  # fmt: skip


def with_defect(sheet: Sheet, defect: str) -> Sheet:
    """The sheet of bond-based laws with a defect, whose edge is a staircase of cells."""
    if defect == "hole":
        # As in the paper, every remaining point represents its cell.
        holed = sheet.hole((0.0, 0.0), RADIUS)
        return replace(holed, areas=np.full(holed.size, sheet.areas[0]))
    if defect == "crack":
        return sheet.cut((0.0, -0.5 * CRACK), (0.0, 0.5 * CRACK))
    if defect == "inclusion":
        return sheet.inclusion((0.0, 0.0), RADIUS)
    if defect == "stiff_inclusion":
        return stiff_inside(sheet)
    return sheet


def outlined(points: int, defect: str) -> Sheet:
    """The sheet of the bond-associated law, centred at the origin, with points on all edges and on the defect."""
    if defect in ("none", "stiff_inclusion"):
        sheet = Sheet.rectangle(
            SIDE, SIDE, thickness=THICKNESS, density=DENSITY, points=points, origin=(-HALF, -HALF)
        )  # fmt: skip
        return sheet if defect == "none" else stiff_inside(sheet)
    circle = Circle((0.0, 0.0), RADIUS)
    return Sheet.outline(
        [(-HALF, -HALF), (HALF, -HALF), (HALF, HALF), (-HALF, HALF)],
        spacing=SIDE / (count("points", points, 2) - 1),
        thickness=THICKNESS,
        density=DENSITY,
        holes=[circle] if defect == "hole" else [],
        cracks=[[(0.0, -0.5 * CRACK), (0.0, 0.5 * CRACK)]] if defect == "crack" else [],
        inclusions=[circle] if defect == "inclusion" else [],
    )


def stiff_inside(sheet: Sheet) -> Sheet:
    return sheet.stiffened(sheet.within((0.0, 0.0), RADIUS), STIFF)


def mirrored(sheet: Sheet, mode: str, grip: str, stretch: float) -> Mirror:
    """The layers outside as mirror images of the sheet: across the edges, with grips along them too."""
    across = {"equibiaxial": stretch, "planar": 1.0, "uniaxial": 1.0}[mode]
    outside = np.abs(sheet.points) > HALF * (1.0 + 1e-9)
    if mode == "uniaxial":
        outside[:, 1] = False
    points = np.flatnonzero(outside.any(axis=1))
    beyond, at = outside[points], sheet.points[points]
    edge = np.where(beyond, np.sign(at) * HALF, at)
    images = [sheet.nearest(*place) for place in 2.0 * edge - at]
    held = beyond if grip == "roller" else np.ones_like(beyond)
    return Mirror(points, images, edge * (stretch - 1.0, across - 1.0), held)


def supports(
    sheet: Sheet, mode: str, grip: str, stretch: float, torn: bool = False, moves: bool = True
) -> list[Fixed | Motion]:
    """Motions of the edges, or of the layers outside, as in a uniform stretch, and in-plane supports of all points.

    Without `moves` the layers do not move so.
    """
    x, y = np.abs(sheet.points).T >= HALF * (1.0 - 1e-9)
    across = {"equibiaxial": stretch, "planar": 1.0, "uniaxial": 1.0}[mode]
    if mode == "uniaxial":
        y[:] = False
    moved = {"x": (x, stretch), "y": (y, across)} if grip == "roller" else {"x": (x | y, stretch), "y": (x | y, across)}
    loose = np.setdiff1d(np.arange(sheet.size), np.concatenate([[], *sheet.inclusions]))
    loads: list[Fixed | Motion] = [Fixed(loose, "z")]
    for c, (name, (held, goal)) in enumerate(moved.items() if moves else ()):
        # Points with the same coordinate move together; round-off separates them by far less than a spacing.
        place = np.round(sheet.points[:, c] / (1e-3 * sheet.spacing)).astype(int)
        for where in np.unique(place[held]):
            points = np.flatnonzero(held & (place == where))
            shift = (goal - 1.0) * sheet.points[points, c].mean()
            loads.append(Motion(points, times=[0.0, 1.0], **{name: [0.0, shift]}))
    if not moved["y"][0].any():
        # Both halves, once a crack has crossed the sheet.
        ends = (-HALF, HALF) if torn else (-HALF,)
        loads.append(Fixed([sheet.nearest(x, 0.0) for x in ends], "y"))
    return loads


def reference(mode: str, defect: str, grip: str, stretch: float) -> tuple[float | None, str]:
    """Reference force on an edge [N] and its source, if known."""
    if defect == "none" and (mode != "uniaxial" or grip == "roller"):
        return MU * SIDE * THICKNESS * exact_traction(mode, stretch), "exact, incompressible neo-Hookean"
    if defect == "none":
        return GRIPPED.get(stretch), "membrane finite elements, Q9, width held in the grips"
    if grip == "roller":
        return ELEMENTS.get(defect, {}).get(mode, {}).get(stretch), "finite elements, tools/references"
    return None, ""


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [row["time"] for row in history[1:]])
    plots.from_above(folder / "u1.png", shown, field="u1")
    plots.from_above(folder / "u2.png", shown, field="u2")
    plots.curves(
        folder / "force.png",
        history,
        ["edge_force"],
        "force on the right edge (N)",
        against="stretch",
        xlabel="stretch",
    )
