"""A strip with a notch in one edge is pulled until the notch runs.

A strip of w = 40 mm x 60 mm x 1 mm, mu 1 kPa, rho 1000 kg/m^3, with a notch of `notch` in the middle of its left edge.
Its ends are pulled apart and may narrow, so that the strip is in uniaxial tension. The energy release rate is

    G = 2 k a W(stretch),

with the energy density W of uniaxial tension. Finite elements give the factor k, of the length a over w and of the
stretch (tests/references/torn.json). They have the energy of this sheet, which bears no compression. A sheet that does
has k = 2.66 at a = w / 5 and a stretch of 1.2; 3 / sqrt(stretch) = 2.74 is Greensmith's (1963), for short notches. Here
k is 3.3: where nothing is compressed, tension does not spread behind the notch, and the sheet there goes slack.

A notch runs when the damage that the load has made ahead of its tip has the energy of a crack that is longer by pi / 4
damage lengths. That much is counted: a = notch + pi / 4 length. `onset_ratio` is G over the tearing energy when the
load is largest.
"""

import numpy as np

from warp_pd import BondAssociated, Explicit, Measure, Motion, NeoHookean, Outcome, Sheet, Simulation, TearingEnergy
from warp_pd.device.checks import InputError, count, positive, resolved
from warp_pd.materials import tension_energy_density, with_wrinkles
from warp_pd.measures import TearLine, at_peak, support_force, worst_balance
from warp_pd.shapes.roughness import rough_surface
from warp_pd.tearing.field_constants import DEFAULT_LENGTH

WIDTH, HEIGHT, THICKNESS, DENSITY, MU = 0.04, 0.06, 1e-3, 1000.0, 1e3
# k in tension field theory, by a / w (rows) and stretch, to about 2 %.
RATIOS, STRETCHES = (0.15, 0.2, 0.25, 0.3, 0.35, 0.4), (1.1, 1.15, 1.2, 1.3, 1.5, 2.0, 3.0)
FACTORS = (
    (4.62, 4.06, 3.69, 3.21, 2.71, 2.19, 1.84),
    (3.76, 3.56, 3.33, 2.98, 2.57, 2.12, 1.8),
    (3.02, 3.0, 2.91, 2.76, 2.4, 2.02, 1.74),
    (2.51, 2.51, 2.5, 2.42, 2.22, 1.92, 1.67),
    (2.15, 2.15, 2.15, 2.14, 2.03, 1.81, 1.59),
    (1.88, 1.88, 1.88, 1.88, 1.85, 1.69, 1.52),
)
# Length of a crack with the energy that the damage ahead of a tip has when it runs, over the length of the field.
AHEAD = 0.25 * np.pi


