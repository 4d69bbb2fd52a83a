"""Picture files, and the frames that they show. Matplotlib is imported when the first figure is made."""

from __future__ import annotations

import contextlib
import functools
import io
import itertools
import os
import re
from collections.abc import Iterator, Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..device.checks import InputError, OutputError, show
from ..geometry.triangulation import joined_points
from ..interfaces.frame import format_time
from ..output.vtkhdf import FrameFields, read_frame, read_outlines, read_series
from ..run.folder import FORMATS

# Dots per inch of a PNG, and of the parts of a vector picture that are pixels.
RESOLUTION, RESOLUTION_IN_VECTORS = 130, 300
# Polygons above which a vector picture holds the sheet as pixels.
MOST_VECTORS = 20_000
# Shorter over longer side of a flat sheet in a picture, at least; and below which it is a bar.
THINNEST, BAR = 0.15, 1e-6


@dataclass(frozen=True)
class Drawing:
    """Settings common to the pictures of a run.

    Attributes:
        title: Title of each picture, or "".
        formats: Suffixes of the files, from FORMATS; empty to use the suffix of each path.
        load_duration: Load time of the full load of a static run [s], or None.
        others: Names of pictures in the folder that are not of the run; a number keeps its own apart from them.
    """

    title: str = ""
    formats: tuple[str, ...] = ()
    load_duration: float | None = None
    others: frozenset[str] = frozenset()


_drawing: ContextVar[Drawing | None] = ContextVar("_drawing", default=None)


def current() -> Drawing:
    """The current settings."""
    return _drawing.get() or Drawing()


@contextlib.contextmanager
def drawing(common: Drawing) -> Iterator[None]:
    """Context that sets the settings for the pictures of one run."""
    token = _drawing.set(common)
    try:
        yield
    finally:
        _drawing.reset(token)


def new_figure(width: float, height: float) -> Any:
    """A figure for files and notebooks, independent of pyplot and the user's backend."""
    figure = _figure_class()(figsize=(width, height), layout="constrained")
    if current().title:
        figure.suptitle(current().title, fontsize=10)
    return figure


