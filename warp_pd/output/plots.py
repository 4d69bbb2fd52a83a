"""Pictures: surfaces in space, from above, and curves. matplotlib is imported here only."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .vtkhdf import read_frame, read_series

COLOURS = "inferno_r"


@dataclass(frozen=True, eq=False)
class Shown:
    """A frame as the pictures need it.

    Attributes:
        time: [s].
        points: Deformed positions [m], shape (N, 3).
        triangles: Intact triangles, shape (F, 3).
        fields: Point fields by name; u1, u2, u3 are the components of the displacement.
    """

    time: float
    points: np.ndarray
    triangles: np.ndarray
    fields: dict[str, np.ndarray]


def frames_at(folder: Path, times: Sequence[float]) -> list[Shown]:
    """The frames of `folder`/frames.vtkhdf nearest to the given times [s], each at most once."""
    path = folder / "frames.vtkhdf"
    series = read_series(path)
    indices = sorted({int(np.argmin(np.abs(np.asarray(series.times) - t))) for t in times})
    return [_shown(path, index) for index in indices]


def _shown(path: Path, index: int) -> Shown:
    time, points, triangles, fields = read_frame(path, index)
    for c in range(3):
        fields[f"u{c + 1}"] = fields["displacement"][:, c]
    return Shown(time, points, triangles, fields)


def surfaces(
    path: Path, frames: Sequence[Shown], field: str, label: str, limits: tuple[float, float] | None = None
) -> None:
    """The deformed sheet in space at some times, coloured by a field and shaded."""
    plt, figure_size = _pyplot(), (5.2 * min(2, len(frames)), 4.2 * -(-len(frames) // 2))
    low, high = limits or _range(frames, field)
    colours = plt.get_cmap(COLOURS)
    norm = plt.Normalize(low, high)
    figure = plt.figure(figsize=figure_size, layout="constrained")
    axes_list = []
    bounds = np.array([[f.points[_used(f)].min(axis=0), f.points[_used(f)].max(axis=0)] for f in frames])
    low_corner, high_corner = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    for k, frame in enumerate(frames):
        axes = figure.add_subplot(-(-len(frames) // 2), min(2, len(frames)), k + 1, projection="3d")
        values = frame.fields[field][frame.triangles].mean(axis=1)
        face = colours(norm(values))
        face[:, :3] *= _shade(frame)[:, None]
        axes.add_collection3d(_polygons(frame, face))
        axes.set(title=f"t = {frame.time:.3g} s")
        for c, name in enumerate("xyz"):
            getattr(axes, f"set_{name}lim")(low_corner[c], max(high_corner[c], low_corner[c] + 1e-12))
            getattr(axes, f"set_{name}label")(f"{name} (m)")
        axes.set_box_aspect(np.maximum(high_corner - low_corner, 0.25 * (high_corner - low_corner).max()))
        axes.view_init(elev=28, azim=-60)
        axes_list.append(axes)
    figure.colorbar(plt.cm.ScalarMappable(norm, colours), ax=axes_list, label=label, shrink=0.7)
    _save(figure, path)


def from_above(path: Path, frame: Shown, field: str, label: str, limits: tuple[float, float] | None = None) -> None:
    """The deformed sheet seen from +z, lower triangles drawn first."""
    plt = _pyplot()
    from matplotlib.collections import PolyCollection

    low, high = limits or _range([frame], field)
    colours, norm = plt.get_cmap(COLOURS), plt.Normalize(low, high)
    order = np.argsort(frame.points[frame.triangles, 2].mean(axis=1))
    triangles = frame.triangles[order]
    values = frame.fields[field][triangles].mean(axis=1)
    face = colours(norm(values))
    face[:, :3] *= _shade(frame)[order][:, None]
    figure, axes = plt.subplots(figsize=(6.4, 5.4), layout="constrained")
    axes.add_collection(PolyCollection(list(frame.points[triangles][:, :, :2]), facecolors=face, edgecolors=face))
    axes.autoscale_view()
    axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)", title=f"from above, t = {frame.time:.3g} s")
    figure.colorbar(plt.cm.ScalarMappable(norm, colours), ax=axes, label=label)
    _save(figure, path)


def curves(path: Path, history: Sequence[dict[str, float]], names: Sequence[str], ylabel: str) -> None:
    """Columns of the history against time."""
    plt = _pyplot()
    figure, axes = plt.subplots(figsize=(6.4, 4.0), layout="constrained")
    times = [row["time"] for row in history]
    for name in names:
        if all(name in row for row in history):
            axes.plot(times, [row[name] for row in history], label=name.replace("_", " "))
    axes.set(xlabel="time (s)", ylabel=ylabel)
    axes.grid(alpha=0.3)
    axes.legend()
    _save(figure, path)


def _pyplot() -> Any:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    return plt


def _polygons(frame: Shown, face: np.ndarray) -> Any:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    return Poly3DCollection(frame.points[frame.triangles], facecolors=face, edgecolors=face, linewidths=0.2)


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
    return 0.45 + 0.55 * np.abs(normal @ light)


def _range(frames: Sequence[Shown], field: str) -> tuple[float, float]:
    low = min(float(f.fields[field].min()) for f in frames)
    high = max(float(f.fields[field].max()) for f in frames)
    return low, high if high > low else low + 1.0


def _save(figure: Any, path: Path) -> None:
    aside = path.with_name(path.name + ".part")
    figure.savefig(aside, dpi=130, format="png")
    os.replace(aside, path)
    _pyplot().close(figure)