def build(
    points: int = 80,
    horizon: float = 2.015,
    tearing_energy: float = 4.0,
    damage_length: float | None = None,
    notch: float = 8e-3,
    overload: float = 1.3,
    duration: float = 3.0,
    damping: float = 5.0,
    frames: int = 150,
    roughness: float = 1e-3,
    turn: float = 0.0,
    jitter: float = 0.0,
    seed: int = 0,
) -> Simulation:
    """Build the scene.

    Args:
        damage_length: Length of the damage field [m], see TearingEnergy; by default four spacings.
        points: Points along the width. The sheet wrinkles below the spacing, as its notch does not close.
        notch: Length of the notch [m].
    """
    material = with_wrinkles(NeoHookean(MU, 100.0 * MU), "relaxed")
    columns, energy = count("points", points, 8), positive("tearing_energy", tearing_energy)
    rows = 2 * round(0.75 * columns)
    sheet = Sheet.filled(
        WIDTH, HEIGHT, thickness=THICKNESS, density=DENSITY, points=(columns, rows), turn=turn, jitter=jitter, seed=seed
    )
    resolved("notch", positive("notch", notch), sheet.spacing)
    length = DEFAULT_LENGTH * sheet.spacing if damage_length is None else positive("damage_length", damage_length)
    crack = notch + AHEAD * length
    if not RATIOS[0] * WIDTH <= crack <= RATIOS[-1] * WIDTH:
        raise InputError(
            f"notch = {notch!r}: expected notch plus pi / 4 of the damage length from {RATIOS[0] * WIDTH:g} to "
            f"{RATIOS[-1] * WIDTH:g} m, got {crack:.4g} m"
        )
    middle = 0.5 * HEIGHT
    sheet = sheet.cut((-WIDTH, middle), (notch, middle))
    top, bottom = sheet.edges("top"), sheet.edges("bottom")
    # Families at the ends are cut off and would tear first.
    ends = sheet.where(lambda x, y: abs(y - middle) > middle - 2.0 * horizon * sheet.spacing)
    stretches = np.linspace(1.0, 12.0, 2000)
    rates = release_rate(material, stretches, crack)
    positive("overload", overload)
    if overload * energy > rates.max():
        raise InputError(f"tearing_energy = {energy:g}, overload = {overload:g}: expected less for this notch")
    last = float(np.interp(overload * energy, rates, stretches))
    travel = 0.5 * (last - 1.0) * HEIGHT
    line = TearLine(sheet)
    tip, ahead = (notch, middle), (WIDTH, middle)

    def stretch(built, frame):
        return 1.0 + (last - 1.0) * min(frame.time / duration, 1.0)

    def ratio(built, frame):
        return float(np.interp(stretch(built, frame), stretches, rates)) / energy

    def onset(history):
        if max(row["tip"] for row in history) == 0.0:
            return None
        return at_peak("release_ratio", "load")(history)

    return Simulation(
        sheet,
        force=BondAssociated(material, horizon=horizon),
        loads=[
            Motion(top, times=[0.0, duration], y=[0.0, travel], z=0.0),
            Motion(bottom, times=[0.0, duration], y=[0.0, -travel], z=0.0),
            Motion([sheet.nearest(0.5 * WIDTH, y) for y in (0.0, HEIGHT)], times=[0.0], x=[0.0]),
        ],
        damage=TearingEnergy(energy, length, spared=ends),
        initial_displacement=rough_surface(sheet, roughness, seed, np.concatenate([top, bottom])),
        solver=Explicit(duration=positive("duration", duration), frames=count("frames", frames, 1), damping=damping),
        measures=[
            Measure("stretch", "1", stretch),
            Measure("release_ratio", "1", ratio),
            Measure("load", "N", lambda built, frame: support_force(built, top)[1]),
            Measure("tip", "m", lambda built, frame: line.reach(frame.intact_faces, tip, ahead)),
        ],
        outcomes=[
            Outcome("onset_ratio", "1", onset, 1.0, "finite elements: G = 2 k a W"),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        notes=[f"the notch counts as {crack:.4g} m long; the strip is stretched to {last:.4g}"],
        section="Greensmith 1963",
        pictures=pictures,
    )


def release_rate(material, stretches, crack):
    """G of a crack at increasing stretches [J/m^2]."""
    by_stretch = [np.interp(crack / WIDTH, RATIOS, column) for column in np.transpose(FACTORS)]
    # Beyond the table k falls as 1 / sqrt(stretch).
    known = np.interp(stretches, STRETCHES, by_stretch * np.sqrt(STRETCHES)) / np.sqrt(stretches)
    return 2.0 * known * crack * tension_energy_density(material, stretches)


def pictures(history, folder):
    from warp_pd.viewer import plots

    begin = next((row["time"] for row in history if row["tip"] > 0.0), history[-1]["time"])
    shown = plots.frames_at(folder, [begin, 0.5 * (begin + history[-1]["time"]), history[-1]["time"]])
    plots.from_above(folder / "damage.png", shown, field="damage", limits=(0.0, 1.0))
    plots.curves(
        folder / "release.png", history, ["release_ratio"], ylabel="G / Gc", against="stretch", xlabel="stretch"
    )
    plots.curves(folder / "load.png", history, ["load"], ylabel="load (N)")
