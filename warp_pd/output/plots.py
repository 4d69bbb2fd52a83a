"""Pictures of results: surfaces in space, from above, and curves. Matplotlib is imported here and in `sheet_plot`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..frame import format_time
from .vtkhdf import read_ball, read_bodies, read_frame, read_series

COLOURS = "inferno_r"
# Triangles of the outline of a plane, which is drawn behind the sheet.
PLANE = 2
STYLES = ("-", "--", "-.", ":")
ENERGIES = ("kinetic", "strain", "external", "damping", "rupture", "viscous", "contact", "sheet_friction")


@dataclass(frozen=True, eq=False)
class Shown:
    """A frame as the pictures need it.

    Attributes:
        when: Its time or share of the load, in words.
        points: Deformed positions [m], shape (N, 3).
        reference: Reference positions [m], shape (N, 3).
        triangles: Intact triangles, shape (F, 3).
        fields: Point fields by name; u1, u2, u3 are the components of the displacement, and NAME_1, NAME_2, NAME_3
            those of another vector field NAME.
        ball: Centre [m], shape (3,), and diameter [m] of the ball, or None.
        bodies: Vertices [m] and triangles of the outlines of other rigid bodies.
    """

    when: str
    points: np.ndarray
    reference: np.ndarray
    triangles: np.ndarray
    fields: dict[str, np.ndarray]
    ball: tuple[np.ndarray, float] | None = None
    bodies: Sequence[tuple[np.ndarray, np.ndarray]] = ()


def frames_at(folder: Path, times: Sequence[float]) -> list[Shown]:
    """The frames of `folder`/frames.vtkhdf nearest to the given times [s], each at most once."""
    path = folder / "frames.vtkhdf"
    series = read_series(path)
    indices = sorted({int(np.argmin(np.abs(np.asarray(series.times) - t))) for t in times})
    load_duration = series.metadata.get("load_duration")
    return [_shown(path, index, load_duration) for index in indices]


def _shown(path: Path, index: int, load_duration: float | None) -> Shown:
    time, points, triangles, fields = read_frame(path, index)
    for c in range(3):
        fields[f"u{c + 1}"] = fields["displacement"][:, c]
    for name in [n for n, values in fields.items() if values.ndim == 2 and n != "displacement"]:
        for c in range(fields[name].shape[1]):
            fields[f"{name}_{c + 1}"] = fields[name][:, c]
    when = format_time(time, load_duration)
    return Shown(
        when,
        points,
        points - fields["displacement"],
        triangles,
        fields,
        read_ball(path, index),
        read_bodies(path, index),
    )


def surfaces(
    path: Path,
    frames: Sequence[Shown],
    field: str,
    label: str,
    limits: tuple[float, float] | None = None,
    view: tuple[float, float] = (28.0, -60.0),
) -> None:
    """The deformed sheet in space at some times, coloured by a field and shaded; the ball shows through it.

    Args:
        path: Of the picture.
        frames: One panel each.
        field: Name of the field.
        label: Its name and unit.
        limits: Of the colours; by default those of the field.
        view: Elevation and azimuth of the eye [degrees].
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.ticker import MaxNLocator

    columns = _columns(len(frames))
    rows = -(-len(frames) // columns)
    colours, norm = _colours(frames, field, limits)
    figure = new_figure(5.2 * columns, 4.2 * rows)
    figure.get_layout_engine().set(wspace=0.1)
    axes_list = []
    bounds = np.array([_bounds(f) for f in frames])
    low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    extent = np.maximum(high - low, 1e-12)
    shown_extent = np.maximum(extent, 0.25 * extent.max())
    for k, frame in enumerate(frames):
        axes = figure.add_subplot(rows, columns, k + 1, projection="3d", computed_zorder=False)
        values = frame.fields[field][frame.triangles].mean(axis=1)
        face = colours(norm(values))
        face[:, :3] *= _shade(frame)[:, None]
        axes.add_collection3d(_polygons(frame, face))
        if frame.ball is not None:
            axes.plot_surface(*_sphere(*frame.ball), color="tab:blue", alpha=0.35, linewidth=0, zorder=3)
        for vertices, triangles in frame.bodies:
            axes.plot_trisurf(
                *vertices.T, triangles=triangles, color="tab:blue", alpha=0.35, linewidth=0,
                zorder=0 if len(triangles) == PLANE else 3,
            )  # fmt: skip
        grown = shown_extent / extent
        grown /= grown.min()
        stretched = [f"{name} drawn {g:.2g} times as large" for name, g in zip("xyz", grown, strict=True) if g > 1.05]
        axes.set(title="\n".join([frame.when, *stretched]))
        for c, name in enumerate("xyz"):
            getattr(axes, f"set_{name}lim")(low[c], low[c] + extent[c])
            getattr(axes, f"set_{name}label")(f"{name} (m)")
            getattr(axes, f"{name}axis").set_major_locator(MaxNLocator(4 if grown[c] <= 1.05 else 3))
        axes.zaxis.labelpad = 8
        # The background of a panel would hide the labels of the one before it.
        axes.set_facecolor("none")
        axes.set_box_aspect(shown_extent)
        axes.view_init(elev=view[0], azim=view[1])
        axes_list.append(axes)
    figure.colorbar(ScalarMappable(norm, colours), ax=axes_list, label=label, shrink=0.7, pad=0.12)
    save(figure, path)


def from_above(
    path: Path, frames: Sequence[Shown], field: str, label: str, limits: tuple[float, float] | None = None
) -> None:
    """The deformed sheet at some times, seen from +z, lower triangles drawn first."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import PolyCollection
    from matplotlib.ticker import MaxNLocator

    columns = _columns(len(frames))
    rows = -(-len(frames) // columns)
    colours, norm = _colours(frames, field, limits)
    corners = np.concatenate([f.points[_used(f), :2] for f in frames])
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = 0.03 * (high - low).max()
    width = 6.0 if columns == 1 else 4.2
    height = min(max(width * (high - low)[1] / (high - low)[0], 1.0), 1.5 * width)
    figure = new_figure(width * columns + 1.4, (height + 0.5) * rows + 0.4)
    axes_grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for axes, frame in zip(axes_grid.flat, frames, strict=False):
        order = np.argsort(frame.points[frame.triangles, 2].mean(axis=1))
        triangles = frame.triangles[order]
        face = colours(norm(frame.fields[field][triangles].mean(axis=1)))
        face[:, :3] *= _shade(frame)[order][:, None]
        axes.add_collection(PolyCollection(list(frame.points[triangles][:, :, :2]), facecolors=face, edgecolors=face))
        axes.set(aspect="equal", title=frame.when)
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.set_xlim(low[0] - margin, high[0] + margin)
        axes.set_ylim(low[1] - margin, high[1] + margin)
    for axes in axes_grid.flat[len(frames) :]:
        axes.set_visible(False)
    figure.supxlabel("x (m)")
    figure.supylabel("y (m)")
    figure.colorbar(ScalarMappable(norm, colours), ax=axes_grid, label=label)
    save(figure, path)


def reference(
    path: Path, frames: Sequence[Shown], field: str, label: str, limits: tuple[float, float] | None = None
) -> None:
    """A field on the reference sheet at some times: where cracks run, whatever the sheet does in space."""
    from_above(path, [replace(f, points=f.reference) for f in frames], field, label, limits)


def curves(
    path: Path,
    history: Sequence[dict[str, float]],
    names: Sequence[str],
    ylabel: str,
    against: str = "time",
    xlabel: str = "time (s)",
    marks: Sequence[tuple[float, float]] = (),
    marks_label: str = "reference",
) -> None:
    """Columns of the history against another one.

    Args:
        path: Of the picture.
        history: One row a frame.
        names: Columns to draw; one that is missing is left out. If all are zero throughout, the picture says so.
        ylabel: Their name and unit.
        against: The column on the horizontal axis.
        xlabel: Its name and unit.
        marks: Reference values (x, y).
        marks_label: What they are.
    """
    figure = new_figure(6.4, 4.0)
    axes = figure.subplots()
    across = [row[against] for row in history]
    known = [name for name in names if all(name in row for row in history)]
    for k, name in enumerate(known):
        # One curve may lie on another one.
        axes.plot(across, [row[name] for row in history], STYLES[k % len(STYLES)], label=name.replace("_", " "))
    if not any(row[name] for row in history for name in known):
        axes.text(0.5, 0.5, "zero throughout", transform=axes.transAxes, ha="center")
    if marks:
        axes.plot(*zip(*marks, strict=True), "k+", markersize=10, label=marks_label)
    axes.set(xlabel=xlabel, ylabel=ylabel)
    axes.grid(alpha=0.3)
    axes.legend()
    save(figure, path)


def profiles(path: Path, lines: Sequence[tuple[str, np.ndarray, np.ndarray, str]], xlabel: str, ylabel: str) -> None:
    """Curves (label, x, y, style of matplotlib), each with points of its own."""
    figure = new_figure(6.4, 4.0)
    axes = figure.subplots()
    for label, x, y, style in lines:
        axes.plot(x, y, style, label=label, markersize=4, markevery=max(1, len(x) // 40))
    axes.set(xlabel=xlabel, ylabel=ylabel)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    save(figure, path)


def directions(path: Path, frame: Shown, label: str, across: int = 40) -> None:
    """Largest principal stress as strokes along its direction on the reference sheet, about `across` of them in a row.

    Their length grows with the root of the stress.

    Args:
        path: Of the picture.
        frame: With the field "principal_stress": largest, smallest, angle [rad].
        label: Of the colours.
        across: Strokes along the longer side.
    """
    size = np.ptp(frame.reference[:, :2], axis=0)
    step = max(1, round(float(np.sqrt(len(frame.reference) * size.max() / size.min())) / across))
    cell = np.sqrt(size[0] * size[1] / len(frame.reference))
    place = np.round((frame.reference[:, :2] - frame.reference[:, :2].min(axis=0)) / cell).astype(int)
    chosen = (place % step == step // 2).all(axis=1)
    largest, angle = frame.fields["principal_stress"][chosen][:, [0, 2]].T
    x, y = frame.reference[chosen, :2].T
    width = 8.0
    figure = new_figure(width + 1.5, max(2.5, width * size[1] / size[0]) + 0.6)
    axes = figure.subplots()
    length = np.sqrt(np.maximum(largest, 0.0) / (largest.max() if largest.max() > 0.0 else 1.0))
    drawn = axes.quiver(
        x, y, length * np.cos(angle), length * np.sin(angle), largest, cmap=COLOURS, pivot="mid", headwidth=0,
        headlength=0, headaxislength=0, scale=0.7 * across,
    )  # fmt: skip
    axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")
    figure.colorbar(drawn, ax=axes, label=label)
    save(figure, path)


def _columns(panels: int) -> int:
    """One panel alone, two side by side, up to four in a square, more in rows of three."""
    return 1 if panels == 1 else 2 if panels <= 4 else 3


def _colours(frames: Sequence[Shown], field: str, limits: tuple[float, float] | None) -> tuple[Any, Any]:
    from matplotlib import colormaps
    from matplotlib.colors import Normalize

    return colormaps[COLOURS], Normalize(*(limits or _range(frames, field)))


def new_figure(width: float, height: float) -> Any:
    """A figure that is drawn into files alone: pyplot, and the backend that a user chose for it, have no part in it."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def _polygons(frame: Shown, face: np.ndarray) -> Any:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    return Poly3DCollection(frame.points[frame.triangles], facecolors=face, edgecolors=face, linewidths=0.2)


def _bounds(frame: Shown) -> np.ndarray:
    """Lowest and highest coordinates of the sheet, the ball, and bodies no larger than the sheet [m], shape (2, 3)."""
    points = frame.points[_used(frame)]
    if frame.ball is not None:
        centre, diameter = frame.ball
        points = np.vstack([points, centre - 0.5 * diameter, centre + 0.5 * diameter])
    largest = np.ptp(points, axis=0).max()
    shown = [vertices for vertices, _ in frame.bodies if np.ptp(vertices, axis=0).max() <= largest]
    points = np.vstack([points, *shown])
    return np.array([points.min(axis=0), points.max(axis=0)])


def _sphere(centre: np.ndarray, diameter: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates of a net on a sphere [m], each of shape (13, 25)."""
    polar, around = np.meshgrid(np.linspace(0.0, np.pi, 13), np.linspace(0.0, 2.0 * np.pi, 25), indexing="ij")
    direction = (np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar))
    x, y, z = (c + 0.5 * diameter * d for c, d in zip(centre, direction, strict=True))
    return x, y, z


def _used(frame: Shown) -> np.ndarray:
    """Points of intact triangles: loose points that fly away do not set the scale."""
    return np.unique(frame.triangles) if len(frame.triangles) else np.arange(len(frame.points))


def _shade(frame: Shown) -> np.ndarray:
    """Brightness of each triangle under a light from above left, shape (F,)."""
    corners = frame.points[frame.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.where(length > 0.0, length, 1.0)
    light = np.array([-0.4, -0.5, 0.77])
    return np.asarray(0.45 + 0.55 * np.abs(normal @ light))


def _range(frames: Sequence[Shown], field: str) -> tuple[float, float]:
    values = np.concatenate([f.fields[field][_used(f)] for f in frames])
    low, high = float(values.min()), float(values.max())
    return low, high if high > low else low + 1.0


def save(figure: Any, path: Path, **options: Any) -> None:
    """Write a picture, complete or not at all, in the format of its suffix."""
    aside = path.with_name(f".{path.name}.unfinished")
    figure.savefig(aside, dpi=130, format=path.suffix[1:].lower(), **options)
    os.replace(aside, path)
