"""Pictures of results: surfaces in 3D and from above, and curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..geometry.triangulation import boundary_sides, directed_edges
from ..output.quantities import ENERGIES, column_label, field_label, with_unit
from .beside import drawn_beside
from .coarsen import clusters, contracted, drawn
from .painter import (
    ONE_SIGN,
    ColourScale,
    DepthBuffer,
    View,
    material_lines,
    places_of,
    require_left,
    scale_of,
    strokes,
)
from .pictures import (
    MOST_VECTORS,
    RESOLUTION_IN_VECTORS,
    Shown,
    current,
    enlarged,
    enlargement,
    frames_at,
    new_figure,
    new_panels,
    save,
)

# Triangles of a sheet above which larger ones are drawn, about half as many.
MOST_TRIANGLES = 400_000
STYLES = ("-", "--", "-.", ":")
# Rows of a history below which every one has a marker.
FEW = 40
# Colours of the lines of the material, of edges and cracks, of bodies, and of strokes [red, green, blue, opacity].
LINE, EDGE, BODY = (0.0, 0.0, 0.0, 0.3), (0.0, 0.0, 0.0, 0.5), (0.55, 0.6, 0.68, 1.0)
STRONG = (0.0, 0.0, 0.0, 0.9)
# Elevation and azimuth of the viewpoint [degrees].
VIEW = (28.0, -60.0)
# Width of a body over that of the sheet below which it is marked in a picture from above.
NEEDLE = 0.05
# Width of strokes [points].
STROKE = 0.5
# Sheets closer than this fraction of the picture are in contact.
IN_CONTACT = 1e-3
# Bodies are drawn so much further away than they are.
FACETS = 4e-3
# Width of a panel, what labels take of it beside and below the box, and a line of a title [inches].
PANEL, BESIDE, BELOW, TITLE_LINE = 4.4, 0.9, 1.15, 0.18
# Ratio of its sides from which a sheet is a strip, and the width of a title [inches].
STRIP, TITLE_WIDTH = 2.5, 2.0
# Height over width of a box: a lower one leaves room above, a taller one makes the panel narrower.
LOWEST, TALLEST = 0.3, 1.4
# Most repetitions of the layout of a figure.
LAYOUTS = 6
# Room for the label of a tick across and upwards [inches].
TICK, TICK_UP = 0.75, 0.3
# Distances of tick labels and names from the edges of the box, and of labels from each other and from corners [points].
TICK_APART, NAME_APART, TICK_NEXT, CORNER = 9.0, 32.0, 38.0, 14.0


@drawn_beside
def surfaces(
    path: Path,
    frames: Sequence[Shown],
    field: str,
    label: str | None = None,
    limits: tuple[float, float] | None = None,
    view: tuple[float, float] = VIEW,
    cut: str | None = None,
    along: str | None = None,
) -> None:
    """Draw the deformed sheet in 3D at some times, coloured by a field, with material lines.

    There is no shading, so colours match the colour bar exactly.

    Args:
        path: File of the picture.
        frames: One panel per frame, with a common colour scale.
        field: Name of the field.
        label: Its name and unit; by default from `labels`.
        limits: Limits of the colour scale; by default those of the field.
        view: Elevation and azimuth of the viewpoint [degrees].
        cut: What of sheet and bodies is cut away, such as "y<0.05" [m].
        along: A field of directions, such as "stretch_direction", drawn as strokes in place of the material lines.
    """
    save(surfaces_figure(frames, frames, field, label, limits, view, cut, along), path)


def surfaces_figure(
    every: Sequence[Shown],
    frames: Sequence[Shown],
    field: str,
    label: str | None = None,
    limits: tuple[float, float] | None = None,
    view: tuple[float, float] = VIEW,
    cut: str | None = None,
    along: str | None = None,
) -> Any:
    """The figure of `surfaces` for some `frames` of `every` one, all of which it has room and colours for."""
    scale = scale_of(every, field, label or field_label(field), limits)
    everything = np.concatenate([places_of(frame) for frame in every])
    require_left(cut, everything)
    seen = View.of(everything.min(axis=0), everything.max(axis=0), *view)
    places = np.concatenate([everything, *(np.array(edge[1:3]) for edge in seen.edges())])
    across = seen.seen(places)[:, :2]
    low, high = across.min(axis=0), across.max(axis=0)
    shape = max(float((high - low)[1] / (high - low)[0]), LOWEST)
    wide = (PANEL - BESIDE) * min(1.0, TALLEST / shape)
    columns = _columns(len(frames))
    points = 72.0 * wide / float((high - low)[0])
    grown = enlarged(seen.grown)
    tall = wide * shape + BELOW + TITLE_LINE * len(grown)
    figure, panels = new_panels(len(frames), columns, (wide + BESIDE, tall), (1.4, 0.3))
    for axes, frame in zip(panels, frames, strict=True):
        axes.set_axis_off()
        axes.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.set_title("\n".join([frame.when, *grown]), fontsize=10)
        _paint(axes, frame, field, scale, seen, (wide, wide * shape), cut, along)
        _scale_the_box(axes, seen, points)
    scale.add_bar(figure, panels, shrink=0.7)
    _name(figure, frames)
    _lay_out(figure, panels)
    return figure


def _lay_out(figure: Any, panels: Sequence[Any]) -> None:
    """Repeat the layout until the labels of all panels are inside: it takes free room beside a panel for a margin."""
    for _ in range(LAYOUTS):
        figure.get_layout_engine().execute(figure)
        boxes = [axes.get_tightbbox() for axes in panels]
        if all(box.x0 >= 0.0 and box.x1 <= figure.bbox.x1 for box in boxes):
            return


@drawn_beside
def from_above(
    path: Path,
    frames: Sequence[Shown],
    field: str,
    label: str | None = None,
    limits: tuple[float, float] | None = None,
    cut: str | None = None,
    along: str | None = None,
) -> None:
    """Draw the deformed sheet and thin bodies at some times, seen from +z; arguments as for `surfaces`."""
    save(from_above_figure(frames, frames, field, label, limits, cut, along), path)


def from_above_figure(
    every: Sequence[Shown],
    frames: Sequence[Shown],
    field: str,
    label: str | None = None,
    limits: tuple[float, float] | None = None,
    cut: str | None = None,
    along: str | None = None,
) -> Any:
    """The figure of `from_above` for some `frames` of `every` one, all of which it has room and colours for."""
    from matplotlib.ticker import MaxNLocator

    scale = scale_of(every, field, label or field_label(field), limits)
    everything = np.concatenate([f.points[f.framed] for f in every])
    require_left(cut, everything)
    low, high = everything.min(axis=0)[:2], everything.max(axis=0)[:2]
    longest = float((high - low).max())
    grown = enlargement(high - low)
    margin = 0.03 * longest / grown
    extent = high - low + 2.0 * margin
    shape = float(np.divide(*(extent * grown)[::-1]))
    # Strips lie beside each other along their length.
    columns = 1 if shape < 1.0 / STRIP else len(frames) if shape > STRIP else _columns(len(frames))
    wide = (6.0 if columns == 1 else 4.2) * min(1.0, 1.5 / shape)
    size = (wide, wide * shape)
    told = enlarged(grown)
    # The bar of colours needs some height.
    room = (max(wide, TITLE_WIDTH if told else 1.5), max(size[1], 1.2) + 0.5 + TITLE_LINE * len(told))
    figure, panels = new_panels(len(frames), columns, room, (1.4, 0.4), sharex=True, sharey=True)
    seen = View(np.zeros(3), np.append(high, 0.0), np.ones(3), np.eye(3))
    for axes, frame in zip(panels, frames, strict=True):
        axes.set_aspect(grown[1] / grown[0])
        axes.set_title("\n".join([frame.when, *told]), fontsize=10)
        axes.set(xlim=(low[0] - margin[0], high[0] + margin[0]), ylim=(low[1] - margin[1], high[1] + margin[1]))
        _paint(axes, replace(frame, bodies=(), balls=()), field, scale, seen, size, cut, along)
        for vertices, _ in frame.bodies:
            # A larger body would hide the sheet, and the lines of this one could not be seen.
            if len(vertices) and np.ptp(vertices[:, :2], axis=0).max() < NEEDLE * (high - low).max():
                middle = vertices[:, :2].mean(axis=0)
                axes.plot(*middle, "o", markersize=5.0, color=BODY, markeredgecolor=EDGE, markeredgewidth=0.7)
        axes.xaxis.set_major_locator(MaxNLocator(max(1, min(5, int(wide / TICK)))))
        axes.yaxis.set_major_locator(MaxNLocator(max(1, min(8, int(size[1] / TICK_UP)))))
    figure.supxlabel("x (m)")
    figure.supylabel("y (m)")
    scale.add_bar(figure, panels)
    _name(figure, frames)
    return figure


@drawn_beside
def reference(
    path: Path,
    frames: Sequence[Shown],
    field: str,
    label: str | None = None,
    limits: tuple[float, float] | None = None,
) -> None:
    """Draw a field on the reference sheet at some times, for example to show the paths of cracks."""
    from_above(path, [replace(f, points=f.reference, bodies=()) for f in frames], field, label, limits)


@drawn_beside
def curves(
    path: Path,
    history: Sequence[dict[str, float]],
    names: Sequence[str],
    ylabel: str,
    against: str = "time",
    xlabel: str | None = None,
    marks: Sequence[tuple[float, float]] = (),
    marks_label: str = "reference",
) -> None:
    """Plot columns of the history against another column.

    Args:
        path: File of the picture.
        history: One row per frame.
        names: Columns to draw; missing ones are skipped. If all are zero throughout, the picture says so.
        ylabel: Their name and unit.
        against: The column on the horizontal axis.
        xlabel: Its name and unit; by default the time, or in static runs the load factor.
        marks: Reference values (x, y).
        marks_label: Label of the reference values.
    """
    figure = new_figure(6.4, 4.0)
    axes = figure.subplots()
    draw_curves(axes, history, names, against)
    if marks:
        axes.plot(*zip(*marks, strict=True), "k+", markersize=10, label=marks_label)
    axes.set(xlabel=xlabel or across_label(against), ylabel=ylabel)
    axes.legend()
    save(figure, path)


def draw_curves(axes: Any, history: Sequence[dict[str, float]], names: Sequence[str], against: str = "time") -> None:
    """Plot columns of the history against another column, on axes."""
    duration = current().load_duration if against == "time" else None
    across = [row[against] / (duration or 1.0) for row in history]
    known = [name for name in names if all(name in row for row in history)]
    for k, name in enumerate(known):
        # One curve may lie on another one.
        style = {"linestyle": STYLES[k % len(STYLES)], "marker": "." if len(history) < FEW else ""}
        axes.plot(across, [row[name] for row in history], label=column_label(name), **style)
    if not any(row[name] for row in history for name in known):
        axes.text(0.5, 0.5, "zero throughout", transform=axes.transAxes, ha="center")
    axes.grid(alpha=0.3)
    part_ticks(axes)


def part_ticks(axes: Any) -> None:
    """Take so few ticks along the horizontal axis that their labels do not meet."""
    from matplotlib.ticker import MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(5))


def across_label(against: str) -> str:
    """Name and unit of a column on the horizontal axis."""
    if against != "time":
        return with_unit(against)
    return "time (s)" if current().load_duration is None else "load factor"


@drawn_beside
def profiles(path: Path, lines: Sequence[tuple[str, np.ndarray, np.ndarray, str]], xlabel: str, ylabel: str) -> None:
    """Plot curves (label, x, y, Matplotlib style), each with separate x values."""
    figure = new_figure(6.4, 4.0)
    axes = figure.subplots()
    for label, x, y, style in lines:
        axes.plot(x, y, style, label=label, markersize=4, markevery=max(1, len(x) // 40))
    axes.set(xlabel=xlabel, ylabel=ylabel)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    save(figure, path)


@drawn_beside
def fitted(path: Path, panels: Sequence[tuple[str, str, str, np.ndarray, np.ndarray, np.ndarray, np.ndarray]]) -> None:
    """Plot data with the fitted model above and scaled residuals below, one column per test.

    A panel has a title, labels of both axes, controlled values, measured values, model values, and residuals [-].
    """
    figure = new_figure(4.2 * len(panels), 5.0)
    for k, (title, xlabel, ylabel, at, data, model, residual) in enumerate(panels):
        order = np.argsort(at)
        above = figure.add_subplot(2, len(panels), k + 1)
        above.plot(at, data, "k.", markersize=4, label="data")
        above.plot(at[order], model[order], "-", color="tab:red", linewidth=1.0, label="fit")
        above.set_title(title, fontsize=9)
        above.set_ylabel(ylabel)
        above.legend(frameon=False)
        below = figure.add_subplot(2, len(panels), len(panels) + k + 1)
        below.axhline(0.0, color="0.6", linewidth=0.8)
        below.plot(at, 100.0 * residual, "k.", markersize=4)
        below.set_xlabel(xlabel)
        below.set_ylabel("model - data (%)")
    save(figure, path)


@drawn_beside
def directions(path: Path, frame: Shown, label: str, across: int = 40) -> None:
    """Draw the directions of the largest principal stress as strokes on the reference sheet.

    The length of a stroke is proportional to the square root of the stress; stresses below zero have none.

    Args:
        path: Path of the picture.
        frame: A frame with the field "principal_stress": largest, smallest, angle [rad].
        label: Label of the colour bar.
        across: Approximate number of strokes along the longer side.
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
        x, y, length * np.cos(angle), length * np.sin(angle), largest, cmap=ONE_SIGN, pivot="mid", headwidth=0,
        headlength=0, headaxislength=0, scale=0.7 * across,
    )  # fmt: skip
    axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")
    axes.set_title(frame.when, fontsize=10)
    figure.colorbar(drawn, ax=axes, label=label)
    _name(figure, [frame])
    save(figure, path)


