"""A cut sheet is torn by pulling its two legs apart, out of its plane. BA paper, section 6.5 (figures 14 and 15).

Gent sheet of 100 x 100 x 1 mm, mu 1 kPa, 1/D 100 kPa, Jm 160, rho 1000 kg/m^3, 80 x 80 points, with a cut of 30 mm
in from the middle of the right edge. The left edge is held; the two halves of the right edge move up and
down at 0.4 mm/s. The sheet tears at a tearing energy of 1.5 J/m^2, the damage length is 3.5 mm; in the paper bonds
break at a stretch of 2: `critical_stretch=2`. It shows the damage while the crack runs straight on from the cut "for
some distance", as experiments do, and gives no numbers.

With the tearing energy the crack runs straight for 34 mm; then the legs, which are held at their length, are stretched
so far that it forks and cuts them off. With a critical stretch, on a grid aligned with the cut and symmetric about it,
it runs straight for 20 mm before it forks; ten times as fast for 64 mm, with half the step or ten times the damping
for 53 mm and more: only the first 13 to 20 mm are common to all (docs/papers/ba.md). On rotated or jittered grids it
turns to one side after 10 to 30 mm, and cuts off a leg (`--set turn=15`): by then the straight
tear is no longer stable. The grid rotated by 45 degrees is no exception: its points lie symmetric about the cut, but
those on the cut itself belong to its lower side.

The grips continue outside the sheet, and points in them do not tear out. The paper does not say whether the pulled
halves may move towards the left edge (here they may not), nor its damping (here 20 /s). The pull is slow: waves
cross the sheet in a tenth of a second. `--set speed=4e-3` begins to tear at the same separation within 1 %, ten times
sooner, but runs straight for longer. The run at the printed speed takes 265 000 steps.
"""

import math

import numpy as np

from warp_pd import BondAssociated, BoundaryForce, Explicit, Fixed, Gent, Measure, Motion, Outcome, Sheet, Simulation
from warp_pd.device.checks import InputError, positive, resolved
from warp_pd.materials import with_wrinkles
from warp_pd.measures import TearLine, largest, support_force, time_above, when_above, worst_balance
from warp_pd.papers import point_areas
from warp_pd.tearing import horizon_for_tears, length_for_tears, notes_on_criterion, stretch_or_energy


