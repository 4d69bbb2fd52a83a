"""Pictures of the undeformed sheet."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from ..device.checks import of_kind, point_indices
from ..geometry.sheet import SIDES, Shape, Sheet
from ..geometry.triangulation import boundary_edges, boundary_rings, corner_sums, directed_edges, pieces, triangle_areas
from .pictures import enlarged, enlargement, new_figure, save, target

# Most triangles that are drawn one by one, most markers of a kind, most parts in the legend, longest side [inches].
MAX_TRIANGLES, MAX_MARKERS, MAX_PARTS, SIDE = 20_000, 8_000, 18, 8.0
RUBBER, EDGE, GRID_POINT, OTHER_POINT, RIGID, CUT = "#f0dfb8", "#3b2a14", "#16324f", "#a0622d", "#555555", "#c1121f"
# Colours of a thickness that varies.
THICKNESS = "YlOrBr"
PART_COLOURS = ("C0", "C1", "C2", "C3", "C4", "C6", "C8", "C9")
# Points on the two faces of a crack coincide: each is drawn so far into its triangles, as a fraction.
APART = 0.2
# Elevation and azimuth of the eye [degrees].
VIEW = (28.0, -60.0)
# The name of the whole edge, that of a sheet beside others with its number.
WHOLE_EDGE = re.compile(r"(?P<piece>(sheet \d+ )*)all")
# Labels and points of parts.
Parts: TypeAlias = Sequence[tuple[str, np.ndarray]]


def draw_shape(
    sheet: Shape,
    path: str | os.PathLike[str] | None = None,
    *,
    title: str = "",
    view: tuple[float, float] = VIEW,
    thickness: float | np.ndarray,
    stiffness: np.ndarray | None,
    regions: Parts = (),
) -> Any:
    """Draw a shape with thickness, stiffness and regions of materials; the public function is `warp_pd.draw_sheet`."""
    written = None if path is None else target(path)
    curved = bool(np.ptp(sheet.positions[:, 2]) > 0.0)
    varying = np.asarray(thickness) if np.ndim(thickness) else None
    parts = _parts(sheet, stiffness, regions)
    figure, axes = _curved(sheet, parts, varying, view) if curved else _flat(sheet, parts, varying)
    thin = [] if curved else enlarged(enlargement(np.ptp(sheet.points, axis=0)))
    lines = [*([title] if title else []), _described(sheet, varying), *thin]
    axes.set_title("\n".join(lines), fontsize=10, pad=20 if curved else 6)
    axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0, fontsize=8, frameon=False)
    if written is not None:
        save(figure, written, bbox_inches="tight", pad_inches=0.15)
    return figure


def _described(sheet: Shape, thickness: np.ndarray | None) -> str:
    size = " x ".join(f"{extent:.4g}" for extent in np.ptp(sheet.points, axis=0))
    text = f"{size} m, {sheet.size} points, {len(sheet.triangles)} triangles"
    text += f", spacing {sheet.spacing:.4g} m" if sheet.spacings is None else (
        f", spacing {sheet.spacings.min():.4g} to {sheet.spacings.max():.4g} m"
    )  # fmt: skip
    if thickness is not None:
        text += f", thickness {thickness.min():.4g} to {thickness.max():.4g} m"
    count = int(pieces(sheet.triangles).max()) + 1 if len(sheet.triangles) else 1
    return text if count == 1 else f"{text}, {count} pieces"


def _flat(sheet: Shape, parts: Parts, thickness: np.ndarray | None) -> tuple[Any, Any]:
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.patches import PathPatch

    where = _apart(sheet)
    low, high = where.min(axis=0), where.max(axis=0)
    grown = enlargement(high - low)
    extent = (high - low) * grown
    width, height = SIDE * extent / extent.max()
    figure = new_figure(max(width, 3.0) + 2.6, max(height, 1.0) + 1.2)
    axes = figure.subplots()
    edges = boundary_edges(sheet.triangles)
    if len(edges):
        outline = _filled(where, edges)
        axes.add_patch(PathPatch(outline, facecolor=RUBBER, edgecolor="none", zorder=0))
        if thickness is not None:
            shaded = axes.tripcolor(*where.T, sheet.triangles, thickness, cmap=THICKNESS, zorder=0.5)
            figure.colorbar(shaded, location="bottom", label="thickness (m)", shrink=0.6)
        if len(sheet.triangles) <= MAX_TRIANGLES:
            sides = where[np.unique(np.sort(directed_edges(sheet.triangles), axis=1), axis=0)]
            axes.add_collection(LineCollection(sides, colors="0.55", linewidths=0.35, label="triangles", zorder=1))
        axes.add_collection(LineCollection(where[edges], colors=EDGE, linewidths=1.2, label="boundary", zorder=4))
    typical = np.median(sheet.spacing if sheet.spacings is None else sheet.spacings)
    size = float(np.clip(0.35 * 72.0 * SIDE * typical / extent.max(), 0.8, 5.0))
    for label, members in _inclusions(sheet):
        inner = where[sheet.triangles[np.isin(sheet.triangles, members).all(axis=1)]]
        axes.add_collection(PolyCollection(inner, facecolors=RIGID, alpha=0.6, zorder=2))
        _markers(axes, where, members, label, color=RIGID, markersize=size + 2.0, marker="s", zorder=2.5)
    if sheet.cuts:
        axes.add_collection(LineCollection(sheet.cuts, colors=CUT, linewidths=2.0, label="cuts", zorder=5))
    for label, chosen, colour in _kinds(sheet):
        _markers(axes, where, chosen, label, color=colour, markersize=size, zorder=3)
    for rank, (label, chosen) in enumerate(parts):
        _markers(axes, where, chosen, label, **_part_style(parts, rank, size), zorder=6)
    margin = 0.03 * extent.max() / grown
    axes.set(aspect=grown[1] / grown[0], xlabel="x (m)", ylabel="y (m)")
    axes.set_xlim(low[0] - margin[0], high[0] + margin[0])
    axes.set_ylim(low[1] - margin[1], high[1] + margin[1])
    return figure, axes


def _curved(sheet: Shape, parts: Parts, thickness: np.ndarray | None, view: tuple[float, float]) -> tuple[Any, Any]:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import to_rgb
    from matplotlib.ticker import MaxNLocator
    from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

    where = sheet.positions
    low, high = where.min(axis=0), where.max(axis=0)
    figure = new_figure(SIDE + 2.6, SIDE)
    axes = figure.add_subplot(projection="3d", computed_zorder=False)
    triangles = sheet.triangles
    corners = where[triangles] if len(triangles) <= MAX_TRIANGLES else _coarse(where, triangles)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    shade = 0.5 + 0.5 * np.abs(normals @ (-0.4, -0.5, 0.77))
    face = np.column_stack([shade[:, None] * to_rgb(RUBBER), np.ones(len(shade))])
    if thickness is not None and len(triangles) <= MAX_TRIANGLES:
        shown = ScalarMappable(cmap=THICKNESS)
        face[:, :3] = shade[:, None] * shown.to_rgba(thickness[triangles].mean(axis=1))[:, :3]
        figure.colorbar(shown, ax=axes, location="bottom", label="thickness (m)", shrink=0.6)
    label = "triangles" if len(triangles) <= MAX_TRIANGLES else "triangles, joined to larger ones"
    lines = {"edgecolors": "0.45", "linewidths": 0.2}
    axes.add_collection3d(Poly3DCollection(corners, facecolors=face, label=label, zorder=1, **lines))
    edges = boundary_edges(triangles)
    if len(edges):
        axes.add_collection3d(Line3DCollection(where[edges], colors=EDGE, linewidths=1.2, label="boundary", zorder=3))
    for label, members in _inclusions(sheet):
        _markers(axes, where, members, label, color=RIGID, markersize=3.5, marker="s", zorder=2)
    for label, chosen, colour in _kinds(sheet):
        _markers(axes, where, chosen[_towards(sheet, view)[chosen]], label, color=colour, markersize=1.5, zorder=2)
    for rank, (label, chosen) in enumerate(parts):
        _markers(axes, where, chosen, label, **_part_style(parts, rank, 2.0), zorder=4)
    for c, name in enumerate("xyz"):
        getattr(axes, f"set_{name}lim")(low[c], high[c])
        getattr(axes, f"set_{name}label")(f"{name} (m)")
        # Labels of two axes would collide at a corner of the box.
        margin = 0.1 * (high[c] - low[c])
        ticks = [t for t in MaxNLocator(4).tick_values(low[c], high[c]) if low[c] + margin < t < high[c] - margin]
        getattr(axes, f"{name}axis").set_ticks(ticks)
    axes.zaxis.labelpad = 14
    axes.set_box_aspect(np.maximum(high - low, 1e-3 * (high - low).max()))
    axes.view_init(elev=view[0], azim=view[1])
    return figure, axes


def _markers(axes: Any, where: np.ndarray, chosen: np.ndarray, label: str, **style: Any) -> None:
    """Draw points as markers; a random subset if there are too many."""
    if len(chosen) == 0:
        return
    if len(chosen) > MAX_MARKERS:
        label = f"{label}, {MAX_MARKERS} shown"
        chosen = np.sort(np.random.default_rng(0).choice(chosen, MAX_MARKERS, replace=False))
    axes.plot(*where[chosen].T, **{"marker": "o", "linestyle": "none", "markeredgewidth": 0.0, "label": label, **style})


def _kinds(sheet: Shape) -> list[tuple[str, np.ndarray, str]]:
    """Label, points and colour of the points on the square grid and of the others."""
    if sheet.grid is None:
        return [(f"{sheet.size} points", np.arange(sheet.size), GRID_POINT)]
    on = sheet.grid[:, 0] >= 0
    inside, others = np.flatnonzero(on), np.flatnonzero(~on)
    return [
        (f"{len(inside)} points on the grid", inside, GRID_POINT),
        (f"{len(others)} other points", others, OTHER_POINT),
    ]


def _inclusions(sheet: Shape) -> list[tuple[str, np.ndarray]]:
    """Labels and points of the rigid inclusions; labels that begin with an underscore are not in the legend."""
    return [
        (f"rigid inclusion {number}, {len(points)} points" if number <= MAX_PARTS else "_more", points)
        for number, points in enumerate(sheet.inclusions, start=1)
    ]


def _parts(sheet: Shape, stiffness: np.ndarray | None, regions: Parts) -> list[tuple[str, np.ndarray]]:
    """Labels and points of regions, stiffened and named parts, largest first, so that smaller ones are on top."""
    stiffness = np.ones(0) if stiffness is None else stiffness
    stiff = {f"{s:g} times as stiff": np.flatnonzero(stiffness == s) for s in np.unique(stiffness[stiffness != 1.0])}
    hidden = _edges_kept(sheet)
    named = [(name, points) for name, points in sheet.parts.items() if name not in hidden]
    order = sorted([*regions, *named, *stiff.items()], key=lambda part: -len(part[1]))
    shown = [(f"{name}, {len(points)} points", points) for name, points in order[:MAX_PARTS]]
    rest = [points for _, points in order[MAX_PARTS:]]
    return shown if not rest else [*shown, (f"{len(rest)} more parts", np.unique(np.concatenate(rest)))]


def _edges_kept(sheet: Shape) -> set[str]:
    """Names of edges that an edit keeps: the boundary is drawn, and the sides of a flat sheet are where they seem."""
    sides = SIDES if sheet.frames is None else ()
    wholes = [found for name in sheet.parts if (found := WHOLE_EDGE.fullmatch(name))]
    return {found["piece"] + name for found in wholes for name in (*sides, "all")}


def _part_style(parts: Parts, rank: int, size: float) -> dict[str, Any]:
    """Colour and size of the markers of a part; those below others are larger and remain visible."""
    grown = size + 0.6 + 0.5 * min(len(parts) - rank - 1, 5)
    return {"color": PART_COLOURS[rank % len(PART_COLOURS)], "markersize": grown}


def _apart(sheet: Shape) -> np.ndarray:
    """Drawing positions of the points of a flat sheet, with crack faces moved apart [m], shape (N, 2)."""
    where = sheet.points.copy()
    edge = np.unique(boundary_edges(sheet.triangles))
    _, place, times = np.unique(where[edge], axis=0, return_inverse=True, return_counts=True)
    double = np.zeros(len(where), bool)
    double[edge[times[place.ravel()] > 1]] = True
    touched = sheet.triangles[double[sheet.triangles].any(axis=1)]
    middles = np.repeat(sheet.points[touched].mean(axis=1)[:, None], 3, axis=1)
    sums = [corner_sums(middles[..., c], touched, len(where))[double] for c in (0, 1)]
    count = np.bincount(touched.ravel(), minlength=len(where))[double]
    where[double] += APART * (np.column_stack(sums) / count[:, None] - where[double])
    return where


def _filled(where: np.ndarray, edges: np.ndarray) -> Any:
    """The area enclosed by the boundary, as a single path."""
    from matplotlib.path import Path as Outline

    closed = (where[np.append(ring, ring[:1])] for ring in boundary_rings(edges))
    return Outline.make_compound_path(*(Outline(ring, closed=True) for ring in closed))


def _coarse(where: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Coarsened triangles: points of a cell of a cubic grid are merged (Rossignac & Borrel 1993)."""
    low = where.min(axis=0)
    area = float(triangle_areas(where, triangles).sum())
    # A cell holds a square of the surface, and a square two triangles; it is cut at an angle.
    cell = np.sqrt(4.0 * area / MAX_TRIANGLES)
    _, of_cell = np.unique(np.floor((where - low) / cell).astype(np.int64), axis=0, return_inverse=True)
    of_cell = of_cell.ravel()
    count = np.bincount(of_cell)
    middle = np.column_stack([np.bincount(of_cell, component) / count for component in where.T])
    joined = of_cell[triangles]
    whole = (joined[:, 0] != joined[:, 1]) & (joined[:, 1] != joined[:, 2]) & (joined[:, 2] != joined[:, 0])
    joined = joined[whole]
    _, first = np.unique(np.sort(joined, axis=1), axis=0, return_index=True)
    return np.asarray(middle[joined[first]])


