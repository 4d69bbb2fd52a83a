"""A slit in the middle of a sheet grows as the sheet is pulled and lifted. NN paper, section 6.3 (figures 13 to 15).

1 x 1 x 0.01 m, neo-Hookean mu 1 kPa, K 100 kPa, rho 1000 kg/m^3, 120 x 120 points, the left edge fixed. The points
within 0.04 m of the middle of the right edge move by u1 = 0.0125 t, u3 = 0.025 t. The sheet tears at a tearing energy
of 2.43 J/m^2, the damage length is 50 mm; in the paper bonds break at a stretch of 1.3: `critical_stretch=1.3`. Initial
displacements that vary as sines seed the wrinkles that form along the slit. The paper shows u3 at 3, 4.5, 6, 7.5, 9 and
10.5 s, and crack length and speed against time.

The paper does not specify the slit (here 0.3 m along y through the middle, `slit` and `slit_at`), the seed (here
0.1 mm, four waves along each side, `seed_height`), its damping (here 0.1 /s, as in 6.1), or why the sheet does not
tear where it is pulled: here the bonds of the pulled points do not break, and with a tearing energy those within a
damage length of them. `grip_share` is the fraction of the sheet that is still attached to them, and
`grip_tears_out` the time at which it falls below 2 %, or none if they hold. With a critical stretch they tear out at
7 s with 45 points and hold with 60: use 60 points or more.
Cracks within 0.2 m of the middle of the pulled edge do not count as part of the slit.
"""

import numpy as np

from warp_pd import Explicit, Fixed, Measure, Motion, NeoHookean, Outcome, Sheet, Simulation
from warp_pd.device.checks import InputError, positive, resolved
from warp_pd.measures import TearLine, growth_rate, largest, support_force, time_above, time_below, worst_balance
from warp_pd.papers import force_law, point_areas
from warp_pd.tearing import horizon_for_tears, length_for_tears, notes_on_criterion, stretch_or_energy

# Within this distance of the pulled points [m] torn faces belong to the grip.
GRIP = 0.2
SHOWN = (3.0, 4.5, 6.0, 7.5, 9.0, 10.5)


