"""Static equilibrium of a scene: states along its load path, and linear solves with the tangent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

import numpy as np

from ..device.checks import InputError
from ..device.fields import assign, doubles
from ..interfaces import FrameSink
from ..interfaces.frame import Frame
from ..run.built import Built
from ..run.recorder import FramePoints
from ..run.simulation import Simulation
from ..statics.newton import BuiltNewton

# Linear solves end at this fraction of their right side; those of a fit need no more than its states have.
ACCURACY = {64: 1e-9, 32: 1e-5}
FIT_ACCURACY = {64: 1e-6, 32: 1e-4}
# A load factor that is not reached in one step is approached in steps this many times halved at most.
MAX_HALVINGS = 6


class Silent(FrameSink):
    """A frame sink that discards everything."""


class NoEquilibriumError(Exception):
    """Newton's method found no equilibrium."""


def has_equilibrium(scene: Simulation) -> bool:
    """Whether the scene's solver is Newton."""
    return not scene.solver.dynamic and hasattr(scene.solver, "load_steps") and hasattr(scene.solver, "most_cuts")


def require_newton(scene: Simulation) -> None:
    """Check that derivatives at equilibrium are available for a scene."""
    if not has_equilibrium(scene):
        raise InputError(
            f"solver = {type(scene.solver).__name__}: expected Newton, whose tangent gives the derivatives; for others "
            "take differences over runs"
        )
    if scene.contacts:
        raise InputError("contact: expected None for derivatives at equilibrium, because contact makes the forces jump")
    if scene.damage is not None:
        raise InputError("damage: expected None for derivatives at equilibrium, because breaking bonds cause jumps")


