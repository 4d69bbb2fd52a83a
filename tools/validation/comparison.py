"""A comparison: what others found, where the constants come from, and the model that is to give the same numbers."""

from __future__ import annotations

import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from study import Row, build_scene, device_title, provenance, whole

from warp_pd import Simulation

TEXTS = tomllib.loads(Path(__file__).with_name("rows.toml").read_text("utf-8"))


@dataclass(frozen=True)
class Comparison:
    """One row of the page; what the page says of it is in rows.toml.

    Attributes:
        name: Of the row, and of its files.
        at: Abscissae, numbers or words.
        theirs: Ordinates of the source.
        width: Length across which the model has its points [m].
        points: Numbers of points at a size for two cores, from the coarsest.
        full: The same at full size.
        model: Ordinates for a number of points on a device.
        reasons: Tests that isolate why theory and source part: numbers by words.
        counts: False if the source is a bound or an order of magnitude: no deviation then.
    """

    name: str
    at: tuple[Any, ...]
    theirs: tuple[float, ...]
    width: float
    points: tuple[int, ...]
    full: tuple[int, ...]
    model: Callable[[int, str | None], Sequence[float]]
    reasons: Callable[[int, str | None], Mapping[str, float]] | None = None
    counts: bool = True

    def __getattr__(self, key: str) -> Any:
        """A text of rows.toml: title, source, seen, measured, constants, labels, scatter, verdict."""
        texts = TEXTS.get(self.name, {})
        if key not in texts:
            raise AttributeError(key)
        return texts[key]


def measured(row: Comparison, full: bool, device: str | None) -> Row:
    """Run a row at its spacings."""
    begin, levels = time.perf_counter(), row.full if full else row.points
    ours = [[six_digits(value) for value in row.model(points, device)] for points in levels]
    reasons = {} if row.reasons is None else dict(row.reasons(levels[-1], device))
    return {
        "row": row.name,
        "full": full,
        "made": provenance(device_title(device)),
        "seconds": round(time.perf_counter() - begin, 1),
        "points": list(levels),
        "spacing": [six_digits(row.width / (points - 1)) for points in levels],
        "at": [x if isinstance(x, str) else six_digits(x) for x in row.at],
        "theirs": [six_digits(value) for value in row.theirs],
        "ours": [[known(value) for value in values] for values in ours],
        "change": None if len(levels) < 2 else known(median_deviation(ours[-2], ours[-1])),
        "order": order(ours, [row.width / (points - 1) for points in levels]),
        "deviation": known(median_deviation(ours[-1], row.theirs)) if row.counts else None,
        "worst": known(largest_deviation(ours[-1], row.theirs)) if row.counts else None,
        "reasons": {what: known(six_digits(value)) for what, value in reasons.items()},
    }


def six_digits(value: float) -> float:
    """A number as it is kept."""
    return float(f"{value:.6g}")


def known(value: float) -> float | None:
    """A number, or None in place of NaN, which JSON does not have."""
    return float(value) if np.isfinite(value) else None


def deviations(ours: Sequence[float], theirs: Sequence[float]) -> np.ndarray:
    """Ours / theirs - 1."""
    return np.asarray(np.array(ours, float) / np.array(theirs, float) - 1.0)


def median_deviation(ours: Sequence[float], theirs: Sequence[float]) -> float:
    """Median of the sizes of all deviations."""
    return float(np.median(np.abs(deviations(ours, theirs))))


def largest_deviation(ours: Sequence[float], theirs: Sequence[float]) -> float:
    """The deviation of largest size, with its sign."""
    found = deviations(ours, theirs)
    return float(found[np.argmax(np.abs(found))])


def order(ours: Sequence[Sequence[float]], spacings: Sequence[float]) -> float | None:
    """Observed order, from the changes between three spacings in a constant ratio; None if they do not converge."""
    if len(ours) < 3:
        return None
    coarse, middle, fine = (np.array(values) for values in ours[-3:])
    first, second = np.linalg.norm(middle - coarse), np.linalg.norm(fine - middle)
    if not first > second > 0.0:
        return None
    return float(np.log(first / second) / np.log(spacings[-2] / spacings[-1]))


class UnfinishedError(RuntimeError):
    """A run that a row rests on ended early, or may have left its branch of equilibria."""


def finished(simulation: Simulation, device: str | None, what: str) -> Sequence[Row]:
    """History of a run without its first frame.

    Raises:
        UnfinishedError: if it ended early, or Newton's method may have jumped to another equilibrium.
    """
    result = whole(simulation.run(device=device, usd=False, pictures=False))
    if result.status != "finished":
        raise UnfinishedError(f"{what}: the run ended {result.status!r} after {len(result.history) - 1} frames")
    jumps = [note for note in result.summary["notes"] if "may have jumped" in note]
    if jumps:
        raise UnfinishedError(f"{what}: {jumps[0]}")
    return result.history[1:]


def outcome(scene: str, name: str, settings: Mapping[str, Any], device: str | None) -> float:
    """An outcome of a scene; NaN if the run does not have it."""
    result = whole(build_scene(scene, settings).run(device=device, usd=False, pictures=False))
    value = result.summary["measures"][name]["value"]
    return float("nan") if value is None else float(value)
