"""Figures and picture files. Matplotlib is imported when the first figure is made."""

from __future__ import annotations

import contextlib
import functools
import io
import itertools
import os
import re
from collections.abc import Iterator
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..device.checks import InputError, OutputError, said
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
        raise InputError(f"path = {said(path)}: expected the path of a picture or None")
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
