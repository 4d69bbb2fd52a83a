"""Converged finite elements, for a draped sheet this code's finest run, and how far a run is from them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from error_vs_time.errors import interpolated
from finite_elements import Array, Response
from scipy.interpolate import RegularGridInterpolator

from peers.adapters import this_code
from peers.codes import FALL
from peers.elements import solved
from peers.problems import Problem

# Largest relative change of the field by halving the elements at which it counts as converged, and the finest grid; in
# time elements have four nodes.
CONVERGED, FINEST, FINEST_IN_TIME = 2e-5, 193, 97
# Points of the runs of this code that a draped sheet is compared with.
# The second one starts where the first one came to rest, and takes this time to come to rest [s].
DRAPED, SETTLES = (49, 97), 0.3


def kept(cache: Path, problem: Problem, *given: Any) -> Path:
    """The file of a reference, named by all that it depends on."""
    cache.mkdir(parents=True, exist_ok=True)
    return cache / f"{problem.name}-{hashlib.sha256(repr((problem, given)).encode()).hexdigest()[:12]}.npz"


class Reference:
    """A converged field, which is kept in a file.

    Attributes:
        problem: What was solved.
        points: Nodes along the shorter side of the finest elements.
        change: Relative change of the field by the last halving of the elements.
    """

    def __init__(self, problem: Problem, material: Callable[[Problem], Response], cache: Path) -> None:
        self.problem = problem
        finest = FINEST_IN_TIME if problem.until else FINEST
        file = kept(cache, problem, material.__name__, CONVERGED, finest)
        if file.is_file():
            found = np.load(file)
            self.points, self.change = int(found["points"]), float(found["change"])
            self._nodes, self._moved = found["nodes"], found["moved"]
            return
        self.points, self.change = 25, np.inf
        sheet = solved(problem, self.points, material(problem))
        self._nodes, self._moved = sheet.nodes, sheet.displacement
        while self.change > CONVERGED and self.points < finest:
            coarse, self.points = sheet, 2 * self.points - 1
            sheet = solved(problem, self.points, material(problem))
            self._nodes, self._moved = sheet.nodes, sheet.displacement
            self.change = self.error(coarse.nodes, coarse.displacement)
        np.savez(file, points=self.points, change=self.change, nodes=self._nodes, moved=self._moved)

    def error(self, places: Array, displacement: Array) -> float:
        """Root mean square distance over that of the field, (N, 2) [m] and (N, 2 or 3) [m].

        The field counts less the uniform stretch, which every code is given.
        """
        wanted = interpolated(self._nodes, self._moved, places)
        size = wanted - self.problem.even(places)[:, : wanted.shape[1]]
        off = displacement[:, : wanted.shape[1]] - wanted
        return float(np.sqrt((off**2).sum() / (size**2).sum()))


class Draped:
    """This code's finest run of a draped sheet, since the finite elements have no bending stiffness.

    Attributes:
        change: Relative change of the field by the last halving of the spacing.
    """

    def __init__(self, problem: Problem, device: str, cache: Path) -> None:
        self._size, settings = problem.size[0], {**FALL, "device": device}
        for points in DRAPED:
            file, places = kept(cache, problem, points, FALL, SETTLES).with_suffix(".npy"), problem.grid(points)
            if not file.is_file():
                if points > DRAPED[0]:
                    settings |= {"start": outside(problem, places, self._at(places)), "duration": SETTLES}
                np.save(file, this_code.solve(problem, {**settings, "points": points})["displacement"])
            found = np.load(file)
            self.change = self.error(places, found) if points > DRAPED[0] else np.inf
            self._finest = found.reshape(points, points, 3)

    def _at(self, places: Array) -> Array:
        ticks = np.linspace(0.0, self._size, len(self._finest))
        return RegularGridInterpolator((ticks, ticks), self._finest)(places[:, ::-1])

    def error(self, places: Array, displacement: Array) -> float:
        """As in `Reference`."""
        wanted = self._at(places)
        return float(np.sqrt(((displacement - wanted) ** 2).sum() / (wanted**2).sum()))


def outside(problem: Problem, places: Array, displacement: Array) -> Array:
    """The displacement with points that are inside the ball brought to its surface [m]."""
    arms = np.column_stack([places, np.zeros(len(places))]) + displacement - problem.ball_at
    distance = np.linalg.norm(arms, axis=1, keepdims=True)
    return displacement + np.maximum(problem.ball / distance - 1.0, 0.0) * arms * ~problem.fixed(places)[:, None]
