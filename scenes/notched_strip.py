"""A membrane strip with a notch is torn and wrinkles next to the crack. IM paper, section 6.5 (figure 21).

0.1 x 0.04 x 0.001 m, a notch of 6 mm in the middle of the lower edge, 200 x 80 points, horizon of 3 spacings, E+ 1e5
Pa, nu 1/3, no compressive modulus; the ends move apart by Ux each, bonds break at a strain of 6e-3. The paper shows
crack and wrinkle level at Ux = 2.1, 2.4, 2.7 and 3.0e-4 m, without numbers; the membrane next to the crack is slack.

`law`: "bonds" is the paper's law, in which single bonds go slack. With free sides its rows of points separate instead
of tearing at the notch (docs/papers/im.md). "tension_field" is recommended: the relaxed energy of tension field theory
in the bond-associated form, with the same modulus and critical strain. Its crack begins at the notch.

`solver`: "newton" and "relaxation" follow the static path by the paper's procedure: one load step to `start`, the
others on to 3.0e-4 m by `increment` (the paper's smallest: 1e-6 m), bonds breaking in equilibrium until none does.
Neither suits a strip that goes slack. "explicit" pulls it slowly, within `duration`, against mass damping; it is the
default for "tension_field". `ends` are "free" to contract, but for the middle of each, which keeps its height, or
"held". `compression` is the compressive modulus over that in tension, for the law "bonds".
"""

import math
from dataclasses import replace

import numpy as np

from warp_pd import (
    Bimodular,
    BondAssociated,
    BondBased,
    CriticalStretch,
    Explicit,
    Fixed,
    Measure,
    Motion,
    NeoHookean,
    Newton,
    Outcome,
    Relaxation,
    Sheet,
    Simulation,
    TensionField,
)
from warp_pd.device.checks import InputError, count, finite, not_negative, one_of, positive
from warp_pd.interfaces import Solver
from warp_pd.measures import TearLine, largest, support_force, when_above

WIDTH, HEIGHT, NOTCH, TRAVEL = 0.1, 0.04, 6e-3, 3.0e-4
MODULUS, POISSON = 1e5, 1.0 / 3.0
Path = tuple[list[float], list[float]]
SHOWN = (2.1e-4, 2.4e-4, 2.7e-4, 3.0e-4)


def build(
    points: int = 200,
    horizon: float = 3.0,
    law: str = "bonds",
    ends: str = "free",
    compression: float = 0.0,
    critical_strain: float = 6e-3,
    solver: str = "auto",
    start: float = 1.0e-4,
    increment: float = 5e-6,
    tolerance: float = 1e-6,
    duration: float = 3.0,
    damping: float = 50.0,
    frames: int = 60,
    slow_from: float | None = None,
    slow_to: float | None = None,
) -> Simulation:
    """Build the scene.

    Args:
        critical_strain: Strain at which a bond breaks [-].
        start: Displacement of each end after the first load step [m].
        increment: Displacement of each end in every further load step [m].
        slow_from: Frames of explicit dynamics are 2 ms apart from this time on [s]; None: shortly before the notch
            tears by Griffith's criterion, with the law "tension_field".
        slow_to: Frames are 2 ms apart up to this time [s]; None: 1.4 times the time at which it tears.
    """
    bonds = one_of("law", law, ("bonds", "tension_field")) == "bonds"
    if not_negative("compression", compression) > 0.0 and not bonds:
        raise InputError(f"compression = {compression!r}: expected 0 with the law 'tension_field'")
    if count("points", points, 3) * NOTCH < 2.0 * WIDTH:
        least = math.ceil(2.0 * WIDTH / NOTCH)
        raise InputError(f"points = {points}: expected at least {least}, two spacings per notch")
    if solver == "auto":
        solver = "newton" if bonds else "explicit"
    explicit = one_of("solver", solver, ("explicit", "newton", "relaxation")) == "explicit"
    if not (bonds or explicit):
        raise InputError(f"solver = {solver!r}: expected 'explicit' with the law 'tension_field'")
    sheet = Sheet.rectangle(
        WIDTH, HEIGHT, thickness=1e-3, density=1000.0, points=points + points % 2, centred=True
    ).cut((0.5 * WIDTH, -0.01 * HEIGHT), (0.5 * WIDTH, NOTCH))
    left, right = sheet.edges("left"), sheet.edges("right")
    held = np.concatenate([left, right])
    middles = [sheet.nearest(x, 0.5 * HEIGHT) for x in (0.0, WIDTH)]
    # Families of the bond-associated law are cut off at the ends and would tear there first.
    margin = 2.0 * horizon * sheet.spacing
    beside = sheet.where(lambda x, y: (x < margin) | (x > WIDTH - margin))
    static, (times, path) = _static(solver, start, increment, tolerance)
    pulled = Explicit(duration=positive("duration", duration), frames=count("frames", frames, 1), damping=damping)
    if not bonds or (slow_from is not None and slow_to is not None):
        tears = duration * _griffith(critical_strain, sheet.spacing) / TRAVEL
        begin = 0.9 * tears if slow_from is None else finite("slow_from", slow_from)
        end = 1.4 * tears if slow_to is None else finite("slow_to", slow_to)
        pulled = replace(pulled, frames=_with_slow(duration, frames, begin, end))
    if explicit:
        times, path = [0.0, duration], [0.0, TRAVEL]
    line, tip = TearLine(sheet), (0.5 * WIDTH, NOTCH)
    return Simulation(
        sheet,
        force=_law(bonds, compression, horizon),
        loads=[
            Fixed(range(sheet.size), "z"),
            Fixed(held if one_of("ends", ends, ("free", "held")) == "held" else middles, "y"),
            Motion(left, times, x=[-u for u in path]),
            Motion(right, times, x=path),
        ],
        damage=CriticalStretch(1.0 + critical_strain, spared=held if bonds else beside),
        solver=pulled if explicit else static,
        measures=[
            Measure("end_displacement", "m", lambda built, frame: frame.displacement[right, 0].mean()),
            Measure("load", "N", lambda built, frame: support_force(built, right)[0]),
            Measure("crack_length", "m", lambda built, frame: line.length(frame.intact_faces)),
            Measure("crack_reach", "m", lambda built, frame: line.reach(frame.intact_faces, tip, (tip[0], HEIGHT))),
            Measure("crack_direction", "degrees", lambda built, frame: line.direction(frame.intact_faces)),
            Measure("mean_wrinkle_level", "1", lambda built, frame: _slack(frame).mean()),
        ],
        outcomes=[
            Outcome("largest_load", "N", largest("load")),
            Outcome("tear_begins_at", "m", when_above("end_displacement", "crack_length", 0.0)),
        ],
        fields=("principal_stress", "wrinkle_level") if bonds else ("wrinkle_state",),
        section="IM 6.5",
        pictures=pictures,
    )


