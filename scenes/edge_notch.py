"""A strip with a notch in one edge is pulled until the notch runs. Greensmith (1963).

A strip of w = 40 mm x 60 mm x 1 mm, mu 1 kPa, rho 1000 kg/m^3, with a notch of `notch` in the middle of its left edge.
Its ends are pulled apart and may narrow, so that the strip is in uniaxial tension. For a notch that is short against
the width, the energy release rate is

    G = 2 k a W(stretch),     k = 3 / sqrt(stretch),

with the energy density W of uniaxial tension and the length a of the notch. k was measured on rubbers to about 5 %. In
a strip of finite width G is larger: `width_factor` in the notes is that of linear elasticity, which G includes (Tada,
Paris and Irwin: 1.117 at a / w = 0.1). `onset_ratio` is G over the tearing energy when the tip has moved by `advance`
spacings.
"""

import numpy as np

from warp_pd import BondAssociated, Explicit, Measure, Motion, NeoHookean, Outcome, Sheet, Simulation, TearingEnergy
from warp_pd.device.checks import InputError, count, positive, resolved
from warp_pd.geometry.roughness import rough_surface
from warp_pd.materials import tension_energy_density, with_wrinkles
from warp_pd.measures import TearLine, support_force, worst_balance

WIDTH, HEIGHT, THICKNESS, DENSITY, MU = 0.04, 0.06, 1e-3, 1000.0, 1e3


def build(
    points: int = 60,
    horizon: float = 3.15,
    tearing_energy: float = 4.0,
    notch: float = 4e-3,
    overload: float = 1.5,
    advance: float = 3.0,
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
        points: Points along the width. The sheet wrinkles below the spacing, as its notch does not close.
        notch: Length of the notch [m].
        advance: Growth of the crack at which its onset is read, in spacings.
    """
    material = with_wrinkles(NeoHookean(MU, 100.0 * MU), "relaxed")
    columns, energy = count("points", points, 8), positive("tearing_energy", tearing_energy)
    rows = 2 * round(0.75 * columns)
    sheet = Sheet.filled(
        WIDTH, HEIGHT, thickness=THICKNESS, density=DENSITY, points=(columns, rows), turn=turn, jitter=jitter, seed=seed
    )
    resolved("notch", positive("notch", notch), sheet.spacing)
    if notch > 0.3 * WIDTH:
        raise InputError(f"notch = {notch!r}: expected a length of at most {0.3 * WIDTH:g} m, 0.3 of the width")
    middle = 0.5 * HEIGHT
    sheet = sheet.cut((-WIDTH, middle), (notch, middle))
    top, bottom = sheet.edges("top"), sheet.edges("bottom")
    # Families at the ends are cut off and would tear first.
    ends = sheet.where(lambda x, y: abs(y - middle) > middle - 2.0 * horizon * sheet.spacing)
    factor, stretches = width_factor(notch / WIDTH), np.linspace(1.0, 12.0, 2000)
    rates = factor * release_rate(material, stretches, notch)
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
        return next((row["release_ratio"] for row in history if row["tip"] > advance * sheet.spacing), None)

    return Simulation(
        sheet,
        force=BondAssociated(material, horizon=horizon),
        loads=[
            Motion(top, times=[0.0, duration], y=[0.0, travel], z=0.0),
            Motion(bottom, times=[0.0, duration], y=[0.0, -travel], z=0.0),
            Motion([sheet.nearest(0.5 * WIDTH, y) for y in (0.0, HEIGHT)], times=[0.0], x=[0.0]),
        ],
        damage=TearingEnergy(energy, spared=ends),
        initial_displacement=rough_surface(sheet, roughness, seed, np.concatenate([top, bottom])),
        solver=Explicit(duration=positive("duration", duration), frames=count("frames", frames, 1), damping=damping),
        measures=[
            Measure("stretch", "1", stretch),
            Measure("release_ratio", "1", ratio),
            Measure("load", "N", lambda built, frame: support_force(built, top)[1]),
            Measure("tip", "m", lambda built, frame: line.reach(frame.intact_faces, tip, ahead)),
        ],
        outcomes=[
            Outcome("onset_ratio", "1", onset, 1.0, "Greensmith 1963: G = 2 k a W"),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        notes=[f"width_factor = {factor:.4g}; the strip is stretched to {last:.4g}"],
        section="Greensmith 1963",
        pictures=pictures,
    )


def release_rate(material, stretch, notch):
    """G of a short notch [J/m^2]."""
    return 6.0 / np.sqrt(stretch) * notch * tension_energy_density(material, stretch)


def width_factor(ratio):
    """G of a notch in a strip of finite width over that of a short one, in linear elasticity; `ratio` is a / w."""
    form = 1.12 - 0.231 * ratio + 10.55 * ratio**2 - 21.72 * ratio**3 + 30.39 * ratio**4
    return (form / 1.12) ** 2


def pictures(history, folder):
    from warp_pd.output import plots

    begin = next((row["time"] for row in history if row["tip"] > 0.0), history[-1]["time"])
    shown = plots.frames_at(folder, [begin, 0.5 * (begin + history[-1]["time"]), history[-1]["time"]])
    plots.from_above(folder / "damage.png", shown, field="damage", limits=(0.0, 1.0))
    plots.curves(
        folder / "release.png", history, ["release_ratio"], ylabel="G / Gc", against="stretch", xlabel="stretch"
    )
    plots.curves(folder / "load.png", history, ["load"], ylabel="load (N)")
