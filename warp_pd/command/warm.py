"""Compile kernels before they are needed: `warp-pd warm`."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import Any

from tqdm import tqdm

from ..device.checks import InputError
from .scene_files import build_scene, require_scene, scene_names


def warm(scenes: Sequence[str], device: str | None, precision: int | None, quiet: bool) -> tuple[int, float]:
    """Compile or load what the launches of scenes use, as they are built without arguments; nothing is run.

    The modules of a scene are compiled beside each other, one on each core.

    Args:
        scenes: Names or files; none for all that are shipped.
        device: As for a run.
        precision: 32 or 64; by default each solver's.
        quiet: Whether to show no progress.

    Returns:
        Number of scenes, and how long it took [s].

    Raises:
        InputError: if a scene that was named cannot be built here. Among all, those that want what is not installed
            are left out.
    """
    begin, done = perf_counter(), 0
    for name in scenes:
        require_scene(name)
    progress: Any = tqdm(scenes or scene_names(), unit="scene", disable=True if quiet else None)
    for name in progress:
        progress.set_description(name)
        try:
            built = build_scene(name, {}).build(device, precision)
        except InputError as error:
            if scenes:
                raise
            progress.write(f"{name}: left out, {error}")
            continue
        built.context.compile()
        done += 1
    return done, perf_counter() - begin
