"""Cracks that run and branch."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

import numpy as np
from study import build_scene

from validation.bulges import rubber
from validation.comparison import Comparison
from warp_pd import (
    BondAssociated,
    Explicit,
    Fixed,
    Measure,
    Sheet,
    Simulation,
    TearingEnergy,
    TensionField,
    Yeoh,
)
from warp_pd.geometry.roughness import rough_surface
from warp_pd.materials import energy_density
from warp_pd.measures import TearLine
from warp_pd.scenes import running_crack
from warp_pd.scenes.pure_shear_tear import HEIGHT

# A crack whose length grows so many times as fast as its tip advances has branched.
BRANCHED = 1.25
OVERLOADS = (1.3, 1.6, 2.0)
FULL = (48, 72, 108, 162)
# Length of the damage field [m]: short, so that the strip is strong enough to bear its overload.
FIELD = 2.2e-3
# Natural rubber of Treloar, stretched equally both ways; Gc of natural rubber that does not tear slowly.
DENSITY, TEARING_ENERGY, TALL, THICKNESS, RUBBER_FIELD = 930.0, 10e3, 0.032, 0.3e-3, 8.4e-4


@lru_cache
def running(points: int, overload: float, device: str | None) -> tuple[float, float]:
    """Speed of a crack over that of shear waves, and growth of its length over the advance of its tip."""
    settings = {"points": points, "overload": overload, "duration": 0.3, "damage_length": FIELD}
    history = build_scene("running_crack", settings).run(device=device, usd=False, pictures=False).history
    rows = [row for row in history if running_crack.BEGIN < row["tip"] < running_crack.END]
    tip, length, time = (np.array([row[name] for row in rows]) for name in ("tip", "crack_length", "time"))
    return float(np.polyfit(time, tip, 1)[0] / running_crack.WAVE_SPEED), float(np.polyfit(tip, length, 1)[0])


def branching(points: int, device: str | None) -> Sequence[float]:
    """G / Gc at which cracks branch, between OVERLOADS."""
    growth = np.maximum.accumulate([running(points, overload, device)[1] for overload in OVERLOADS])
    return [float(np.interp(BRANCHED, growth, OVERLOADS)) if growth[0] < BRANCHED <= growth[-1] else float("nan")]


def limiting_speed(points: int, device: str | None) -> Sequence[float]:
    """Speed at which cracks branch, over that of shear waves; where none branches, the largest."""
    runs = [running(points, overload, device) for overload in OVERLOADS]
    if max(growth for _, growth in runs) < BRANCHED:
        return [max(speed for speed, _ in runs)]
    return [float(np.interp(branching(points, device)[0], OVERLOADS, [speed for speed, _ in runs]))]


@lru_cache
def stretched_sheet_speed(
    points: int,
    stretch: float,
    device: str | None,
    energy: float = TEARING_ENERGY,
    hardens: bool = True,
    size: float = 1.0,
) -> float:
    """Speed of a crack in a sheet stretched equally both ways and held at its edges, in the sheet at rest [m/s].

    The sheet is `size` TALL and 1.75 times as long; its cut of 0.4 of the height begins at the left. `points` are those
    along TALL.
    """
    rest = rubber("treloar")
    rest = rest if hardens else Yeoh(rest.c10)
    tall = size * TALL
    long, cut, middle = 1.75 * tall, 0.4 * tall, 0.5 * tall
    rows = 2 * round(0.5 * size * points)
    sheet = Sheet.filled(
        long, tall, thickness=THICKNESS, density=DENSITY, points=(round(1.75 * size * points), rows)
    ).cut((-tall, middle), (cut, middle))
    edges = np.unique(np.concatenate([sheet.edges("top"), sheet.edges("bottom"), sheet.edges("right")]))
    left = np.setdiff1d(sheet.edges("left"), edges)
    spared = sheet.where(lambda x, y: (x < 3e-2 * long) | (x > 0.97 * long) | (abs(y - middle) > 0.47 * tall))
    apart = rough_surface(sheet, 1e-3, 0, edges)
    apart[:, :2] += (stretch - 1.0) * sheet.points
    line = TearLine(sheet)
    result = Simulation(
        sheet,
        force=BondAssociated(TensionField(rest), horizon=2.015),
        loads=[Fixed(np.concatenate([edges, left]))],
        initial_displacement=apart,
        damage=TearingEnergy(energy, length=RUBBER_FIELD, spared=spared),
        solver=Explicit(duration=4e-3 * size, frames=160, damping=50.0, safety=0.2),
        measures=[Measure("tip", "m", lambda b, f: line.reach(f.intact_faces, (cut, middle), (long, middle)))],
    ).run(device=device, usd=False, pictures=False)
    rows = [(row["time"], row["tip"]) for row in result.history if 0.3 * tall < row["tip"] < 1.1 * tall]
    return (
        float(np.polyfit(*np.transpose(rows), 1)[0]) if result.status == "finished" and len(rows) > 3 else float("nan")
    )


def wave_speeds(stretch: float) -> tuple[float, float]:
    """Longitudinal and shear wave speeds of the stretched sheet, in the sheet at rest [m/s]."""
    rest, e = rubber("treloar"), 1e-3

    def energy(first, second):
        return float(energy_density(rest, first, second, "cpu"))

    here = energy(stretch, stretch)
    along = (energy(stretch + e, stretch) - 2.0 * here + energy(stretch - e, stretch)) / e**2
    # (l1 W1 - l2 W2) / (l1^2 - l2^2) where both are nearly equal.
    both = (energy(stretch + e, stretch + e) - energy(stretch + e, stretch - e)) / (2.0 * e) ** 2
    both -= (energy(stretch - e, stretch + e) - energy(stretch - e, stretch - e)) / (2.0 * e) ** 2
    slope = (energy(stretch + e, stretch) - energy(stretch - e, stretch)) / (2.0 * e)
    shear = 0.5 * (along - both + slope / stretch)
    return (along / DENSITY) ** 0.5, (shear / DENSITY) ** 0.5


EQUAL = (2.25, 2.5)


def speed_over_sound(points: int, device: str | None) -> Sequence[float]:
    """Crack speed over that of longitudinal waves, at the stretches EQUAL."""
    return [stretched_sheet_speed(points, stretch, device) / wave_speeds(stretch)[0] for stretch in EQUAL]


def speed_over_shear(points: int, device: str | None) -> Sequence[float]:
    """Crack speed over that of shear waves."""
    return [stretched_sheet_speed(points, stretch, device) / wave_speeds(stretch)[1] for stretch in EQUAL]


def laboratory_speeds(points: int, device: str | None) -> Mapping[str, float]:
    """Speeds past the stretched rubber [m/s]."""
    return {
        f"m/s at a stretch of {stretch:g}": stretch * stretched_sheet_speed(points, stretch, device)
        for stretch in EQUAL
    }


def other_rubber(points: int, device: str | None) -> Mapping[str, float]:
    """Crack speeds over that of shear waves: tougher and not hardening at the larger stretch, small at the other.

    A crack that the strain ahead of it drives, as theirs, is as fast in a small sheet. Half the size has half the G.
    """
    over = EQUAL[-1], device
    small = stretched_sheet_speed(points, EQUAL[0], device, size=0.5) / wave_speeds(EQUAL[0])[1]
    shear, soft = wave_speeds(EQUAL[-1])[1], (2.0 * rubber("treloar").c10 / DENSITY) ** 0.5
    return {
        "with 1.5 times the Gc": stretched_sheet_speed(points, *over, energy=1.5 * TEARING_ENERGY) / shear,
        "in rubber that does not harden": stretched_sheet_speed(points, *over, hardens=False) / soft,
        f"in a sheet of half the size at a stretch of {EQUAL[0]:g}": small,
    }


def limits(points: int, device: str | None) -> Mapping[str, float]:
    """Growth of the crack's length over the advance of its tip, at all overloads."""
    return {f"length over advance at {g:g} Gc": running(points, g, device)[1] for g in OVERLOADS}


def speeds(points: int, device: str | None) -> Mapping[str, float]:
    """Speeds over that of shear waves at all overloads."""
    return {f"at {g:g} Gc": running(points, g, device)[0] for g in OVERLOADS}


ROWS: tuple[Callable[[], Comparison], ...] = (
    lambda: Comparison("branching", ("strip in tension",), (2.0,), HEIGHT, (48,), FULL, branching, limits),
    lambda: Comparison("limit", ("strip in tension",), (0.87,), HEIGHT, (48,), FULL, limiting_speed, speeds),
    lambda: Comparison(
        "sound", EQUAL, (1.0 / 3.0,) * len(EQUAL), TALL, (100,), (100, 150), speed_over_sound, laboratory_speeds, False
    ),
    lambda: Comparison(
        "shear", EQUAL, (1.0,) * len(EQUAL), TALL, (100,), (100, 150), speed_over_shear, other_rubber, False
    ),
)
