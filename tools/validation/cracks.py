"""Cracks that run and branch."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import takewhile

import numpy as np
from study import build_scene, whole

from validation.bulges import rubber
from validation.comparison import Comparison, UnfinishedError
from validation.light_band import LightBand
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
from warp_pd.materials import energy_density
from warp_pd.measures import TearLine
from warp_pd.scenes import running_crack
from warp_pd.scenes.pure_shear_tear import HEIGHT
from warp_pd.shapes.roughness import rough_surface

# Part of the way on which a crack that has branched is two.
BRANCHED = 0.1
OVERLOADS = (1.5, 1.7, 1.9, 2.1, 2.3, 2.5)
# That at which the start, the lag of damage and the mass of the band are varied.
VARIED = 1.9
FULL = (96, 136, 192)
# Length of the damage field [m]: the smallest that the coarsest of these grids resolves by four spacings.
FIELD = 4.0 * HEIGHT / (FULL[0] - 1)
# Natural rubber of Treloar, stretched equally both ways; Gc of natural rubber that does not tear slowly.
DENSITY, TEARING_ENERGY, TALL, THICKNESS, RUBBER_FIELD = 930.0, 10e3, 0.032, 0.3e-3, 8.4e-4


@lru_cache
def running(
    points: int,
    overload: float,
    device: str | None,
    field: float = FIELD,
    rest: bool = True,
    every_step: bool = True,
    light: bool = False,
) -> tuple[float, float]:
    """Speed of a crack, at the end of its way, over that of shear waves, and the part on which it is two.

    Args:
        points: Rows.
        overload: G / Gc.
        device: Where it runs.
        field: Length of the damage field [m].
        rest: Whether the cut is open in equilibrium when the crack sets out; otherwise it is closed and let go.
        every_step: Whether damage is found in every step.
        light: Whether the mass of the band falls with its stiffness.
    """
    settings = {
        "points": points, "overload": overload, "duration": 0.3, "damage_length": field, "every_step": every_step,
        "damping": 0.0,
    }  # fmt: skip
    simulation = build_scene("running_crack", settings)
    # The corners of the free end are above the strength when the strip is at rest.
    far_end = simulation.sheet.where(lambda x, y: x > running_crack.LENGTH - 0.5 * HEIGHT)
    damage = simulation.damage
    simulation = replace(simulation, damage=replace(damage, spared=np.union1d(damage.spared, far_end)))
    if rest:
        simulation = replace(simulation, initial_displacement=at_rest(simulation, device))
    if light:
        loads, solver = [*simulation.loads, LightBand()], replace(simulation.solver, safety=0.25)
        simulation = replace(simulation, loads=loads, solver=solver)
    result = whole(simulation.run(device=device, usd=False, pictures=False))
    tip, time = (np.array([row[name] for row in result.history]) for name in ("tip", "time"))
    end = min(tip.max(), running_crack.END)
    last = (tip > end - HEIGHT) & (tip < end)
    line, spacing = TearLine(simulation.sheet), simulation.sheet.spacing
    torn = line.centres[~line.without_specks(result.frame.intact_faces)] - (running_crack.CUT, 0.0)
    on_way = torn[(torn[:, 0] > running_crack.BEGIN) & (torn[:, 0] < end)]
    speed = np.polyfit(time[last], tip[last], 1)[0] / running_crack.WAVE_SPEED
    return float(speed), doubled(on_way, spacing, field)


def at_rest(simulation: Simulation, device: str | None) -> np.ndarray:
    """Displacement [m] of the strip at rest, with the damage that its cut has from the start and no other.

    Waves cross the strip four times in the duration, and nearly critical damping takes them.
    """
    damage = simulation.damage
    result = whole(
        replace(
            simulation,
            damage=replace(damage, energy=1e3 * damage.energy, every_step=False),
            solver=Explicit(duration=0.15, frames=2, damping=100.0),
            measures=(),
            outcomes=(),
        ).run(device=device, usd=False, pictures=False)
    )
    if result.status != "finished":
        raise UnfinishedError(f"a strip of {simulation.sheet.size} points at rest: the run ended {result.status!r}")
    return result.frame.displacement


def doubled(torn: np.ndarray, spacing: float, apart: float) -> float:
    """Part of the columns of torn faces in which two of them are `apart` with none between them.

    Args:
        torn: Centres of the faces [m], shape (n, 2).
        spacing: Width of a column [m].
        apart: Distance between two cracks [m].
    """
    column = np.floor(torn[:, 0] / spacing).astype(int)
    order = np.lexsort((torn[:, 1], column))
    column, y = column[order], torn[order, 1]
    gaps = (np.diff(column) == 0) & (np.diff(y) > apart)
    return len(np.unique(column[1:][gaps])) / len(np.unique(column))


@lru_cache
def straight(points: int, device: str | None) -> list[float]:
    """Those of OVERLOADS, from the lowest, up to the first at which the crack branches."""
    return list(takewhile(lambda overload: running(points, overload, device)[1] < BRANCHED, OVERLOADS))


def branching(points: int, device: str | None) -> Sequence[float]:
    """G / Gc at which cracks branch: between the last of OVERLOADS without branches and the next."""
    below = len(straight(points, device))
    return [0.5 * (OVERLOADS[below - 1] + OVERLOADS[below]) if 0 < below < len(OVERLOADS) else float("nan")]


def limiting_speed(points: int, device: str | None) -> Sequence[float]:
    """Largest speed of cracks that do not branch, over that of shear waves."""
    return [max((running(points, g, device)[0] for g in straight(points, device)), default=float("nan"))]


@lru_cache
def stretched_sheet_speed(
    points: int,
    stretch: float,
    device: str | None,
    energy: float = TEARING_ENERGY,
    hardens: bool = True,
    size: float = 1.0,
    every_step: bool = False,
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
    result = whole(
        Simulation(
            sheet,
            force=BondAssociated(TensionField(rest), horizon=2.015),
            loads=[Fixed(np.concatenate([edges, left]))],
            initial_displacement=apart,
            damage=TearingEnergy(energy, length=RUBBER_FIELD, spared=spared, every_step=every_step),
            solver=Explicit(duration=4e-3 * size, frames=160, damping=50.0, safety=0.2),
            measures=[Measure("tip", "m", lambda b, f: line.reach(f.intact_faces, (cut, middle), (long, middle)))],
        ).run(device=device, usd=False, pictures=False)
    )
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
        "with damage found in every step": stretched_sheet_speed(points, *over, every_step=True) / shear,
        f"in a sheet of half the size at a stretch of {EQUAL[0]:g}": small,
    }


def tried(points: int, device: str | None) -> list[float]:
    """OVERLOADS up to the first at which the crack branches, that one, too."""
    return list(OVERLOADS[: len(straight(points, device)) + 1])


def limits(points: int, device: str | None) -> Mapping[str, float]:
    """Part of the way on which the crack is two; on the coarsest grid also in other ways."""
    coarse = min(points, FULL[0])
    others = {
        f"{VARIED:g} Gc from a closed cut": running(coarse, VARIED, device, rest=False),
        **{f"{g:g} Gc with a light band": running(coarse, g, device, light=True) for g in (OVERLOADS[0], VARIED)},
    }
    return {
        **{f"part of the way as two cracks at {g:g} Gc": running(points, g, device)[1] for g in tried(points, device)},
        **{f"part of the way as two cracks at {what}": part for what, (_, part) in others.items()},
    }


def speeds(points: int, device: str | None) -> Mapping[str, float]:
    """Speeds over that of shear waves; on the coarsest grid also in other ways."""
    coarse = min(points, FULL[0])
    others = {
        f"{VARIED:g} Gc with damage found in every second step": running(coarse, VARIED, device, every_step=False),
        **{f"{g:g} Gc with a light band": running(coarse, g, device, light=True) for g in (OVERLOADS[0], VARIED)},
    }
    return {
        **{f"at {g:g} Gc": running(points, g, device)[0] for g in tried(points, device)},
        **{f"at {what}": speed for what, (speed, _) in others.items()},
    }


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