def _columns(panels: int) -> int:
    """Up to three panels side by side, four in a square, more in rows of three."""
    return 2 if panels == 4 else min(panels, 3)


def _name(figure: Any, frames: Sequence[Shown]) -> None:
    """Write the scene's name above a picture, unless the run's settings already have a title."""
    if not current().title and frames and frames[0].scene:
        figure.suptitle(frames[0].scene, fontsize=10)


def _paint(
    axes: Any, frame: Shown, field: str, scale: ColourScale, seen: View, size: tuple[float, float], cut: str | None,
    along: str | None,
) -> None:  # fmt: skip
    """Draw sheet, lines and bodies within the limits of `axes`, of that size [inches]; near ones hide far ones."""
    from matplotlib.collections import LineCollection

    frame = _with_fewer_triangles(frame)
    values = frame.fields[field][frame.triangles].mean(axis=1)
    sheet = seen.seen(frame.points[frame.triangles])
    # Of two sheets in contact the one with a value is shown.
    sheet[~np.isfinite(values), :, 2] -= IN_CONTACT * seen.size
    bodies, greys = _bodies(frame, seen)
    # Facets of a body cut into a sheet that lies on it.
    bodies[..., 2] -= FACETS * seen.size
    low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
    columns, rows = (max(1, round(RESOLUTION_IN_VECTORS * side)) for side in size)
    buffer = DepthBuffer.of(low, high, columns, rows, None if cut is None else seen.cut(cut))
    buffer.draw(sheet, scale.colours(values))
    buffer.draw(bodies, greys)
    extent = (low[0], high[0], low[1], high[1])
    axes.imshow(buffer.image, extent=extent, origin="lower", aspect=axes.get_aspect(), zorder=0.5)
    lines, owners = material_lines(frame) if along is None else strokes(frame, along)
    outline, rim = _outlines(frame)
    owners = np.concatenate([owners, rim])
    ends = seen.seen(np.concatenate([lines, outline]))
    ends[~np.isfinite(values[owners]), :, 2] -= IN_CONTACT * seen.size
    pieces: Any
    pieces, line = buffer.seen(ends, sheet[owners])
    inks = np.where(line[:, None] < len(lines), LINE if along is None else STRONG, EDGE)
    drawn_lines = LineCollection(
        pieces, colors=inks, linewidths=STROKE, capstyle="butt", rasterized=len(pieces) > MOST_VECTORS
    )
    # Limits and layout come from elsewhere, and asking every line for its extent takes long.
    drawn_lines.set_in_layout(False)
    axes.add_collection(drawn_lines, autolim=False)
    for ball in frame.balls:
        _dash_the_ball(axes, ball, seen)