def _towards(sheet: Shape, view: tuple[float, float]) -> np.ndarray:
    """Mask of points on the visible side of a closed surface; all points of an open one, shape (N,)."""
    if len(boundary_edges(sheet.triangles)):
        return np.ones(sheet.size, bool)
    up, around = np.deg2rad(view)
    eye = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
    return np.asarray(sheet.normals @ eye > 0.0)


def draw_sheet(
    sheet: Sheet,
    path: str | os.PathLike[str] | None = None,
    *,
    title: str = "",
    view: tuple[float, float] = VIEW,
    regions: Sequence[tuple[Any, Any]] = (),
) -> Any:
    """Draw an undeformed sheet, flat or curved.

    The picture shows triangles, points (on and off a square grid in different colours), the boundary, cuts, rigid
    inclusions, stiffened points, regions of materials, named parts, and a varying thickness in colour. If there are too
    many points or triangles, it shows some of them and states how many. The two faces of a crack are drawn slightly
    apart.

    Args:
        sheet: The sheet.
        path: File of the picture (.png, .pdf or .svg); None writes no file.
        title: Title of the picture.
        view: Elevation and azimuth of the viewpoint [degrees], for a curved sheet.
        regions: Pairs of points and a material, as for `ByRegion`; `Simulation.draw` passes those of its material.

    Returns:
        The `matplotlib.figure.Figure`.

    Raises:
        InputError: if `sheet` is not a Sheet, or the path cannot be written.
    """
    of_kind("sheet", sheet, Sheet)
    named = [
        (f"region {k}: {type(material).__name__}", point_indices(f"regions[{k - 1}]", points, sheet.size))
        for k, (points, material) in enumerate(regions, start=1)
    ]
    return draw_shape(
        sheet, path, title=title, view=view, thickness=sheet.thickness, stiffness=sheet.stiffness, regions=named
    )
