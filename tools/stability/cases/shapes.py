"""Cases of shape: zero-energy modes, turned and inverted sheets, single points, compression."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from warp_pd import Explicit, Fixed, Sheet, Simulation

from ..laws import MU, RUBBER, THICKNESS, Trial
from ..motion import duration, estimated_step, force_at, rough, smooth, square, stretched, volume
from ..runs import verdict_of_steps
from ..verdicts import CLEAN, STABLE, WRONG, Finding


def zero_energy(trial: Trial) -> Finding:
    """Lowest frequency of the excitations finer than a family, over the highest frequency of the sheet."""
    sheet = square(21)
    a, b = 1.2, 1.1
    built = trial.built(sheet, loads=[Fixed(sheet.edges("all"))], initial_displacement=stretched(sheet, a, b))
    largest = 2.0 / estimated_step(built)
    i, j = np.indices((21, 21)).reshape(2, -1)
    signs = {"checkerboard": (-1.0) ** (i + j), "stripes": (-1.0) ** i, "every third": np.cos(2.0 * np.pi / 3.0 * i)}
    # Away from the edges: families there are one-sided and do feel them.
    middle = (np.sin(np.pi * sheet.points[:, 0]) * np.sin(np.pi * sheet.points[:, 1])) ** 4
    mass = built.to_numpy(built.state.mass)[:, None]
    found = {}
    for name, sign in signs.items():
        for c, axis in enumerate("xyz"):
            v = np.zeros((sheet.size, 3))
            v[:, c] = sign * middle
            v[sheet.edges("all")] = 0.0
            step = 1e-3 * sheet.spacing
            base = stretched(sheet, a, b)
            change = (force_at(built, base - step * v) - force_at(built, base + step * v)) / (2.0 * step)
            squared = float((v * change).sum() / (mass * v * v).sum())
            found[f"{name} along {axis}"] = math.copysign(math.sqrt(abs(squared)), squared) / largest
    worst = min(found, key=lambda k: found[k])
    number = found[worst]
    return Finding(STABLE if number > 0.05 else WRONG, number, worst)


def rotation(degrees: float, axis: tuple[float, float, float]) -> np.ndarray:
    """Rotation matrix (Rodrigues)."""
    n = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]])
    angle = np.deg2rad(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def turned_sheet(degrees: float) -> Callable[[Trial], Finding]:
    """A strained sheet under a rigid rotation: its forces must turn with it."""

    def find(trial: Trial) -> Finding:
        sheet = square()
        place = np.column_stack([sheet.points, np.zeros(sheet.size)])
        start = stretched(sheet, 1.2, 1.1) + smooth(sheet, 0.03)
        built = trial.built(sheet)
        force = force_at(built, start)
        worst = 0.0
        for axis in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (1.0, 2.0, 3.0)):
            turn = rotation(degrees, axis)
            turned = force_at(built, (place + start) @ turn.T - place)
            worst = max(worst, float(np.abs(turned - force @ turn.T).max() / np.abs(force).max()))
        limit = 1e-3 if trial.bits == 32 else 1e-10
        return Finding(STABLE if worst < limit else WRONG, worst, field=force)

    return find


def inside_out(trial: Trial) -> Finding:
    """A mirrored sheet is a surface in space turned over: it must carry the mirrored force of the reference state."""
    sheet = square()
    built = trial.built(sheet)
    start = np.column_stack([-2.0 * sheet.points[:, 0], np.zeros((sheet.size, 2))])
    force = force_at(built, start) - force_at(built, np.zeros_like(start)) * [-1.0, 1.0, 1.0]
    number = float(np.abs(force).max() / (MU * THICKNESS * sheet.spacing))
    limit = 1e-3 if trial.bits == 32 else 1e-10
    return Finding(STABLE if number < limit else WRONG, number)


def put_point(where: Callable[[Sheet], np.ndarray]) -> Callable[[Trial], Finding]:
    """The middle point is put elsewhere and released; `where` gives its displacement [m]."""

    def find(trial: Trial) -> Finding:
        sheet = square(7)
        point = sheet.nearest(0.5, 0.5)
        start = np.zeros((sheet.size, 3))
        start[point] = where(sheet)
        built = trial.built(sheet, loads=[Fixed(sheet.edges("all"))])
        force = force_at(built, start)
        if not np.isfinite(force).all():
            return Finding(CLEAN, None, "the force is NaN or Inf, which the first frame reports")
        time = duration(trial, sheet, RUBBER, 2.0)

        def simulation(share: float) -> Simulation:
            return trial.simulation(
                sheet, loads=[Fixed(sheet.edges("all"))], initial_displacement=start,
                solver=Explicit(time, frames=40, safety=share),
            )  # fmt: skip

        # An upper bound of the work to put it there.
        budget = float(np.linalg.norm(start[point]) * np.linalg.norm(force, axis=1).max())
        return replace(verdict_of_steps(trial, simulation, max(budget, 1e-12)), field=force)

    return find


def point_beside_neighbour(sheet: Sheet) -> np.ndarray:
    """The bond to the right neighbour turns by 90 degrees, out of the plane."""
    return np.array([sheet.spacing, 0.0, -sheet.spacing])


def point_past_neighbour(sheet: Sheet) -> np.ndarray:
    """The bond to the right neighbour turns by 180 degrees, which turns triangles inside out."""
    return np.array([1.9 * sheet.spacing, 0.0, 0.0])


def compression(trial: Trial) -> Finding:
    """Pushed together to half its size, nearly flat: the sheet must buckle and crumple without diverging."""
    sheet = square()
    start = stretched(sheet, 0.5, 0.5) + rough(sheet, 0.01)
    time = duration(trial, sheet, RUBBER, 4.0)

    def simulation(share: float) -> Simulation:
        return trial.simulation(
            sheet, loads=[Fixed(sheet.edges("all"))], initial_displacement=start,
            solver=Explicit(time, frames=40, safety=share),
        )  # fmt: skip

    return verdict_of_steps(trial, simulation, RUBBER.energy(0.5, 0.5) * volume(sheet))
