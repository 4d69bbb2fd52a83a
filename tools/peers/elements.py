"""Membrane finite elements for the problems: scikit-fem's row in the tables, and the reference."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from finite_elements import Array, Membrane, Motion, Response, neo_hookean, rectangle

from peers.problems import Problem


def rubber(problem: Problem) -> Response:
    """The material of the problem."""
    return neo_hookean(problem.mu, problem.bulk)


def newton_membrane(problem: Problem) -> Response:
    """That of newton's VBD: W = mu/2 (t - 2) + L/2 (J - 1 - mu/L)^2, J^2 = d; L = 3 mu is rubber at small strain."""
    mu, resistance = problem.mu, 3.0 * problem.mu
    rest = 1.0 + mu / resistance

    def response(t: Array, d: Array) -> tuple[Array, ...]:
        area, nothing = np.sqrt(d), np.zeros_like(t)
        by_d = 0.5 * resistance * (area - rest) / area
        return nothing + 0.5 * mu, by_d, nothing, nothing, 0.25 * resistance * rest / area**3

    return response


def solved(problem: Problem, points: int, material: Response, nine: bool = True) -> Membrane:
    """Elements in equilibrium, or at the end of their way.

    Args:
        problem: What is solved.
        points: Nodes along the shorter side.
        material: Its energy.
        nine: Whether elements have nine nodes; in time they have four.
    """
    nine = nine and not problem.until
    counts = [(n + 1) // 2 if nine else n for n in problem.counts(points)]
    ticks = [np.linspace(0.0, s, n) for s, n in zip(problem.size, counts, strict=True)]
    components = 2 if problem.plane else 3
    sheet = Membrane(rectangle(*ticks, nine), material, problem.thickness, components, pressure=problem.pressure)
    sheet.displacement[:] = problem.start(sheet.nodes)[:, :components]
    held = problem.fixed(sheet.nodes)
    if not problem.until:
        # Newton's method in one load step.
        sheet.solve(np.repeat(held[:, None], components, axis=1), tolerance=1e-6)
        return sheet
    # A third of the time in which the fastest wave, sqrt(4 mu / rho) at rest, passes an element.
    step = 0.3 * ticks[0][1] / np.sqrt(4.0 * problem.mu / problem.density)
    motion = Motion if not problem.ball else partial(UnderBall, problem)
    motion(sheet, problem.density, 0.0, held, lambda _: np.zeros(3), step).run(problem.until)
    return sheet


class UnderBall(Motion):
    """A membrane and a free rigid ball without friction.

    A node that would end a step inside the ball ends it on its surface, and the ball loses the momentum that the node
    gains: Lagrange multipliers of forward increments (Carpenter, Taylor and Katona 1991).

    Attributes:
        ball_centre: [m].
        ball_velocity: [m/s].
    """

    def __init__(self, problem: Problem, *args: Any) -> None:
        super().__init__(*args)
        self._radius, self._mass = problem.ball, problem.ball_mass
        self.ball_centre, self.ball_velocity = np.array(problem.ball_at), np.array([0.0, 0.0, -problem.ball_speed])

    def touch(self, dt: float) -> None:
        """Bring nodes to the surface."""
        self.ball_centre += dt * self.ball_velocity
        place = self.membrane.displacement + dt * self.velocity - self.ball_centre
        place[:, :2] += self.membrane.nodes
        distance = np.linalg.norm(place, axis=1)
        gained = (np.maximum(self._radius - distance, 0.0) / (dt * distance))[:, None] * place
        self.velocity += gained
        self.ball_velocity -= (self.masses[:, None] * gained).sum(axis=0) / self._mass