def build(
    points: int = 120,
    horizon: float | None = None,
    weights: str = "auto",
    force: str = "bond_associated",
    tearing_energy: float = 2.43,
    damage_length: float | None = None,
    critical_stretch: float | None = None,
    wrinkles: str = "auto",
    slit: float = 0.3,
    slit_at: float = 0.5,
    seed_height: float = 1e-4,
    pull: float = 0.0125,
    lift: float = 0.025,
    patch: float = 0.04,
    damping: float = 0.1,
    duration: float = 10.5,
    frames: int = 210,
    safety: float | None = None,
    turn: float = 0.0,
    jitter: float = 0.0,
    seed: int = 0,
    areas: str = "auto",
) -> Simulation:
    """Build the scene.

    Args:
        horizon: Horizon in spacings; by default 2.015, with a critical stretch 3.15.
        damage_length: Length of the damage field [m]; by default 50 mm, or the horizon if that is more.
        slit: Length of the slit [m].
        slit_at: Distance of the slit from the fixed edge [m].
        seed_height: Height of the waves at the start [m].
        pull: Speed of the patch along x [m/s].
        lift: Speed of the patch along z [m/s].
        patch: Radius of the patch that is pulled [m].
    """
    for name, value in (("slit", slit), ("slit_at", slit_at)):
        if not 0.0 < positive(name, value) < 1.0:
            raise InputError(f"{name} = {value!r}: expected a length less than 1 m, the width")
    horizon = horizon_for_tears(horizon, critical_stretch)
    sheet = Sheet.filled(
        1.0, 1.0, thickness=0.01, density=1000.0, points=points, turn=turn, jitter=jitter, seed=seed,
        areas=point_areas(areas, weights),
    )  # fmt: skip
    resolved("slit", slit, sheet.spacing)
    lower, upper = (slit_at, 0.5 - 0.5 * slit), (slit_at, 0.5 + 0.5 * slit)
    sheet = sheet.cut(lower, upper)
    left, pulled = sheet.edges("left"), sheet.within((1.0, 0.5), patch)
    line = TearLine(sheet)
    length = length_for_tears(damage_length, 0.05, horizon, sheet)
    # The field of a tear at the grip is as wide as its length.
    held = pulled if critical_stretch is not None else sheet.within((1.0, 0.5), patch + length)
    grip = np.hypot(*(line.centres - (1.0, 0.5)).T) < GRIP
    x, y = sheet.points.T
    ripples = np.zeros((sheet.size, 3))
    ripples[:, 2] = seed_height * np.sin(8.0 * np.pi * x) * np.sin(8.0 * np.pi * y)
    ripples[np.concatenate([left, pulled])] = 0.0
    return Simulation(
        sheet,
        force=force_law(force, NeoHookean(mu=1e3, bulk=100e3), horizon, weights, wrinkles),
        loads=[
            Fixed(left),
            Motion(pulled, times=[0.0, duration], x=[0.0, pull * duration], y=0.0, z=[0.0, lift * duration]),
        ],
        damage=stretch_or_energy(critical_stretch, tearing_energy, length, np.concatenate([left, held])),
        notes=notes_on_criterion(critical_stretch),
        initial_displacement=ripples,
        solver=Explicit(duration=duration, frames=frames, damping=damping, safety=safety),
        measures=[
            Measure("crack_growth", "m", lambda built, frame: line.length(frame.intact_faces | grip)),
            Measure("crack_length", "m", lambda built, frame: slit + line.length(frame.intact_faces | grip)),
            Measure("crack_direction", "degrees", lambda built, frame: line.direction(frame.intact_faces | grip)),
            Measure("crack_alignment", "1", lambda built, frame: line.alignment(frame.intact_faces | grip, turn)),
            Measure(
                "crack_deviation", "m", lambda built, frame: line.deviation(frame.intact_faces | grip, lower, upper)
            ),
            Measure("grip_share", "1", lambda built, frame: line.attached_fraction(frame.intact_faces, pulled)),
            Measure("pull", "N", lambda built, frame: float(np.linalg.norm(support_force(built, pulled)))),
            Measure("pieces", "1", lambda built, frame: line.pieces(frame.intact_faces)),
        ],
        outcomes=[
            Outcome("largest_pull", "N", largest("pull")),
            Outcome(
                "first_bond_breaks", "s", time_above("rupture" if critical_stretch is None else "largest_damage", 0.0)
            ),
            Outcome("tear_begins", "s", time_above("crack_growth", 0.0)),
            Outcome("grip_tears_out", "s", time_below("grip_share", 0.02)),
            Outcome("largest_crack_speed", "m/s", largest_speed),
            Outcome("two_pieces", "s", time_above("pieces", 1.5)),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        section="NN 6.3",
        pictures=pictures,
    )


def largest_speed(history):
    """Largest speed of the crack [m/s]; None if it does not grow."""
    return float(growth_rate(history, "crack_length").max()) or None


def pictures(history, folder):
    from warp_pd.viewer import plots

    end = history[-1]["time"]
    shown = plots.frames_at(folder, [t for t in SHOWN if t <= end] or [end])
    plots.surfaces(folder / "deflection.png", shown, field="u3", view=(35.0, -70.0))
    plots.surfaces(folder / "deflection_at_end.png", shown[-1:], field="u3", view=(35.0, -70.0))
    plots.from_above(folder / "from_above.png", shown, field="u3")
    plots.reference(folder / "damage.png", shown, field="damage", limits=(0.0, 1.0))
    speed = growth_rate(history, "crack_length")
    rows = [{**row, "crack_speed": v} for row, v in zip(history, speed, strict=True)]
    plots.curves(folder / "crack_length.png", rows, ["crack_length"], ylabel="crack length (m)")
    plots.curves(folder / "crack_speed.png", rows, ["crack_speed"], ylabel="crack speed (m/s)")
    plots.curves(folder / "energy.png", history, plots.ENERGIES, ylabel="energy (J)")