def new_panels(
    number: int, columns: int, size: tuple[float, float], room: tuple[float, float], **options: Any
) -> tuple[Any, Any]:
    """A figure and its panels, row by row, each of a size [inches], with room beside and below all of them."""
    rows = -(-number // columns)
    figure = new_figure(size[0] * columns + room[0], size[1] * rows + room[1])
    panels = figure.subplots(rows, columns, squeeze=False, **options).ravel()
    for axes in panels[number:]:
        axes.set_visible(False)
    return figure, panels[:number]


@functools.cache
def _figure_class() -> Any:
    from matplotlib.figure import Figure

    class Picture(Figure):
        """A figure that a notebook displays."""

        def _repr_png_(self) -> bytes:
            stream = io.BytesIO()
            self.savefig(stream, dpi=100, format="png", bbox_inches="tight")
            return stream.getvalue()

    return Picture


def enlargement(extent: np.ndarray) -> np.ndarray:
    """Factors of x and y by which a flat sheet is drawn larger, so that its shorter side can be seen.

    `extent` is that of the sheet [m], shape (2,). A bar, which has no shorter side, is drawn as it is.
    """
    least = THINNEST * extent.max()
    return np.where(extent > BAR * extent.max(), np.maximum(1.0, least / np.maximum(extent, BAR * least)), 1.0)


def enlarged(factors: np.ndarray) -> list[str]:
    """Lines of a title on the directions that are drawn larger than others."""
    return [f"{name} drawn {g:.2g} times as large" for name, g in zip("xyz", factors, strict=False) if g > 1.05]


def target(path: Any) -> Path:
    """Check the path of a picture. Raises InputError if it cannot be written."""
    if not isinstance(path, str | os.PathLike):
        raise InputError(f"path = {show(path)}: expected the path of a picture or None")
    found = Path(path)
    if found.suffix.lower()[1:] not in FORMATS:
        raise InputError(
            f"path = {str(path)!r}: expected a name that ends in {', '.join(f'.{name}' for name in FORMATS)}"
        )
    if not found.parent.is_dir() or not os.access(found.parent, os.W_OK):
        raise InputError(
            f"path = {str(path)!r}: expected a folder that can be written; {str(found.parent)!r} is missing or "
            "read-only"
        )
    return found


def save(figure: Any, path: Path, **options: Any) -> None:
    """Write a picture atomically, in the format of its suffix or in the formats of the current settings.

    Raises:
        OutputError: if it cannot be written.
    """
    for suffix in current().formats or (path.suffix[1:].lower(),):
        target = _beside_others(path.with_suffix(f".{suffix}"))
        aside = target.with_name(f".{target.name}.unfinished")
        dots = RESOLUTION if suffix == "png" else RESOLUTION_IN_VECTORS
        try:
            figure.savefig(aside, **{"dpi": dots, "format": suffix, **options})
            os.replace(aside, target)
        except OSError as error:
            raise OutputError(f"{str(target)!r} cannot be written: {error.strerror or error}") from error


def _beside_others(path: Path) -> Path:
    """The path, or that with the first number from 2 on that is no picture of others."""
    others = current().others
    numbered = (path.with_name(f"{path.stem}-{number}{path.suffix}") for number in itertools.count(2))
    return next(found for found in itertools.chain([path], numbered) if found.name not in others)


def unnumbered(name: str) -> str:
    """The name of a picture without the number that keeps it apart from pictures of others."""
    return re.sub(r"-\d+(?=\.\w+$)", "", name)


# Fraction of the points, at either end of each direction, that may be far from the others.
FAR = 0.01


@dataclass(frozen=True, eq=False)
class Shown:
    """A frame with the data for pictures.

    Attributes:
        when: Time or load factor as text.
        points: Deformed positions [m], shape (N, 3).
        reference: Reference positions [m], shape (N, 3).
        triangles: Intact triangles, shape (F, 3).
        fields: Point fields by name; u is the size of the displacement, u1, u2, u3 are its components, and
            NAME_1, NAME_2, NAME_3 those of any other vector field NAME. "stress" is the largest principal one,
            Cauchy's if there is one; "thickness" is that over the stress-free one of a material of constant volume.
            Pieces are displaced from where they were placed, which is where they are in the first frame.
        bodies: Vertices [m] and triangles of rigid bodies.
        balls: Centres [m], shape (3,), and diameters [m] of those that are spheres.
        scene: Name of the scene.
        regions: Points of each region with another material, whose outline is drawn.
        held: Points that supports hold or move.
    """

    when: str
    points: np.ndarray
    reference: np.ndarray
    triangles: np.ndarray
    fields: dict[str, np.ndarray]
    bodies: Sequence[tuple[np.ndarray, np.ndarray]] = ()
    balls: Sequence[tuple[np.ndarray, float]] = ()
    scene: str = ""
    regions: Sequence[np.ndarray] = ()
    held: Sequence[int] | np.ndarray = ()

    @cached_property
    def framed(self) -> np.ndarray:
        """Points that a picture and its colours have to show.

        They are those of intact triangles, without pieces that no support holds, if there are supports, and without the
        few that are further from the others than the size of all others.
        """
        if not len(self.triangles):
            return np.arange(len(self.points))
        used = np.unique(self.triangles)
        piece = joined_points(len(self.points), self.triangles)
        held = np.intersect1d(used, np.asarray(self.held, int))
        if len(held):
            used = used[np.isin(piece[used], piece[held])]
        places = self.points[used]
        low, high = np.quantile(places, [FAR, 1.0 - FAR], axis=0)
        room = float((high - low).max())
        near = ((places >= low - room) & (places <= high + room)).all(axis=1)
        return np.asarray(used[near])


def frames_at(folder: Path, times: Sequence[float]) -> list[Shown]:
    """The frames of `folder`/frames.vtkhdf nearest to the given times [s], each at most once."""
    path = folder / "frames.vtkhdf"
    series = read_series(path)
    indices = sorted({int(np.argmin(np.abs(np.asarray(series.times) - t))) for t in times})
    load_duration = series.metadata.get("load_duration")
    placed = read_frame(path, 0)[3]["displacement"] if "pieces" in series.metadata else np.zeros(3, np.float32)
    return [_shown(path, index, load_duration, str(series.metadata.get("scene", "")), placed) for index in indices]


def _shown(path: Path, index: int, load_duration: float | None, scene: str, placed: np.ndarray) -> Shown:
    time, points, triangles, fields = read_frame(path, index)
    moved = fields["displacement"] - placed
    fields |= {"u": np.linalg.norm(moved, axis=1), "u1": moved[:, 0], "u2": moved[:, 1], "u3": moved[:, 2]}
    for name in [n for n, values in fields.items() if values.ndim == 2 and n != "displacement"]:
        for c in range(fields[name].shape[1]):
            fields[f"{name}_{c + 1}"] = fields[name][:, c]
    for name in ("cauchy_1", "first_piola_1", "principal_stress_1"):
        if name in fields:
            fields.setdefault("stress", fields[name])
    if {"stretch_1", "stretch_2"} <= set(fields):
        with np.errstate(divide="ignore", invalid="ignore"):
            fields.setdefault("thickness", 1.0 / (fields["stretch_1"] * fields["stretch_2"]))
    outlines = [(body, poses[index]) for body, poses in read_outlines(path)]
    return Shown(
        when=format_time(time, load_duration),
        points=points,
        reference=points - fields["displacement"],
        triangles=triangles,
        fields=FrameFields(fields),
        bodies=[(body.placed(pose), body.triangles) for body, pose in outlines],
        balls=[(pose[:3], 2.0 * body.sizes[0]) for body, pose in outlines if body.kind == "sphere"],
        scene=scene,
    )