class Equilibrium:
    """A built scene that can be brought to any load factor.

    Attributes:
        built: The simulation on a device.
        factor: Load factor of the current state.
        accuracy: Relative residual at which linear solves end.
    """

    def __init__(self, scene: Simulation, device: str | None = None, precision: int | None = None) -> None:
        """Build the scene, reusing compiled kernels."""
        require_newton(scene)
        self.built: Built = scene.build(device, precision)
        self.built.context.compile()
        self.built.context.run("start")
        for part in self.built.parts:
            part.begin()
        self.built.context.run("setup")
        self.search = cast(BuiltNewton, self.built.solver)
        if not self.search.tangent.symmetric:
            raise InputError(f"{self.built.law.label}: expected a law with an energy for derivatives at equilibrium")
        self.level, self.linear = self.search.levels[0], self.search.solvers[0]
        self.free = ~self.level.held
        self.duration = scene.solver.duration
        self.factor = 0.0
        self.accuracy = ACCURACY[self.built.context.bits]
        self._skew: Callable[[np.ndarray], np.ndarray] | None = None
        self._internal_stage = False

    # States --------------------------------------------------------------------------------------------

    @property
    def displacement(self) -> np.ndarray:
        """Displacement of the current state from the stress-free state [m], shape (N, 3)."""
        return doubles(self.level.displacement)

    def held_at(self, factor: float) -> np.ndarray:
        """Displacement of held components at a load factor [m], shape (N, 3); zero elsewhere."""
        return np.where(self.free, 0.0, self.search.target(0, factor))

    def reach(self, factor: float, guess: np.ndarray | None = None) -> None:
        """Bring the sheet to equilibrium at a load factor, starting from `guess` [m] or the current state.

        Raises:
            NoEquilibriumError: if the solver finds none.
        """
        before, begin = self.displacement, self.factor
        if guess is not None:
            start = np.where(self.free, guess, self.held_at(factor))
            if self.search.equilibrate(factor, Silent(), start):
                self.factor = factor
                return
            assign(self.level.displacement, before)
        step, halvings = factor - begin, 0
        while abs(factor - self.factor) > 1e-12:
            goal = self.factor + step if abs(step) < abs(factor - self.factor) else factor
            last = self.displacement
            if self.search.equilibrate(goal, Silent()):
                self.factor = goal
                continue
            assign(self.level.displacement, last)
            step, halvings = 0.5 * step, halvings + 1
            if halvings > MAX_HALVINGS:
                self.set(before, begin)
                raise NoEquilibriumError(f"no equilibrium at {100.0 * factor:.4g} % of the load")

    def set(self, displacement: np.ndarray, factor: float) -> None:
        """Set a state, not necessarily in equilibrium, with prescribed held components, and evaluate forces."""
        self.factor = factor
        self.search.set_loads(factor)
        assign(self.level.displacement, np.where(self.free, displacement, self.held_at(factor)))
        self.level.run("evaluate")

    def residual(self) -> np.ndarray:
        """Unbalanced force on free components at the last evaluation [N], shape (N, 3)."""
        return doubles(self.level.residual)

    def frame(self) -> Frame:
        """The current state as a frame for measures."""
        self.built.context.run("frame")
        return FramePoints(self.built).frame(1, self.factor * self.duration).in_double()

    def bare_frame(self) -> Frame:
        """A frame with only the displacement of the current state, for probes."""
        placement = self.built.context.placement
        shown = self.displacement if placement is None else self.displacement - placement
        return Frame(1, self.factor * self.duration, shown, np.zeros_like(shown))

    # Linear solves -------------------------------------------------------------------------------------

    def linearise(self) -> None:
        """Compute the tangent at the current state; the preconditioner of Newton's last step, if any, is kept.

        Raises:
            NoEquilibriumError: if the tangent is singular.
        """
        self._skew = None
        if self.linear.prepared:
            self.level.linearise(self._tension())
        else:
            self._renew()

    def _tension(self) -> float:
        return float(self.level.tangent.min_tension(self.search.tolerance))

    def _renew(self) -> None:
        if not self.search.linearise(0, self._tension()):
            raise NoEquilibriumError("the tangent is singular")

    def solve(self, force: np.ndarray) -> np.ndarray:
        """Displacement x [m] of the free components with K x = force [N], both of shape (N, 3)."""
        return self._solve(force, None)

    def solve_transposed(self, force: np.ndarray) -> np.ndarray:
        """As `solve`, with K^T."""
        if self._skew is None and any(not load.symmetric for load in self.level.following):
            self._skew = self._skew_part()
        return self._solve(force, self._skew)

    def _solve(self, force: np.ndarray, added: Callable[[np.ndarray], np.ndarray] | None) -> np.ndarray:
        side, accuracy = np.where(self.free, force, 0.0), self.accuracy
        if not self.linear.solve_closely(side, accuracy, added):
            self._renew()
            if not self.linear.solve_closely(side, accuracy, added):
                raise NoEquilibriumError("the tangent is too close to singular for derivatives")
        return np.where(self.free, doubles(self.level.direction), 0.0)

    @property
    def has_adjoint(self) -> bool:
        """Whether the transposed tangent is known."""
        here = self.displacement
        return all(load.symmetric or load.tangent_matrix(here) is not None for load in self.level.following)

    def internal_product(self, direction: np.ndarray) -> np.ndarray:
        """Stiffness of the force law (without loads) times a displacement [m]: force [N], shape (N, 3)."""
        context, level = self.built.context, self.level
        if not self._internal_stage:
            level.add_product(context.stage("internal product", "derivatives"), level.vector, level.image, False)
            self._internal_stage = True
        assign(level.vector, direction)
        context.run("internal product")
        return doubles(level.image)

    def _skew_part(self) -> Callable[[np.ndarray], np.ndarray]:
        """K^T - K of the loads whose tangent is not symmetric, on free components."""
        here, free = self.displacement, self.free.ravel()
        total: Any = sum(load.tangent_matrix(here) for load in self.level.following if not load.symmetric)
        # K is minus the change of the force.
        skew = (total - total.T).tocsr()

        def product(x: np.ndarray) -> np.ndarray:
            return np.where(free, skew @ np.where(free, x, 0.0), 0.0)

        return product


def for_differences(scene: Simulation) -> Simulation:
    """The scene with options that make building cheap, for differences of its forces."""
    solver: Any = scene.solver
    return replace(scene, solver=replace(solver, preconditioner="jacobi"))
