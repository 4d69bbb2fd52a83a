"""A wedge opens a strip, and its crack grows in static equilibrium. Griffith's curve, after Rivlin and Thomas (1953).

The strip of `pure_shear_tear`, 4 H long with a cut of 1.25 H, in plane. Both long edges are held; their opening
decreases linearly along the strip to zero at 5 H from its left end, as by a wedge. When the slope of the opening
increases, the crack grows stably, because its energy release rate G decreases towards the hinge. `growth` is its growth
in H.

Griffith: in every equilibrium G(length, slope) = Gc. Ahead of the tip G is H W(stretch) but for 1 to 4 %, see
`stored_energy`. The length of the crack is that of the cut with which an elastic strip stores as much energy;
`length_error` is its largest distance from Griffith's. The last bond that broke, `tip`, lies 1 to 2 lengths of the
damage field behind.
"""

from functools import partial

import numpy as np
from numpy.polynomial.polynomial import polyval2d
from scipy.optimize import brentq

from warp_pd import BondAssociated, Fixed, Measure, Motion, NeoHookean, Newton, Outcome, Simulation, TearingEnergy
from warp_pd.device.checks import InputError, count, finite, positive
from warp_pd.measures import TearLine
from warp_pd.scenes.pure_shear_tear import HEIGHT, MU, THICKNESS, strip

# In heights: length of the strip, where its crack begins, where its edges do not move apart, longest crack.
LENGTH, CUT, HINGE, LONGEST = 4.0, 1.25, 5.0, 3.0
# Energy of elastic strips with cuts of 1 to 3 H at slopes of 0.03 to 0.1, over that of pure shear ahead of the tip,
# from 16, 24 and 32 rows to none: powers of length / H - 2 (down) and slope, a least-squares fit.
STORED = ((1.0138, 0.5156), (-0.0058, 0.1582), (-0.004, 0.06), (0.0004, 0.0195))
# Tearing energies whose curve lies within those slopes [J/m^2].
LEAST, MOST = 1.0, 4.0


def build(
    points: int = 24,
    horizon: float = 2.015,
    tearing_energy: float = 2.0,
    damage_length: float | None = None,
    growth: float = 1.5,
    load_steps: int = 8,
    tolerance: float = 1e-6,
) -> Simulation:
    """Build the scene.

    Args:
        points: Points along the height: rows.
        damage_length: Length of the damage field [m]; by default that of TearingEnergy.
        growth: Growth of Griffith's crack over the height, up to 1.75 [-].
        load_steps: The first one ends where Griffith's crack begins to grow.
    """
    energy = positive("tearing_energy", tearing_energy)
    if not LEAST <= energy <= MOST:
        raise InputError(f"tearing_energy = {energy:g}: expected {LEAST:g} to {MOST:g} J/m^2, where the curve is known")
    if not 0.0 < finite("growth", growth) <= LONGEST - CUT:
        raise InputError(f"growth = {growth:g}: expected a number greater than 0 and at most {LONGEST - CUT:g}")
    begin, end = (griffith_slope(length * HEIGHT, energy) for length in (CUT, CUT + growth))
    times, slopes = [0.0, 1.0 / count("load_steps", load_steps, 2), 1.0], [0.0, begin, end]
    sheet, loads, grips = wedged_strip(points, CUT * HEIGHT, times, slopes)
    damage = TearingEnergy(energy, damage_length, spared=grips)
    line, tip, ahead = TearLine(sheet), (CUT * HEIGHT, 0.5 * HEIGHT), (LENGTH * HEIGHT, 0.5 * HEIGHT)

    def slope(built, frame):
        return float(np.interp(frame.time, times, slopes))

    def from_stiffness(built, frame):
        if frame.time == 0.0:
            return CUT * HEIGHT
        stored = float(built.to_numpy(built.law.strain_energy).sum())
        energy_of = partial(stored_energy, slope=slope(built, frame))
        return length_of(energy_of, stored) if stored > energy_of(LONGEST * HEIGHT) else None

    def griffith(built, frame):
        if frame.time <= times[1]:
            return CUT * HEIGHT
        return length_of(partial(release_rate, slope=slope(built, frame)), energy)

    def growing(history):
        # Beyond the damage that the end of the cut has from the start.
        grown = [row for row in history if row["griffith_length"] > (CUT + 0.4) * HEIGHT]
        return [row for row in grown if not np.isnan(row["crack_length"])]

    def length_error(history):
        errors = [abs(row["crack_length"] / row["griffith_length"] - 1.0) for row in growing(history)]
        return max(errors, default=None)

    def release_ratio(history):
        rates = [release_rate(row["crack_length"], row["slope"]) for row in growing(history)]
        return float(np.mean(rates)) / energy if rates else None

    return Simulation(
        sheet,
        force=BondAssociated(NeoHookean(MU, 100.0 * MU), horizon=horizon),
        loads=loads,
        damage=damage,
        solver=Newton(load_steps=load_steps, tolerance=tolerance),
        measures=[
            Measure("slope", "1", slope),
            Measure("crack_length", "m", from_stiffness),
            Measure("griffith_length", "m", griffith),
            Measure("tip", "m", lambda built, frame: CUT * HEIGHT + line.reach(frame.intact_faces, tip, ahead)),
        ],
        outcomes=[
            Outcome("release_ratio", "1", release_ratio, 1.0, "Griffith: G = Gc, mean of the load steps"),
            Outcome("length_error", "1", length_error),
        ],
        notes=[f"Gc = {energy:.4g} J/m^2; the crack begins to grow at a slope of {begin:.4g}"],
        section="Rivlin and Thomas 1953",
        pictures=pictures,
    )