def _law(bonds, compression, horizon):
    """The paper's law, or the same modulus and Poisson's ratio in a sheet that wrinkles below the spacing."""
    if bonds:
        return BondBased(Bimodular(MODULUS, compression * MODULUS), horizon=horizon)
    shear, bulk = 0.5 * MODULUS / (1.0 + POISSON), MODULUS / (3.0 - 6.0 * POISSON)
    return BondAssociated(TensionField(NeoHookean(shear, bulk)), horizon=horizon)


def _static(solver: str, start: float, increment: float, tolerance: float) -> tuple[Solver, Path]:
    """The solver of the static path and its schedule: times, and displacements of the right end [m]."""
    if not 0.0 < positive("start", start) < TRAVEL:
        raise InputError(f"start = {start!r}: expected a displacement greater than 0 and less than {TRAVEL:g} m")
    if not 0.0 < positive("increment", increment) <= TRAVEL - start:
        raise InputError(f"increment = {increment!r}: expected a step greater than 0 and at most {TRAVEL - start:g} m")
    further = max(1, round((TRAVEL - start) / increment))
    path = ([0.0, 1.0 / (1 + further), 1.0], [0.0, start, TRAVEL])
    if solver == "relaxation":
        return Relaxation(tolerance=tolerance, load_steps=1 + further, most_steps=10_000_000), path
    return Newton(tolerance=tolerance, load_steps=1 + further, most_iterations=60), path


def _griffith(critical_strain: float, spacing: float) -> float:
    """Ux at which G of the notch is the energy that the tension field's bonds release (docs/papers/im.md)."""
    return 0.5 * WIDTH * critical_strain * math.sqrt(2.2 * spacing / (2.0 * 1.605 * math.pi * NOTCH))


def _with_slow(duration: float, frames: int, begin: float, end: float) -> list[float]:
    """Times of the frames [s], 2 ms apart from `begin` to `end`."""
    slow = [t for t in np.arange(begin, end, 2e-3).round(9).tolist() if 0.0 < t < duration]
    return sorted({*slow, *(duration * (np.arange(1, frames + 1) / frames)).tolist()})


def _slack(frame):
    """Wrinkle level of the points: fraction of compressed bonds, or 0 taut, 0.5 wrinkled and 1 slack."""
    fields = frame.point_data
    return fields["wrinkle_level"] if "wrinkle_level" in fields else 0.5 * fields["wrinkle_state"]


def pictures(history, folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, _shown(history))
    plots.reference(folder / "damage.png", shown, field="damage", limits=(0.0, 1.0))
    field = "wrinkle_level" if "wrinkle_level" in shown[0].fields else "wrinkle_state"
    limits = (0.0, 1.0 if field == "wrinkle_level" else 2.0)
    plots.reference(folder / "wrinkles.png", shown, field=field, label=field.replace("_", " "), limits=limits)
    plots.curves(
        folder / "load.png", history, ["load"], ylabel="load (N)", against="end_displacement", xlabel="Ux (m)"
    )  # fmt: skip


def _shown(history):
    """Times of the pictures [s]: at the paper's displacements; of a tear that is over by then, while it grows."""
    ends, reach, times = (
        np.array([row[name] for row in history]) for name in ("end_displacement", "crack_reach", "time")
    )
    across = reach.max()
    if across > 0.0 and reach[np.argmin(np.abs(ends - SHOWN[0]))] == across:
        return [float(times[np.argmax(reach >= fraction * across)]) for fraction in (0.05, 0.33, 0.67, 1.0)]
    return [float(times[np.argmin(np.abs(ends - end))]) for end in SHOWN]
