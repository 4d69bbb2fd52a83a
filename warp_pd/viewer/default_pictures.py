"""Default pictures of a scene: the sheet, its damage, energies, measures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from ..output.quantities import ENERGIES, column_label, column_unit, known_units, with_unit
from ..output.vtkhdf import read_series
from . import plots
from .beside import drawn_beside
from .pictures import Shown, frames_at, new_panels, save

# Panels of the sheet; of a sheet with more points than that only the last frame is drawn.
PANELS, LARGE = 4, 300_000
# Numbers in a picture; further ones are named below.
MOST_NUMBERS = 30
# A tear begins where the damage has grown by this fraction of what it grows in all.
ONSET = 0.02
# A displacement out of the plane above this fraction of the size of the sheet is drawn in space.
OUT_OF_PLANE = 1e-3
# A component below this fraction of the largest one of its vector is noise.
NOISE = 1e-3
# Changes of numbers below so many times the round-off are none.
ROUNDINGS = 10.0
# A torque below that of the force at this arm [m] is noise.
ARM = 1e-12
NOT_DRAWN = {
    "time", "load_factor", "step", "half_step_kinetic", "balance_error", "largest_damage", "mean_damage", *ENERGIES,
}  # fmt: skip


def draw(
    history: Sequence[dict[str, float]],
    folder: Path,
    summary: Mapping[str, Any],
    regions: Sequence[np.ndarray] = (),
    held: np.ndarray | Sequence[int] = (),
    fine: Sequence[dict[str, float]] = (),
) -> None:
    """Draw sheet, damage, stress, thickness, energy and measures, except those for which the run has no data.

    `regions` are the points of each region of another material, whose outline is drawn; pieces without points of `held`
    do not widen a picture. Columns that have rows between frames, `fine`, are drawn from these.
    """
    series = read_series(folder / "frames.vtkhdf")
    chosen = telling_frames(history, series.frames) if series.points <= LARGE else [series.frames - 1]
    if "stride" in series.metadata:
        # Points of the frames are not those of the sheet.
        regions, held = (), ()
    frames = [replace(frame, regions=regions, held=held) for frame in frames_at(folder, series.times[chosen].tolist())]
    if len(frames[0].triangles):
        _draw_sheet(folder, frames)
    energies = [name for name in ENERGIES if any(row.get(name) for row in history)]
    if energies:
        rows = fine if fine and set(energies) <= set(fine[0]) else history
        plots.curves(folder / "energy.png", rows, energies, ylabel="energy (J)")
    units, measures = known_units(summary), summary.get("measures", {})
    columns = {name: fine if fine and name in fine[0] else history for name in history[-1] if name not in NOT_DRAWN}
    noise = _round_off(history, units, float(np.ptp(frames[0].reference, axis=0).max()), summary["precision"])
    numbers = [name for name, rows in columns.items() if _moves(rows, name, noise, units)]
    numbers = [name for name in numbers if name in measures or _counts(columns[name], name)]
    numbers.sort(key=lambda name: name not in measures)
    if numbers and len(history) > 1:
        still = [name for name in measures if name in history[-1] and name not in numbers]
        _draw_numbers(folder, {name: columns[name] for name in numbers}, units, still)


def telling_frames(history: Sequence[Mapping[str, float]], frames: int) -> list[int]:
    """Indices of up to four frames that show the course of a run.

    For a sheet that tears: the last frame before the tear begins, the first after, the one at half of the growth of the
    mean damage, and the last. For others: at a quarter, a half, three quarters and the end of the run.
    """
    last = frames - 1
    damage = np.array([row.get("mean_damage", 0.0) for row in history[:frames]])
    growth = damage - damage[0]
    if last < PANELS or len(damage) < frames or not growth[-1] > 0.0:
        return [int(k) for k in np.unique(np.linspace(0, last, PANELS + 1).round())][min(last, 1) :]
    onset, half = (int(np.argmax(growth > part * growth[-1])) for part in (ONSET, 0.5))
    chosen = {max(onset - 1, 0), onset, half, last}
    # A sheet that tears at once: what becomes of it takes the place of the half-torn sheet.
    return sorted(chosen if len(chosen) == PANELS else chosen | {(half + last) // 2})


def _draw_sheet(folder: Path, frames: Sequence[Shown]) -> None:
    """Draw the displacement, and the damage if there is any."""
    field, in_space = telling_field(frames[-1])
    picture = plots.surfaces if in_space else plots.from_above
    picture(folder / "sheet.png", frames, field)
    if any(frame.fields["damage"].any() for frame in frames if "damage" in frame.fields):
        picture(folder / "damage.png", frames, "damage", limits=(0.0, 1.0))
    along = "stretch_direction" if "stretch_direction" in frames[0].fields else None
    for name in ("stress", "thickness"):
        if name in frames[0].fields:
            picture(folder / f"{name}.png", frames, name, along=along)


def telling_field(last: Shown) -> tuple[str, bool]:
    """The field that shows what a sheet did by its last frame, and whether it is drawn in space.

    Of a curved sheet it is the size of the displacement, otherwise its component out of the plane, or the largest one.
    """
    size = float(np.ptp(last.reference, axis=0).max())
    moved = [float(np.abs(last.fields[name][last.framed]).max()) for name in ("u1", "u2", "u3")]
    curved, deep = (float(np.ptp(places[:, 2])) > OUT_OF_PLANE * size for places in (last.reference, last.points))
    out_of_plane = moved[2] > OUT_OF_PLANE * size
    field = "u" if curved else "u3" if out_of_plane else f"u{int(np.argmax(moved)) + 1}"
    return field, out_of_plane or curved or deep


def _values(history: Sequence[Mapping[str, float]], name: str) -> np.ndarray:
    values = np.array([row.get(name, np.nan) for row in history], float)
    return np.asarray(values[np.isfinite(values)])


def _round_off(
    history: Sequence[Mapping[str, float]], units: Mapping[str, str], size: float, bits: int
) -> dict[str, float]:
    """Round-off of columns by unit, from the largest number of each, the energy, and the size of the sheet [m].

    Under the unit "1" it is the relative one.
    """
    relative = ROUNDINGS * float(np.finfo(f"f{bits // 8}").eps)
    largest: dict[str, float] = {"m": size}
    for name in history[-1]:
        unit = column_unit(name, units)
        largest[unit] = max(largest.get(unit, 0.0), float(np.abs(_values(history, name)).max(initial=0.0)))
    # An energy over the size is a force of the sheet.
    largest["N"] = max(largest.get("N", 0.0), largest.get("J", 0.0) / size)
    noise = {unit: relative * value for unit, value in largest.items() if unit}
    return {**noise, "1": relative}


def _moves(
    history: Sequence[Mapping[str, float]], name: str, noise: Mapping[str, float], units: Mapping[str, str]
) -> bool:
    """Whether a column changes by more than round-off."""
    values = _values(history, name)
    if not len(values):
        return False
    allowed = max(noise.get(column_unit(name, units), 0.0), noise["1"] * float(np.abs(values).max()))
    return bool(np.ptp(values) > allowed)


def _counts(history: Sequence[Mapping[str, float]], name: str) -> bool:
    """Whether a vector component, such as ball_force_x, is larger than the noise of the largest component."""
    if name[-2:] not in ("_x", "_y", "_z"):
        return True
    reach = {c: max(abs(row.get(name[:-1] + c, 0.0)) for row in history) for c in "xyz"}
    force = name[:-1].replace("_torque_", "_force_")
    of_force = max(abs(row.get(force + c, 0.0)) for row in history for c in "xyz")
    return reach[name[-1]] > max(NOISE * max(reach.values()), ARM * of_force if "_torque_" in name else 0.0)


@drawn_beside
def _draw_numbers(
    folder: Path, columns: Mapping[str, Sequence[dict[str, float]]], units: Mapping[str, str], still: Sequence[str]
) -> None:  # fmt: skip
    """Draw one panel per number, with its rows of the history, and a line that lists numbers without a panel."""
    drawn, others = list(columns)[:MOST_NUMBERS], list(columns)[MOST_NUMBERS:]
    across = min(len(drawn), 3)
    figure, panels = new_panels(len(drawn), across, (4.2, 2.9), (0.0, 0.3))
    for axes, name in zip(panels, drawn, strict=True):
        plots.draw_curves(axes, columns[name], [name])
        axes.set(xlabel=plots.across_label("time"), ylabel=with_unit(name, units.get(name, "")))
    told = [f"{word} {', '.join(map(column_label, found))}" for word, found in (
        ("constant but for round-off, or missing:", still), ("only in history.csv:", others)) if found]  # fmt: skip
    if told:
        figure.supxlabel(fill("; ".join(told), 40 * across), fontsize=8)
    save(figure, folder / "measures.png")
