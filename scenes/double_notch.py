"""A sheet with a notch in each side is pulled until it separates. BA paper, section 6.3 (figures 9 and 10).

Gent sheet of 20 x 10 x 1 mm, mu 1 kPa, 1/D 100 kPa, Jm 160, rho 1000 kg/m^3, 60 x 30 points. Top and bottom edge
move apart at 1.2 mm/s each. The sheet tears at a tearing energy of 0.9 J/m^2, the damage length is 0.75 mm. In the
paper bonds break at a stretch of 2: `critical_stretch=2`. It shows the damage as the crack runs from both notches
straight to the middle, and gives no numbers.

The paper does not specify the length of the notches (here 2.5 mm, `notch`), how the edges are held (here by grips,
where the sheet neither contracts nor tears; with a critical stretch they continue outside), or its damping (here 20
/s, which settles waves but is far below the load). The crack crosses the sheet in some hundredths of a second: frames
from `slow_from` to `slow_to` are 1 ms apart. Their defaults fit both criteria at 60 points; with a critical stretch
coarser grids tear later, finer ones earlier. At 60 points a row of points lies on the line of the notches; it belongs
to the upper side.

An exactly flat sheet stays flat. When it snaps, its recoil then crushes families next to its edges in plane, which
ended the run on rotated and jittered grids; a real sheet buckles. `roughness`, the height of random bumps in
spacings, lets it buckle: 1e-3 and 1e-2 give the same crack.
"""

import math

import numpy as np

from warp_pd import BondAssociated, Explicit, Gent, Measure, Motion, Outcome, Sheet, Simulation
from warp_pd.device.checks import InputError, count, finite, positive, resolved
from warp_pd.materials import with_wrinkles
from warp_pd.measures import TearLine, largest, support_force, time_above, worst_balance
from warp_pd.papers import point_areas
from warp_pd.shapes.roughness import rough_surface
from warp_pd.tearing import horizon_for_tears, length_for_tears, notes_on_criterion, stretch_or_energy


def build(
    points: int = 60,
    horizon: float | None = None,
    weights: str = "auto",
    tearing_energy: float = 0.9,
    damage_length: float | None = None,
    critical_stretch: float | None = None,
    wrinkles: str = "relaxed",
    notch: float = 2.5e-3,
    speed: float = 1.2e-3,
    damping: float = 20.0,
    duration: float = 3.0,
    frames: int = 40,
    slow_from: float = 0.98,
    slow_to: float = 1.1,
    safety: float | None = None,
    roughness: float = 1e-3,
    turn: float = 0.0,
    jitter: float = 0.0,
    seed: int = 0,
    areas: str = "auto",
) -> Simulation:
    """Build the scene.

    Args:
        horizon: Horizon in spacings; by default 2.015, with a critical stretch 3.15.
        damage_length: Length of the damage field [m]; by default 0.75 mm, or the horizon if that is more.
        notch: Length of each notch [m].
        speed: Speed of each grip [m/s].
        slow_from: Frames are 1 ms apart from this time on [s].
        slow_to: Frames are 1 ms apart up to this time [s].
    """
    width, height = 20e-3, 10e-3
    horizon = horizon_for_tears(horizon, critical_stretch)
    if not 0.0 < positive("notch", notch) < 0.5 * width:
        raise InputError(f"notch = {notch!r}: expected a length less than {0.5 * width:g} m, half the width")
    # A critical stretch breaks families that are cut off at an edge first: its grips continue outside for a horizon.
    layers = 0 if critical_stretch is None else math.ceil(horizon)
    sheet = Sheet.filled(
        width, height, thickness=1e-3, density=1000.0, points=points,
        layers=(0, layers), turn=turn, jitter=jitter, seed=seed, areas=point_areas(areas, weights),
    )  # fmt: skip
    resolved("notch", notch, sheet.spacing)
    positive("speed", speed)
    count("frames", frames, 1)
    begin, end = (
        max(0.0, finite("slow_from", slow_from)),
        min(positive("duration", duration), finite("slow_to", slow_to)),
    )
    slow = [t for t in np.arange(begin, end, 1e-3).round(9).tolist() if 0.0 < t < duration]
    times = sorted({*slow, *(duration * (np.arange(1, frames + 1) / frames)).tolist()})
    middle = 0.5 * height
    sheet = sheet.cut((0.0, middle), (notch, middle)).cut((width - notch, middle), (width, middle))
    top = sheet.where(lambda x, y: y > height - 1e-9)
    bottom = sheet.where(lambda x, y: y < 1e-9)
    travel = speed * duration
    material = with_wrinkles(Gent(mu=1e3, bulk=2 * 100e3, lock=160.0), wrinkles)
    line = TearLine(sheet)
    length = length_for_tears(damage_length, 7.5e-4, horizon, sheet)
    grips = np.concatenate([top, bottom])
    left, right = line.centres[:, 0] < 0.5 * width, line.centres[:, 0] >= 0.5 * width
    return Simulation(
        sheet,
        force=BondAssociated(material, horizon=horizon, weights=weights),
        loads=[
            Motion(top, times=[0.0, duration], x=0.0, y=[0.0, travel], z=0.0),
            Motion(bottom, times=[0.0, duration], x=0.0, y=[0.0, -travel], z=0.0),
        ],
        damage=stretch_or_energy(critical_stretch, tearing_energy, length, grips),
        notes=notes_on_criterion(critical_stretch),
        initial_displacement=rough_surface(sheet, roughness, seed, grips),
        solver=Explicit(duration=duration, frames=times, damping=damping, safety=safety),
        measures=[
            Measure("extension", "m", lambda built, frame: 2.0 * speed * frame.time),
            Measure("load", "N", lambda built, frame: support_force(built, top)[1]),
            Measure("crack_length", "m", lambda built, frame: line.length(frame.intact_faces)),
            Measure("left_crack_length", "m", lambda built, frame: line.length(frame.intact_faces | right)),
            Measure("right_crack_length", "m", lambda built, frame: line.length(frame.intact_faces | left)),
            Measure("crack_direction", "degrees", lambda built, frame: line.direction(frame.intact_faces)),
            Measure("crack_alignment", "1", lambda built, frame: line.alignment(frame.intact_faces, turn)),
            Measure(
                "crack_deviation",
                "m",
                lambda built, frame: line.deviation(frame.intact_faces, (0.0, middle), (width, middle)),
            ),
            Measure("pieces", "1", lambda built, frame: line.pieces(frame.intact_faces)),
        ],
        outcomes=[
            Outcome("largest_load", "N", largest("load")),
            Outcome("tear_begins", "s", time_above("crack_length", 0.0)),
            Outcome("two_pieces", "s", time_above("pieces", 1.5)),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        section="BA 6.3",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.measures import time_above
    from warp_pd.viewer import plots

    begin = time_above("crack_length", 0.0)(history) or history[-1]["time"]
    end = time_above("pieces", 1.5)(history) or history[-1]["time"]
    shown = plots.frames_at(folder, [begin + fraction * (end - begin) for fraction in (0.0, 0.33, 0.67, 1.0)])
    plots.from_above(folder / "damage.png", shown, field="damage", limits=(0.0, 1.0))
    plots.curves(folder / "load.png", history, ["load"], ylabel="load (N)", against="extension", xlabel="extension (m)")
    names = ["crack_length", "left_crack_length", "right_crack_length"]
    plots.curves(folder / "crack_length.png", history, names, ylabel="crack length (m)")
    plots.curves(folder / "energy.png", history, plots.ENERGIES, ylabel="energy (J)")
