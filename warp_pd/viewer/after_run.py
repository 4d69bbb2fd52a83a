"""What a run shows at its end: pictures and its page."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..device.checks import InputError, kind_and_text, point_indices, user_code
from ..interfaces import HELD, History
from ..materials import capabilities
from ..run.built import held_by_loads
from ..run.folder import FINE, FRAMES, pictures_in, read_history, save_summary
from ..run.result import Result
from ..run.runner import Files, write_summary
from ..run.scene import Scene
from .beside import begun, wait_for_pictures
from .pictures import Drawing, drawing, unnumbered
from .view import LARGE, write_page


def show(
    result: Result, folder: Path, files: Files, others: Sequence[str], animation: Callable[[], None] | None
) -> None:
    """Write the summary, the pictures beside those of others, the page, and meanwhile the animation."""
    with contextlib.ExitStack() as after:
        if animation is not None:
            after.callback(begun(animation))
        _show(result, folder, files, others)


def _show(result: Result, folder: Path, files: Files, others: Sequence[str]) -> None:
    from .view import page_frames

    before = {p.name: p.stat().st_mtime_ns for p in pictures_in(folder)}
    summary, scene = result.summary, result.built.simulation
    large = result.built.context.whole.size > LARGE
    if files.view and large:
        summary["notes"].append(
            f"view.html: not written because of the number of points; write it with `warp-pd view {folder}`"
        )
    frames = begun(page_frames, folder / FRAMES) if files.view and not large else None
    # First, so that a picture that cannot be drawn does not take the numbers with it.
    summary["pictures"] = []
    write_summary(result, folder)
    if files.pictures:
        try:
            draw(scene, result.history, folder, summary, files.pictures, others)
        except InputError as error:
            if scene.chosen_fields is None:
                raise
            summary["notes"].append(
                f"pictures: some were not drawn because `fields` omits a field that they show: {error}"
            )
    summary["pictures"] = sorted(p.name for p in pictures_in(folder) if p.stat().st_mtime_ns != before.get(p.name))
    for name in summary["pictures"]:
        wanted = unnumbered(name)
        if wanted in others:
            summary["notes"].append(f"pictures: {name} instead of {wanted}, which is not of this run")
    write_summary(result, folder)
    if frames is not None:
        write_page(folder, read=frames)


def draw(
    scene: Scene, history: History, folder: Path, summary: Mapping[str, Any], formats: tuple[str, ...] = ("png",),
    others: Collection[str] = (),
) -> None:  # fmt: skip
    """Draw the scene's pictures, or the default pictures if the scene has no function for them.

    `others` are names of pictures that are not of this run; they are not replaced.
    """
    with (
        user_code(lambda error: f"pictures: {kind_and_text(error)}; the results are in {folder}"),
        drawing(Drawing(scene.scene, formats, scene.load_duration, frozenset(others))),
    ):
        try:
            if scene.pictures is not None:
                scene.pictures(history, folder)
            else:
                _draw_default(scene, history, folder, summary)
        finally:
            wait_for_pictures()


def redraw(scene: Scene, folder: Path, summary: dict[str, Any], formats: tuple[str, ...]) -> None:
    """Draw the pictures of an earlier run again, and add them to the list in its summary."""
    ours = set(summary.get("pictures", []))
    there = {path.name: path.stat().st_mtime_ns for path in pictures_in(folder)}
    draw(scene, read_history(folder / "history.csv"), folder, summary, formats, there.keys() - ours)
    drawn = (path.name for path in pictures_in(folder) if path.stat().st_mtime_ns != there.get(path.name))
    summary["pictures"] = sorted(ours.union(drawn))
    save_summary(folder, summary)


def _draw_default(scene: Scene, history: History, folder: Path, summary: Mapping[str, Any]) -> None:
    from . import default_pictures

    regions = capabilities(scene.force.material).regions
    points = [point_indices("regions", points, scene.sheet.size) for points, _ in regions]
    fine = read_history(folder / FINE) if (folder / FINE).is_file() else ()
    held = np.flatnonzero(held_by_loads(scene) & HELD == HELD)
    default_pictures.draw(history, folder, summary, points, held, fine)