def _with_fewer_triangles(frame: Shown) -> Shown:
    """The frame itself, or with larger triangles in place of more than `MOST_TRIANGLES`."""
    if len(frame.triangles) <= MOST_TRIANGLES:
        return frame
    cluster = clusters(frame.reference, frame.triangles, frame.triangles, MOST_TRIANGLES // 4)
    sheet = drawn([contracted(frame.triangles, cluster)], len(frame.points))
    return replace(frame, triangles=sheet.points[sheet.triangles])


def _outlines(frame: Shown) -> tuple[np.ndarray, np.ndarray]:
    """Edges of the sheet and of its regions: ends [m], shape (E, 2, 3), and the triangle of each, shape (E,)."""
    found = []
    regions = [np.isin(frame.triangles, points).all(axis=1) for points in frame.regions]
    for inside in map(np.flatnonzero, [np.ones(len(frame.triangles)), *regions]):
        sides = boundary_sides(frame.triangles[inside])
        found.append((directed_edges(frame.triangles[inside])[sides], inside[sides % max(len(inside), 1)]))
    edges, owners = (np.concatenate(each) for each in zip(*found, strict=True))
    return frame.points[edges], owners


def _bodies(frame: Shown, seen: View) -> tuple[np.ndarray, np.ndarray]:
    """Projected triangles of bodies, shape (F, 3, 3), and their shades of grey, shape (F, 4)."""
    corners = np.concatenate([np.zeros((0, 3, 3)), *(vertices[triangles] for vertices, triangles in frame.bodies)])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    shades = np.tile(BODY, (len(corners), 1))
    shades[:, :3] *= 0.6 + 0.4 * np.abs(normal @ np.array([-0.4, -0.5, 0.77]))[:, None]
    return seen.seen(corners), shades


def _dash_the_ball(axes: Any, ball: tuple[np.ndarray, float], seen: View) -> None:
    """Draw the dashed outline of the ball, also where the sheet hides it."""
    centre, diameter = ball
    middle, *ends = seen.seen(centre + 0.5 * diameter * np.vstack([np.zeros(3), np.eye(3)]))[:, :2]
    # The image of a sphere under a linear map is an ellipse along its singular vectors.
    turn, sizes, _ = np.linalg.svd((np.array(ends) - middle).T)
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    ring = middle + np.stack([np.cos(angle), np.sin(angle)], axis=1) * sizes @ turn.T
    axes.plot(*ring.T, "--", color=(0.2, 0.25, 0.35), linewidth=0.7)


def _scale_the_box(axes: Any, seen: View, points: float) -> None:
    """Draw coordinate scales along three edges of the bounding box; a unit of length is about `points` / 72 inch."""
    from matplotlib.ticker import MaxNLocator

    for c, start, end, away in seen.edges():
        rim = seen.seen(np.array([start, end]))[:, :2]
        axes.plot(*rim.T, color="0.4", linewidth=0.7, zorder=0, clip_on=False)
        length = points * float(np.linalg.norm(rim[1] - rim[0]))
        place = {"ha": _side(away[0], "right", "left"), "va": _side(away[1], "top", "bottom")}
        style = {"textcoords": "offset points", "annotation_clip": False}
        most = int(min(length / TICK_NEXT, 4))
        for tick in MaxNLocator(most).tick_values(start[c], end[c]) if most else ():
            fraction = (tick - start[c]) / (end[c] - start[c])
            # Two labels would collide at a corner.
            if not CORNER < fraction * length < length - CORNER:
                continue
            at = rim[0] + fraction * (rim[1] - rim[0])
            axes.plot(*np.array([at, at + 4.0 / points * away]).T, color="0.4", linewidth=0.7, clip_on=False)
            axes.annotate(f"{round(tick, 12):g}", at, tuple(TICK_APART * away), fontsize=8, **place, **style)
        name = f"{'xyz'[c]} (m)"
        if c == 2:
            axes.annotate(name, rim[1], (0.0, 6.0), fontsize=9, ha="center", va="bottom", **style)
        else:
            apart = NAME_APART if most else TICK_APART
            axes.annotate(name, rim.mean(axis=0), tuple(apart * away), fontsize=9, **place, **style)


def _side(component: float, negative: str, positive: str) -> str:
    """Alignment of a text such that it extends away from its anchor."""
    return "center" if abs(component) < 0.35 else positive if component > 0.0 else negative


__all__ = ["ENERGIES", "Shown", "curves", "directions", "frames_at", "from_above", "new_figure", "profiles",
           "reference", "save", "surfaces"]  # fmt: skip
