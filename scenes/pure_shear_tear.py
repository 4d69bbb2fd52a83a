"""A strip held along both long edges is pulled across, and a crack runs along it. Rivlin and Thomas (1953).

H = 40 mm high, 3.5 H long, 1 mm thick, mu 1 kPa, rho 1000 kg/m^3, with a cut of 1.25 H along its middle from the left.
Far ahead of the tip the sheet is in pure shear: when the crack grows by da, a piece da of pure shear is unloaded. The
energy release rate is therefore exactly G = H W(stretch), whatever the length of the crack. The sheet must tear when G
reaches the tearing energy Gc: `onset_ratio` is G / Gc when the tip has moved by `advance` spacings. A free end narrows,
and what is ahead of the tip then stores less than W: in Mooney-Rivlin rubber G is 1 to 3 % below H W. With `far_end` =
"held" the end keeps its place along the strip, and pure shear reaches up to it.

`tearing_energy` is Gc [J/m^2]. The edges move apart until G is `overload` times Gc, slow against waves, and most slowly
from 0.9 to 1.15 Gc, where it may tear: while the tear runs G goes on growing. `material` is one of MATERIALS;
with `wrinkles` = "relaxed" it wrinkles more finely than the spacing, with "resolved" it does not. Clamps pull the strip
along the tear, too, unless they are shorter than it: with `along` below 1 / sqrt(stretch) it is in uniaxial tension, as
ahead of the tip of `trousers`.
"""

import math

import numpy as np

from warp_pd import (
    ArrudaBoyce,
    BondAssociated,
    Explicit,
    Fixed,
    Gent,
    Measure,
    MooneyRivlin,
    Motion,
    NeoHookean,
    Ogden,
    Outcome,
    Sheet,
    Simulation,
    TearingEnergy,
    Yeoh,
)
from warp_pd.device.checks import InputError, count, finite, one_of, positive
from warp_pd.materials import energy_density, stretch_of_density, with_wrinkles
from warp_pd.measures import TearLine, support_force, worst_balance
from warp_pd.shapes.roughness import rough_surface

HEIGHT, THICKNESS, DENSITY, MU = 0.04, 1e-3, 1000.0, 1e3
LENGTH, CUT = 3.5 * HEIGHT, 1.25 * HEIGHT
# G / Gc between which the strip is pulled most slowly.
SLOW = (0.9, 1.15)
MATERIALS = {
    "neo_hookean": NeoHookean(MU, 100.0 * MU),
    "gent_160": Gent(MU, 100.0 * MU, 160.0),
    "gent_20": Gent(MU, 100.0 * MU, 20.0),
    "mooney_rivlin": MooneyRivlin(0.4 * MU, 0.1 * MU),
    "ogden": Ogden((1.2 * MU, 0.088 * MU), (1.3, 5.0)),
    "yeoh": Yeoh(0.5 * MU, 0.01 * MU),
    "arruda_boyce": ArrudaBoyce(MU, 5.0),
}


