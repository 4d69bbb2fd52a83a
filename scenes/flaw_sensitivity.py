"""A sheet with a small or a large flaw is stretched equally along both sides until it breaks: strength or toughness.

A square with sides 2 b = 0.1 m, 1 mm thick, mu 1 kPa, rho 1000 kg/m^3, has a cut of length `flaw` along x in its
middle. Rollers pull its four sides apart. Nothing is compressed, so the sheet does not wrinkle, and without a flaw its
strain is uniform. A small flaw does not matter: the sheet breaks when its energy density W reaches its strength. A
large flaw grows at Griffith's stretch, where

    G = 2 pi a C W(stretch) = Gc,

with a = flaw / 2. The factor C depends on a / b and the stretch; it is from plane finite elements
(tests/references/torn.json). `strength_ratio` is W divided by the strength at the largest load, `griffith_ratio` is G
divided by Gc, and `break_ratio` is the larger of the two. Between these limits, where 2 pi a C strength is about Gc,
flaw and strength act together, and the sheet breaks before it reaches either: flaw sensitivity (Chen, Wang, Suo 2017).

A cut acts like a crack that is longer by pi / 4 damage lengths at each end, see scene `edge_notch`. A
flaw shorter than the damage length is not a crack and starts as a cut without damage.
"""

import numpy as np

from warp_pd import BondAssociated, Explicit, Measure, Motion, NeoHookean, Outcome, Sheet, Simulation, TearingEnergy
from warp_pd.device.checks import InputError, count, not_negative, positive, resolved
from warp_pd.materials import energy_density, with_wrinkles
from warp_pd.measures import at_peak, support_force, worst_balance
from warp_pd.tearing.field_constants import DEFAULT_LENGTH, bias

SIDE, THICKNESS, DENSITY, MU = 0.1, 1e-3, 1000.0, 1e3
# C = G / (2 pi a W), by a / b (rows) and stretch.
RATIOS, STRETCHES = (0.05, 0.1, 0.2, 0.3, 0.5), (1.05, 1.1, 1.2, 1.4, 1.7, 2.0, 3.0)
FACTORS = (
    (0.832, 0.748, 0.638, 0.509, 0.410, 0.357, 0.291),
    (0.823, 0.741, 0.633, 0.507, 0.409, 0.357, 0.291),
    (0.761, 0.692, 0.600, 0.488, 0.398, 0.349, 0.285),
    (0.670, 0.619, 0.548, 0.457, 0.380, 0.336, 0.275),
    (0.476, 0.457, 0.426, 0.380, 0.331, 0.299, 0.250),
)  # fmt: skip
# Length of a crack with the energy that the damage of a cut has ahead of each tip, over the length of the field.
AHEAD = 0.25 * np.pi


