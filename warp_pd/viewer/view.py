"""The browser page of a run: the sheet in 3D over time, its curves, measures and settings."""

from __future__ import annotations

import base64
import html
import json
import zlib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..device.checks import InputError, count, one_of
from ..interfaces.frame import format_time
from ..output.info import finite_values
from ..output.quantities import choices, column_unit, curves, known_units
from ..output.vtkhdf import SeriesInfo, read_frames, read_outlines, read_series
from ..run.folder import FRAMES, PAGE, read_history, run_summary, write_atomically
from .coarsen import Drawn, clusters, contracted, drawn
from .pictures import Shown

LEVEL_OF_COMPRESSION = 4


@dataclass
class Arrays:
    """Arrays of a page, each a separate text that the page unpacks on demand.

    Attributes:
        bits: Precision of a series, at most 16: its numbers become 1 to 2^bits - 1, and 0 stands for "no value".
        texts: Compressed bytes of each array, as base64.
    """

    bits: int = 16
    texts: list[str] = field(default_factory=list)

    def add(self, values: NDArray[Any]) -> dict[str, Any]:
        """Add an array, with 32 bits a number or one bit a boolean; return how to unpack it."""
        if values.dtype == np.bool_:
            return self._entry(np.packbits(values, axis=-1, bitorder="little"), "bits", values.shape)
        kind = "float32" if np.issubdtype(values.dtype, np.floating) else "uint32"
        return self._entry(np.ascontiguousarray(values, np.dtype(kind).newbyteorder("<")), kind, values.shape)

    def add_triangles(self, corners: NDArray[np.integer]) -> dict[str, Any]:
        """Add triangles in order of their first corners, shape (T, 3).

        Differences of first corners between triangles, and of other corners from the first, are stored.
        """
        apart = corners.astype(np.int64)
        apart[:, 1:] -= apart[:, :1]
        apart[1:, 0] -= corners[:-1, 0]
        return self._entry(apart.astype("<u4"), "triangles", corners.shape)

    def add_series(self, values: NDArray[np.floating]) -> dict[str, Any]:
        """Add point values at each frame, shape (frames, points), quantised between their extremes.

        Differences between frames and between consecutive points are stored, with the sign in the lowest bit and low
        and high bytes separated, which compresses well.
        """
        finite = np.isfinite(values)
        low = float(values.min(where=finite, initial=np.inf)) if finite.any() else 0.0
        high = float(values.max(where=finite, initial=-np.inf)) if finite.any() else 0.0
        step = (high - low if high > low else 1.0) / (2**self.bits - 2)
        above = np.where(finite, (values.astype(np.float64) - low) / step, 0.0)
        levels = np.where(finite, np.round(1.0 + above), 0.0).astype(np.uint16)
        levels[1:] -= levels[:-1].copy()
        levels[:, 1:] -= levels[:, :-1].copy()
        signed = levels.view(np.int16)
        folded = ((signed << 1) ^ (signed >> 15)).view(np.uint16)
        apart = np.stack([folded & 0xFF, folded >> 8]).astype(np.uint8)
        return {**self._entry(apart, "series", values.shape), "low": low, "high": high, "step": step}

    def _entry(self, values: NDArray[Any], kind: str, shape: tuple[int, ...]) -> dict[str, Any]:
        packed = zlib.compress(values.tobytes(), LEVEL_OF_COMPRESSION)
        self.texts.append(base64.b64encode(packed).decode("ascii"))
        return {"text": len(self.texts) - 1, "kind": kind, "shape": list(shape)}


# What a page loads, in this order; vendor.* are the libraries.
STYLES = ("vendor.css", "page.css")
SCRIPTS = ("vendor.js", "data.js", "colours.js", "sheet.js", "curves.js", "panel.js")
# Defaults of a page: most points, most numbers in all frames together, and fewest frames.
POINTS, NUMBERS, FEWEST_FRAMES = 40_000, 12_000_000, 16
# Frames that the first view has room for.
FRAMED = 6


