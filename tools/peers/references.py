"""Converged finite elements, and how far a run is from them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from error_vs_time.errors import interpolated
from finite_elements import Array, Response

from peers.elements import solved
from peers.problems import Problem

# Largest relative change of the field by halving the elements at which it counts as converged, and the finest grid; in
# time elements have four nodes.
CONVERGED, FINEST, FINEST_IN_TIME = 2e-5, 193, 97


class Reference:
    """A converged field.

    Attributes:
        problem: What was solved.
        points: Nodes along the shorter side of the finest elements.
        change: Relative change of the field by the last halving of the elements.
    """

    def __init__(self, problem: Problem, material: Callable[[Problem], Response]) -> None:
        self.problem, self.points, self.change = problem, 25, np.inf
        self._sheet = solved(problem, self.points, material(problem))
        finest = FINEST_IN_TIME if problem.until else FINEST
        while self.change > CONVERGED and self.points < finest:
            coarse = self._sheet
            self.points = 2 * self.points - 1
            self._sheet = solved(problem, self.points, material(problem))
            self.change = self.error(coarse.nodes, coarse.displacement)

    def error(self, places: Array, displacement: Array) -> float:
        """Root mean square distance over that of the field, (N, 2) [m] and (N, 2 or 3) [m].

        The field counts less the uniform stretch, which every code is given.
        """
        wanted = interpolated(self._sheet.nodes, self._sheet.displacement, places)
        size = wanted - self.problem.even(places)[:, : wanted.shape[1]]
        off = displacement[:, : wanted.shape[1]] - wanted
        return float(np.sqrt((off**2).sum() / (size**2).sum()))