def build(
    points: int = 80,
    horizon: float = 2.015,
    tearing_energy: float = 4.0,
    damage_length: float | None = None,
    strength: float | None = None,
    flaw: float = 0.02,
    overload: float = 1.3,
    duration: float = 3.0,
    damping: float = 5.0,
    frames: int = 150,
    turn: float = 0.0,
    jitter: float = 0.0,
    seed: int = 0,
) -> Simulation:
    """Build the scene.

    Args:
        damage_length: Length of the damage field [m], see TearingEnergy; by default four spacings.
        strength: Energy density at which intact material begins to tear [J/m^3]; by default that of the length.
        flaw: Length of the cut [m]; 0: there is none.
        overload: W at the end over that at which the sheet is expected to break [-].
    """
    material = with_wrinkles(NeoHookean(MU, 100.0 * MU), "relaxed")
    energy, number = positive("tearing_energy", tearing_energy), count("points", points, 8)
    sheet = Sheet.filled(
        SIDE, SIDE, thickness=THICKNESS, density=DENSITY, points=(number, number), turn=turn, jitter=jitter, seed=seed
    )
    reach = positive("horizon", horizon) * sheet.spacing
    length = DEFAULT_LENGTH * sheet.spacing if damage_length is None else positive("damage_length", damage_length)
    middle, half = 0.5 * SIDE, 0.5 * not_negative("flaw", flaw)
    is_crack = flaw > length
    if flaw > 0.0:
        resolved("flaw", flaw, sheet.spacing)
        sheet = sheet.cut((middle - half, middle), (middle + half, middle))
    crack = half + AHEAD * length if is_crack else half
    if crack > RATIOS[-1] * middle:
        raise InputError(
            f"flaw = {flaw!r}: expected flaw plus pi / 2 of the damage length of at most {SIDE * RATIOS[-1]:g} m, got "
            f"{2.0 * crack:.4g} m"
        )
    most = 3.0 * energy / (16.0 * length * bias(reach / length))
    limit = most if strength is None else positive("strength", strength)
    stretches = np.linspace(1.0, 6.0, 2000)
    densities = np.asarray(energy_density(material, stretches, stretches), float)
    by_stretch = [np.interp(crack / middle, RATIOS, column) for column in np.transpose(FACTORS)]
    rates = 2.0 * np.pi * crack * np.interp(stretches, STRETCHES, by_stretch) * densities / energy
    expected = np.interp(1.0, np.maximum(densities / limit, rates), densities)
    last = float(np.interp(positive("overload", overload) * expected, densities, stretches))
    left, right, bottom, top = (sheet.edges(side) for side in ("left", "right", "bottom", "top"))
    # Families at the rollers are cut off and would tear first.
    rim = sheet.where(lambda x, y: np.maximum(abs(x - middle), abs(y - middle)) > middle - 2.0 * reach)
    times, travel = [0.0, positive("duration", duration)], [0.0, (last - 1.0) * middle]
    back = [-way for way in travel]

    def stretch(built, frame):
        return 1.0 + (last - 1.0) * min(frame.time / duration, 1.0)

    def over(values):
        return lambda built, frame: float(np.interp(stretch(built, frame), stretches, values))

    def break_ratio(history):
        ratios = [at_peak(name, "stress")(history) for name in ("density_ratio", "release_ratio")]
        return None if None in ratios else max(ratios)

    return Simulation(
        sheet,
        force=BondAssociated(material, horizon=horizon),
        loads=[
            Motion(np.setdiff1d(left, np.concatenate([bottom, top])), times=times, x=back),
            Motion(np.setdiff1d(right, np.concatenate([bottom, top])), times=times, x=travel),
            *(
                Motion(np.intersect1d(edge, side), times=times, x=way, y=up)
                for edge, up in ((bottom, back), (top, travel))
                for side, way in ((left, back), (right, travel))
            ),
            Motion(np.setdiff1d(bottom, np.concatenate([left, right])), times=times, y=back),
            Motion(np.setdiff1d(top, np.concatenate([left, right])), times=times, y=travel),
        ],
        damage=TearingEnergy(energy, length, strength, spared=rim, cut_profile=is_crack),
        solver=Explicit(duration=duration, frames=count("frames", frames, 1), damping=damping),
        measures=[
            Measure("stretch", "1", stretch),
            Measure("stress", "Pa", lambda built, frame: support_force(built, top)[1] / (SIDE * THICKNESS)),
            Measure("density_ratio", "1", over(densities / limit)),
            Measure("release_ratio", "1", over(rates)),
        ],
        outcomes=[
            Outcome("stress_at_break", "Pa", at_peak("stress", "stress")),
            Outcome("strength_ratio", "1", at_peak("density_ratio", "stress")),
            Outcome("griffith_ratio", "1", at_peak("release_ratio", "stress")),
            Outcome("break_ratio", "1", break_ratio, 1.0, "strength or Griffith's, whichever comes first"),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        notes=[f"strength {limit:.4g} J/m^3; the sheet is stretched to {last:.4g}"],
        section="Flaw sensitivity",
        pictures=pictures,
    )  # fmt: skip


def pictures(history, folder):
    from warp_pd.viewer import plots

    begin = max(history, key=lambda row: row["stress"])["time"]
    shown = plots.frames_at(folder, [begin, 0.5 * (begin + history[-1]["time"]), history[-1]["time"]])
    plots.from_above(folder / "damage.png", shown, field="damage", limits=(0.0, 1.0))
    plots.curves(folder / "stress.png", history, ["stress"], ylabel="stress (Pa)", against="stretch", xlabel="stretch")