def build(
    points: int = 40,
    horizon: float = 2.015,
    material: str = "neo_hookean",
    wrinkles: str = "relaxed",
    far_end: str = "free",
    along: float = 1.0,
    tearing_energy: float = 2.0,
    damage_length: float | None = None,
    overload: float = 1.5,
    advance: float = 10.0,
    duration: float = 3.0,
    damping: float = 5.0,
    frames: int = 200,
    roughness: float = 1e-3,
    turn: float = 0.0,
    jitter: float = 0.0,
    seed: int = 0,
) -> Simulation:
    """Build the scene.

    Args:
        points: Points along the height: rows.
        far_end: "free", or "held": the end away from the cut keeps its place along the strip.
        along: Stretch along the strip at which its clamps hold it, up to 1 [-].
        damage_length: Length of the damage field [m]; by default that of TearingEnergy.
        advance: Growth of the crack at which its onset is read, in spacings.
    """
    sheet_material = with_wrinkles(MATERIALS[one_of("material", material, tuple(MATERIALS))], wrinkles)
    sheet, top, bottom = strip(points, LENGTH, CUT, turn=turn, jitter=jitter, seed=seed)
    spacing, grips = sheet.spacing, np.concatenate([top, bottom])
    energy = positive("tearing_energy", tearing_energy)
    damage = TearingEnergy(energy, length=damage_length, spared=grips)
    held = one_of("far_end", far_end, ("free", "held")) == "held"
    end = [Fixed(np.setdiff1d(sheet.edges("right"), grips), "x")] if held else []
    if not 0.0 < finite("along", along) <= 1.0:
        raise InputError(f"along = {along:g}: expected a number greater than 0 and at most 1")
    if along < 1.0 and wrinkles != "relaxed":
        raise InputError(f"along = {along:g} with wrinkles = {wrinkles!r}: expected 1, or wrinkles that are relaxed")
    start = rough_surface(sheet, roughness, seed, grips)
    start[:, 0] += (along - 1.0) * sheet.points[:, 0]
    positive("overload", overload)
    levels = SLOW[0] * min(overload, 1.0), min(SLOW[1], overload), overload
    times = [fraction * positive("duration", duration) for fraction in (0.0, 0.25, 0.85, 1.0)]
    stretches = [1.0, *(stretch_at(sheet_material, level * energy / HEIGHT, along) for level in levels)]
    travel = [0.5 * (stretch - 1.0) * HEIGHT for stretch in stretches]
    line = TearLine(sheet)
    tip, ahead = (CUT, 0.5 * HEIGHT), (LENGTH, 0.5 * HEIGHT)
    positive("advance", advance)

    def stretch(built, frame):
        return float(np.interp(frame.time, times, stretches))

    def released(built, frame):
        density = energy_density(sheet_material, stretch(built, frame), along, built.context.device)
        return float(density) * HEIGHT / energy

    def onset(history):
        return next((row["release_ratio"] for row in history if row["tip"] > advance * spacing), None)

    def slope(history, key, over):
        """Slope of a number against another while the tear runs, away from both of its ends.

        A tip that waits and then crosses the strip between two frames has no slope.
        """
        running = [row for row in history if advance * spacing < row["tip"] < 2.0 * HEIGHT]
        if len(running) < 3 or running[-1]["tip"] - running[0]["tip"] < 0.5 * HEIGHT:
            return None
        return float(np.polyfit([row[over] for row in running], [row[key] for row in running], 1)[0])

    def released_ratio(history):
        per_length = slope(history, "rupture", "tip")
        return per_length and per_length / (energy * THICKNESS)

    def speed(history):
        return slope(history, "tip", "time")

    return Simulation(
        sheet,
        force=BondAssociated(sheet_material, horizon=horizon),
        loads=[
            Motion(top, times=times, y=travel, z=0.0),
            Motion(bottom, times=times, y=[-y for y in travel], z=0.0),
            Fixed(grips, "x"),
            *end,
        ],
        damage=damage,
        initial_displacement=start,
        solver=Explicit(duration=duration, frames=count("frames", frames, 1), damping=damping),
        measures=[
            Measure("stretch", "1", stretch),
            Measure("release_ratio", "1", released),
            Measure("load", "N", lambda built, frame: support_force(built, top)[1]),
            Measure("tip", "m", lambda built, frame: line.reach(frame.intact_faces, tip, ahead)),
            Measure("crack_length", "m", lambda built, frame: line.length(frame.intact_faces)),
        ],
        outcomes=[
            Outcome("onset_ratio", "1", onset, 1.0, "Rivlin and Thomas 1953: G = H W"),
            Outcome("released_ratio", "1", released_ratio, 1.0, "energy lost to tearing over Gc times new area"),
            Outcome("crack_speed", "m/s", speed),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        notes=[f"Gc = {energy:.4g} J/m^2; the strip is stretched to {stretches[-1]:.4g}"],
        section="Rivlin and Thomas 1953",
        pictures=pictures,
    )


def even_rows(points):
    """Number of rows of points across a cut along the middle."""
    if count("points", points, 8) % 2:
        raise InputError(f"points = {points}: expected an even number, so that the cut lies between two rows")
    return points


def strip(points, length, cut, **grid):
    """A strip of HEIGHT with a cut along its middle, and its points on the upper and the lower edge."""
    rows = even_rows(points)
    sheet = Sheet.filled(
        length, HEIGHT, thickness=THICKNESS, density=DENSITY, points=(round(length / HEIGHT * rows), rows), **grid
    ).cut((-HEIGHT, 0.5 * HEIGHT), (cut, 0.5 * HEIGHT))
    return sheet, sheet.edges("top"), sheet.edges("bottom")


def stretch_at(material, density, along=1.0):
    """Stretch of pure shear, or at another stretch along the strip, at an energy density [J/m^3]."""
    found = stretch_of_density(
        lambda stretches: energy_density(material, stretches, along), density, np.geomspace(1.0, 100.0, 400)
    )
    if math.isnan(found):
        raise InputError(
            f"tearing_energy and overload: expected an energy density that the sheet bears, got {density:g} J/m^3"
        )
    return found


def pictures(history, folder):
    from warp_pd.viewer import plots

    begin = next((row["time"] for row in history if row["tip"] > 0.0), history[-1]["time"])
    shown = plots.frames_at(folder, [begin, 0.5 * (begin + history[-1]["time"]), history[-1]["time"]])
    plots.from_above(folder / "damage.png", shown, field="damage", limits=(0.0, 1.0))
    plots.curves(
        folder / "release.png", history, ["release_ratio"], ylabel="G / Gc", against="stretch", xlabel="stretch"
    )
    plots.curves(folder / "tip.png", history, ["tip"], ylabel="advance of the tip (m)")
    plots.curves(folder / "energy.png", history, plots.ENERGIES, ylabel="energy (J)")
