"""Default pictures of a scene: the sheet, its damage, energies, measures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from ..geometry.picture_files import new_panels, save
from . import plots
from .beside import drawn_beside
from .picture_frames import Shown, frames_at
from .quantities import ENERGIES, column_label, column_unit, known_units
from .vtkhdf import read_series

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
) -> None:
    """Draw sheet.png, damage.png, energy.png and measures.png, except those for which the run has no data.

    `regions` are the points of each region of another material, whose outline is drawn; pieces without points of `held`
    do not widen a picture.
    """
    series = read_series(folder / "frames.vtkhdf")
    chosen = telling_frames(history, series.frames) if series.points <= LARGE else [series.frames - 1]
    if "stride" in series.metadata:
        # Points of the frames are not those of the sheet.
        regions, held = (), ()
    frames = [replace(frame, regions=regions, held=held) for frame in frames_at(folder, series.times[chosen].tolist())]
    if len(frames[0].triangles):
        _draw_sheet(folder, frames)
    if any(row.get(name) for row in history for name in ENERGIES):
        names = [name for name in ENERGIES if any(row.get(name) for row in history)]
        plots.curves(folder / "energy.png", history, names, ylabel="energy (J)")
    numbers = [name for name in history[-1] if name not in NOT_DRAWN and _moves(history, name)]
    measures = summary.get("measures", {})
    numbers = [name for name in numbers if name in measures or _counts(history, name)]
    numbers.sort(key=lambda name: name not in measures)
    if numbers and len(history) > 1:
        still = [name for name in measures if name in history[-1] and name not in numbers]
        _draw_numbers(folder, history, numbers, known_units(summary), still)


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
    """Draw the displacement, and the damage if there is any.

    Of a curved sheet it is the size of the displacement, otherwise its component out of the plane, or the largest one.
    """
    last = frames[-1]
    size = float(np.ptp(last.reference, axis=0).max())
    moved = [float(np.abs(last.fields[name][last.framed]).max()) for name in ("u1", "u2", "u3")]
    curved, deep = (float(np.ptp(places[:, 2])) > OUT_OF_PLANE * size for places in (last.reference, last.points))
    out_of_plane = moved[2] > OUT_OF_PLANE * size
    picture = plots.surfaces if out_of_plane or curved or deep else plots.from_above
    field = "u" if curved else "u3" if out_of_plane else f"u{int(np.argmax(moved)) + 1}"
    picture(folder / "sheet.png", frames, field)
    if any(frame.fields["damage"].any() for frame in frames if "damage" in frame.fields):
        picture(folder / "damage.png", frames, "damage", limits=(0.0, 1.0))


def _moves(history: Sequence[dict[str, float]], name: str) -> bool:
    values = np.array([row.get(name, np.nan) for row in history], float)
    values = values[np.isfinite(values)]
    return bool(len(values) and np.ptp(values) > 0.0)


def _counts(history: Sequence[dict[str, float]], name: str) -> bool:
    """Whether a vector component, such as ball_force_x, is larger than the noise of the largest component."""
    if name[-2:] not in ("_x", "_y", "_z"):
        return True
    reach = {c: max(abs(row.get(name[:-1] + c, 0.0)) for row in history) for c in "xyz"}
    force = name[:-1].replace("_torque_", "_force_")
    of_force = max(abs(row.get(force + c, 0.0)) for row in history for c in "xyz")
    return reach[name[-1]] > max(NOISE * max(reach.values()), ARM * of_force if "_torque_" in name else 0.0)


@drawn_beside
def _draw_numbers(
    folder: Path, history: Sequence[dict[str, float]], names: Sequence[str], units: Mapping[str, str],
    still: Sequence[str],
) -> None:  # fmt: skip
    """Draw one panel per number, and a line that lists numbers without a panel."""
    drawn, others = names[:MOST_NUMBERS], names[MOST_NUMBERS:]
    columns = min(len(drawn), 3)
    figure, panels = new_panels(len(drawn), columns, (4.2, 2.9), (0.0, 0.3))
    for axes, name in zip(panels, drawn, strict=True):
        plots.draw_curves(axes, history, [name])
        unit = column_unit(name, units)
        ylabel = column_label(name) + (f" ({unit})" if unit else "")
        axes.set(xlabel=plots.across_label("time"), ylabel=ylabel)
    told = [f"{word} {', '.join(map(column_label, found))}" for word, found in (
        ("constant or missing:", still), ("only in history.csv:", others)) if found]  # fmt: skip
    if told:
        figure.supxlabel(fill("; ".join(told), 40 * columns), fontsize=8)
    save(figure, folder / "measures.png")