def build(
    points: int = 80,
    horizon: float | None = None,
    weights: str = "corrected",
    tearing_energy: float = 1.5,
    damage_length: float | None = None,
    critical_stretch: float | None = None,
    wrinkles: str = "relaxed",
    boundary_force: float = 0.0,
    cut: float = 0.03,
    speed: float = 0.4e-3,
    travel: float = 0.1,
    damping: float = 20.0,
    frames: int = 100,
    safety: float | None = None,
    turn: float = 0.0,
    jitter: float = 0.0,
    seed: int = 0,
    areas: str = "auto",
) -> Simulation:
    """Build the scene.

    Args:
        horizon: Horizon in spacings; by default 2.015, with a critical stretch 3.15.
        damage_length: Length of the damage field [m]; by default 3.5 mm, or the horizon if that is more.
        boundary_force: A of the empirical force along free edges [N/m^7].
        cut: Length of the cut [m].
        speed: Speed of each leg [m/s].
        travel: Displacement of each leg [m].
    """
    side = 0.1
    horizon = horizon_for_tears(horizon, critical_stretch)
    if not 0.0 < positive("cut", cut) < side:
        raise InputError(f"cut = {cut!r}: expected a length less than {side:g} m, the width")
    # A critical stretch breaks families that are cut off at an edge first: its grips continue outside for a horizon.
    layers = 0 if critical_stretch is None else math.ceil(horizon)
    sheet = Sheet.filled(
        side, side, thickness=1e-3, density=1000.0, points=points, layers=(layers, 0), turn=turn, jitter=jitter,
        seed=seed, areas=point_areas(areas, weights),
    )  # fmt: skip
    middle, tip = 0.5 * side, (side - cut, 0.5 * side)
    resolved("cut", cut, sheet.spacing)
    sheet = sheet.cut((2.0 * side, middle), tip)
    left, right = sheet.where(lambda x, y: x < 1e-9), sheet.where(lambda x, y: x > side - 1e-9)
    # Points on the cut belong to its lower side; round-off must not decide.
    above = sheet.points[right, 1] > middle + 1e-9
    upper, lower = right[above], right[~above]
    duration = positive("travel", travel) / positive("speed", speed)
    material = with_wrinkles(Gent(mu=1e3, bulk=2 * 100e3, lock=160.0), wrinkles)
    line = TearLine(sheet)
    length = length_for_tears(damage_length, 3.5e-3, horizon, sheet)
    ahead = (0.0, middle)
    loads = [
        Fixed(left),
        Motion(upper, times=[0.0, duration], x=0.0, y=0.0, z=[0.0, travel]),
        Motion(lower, times=[0.0, duration], x=0.0, y=0.0, z=[0.0, -travel]),
    ]
    if boundary_force != 0.0:
        loads.append(BoundaryForce(boundary_force))
    return Simulation(
        sheet,
        force=BondAssociated(material, horizon=horizon, weights=weights),
        loads=loads,
        damage=stretch_or_energy(critical_stretch, tearing_energy, length, np.concatenate([left, right])),
        notes=notes_on_criterion(critical_stretch),
        solver=Explicit(duration=duration, frames=frames, damping=damping, safety=safety),
        measures=[
            Measure("separation", "m", lambda built, frame: 2.0 * speed * frame.time),
            Measure("load", "N", lambda built, frame: support_force(built, upper)[2]),
            Measure("crack_length", "m", lambda built, frame: line.length(frame.intact_faces)),
            Measure("crack_reach", "m", lambda built, frame: line.reach(frame.intact_faces, tip, ahead)),
            Measure("crack_direction", "degrees", lambda built, frame: line.direction(frame.intact_faces)),
            Measure("crack_alignment", "1", lambda built, frame: line.alignment(frame.intact_faces, turn)),
            Measure("crack_deviation", "m", lambda built, frame: line.deviation(frame.intact_faces, tip, ahead)),
            Measure("pieces", "1", lambda built, frame: line.pieces(frame.intact_faces)),
        ],
        outcomes=[
            Outcome("largest_load", "N", largest("load")),
            Outcome("load_when_tear_begins", "N", when_above("load", "crack_length", 0.0)),
            Outcome("load_while_tearing", "N", mean_load),
            Outcome("tear_begins", "s", time_above("crack_length", 0.0)),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        section="BA 6.5",
        pictures=pictures,
    )


def mean_load(history):
    """Mean load while the crack grows from 5 to 15 mm [N]."""
    rows = [row["load"] for row in history if 5e-3 < row["crack_length"] < 15e-3]
    return float(np.mean(rows)) if len(rows) > 2 else None


def pictures(history, folder):
    from warp_pd.measures import time_above
    from warp_pd.viewer import plots

    begin, end = time_above("crack_length", 0.0)(history) or 0.0, history[-1]["time"]
    shown = plots.frames_at(folder, [begin + fraction * (end - begin) for fraction in (0.0, 0.33, 0.67, 1.0)])
    plots.surfaces(folder / "damage.png", shown, field="damage", limits=(0.0, 1.0))
    plots.surfaces(folder / "deflection.png", shown, field="u3")
    plots.reference(folder / "crack_path.png", shown[-1:], field="damage", limits=(0.0, 1.0))
    plots.curves(
        folder / "load.png", history, ["load"], ylabel="load (N)", against="separation", xlabel="separation (m)"
    )
    plots.curves(folder / "crack_length.png", history, ["crack_length", "crack_reach"], ylabel="crack length (m)")
    plots.curves(folder / "energy.png", history, plots.ENERGIES, ylabel="energy (J)")