@dataclass(frozen=True)
class Limits:
    """Limits on the content of a page.

    Attributes:
        points: Approximate number of points of the sheet; None for all.
        frames: Number of frames; None for as many as fit.
        fields: Names of the fields besides the displacement; None for all.
        bits: Precision of point values. 16 bits are enough for zooming in, 10 for showing the whole sheet.
    """

    points: int | None = POINTS
    frames: int | None = None
    fields: Collection[str] | None = None
    bits: int = 16

    def __post_init__(self) -> None:
        """Check the minimum numbers of points and frames."""
        if self.points is not None:
            count("points", self.points, 4)
        if self.frames is not None:
            count("frames", self.frames, 2)

    def chosen_fields(self, known: Sequence[str]) -> list[str]:
        """Names of the fields on the page. Raises InputError if the frames do not have a field of that name."""
        for name in self.fields or ():
            one_of("fields", name, known)
        return [name for name in known if self.fields is None or name in ("displacement", *self.fields)]

    def chosen_frames(self, frames: int, numbers: int) -> NDArray[np.int64]:
        """Indices of the frames on the page, including the first and last, if each frame has `numbers` values."""
        fits = max(FEWEST_FRAMES, NUMBERS // numbers) if self.frames is None else self.frames
        return np.unique(np.round(np.linspace(0, frames - 1, min(frames, fits))).astype(np.int64))


@dataclass(frozen=True)
class PageFrames:
    """What a page holds of the frames of a run: names and numbers, and the arrays that they refer to."""

    content: dict[str, Any]
    arrays: Arrays


def page_frames(path: Path, limits: Limits | None = None) -> PageFrames:
    """Read frames.vtkhdf for a page.

    Raises:
        InputError: if the frames are damaged.
    """
    limits = limits or Limits()
    arrays = Arrays(limits.bits)
    return PageFrames(_sheet(path, read_series(path), limits, arrays), arrays)


def _page_of(
    path: Path,
    summary: Mapping[str, Any],
    history: Sequence[Mapping[str, float]],
    frames: PageFrames,
    shared: str | None = None,
) -> str:
    """The page of a run: HTML that needs neither a server nor a network.

    Args:
        path: frames.vtkhdf of the run.
        summary: Contents of its summary.json; empty if there is none.
        history: Its history, one row per frame; empty if there is none.
        frames: What `page_frames` read from the file.
        shared: Address of the package's folder viewer/page, from which the page loads scripts and styles; by default
            they are embedded.
    """
    info = read_series(path)
    content = {
        "title": str(summary.get("scene") or info.metadata.get("scene") or path.parent.name),
        "summary": finite_values(dict(summary)),
        "history": _history(history, summary, bool(info.metadata.get("turns"))),
        **frames.content,
    }
    return _html(content, frames.arrays, shared)


def _sheet(path: Path, info: SeriesInfo, limits: Limits, arrays: Arrays) -> dict[str, Any]:
    """Points, triangles, fields and bodies at the frames that the page shows."""
    most = info.points if limits.points is None else limits.points
    (_, points, first, fields), (_, _, last, _) = read_frames(path, (0, info.frames - 1))
    reference = points - fields["displacement"]
    cluster = clusters(reference, first, last, most)
    kept = np.unique(cluster)
    names = limits.chosen_fields(info.fields)
    components = sum(fields[name][0].size for name in names)
    shown = limits.chosen_frames(info.frames, components * len(kept))
    triangles: list[NDArray[np.int64]] = []
    values: dict[str, list[NDArray[Any]]] = {name: [] for name in names}
    before, corners = None, contracted(first, cluster)
    for _, _, intact, fields in read_frames(path, shown.tolist()):
        if before is None or not np.array_equal(intact, before):
            before, corners = intact, contracted(intact, cluster)
        triangles.append(corners)
        for name, series in values.items():
            series.append(fields[name][kept])
    sheet = drawn(triangles, info.points)
    place = np.searchsorted(kept, sheet.points)
    static, turns = info.metadata.get("load_duration"), bool(info.metadata.get("turns"))
    return {
        "frames": [
            {"time": float(k if turns else info.times[k]), "when": format_time(float(info.times[k]), static)}
            for k in shown
        ],
        "loadDuration": None if turns else static,
        **({"along": "step"} if turns else {}),
        **({"pieces": info.metadata["pieces"]} if "pieces" in info.metadata else {}),
        "leftOut": _left_out(info, sheet, shown),
        "reference": [arrays.add_series(reference[None, sheet.points, c]) for c in range(3)],
        "triangles": arrays.add_triangles(sheet.triangles),
        "intact": arrays.add(sheet.intact),
        "framing": _framing(reference[sheet.points], values["displacement"], place, sheet, arrays),
        **_fields({name: np.stack(series)[:, place] for name, series in values.items()}, sheet, arrays),
        "bodies": _bodies(path, shown, arrays),
    }


def _framing(
    reference: NDArray[Any],
    displacement: Sequence[NDArray[Any]],
    place: NDArray[np.int64],
    sheet: Drawn,
    arrays: Arrays,
) -> dict[str, Any]:
    """Some frames, and the points that the first view of the page shows of each: those that a picture shows.

    A file of frames does not name supports: points that stay where they are in every frame are taken as held.
    """
    moved = [each[place] for each in displacement]
    still = np.flatnonzero(np.all([np.all(each == moved[0], axis=1) for each in moved], axis=0))
    frames = np.unique(np.round(np.linspace(0, len(moved) - 1, FRAMED)).astype(int))
    seen = np.zeros((len(frames), len(reference)), np.bool_)
    for row, frame in zip(seen, frames, strict=True):
        triangles = sheet.triangles[sheet.intact[frame]]
        row[Shown("", reference + moved[frame], reference, triangles, {}, held=still).framed] = True
    return {"frames": frames.tolist(), "points": arrays.add(seen)}


def _fields(values: Mapping[str, NDArray[Any]], sheet: Drawn, arrays: Arrays) -> dict[str, Any]:
    """The fields at the drawn points, one series per component."""
    loose = ~_joined(sheet)
    stored, offered = {}, []
    for name, series in values.items():
        columns = series.reshape(*series.shape[:2], -1).astype(np.float32)
        # A point that hangs on no triangle is not drawn: where it flies to must not set the scale.
        columns[loose] = np.nan
        stored[name] = [arrays.add_series(columns[:, :, c]) for c in range(columns.shape[2])]
        offered += [vars(choice) for choice in choices(name, columns.shape[2])]
    return {"fields": stored, "choices": offered}


def _joined(sheet: Drawn) -> NDArray[np.bool_]:
    """Whether each point has an intact triangle (or the sheet has no triangles), shape (frames, points)."""
    joined = np.full((len(sheet.intact), len(sheet.points)), not len(sheet.triangles))
    for row, intact in zip(joined, sheet.intact, strict=True):
        row[sheet.triangles[intact]] = True
    return joined


def _bodies(path: Path, shown: NDArray[np.int64], arrays: Arrays) -> list[dict[str, Any]]:
    """The ball and other bodies: their outlines once, and their poses."""
    found = []
    for body, poses in read_outlines(path):
        outline = {"radius": body.sizes[0]} if body.kind == "sphere" else {
            "vertices": arrays.add(np.asarray(body.vertices, np.float32)), "triangles": arrays.add(body.triangles)
        }  # fmt: skip
        found.append({"name": body.name, "kind": body.kind, "poses": poses[shown].tolist(), **outline})
    return found


def _history(history: Sequence[Mapping[str, float]], summary: Mapping[str, Any], turns: bool) -> dict[str, Any]:
    """Columns of the history and their grouping into graphs; rows are numbered if the load factor `turns`."""
    if not history:
        return {"columns": {}, "graphs": []}
    columns = {name: [finite_values(float(f"{row[name]:.6g}")) for row in history] for name in history[0]}
    if turns:
        columns["time"] = [float(k) for k in range(len(history))]
    graphs = curves(list(columns), summary.get("measures", {}), known_units(summary))
    return {"columns": columns, "graphs": graphs, "timeUnit": column_unit("time")}


def _left_out(info: SeriesInfo, sheet: Drawn, shown: NDArray[np.int64]) -> list[str]:
    """Notes on parts of the run that are not on the page, one line each."""
    lines = []
    if len(sheet.points) < 0.9 * info.points:
        lines.append(
            f"{len(sheet.points)} of {info.points} points are drawn; colours are those of these points, and a crack "
            "looks up to one drawn triangle wide"
        )
    if len(shown) < info.frames:
        lines.append(f"{len(shown)} of {info.frames} frames are shown")
    return lines


def _part(name: str) -> str:
    return (files("warp_pd.viewer") / "page" / name).read_text(encoding="utf-8")


def _html(content: Mapping[str, Any], arrays: Arrays, shared: str | None) -> str:
    """The page with styles, scripts and data inserted."""
    # Neither a name of a scene nor a note may end the element that holds it.
    data = json.dumps(content, allow_nan=False).replace("<", "\\u003c")
    texts = "\n".join(f'<script type="text/plain" id="array{k}">{text}</script>' for k, text in enumerate(arrays.texts))
    style, scripts = _inside() if shared is None else _beside(html.escape(shared))
    filled = {
        "TITLE": html.escape(str(content["title"])),
        "STYLE": style,
        "DATA": f'<script type="application/json" id="content">{data}</script>\n{texts}',
        "SCRIPTS": scripts,
        "LICENSES": _part("LICENSES.txt"),
    }
    pieces = _part("page.html").split("%%")
    return "".join(filled[piece] if k % 2 else piece for k, piece in enumerate(pieces))


def _inside() -> tuple[str, str]:
    """Elements with embedded styles and scripts."""
    style = "\n".join(map(_part, STYLES))
    return f"<style>{style}</style>", "\n".join(f"<script>{_part(name)}</script>" for name in SCRIPTS)


def _beside(folder: str) -> tuple[str, str]:
    """Elements that link to the files of the styles and scripts."""
    styles = "\n".join(f'<link rel="stylesheet" href="{folder}/{name}">' for name in STYLES)
    return styles, "\n".join(f'<script src="{folder}/{name}"></script>' for name in SCRIPTS)


# A run writes its page itself for sheets of at most so many points.
LARGE = 200_000


def page(
    folder: str | Path,
    limits: Limits | None = None,
    shared: str | None = None,
    frames: Callable[[], PageFrames] | None = None,
) -> str:
    """The page of a run as one self-contained HTML text; arguments as for `Limits` and `_page_of`.

    `frames` returns what the page holds of the frames, if that was begun earlier. A killed run has neither summary nor
    history; the page then shows only its frames. Raises InputError if the folder has no frames, the frames are damaged,
    or they lack a field.
    """
    folder = Path(folder)
    if not folder.exists():
        raise InputError(f"folder = {str(folder)!r}: the folder does not exist; expected the folder of a run")
    if not folder.is_dir():
        raise InputError(f"folder = {str(folder)!r}: it is a file; expected the folder of a run")
    path = folder / FRAMES
    if not path.is_file():
        raise InputError(f"folder = {str(folder)!r}: it has no {path.name}; expected the folder of a run with frames")
    history = read_history(folder / "history.csv") if (folder / "history.csv").is_file() else []
    summary: dict[str, Any] = run_summary(folder) or {}
    return _page_of(path, summary, history, page_frames(path, limits) if frames is None else frames(), shared)


def write_page(
    folder: str | Path,
    out: str | Path | None = None,
    points: int | None = None,
    frames: int | None = None,
    read: Callable[[], PageFrames] | None = None,
) -> Path:
    """Write the page of a run atomically, by default as view.html in its folder, and return the file.

    `points` and `frames` are the largest numbers shown; by default 40 000 points and as many frames as keep the page
    small. `read` returns what the page holds of the frames, if that was begun earlier. Raises InputError as `page`, or
    if the file cannot be written.
    """
    path = Path(folder) / PAGE if out is None else Path(out)
    text = page(folder, Limits(POINTS if points is None else points, frames), frames=read)
    if path.is_dir():
        raise InputError(f"out = {str(path)!r}: it is a folder; expected a file")
    if path.parent.exists() and not path.parent.is_dir():
        raise InputError(f"out = {str(path)!r}: expected a file in a folder")
    write_atomically(path, text)
    return path