def wedged_strip(points, cut, times, slopes):
    """The strip with a cut [m], what holds and moves it, and the points of its grips.

    Args:
        times: [s].
        slopes: Opening of the edges divided by the distance from the hinge [-], one per time.
    """
    sheet, *grips = strip(points, LENGTH * HEIGHT, cut)
    loads = [Fixed(np.arange(sheet.size), "z")]
    for sign, grip in zip((1.0, -1.0), grips, strict=True):
        places = sheet.points[grip, 0].round(9)
        for place in np.unique(places):
            y = [0.5 * sign * slope * (HINGE * HEIGHT - place) for slope in slopes]
            loads.append(Motion(grip[places == place], times, x=0.0, y=y))
    return sheet, loads, np.concatenate(grips)


def pure_shear_energy(length, slope):
    """Energy of a strip that is in pure shear from the tip to its end, and unloaded behind [J]."""

    def integral(opening):
        stretch = 1.0 + opening
        return 0.5 * ((stretch**3 - 1.0) / 3.0 - 2.0 * opening + 1.0 - 1.0 / stretch)

    ahead = integral(slope * (HINGE - length / HEIGHT)) - integral(slope * (HINGE - LENGTH))
    return MU * THICKNESS * HEIGHT**2 * ahead / slope


def stored_energy(length, slope):
    """Energy of an elastic strip with a cut of a length [m] at a slope [J]."""
    return pure_shear_energy(length, slope) * polyval2d(length / HEIGHT - 2.0, slope, STORED)


def release_rate(length, slope):
    """Energy release rate G of a cut of a length [m] at a slope [J/m^2]."""
    step = 1e-4 * HEIGHT
    return (stored_energy(length - step, slope) - stored_energy(length + step, slope)) / (2.0 * step * THICKNESS)


def length_of(falling, value):
    """Length [m] at which a decreasing function has a value; clipped to the ends of its range."""
    shortest, longest = CUT * HEIGHT, LONGEST * HEIGHT
    if value >= falling(shortest):
        return shortest
    return longest if value <= falling(longest) else float(brentq(lambda a: falling(a) - value, shortest, longest))


def griffith_slope(length, energy):
    """Slope at which Griffith's crack has a length [m]."""
    return float(brentq(lambda slope: release_rate(length, slope) - energy, 1e-3, 1.0))


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [history[k]["time"] for k in (1, len(history) // 2, -1)])
    plots.from_above(folder / "damage.png", shown, field="damage", limits=(0.0, 1.0))
    plots.curves(
        folder / "length.png", history[1:], ["crack_length", "griffith_length", "tip"], ylabel="length (m)",
        against="slope", xlabel="slope",
    )  # fmt: skip
