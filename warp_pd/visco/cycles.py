"""What a cyclic test measures: loss per cycle, storage and loss stiffness; functions of a history, for an `Outcome`.

The history needs rows in the last cycle, by the times of frames or by `history_every`, at its turning points too.
Forces and displacements between rows are cubic splines in time, from one turning point to the next.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..device.checks import InputError, one_of, positive

if TYPE_CHECKING:
    from ..parts.supports import Motion

# Rows of a cycle at least, and points of Gauss in each interval between two.
FEWEST, GAUSS = 8, 4


def loss_per_cycle(
    history: Sequence[Mapping[str, float]], motion: Motion, period: float, reaction: str = "reaction"
) -> float | None:
    """Work of a motion in the last cycle of a history [J]; None before the end of the first.

    Args:
        history: Rows with the time and the columns of a `Reaction`.
        motion: The cyclic motion, without a turn.
        period: Period [s].
        reaction: Name of the `Reaction` on the points of the motion.

    Raises:
        InputError: if the last cycle has too few rows.
    """
    arcs = list(_arcs(history, motion, period, reaction))
    return sum(float(np.sum(w[:, None] * force * speed)) for _, w, _, speed, force in arcs) if arcs else None


def dynamic_stiffness(
    history: Sequence[Mapping[str, float]], motion: Motion, period: float, reaction: str = "reaction"
) -> complex | None:
    """Storage and loss stiffness of the last cycle [N/m], as a complex number; None before the end of the first.

    That is the amplitude of the force over that of the displacement, at the frequency of the motion, along the
    direction that it moves most. Arguments as for `loss_per_cycle`. Times length over cross-section it is the complex
    modulus of a strip.
    """
    arcs = list(_arcs(history, motion, period, reaction))
    if not arcs:
        return None
    t, w = (np.concatenate([arc[k] for arc in arcs]) for k in (0, 1))
    moved, force = (np.concatenate([arc[k] for arc in arcs]) for k in (2, 4))
    wave = w * np.exp(-2j * math.pi * t / period)
    amplitude = wave @ moved
    most = int(np.abs(amplitude).argmax())
    return complex((wave @ force)[most] / amplitude[most])


def _arcs(
    history: Sequence[Mapping[str, float]], motion: Motion, period: float, reaction: str
) -> Iterator[tuple[np.ndarray, ...]]:
    """Times, weights, displacement, velocity and force at points of Gauss, from each turning point to the next."""
    from scipy.interpolate import make_interp_spline

    positive("period", period)
    paths = motion.paths()
    if motion.turn() is not None or len(paths) > 1:
        raise InputError("motion: expected one path of all points, without an angle")
    end = history[-1]["time"]
    rows = [row for row in history if row["time"] >= end - period * (1.0 + 1e-9)]
    t = np.array([row["time"] for row in rows])
    if end - t[0] < period * (1.0 - 1e-9):
        if end > period:
            raise InputError(f"history: expected a row at {end - period:.6g} s, a period before the last")
        return
    if len(rows) < FEWEST:
        raise InputError(
            f"history: {len(rows)} rows in the last cycle: expected at least {FEWEST} (frames, history_every)"
        )
    one_of("column", f"{reaction}_x", rows[0])
    (path,) = paths
    moved = np.array([path.at(time) for time in t])
    force = np.array([[row[f"{reaction}_{c}"] for c in "xyz"] for row in rows])
    way = np.sign(np.diff(moved, axis=0).round(12))
    turns = [0, *(1 + np.flatnonzero((way[1:] != way[:-1]).any(axis=1))), len(t) - 1]
    x, weights = np.polynomial.legendre.leggauss(GAUSS)
    for first, last in itertools.pairwise(turns):
        here = slice(first, last + 1)
        of_time = make_interp_spline(t[here], np.hstack([moved[here], force[here]]), k=min(3, last - first))
        half = 0.5 * np.diff(t[here])
        at = (t[first:last, None] + half[:, None] * (1.0 + x)).ravel()
        values = of_time(at)
        yield at, (half[:, None] * weights).ravel(), values[:, :3], of_time(at, 1)[:, :3], values[:, 3:]
