"""A film of a run: one picture per frame, with one frame of reference and one scale of colours."""

from __future__ import annotations

import io
import math
import os
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..device.checks import InputError, OutputError, one_of, positive, show
from ..output.vtkhdf import read_series
from .default_pictures import telling_field
from .painter import ColourScale, scale_of
from .pictures import Drawing, Shown, drawing, frames_at
from .plots import VIEW, from_above_figure, surfaces_figure

# Ticks of a second in which Pillow's formats count how long a picture is shown, and the fewest and most: browsers slow
# down a GIF that is faster.
TICKS = {".gif": (100, 2, 50_000), ".webp": (1000, 1, 10_000_000)}
# Suffixes of films that Pillow writes, and of those that ffmpeg does, where it is installed.
BY_PILLOW, BY_FFMPEG = tuple(TICKS), (".mp4", ".webm")
# Pictures a second, and dots per inch.
RATE, DOTS = 20.0, 100
# Colours of the palette of a GIF that are those of the scale, and how dark lines make some of them.
SCALE, DARKER = 176, (0.7, 0.5)
# Points times frames that are held at once, at most: some two gigabytes.
MOST = 30_000_000


def film(
    folder: Path,
    path: Path,
    field: str | None = None,
    *,
    every: int = 1,
    rate: float = RATE,
    view: tuple[float, float] | None = None,
    cut: str | None = None,
) -> int:
    """Write a film of all frames of a run; return their number.

    Args:
        folder: Folder of the run, with its frames.vtkhdf.
        path: The film, .gif or .webp; .mp4 or .webm where ffmpeg is installed.
        field: Field of the colours; by default that of the picture of the sheet.
        every: One in so many frames is shown.
        rate: Pictures a second.
        view: Elevation and azimuth of the viewpoint [degrees]; by default that of sheet.png.
        cut: What is cut away, such as "y<0.05" [m].

    Raises:
        InputError: if an argument is wrong, or the frames are too many to be held at once.
        OutputError: if the film cannot be written.
    """
    one_of("film", path.suffix.lower(), (*BY_PILLOW, *BY_FFMPEG))
    positive("rate", rate)
    _require_rate(rate, path.suffix.lower())
    if path.suffix.lower() in BY_FFMPEG and shutil.which("ffmpeg") is None:
        raise InputError(f"film = {str(path)!r}: expected {' or '.join(BY_PILLOW)}, or ffmpeg on the path")
    series = read_series(folder / "frames.vtkhdf")
    times = series.times[::every].tolist()
    if len(times) * series.points > MOST:
        least = -(-series.frames * series.points // MOST)
        raise InputError(f"{series.frames} frames of {series.points} points: expected --every {least} or more")
    frames = frames_at(folder, times)
    shown, in_space = telling_field(frames[-1])
    field = shown if field is None else one_of("field", field, frames[-1].fields)
    limits = (0.0, 1.0) if field == "damage" else None
    inks = scale_of(frames, field, "", limits)
    drawn: Any = partial(from_above_figure, field=field, limits=limits, cut=cut)
    if in_space or view is not None:
        drawn = partial(surfaces_figure, field=field, limits=limits, view=view or VIEW, cut=cut)
    aside = path.with_name(f".{path.stem}.unfinished{path.suffix}")
    write: Any = partial(_by_pillow, inks=inks) if path.suffix.lower() in BY_PILLOW else _by_ffmpeg
    try:
        with drawing(Drawing()):
            write(aside, _pictures(frames, drawn), rate)
        os.replace(aside, path)
    except OSError as error:
        raise OutputError(f"{str(path)!r} cannot be written: {error.strerror or error}") from error
    finally:
        aside.unlink(missing_ok=True)
    return len(frames)


def _require_rate(rate: float, suffix: str) -> None:
    """Check that a format can show so many pictures a second."""
    second, fewest, most = TICKS.get(suffix, (1, 0, math.inf))
    if not fewest <= second / rate <= most:
        raise InputError(
            f"rate = {rate!r}: expected {second / most:.2g} to {second / fewest:g} pictures a second in a {suffix}"
        )


def _pictures(frames: Sequence[Shown], drawn: Any) -> Iterator[bytes]:
    """PNG of every frame."""
    for frame in frames:
        stream = io.BytesIO()
        drawn(frames, [frame]).savefig(stream, dpi=DOTS, format="png")
        yield stream.getvalue()


def _by_pillow(path: Path, pictures: Iterator[bytes], rate: float, inks: ColourScale) -> None:
    from PIL import Image

    first, *others = (Image.open(io.BytesIO(picture)).convert("RGB") for picture in pictures)
    if path.suffix.lower() == ".gif":
        # One palette for all: Pillow's own has too few of the colours of the scale, whose bar would have steps.
        colours = inks.colours(np.linspace(inks.low, inks.high, SCALE))[:, :3]
        dark = np.concatenate([share * colours[::8] for share in DARKER])
        greys = np.linspace(0.0, 1.0, 256 - len(colours) - len(dark))[:, None] * np.ones(3)
        palette = np.round(255.0 * np.concatenate([colours, dark, greys])).astype(np.uint8)
        first, *others = (_with_palette(picture, palette) for picture in (first, *others))
    # Rounded from the start, so that what the ticks do not hold adds up to no more than half of one.
    second = TICKS[path.suffix.lower()][0]
    shown = np.diff(np.round(second / rate * np.arange(len(others) + 2))) * (1000 // second)
    first.save(path, save_all=True, append_images=others, duration=shown.astype(int).tolist(), loop=0)


def _with_palette(picture: Any, palette: np.ndarray) -> Any:
    """A picture whose colours are the nearest of a palette, shape (256, 3)."""
    from PIL import Image
    from scipy.spatial import cKDTree

    pixels = np.asarray(picture)
    found, number = np.unique(pixels.reshape(-1, 3), axis=0, return_inverse=True)
    nearest = cKDTree(palette).query(found)[1].astype(np.uint8)
    made = Image.fromarray(nearest[number.ravel()].reshape(pixels.shape[:2]), "P")
    made.putpalette(palette.tobytes())
    return made


def _by_ffmpeg(path: Path, pictures: Iterator[bytes], rate: float) -> None:
    command = ["ffmpeg", "-loglevel", "error", "-y", "-f", "image2pipe", "-framerate", f"{rate:g}", "-i", "-"]
    # Most players need an even number of pixels, and this format of colours.
    even = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", str(path)]
    done = subprocess.run([*command, *even], input=b"".join(pictures), capture_output=True, check=False)
    if done.returncode:
        raise OutputError(f"{str(path)!r}: ffmpeg failed: {show(done.stderr.decode(errors='replace').strip()[-200:])}")
