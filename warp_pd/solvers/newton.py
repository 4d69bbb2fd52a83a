"""Newton's method for sheets at rest: load steps, line search, a tension for what is slack."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..checks import InputError, count, one_of, positive
from ..loads import BoundaryForce
from .linear import LinearSolver
from .load_path import LoadPath
from .multigrid import Hierarchy, coarse_points, coarser, restrict_loads
from .tangent import OWNER, Tangent, assign, dot

if TYPE_CHECKING:
    from ..runner import Recorder
    from ..simulation import Built, Simulation

PRECONDITIONERS = ("auto", "multigrid", "direct", "jacobi")
# A step is accepted unless the work of the unbalanced force along it turned to less than minus this share.
MOST_OVERSHOOT = 0.5
MOST_TRIALS = 12
# Added tension over the mean modulus: at a slack start, after a failed step, where it is given up and dropped.
SLACK_TENSION, FIRST_TENSION, MOST_TENSION, LEAST_TENSION = 0.1, 1e-3, 100.0, 1e-7
SLACK_STRESS = 1e-6
# A linear solve reaches this share of the residual at most, and no further than the tolerance asks.
LOOSEST, TIGHTEST = 0.05, 1e-6
# A wider family hardly feels a checkerboard, so no sweep over the points smooths it: the V-cycle fails at 3.15.
WIDEST = 2.5
# A tangent taken at a residual below this one is kept.
KEPT = 1e-4
# Residual to which coarser lattices are solved: their discretisation error is larger.
COARSE_TOLERANCE = 1e-3
FINISHED, NOT_CONVERGED = "finished", "not converged"


@dataclass(frozen=True)
class Newton:
    """Newton's method on the unbalanced force; for force laws with an energy ("plain", "corrected" weights).

    The load path runs over shares s from 0 to 1: schedules at the time s duration, loads without one times s.
    A load step that fails is cut in half. On an uncut rectangle every load step is solved on coarser lattices
    first. A step of Newton is accepted by the work of the unbalanced force along it (Matthies and Strang,
    Int. J. Numer. Meth. Eng. 14, 1979), which asks for no potential, so follower pressure is no exception;
    its unsymmetric tangent goes to GMRES, symmetric tangents to conjugate gradients. Where the step fails, or
    the start is slack, an isotropic tension is added to the tangent (not to the force) and taken back as the
    steps succeed.

    Attributes:
        tolerance: Norm of the unbalanced force over the norm of loads and reactions at which the sheet is at
            rest; by default 1e-8 in float64 and 1e-4 in float32, whose round-off allows no better.
        load_steps: Number of equal load steps, as long as none fails; each is recorded as a frame.
        most_iterations: Newton steps of one load step after which it counts as failed.
        most_cuts: Times that a load step may be cut in half, over the whole path.
        preconditioner: "multigrid" (uncut rectangles of more than 300 points, horizons up to 2.5), "direct" (a
            sparse factorisation on the host), "jacobi" (3x3 blocks), or "auto": multigrid where that is allowed,
            else direct on a CPU and jacobi on a GPU.
    """

    tolerance: float | None = None
    load_steps: int = 1
    most_iterations: int = 30
    most_cuts: int = 6
    preconditioner: str = "auto"
    duration: float = 1.0
    precision: int = 64

    damping = 0.0
    adaptive_damping = False
    in_time = False
    steps_explicitly = False

    def __post_init__(self) -> None:
        if self.tolerance is not None:
            positive("tolerance", self.tolerance)
        positive("duration", self.duration)
        count("load_steps", self.load_steps, 1)
        count("most_iterations", self.most_iterations, 1)
        count("most_cuts", self.most_cuts, 0)
        one_of("preconditioner", self.preconditioner, PRECONDITIONERS)

    @property
    def frame_count(self) -> int:
        """One a planned load step."""
        return self.load_steps

    def inertia(self, built: Built) -> Any:
        """Nothing moves in time."""
        return None

    def add_before_kick(self, built: Built) -> None:
        """Nothing: there are no steps in time."""

    def check(self, simulation: Simulation) -> None:
        """Compare with the parts of a simulation.

        Raises:
            InputError: for weights without an energy, and for parts that Newton's method does not know.
        """
        if not simulation.force.has_tangent:
            raise InputError(
                f"force = {type(simulation.force).__name__}: allowed with the solver Newton is BondAssociated, which "
                f"has a tangent; take the solver Relaxation"
            )
        if simulation.force.weights == "published":
            raise InputError(
                "weights = 'published': allowed with the solver Newton are 'plain' and 'corrected', which have an "
                "energy; take the solver Relaxation"
            )
        for name, part in (("contact", simulation.contact), ("damage", simulation.damage)):
            if part is not None:
                raise InputError(f"{name} = {type(part).__name__}: allowed with the solver Newton is None")
        if any(isinstance(load, BoundaryForce) for load in simulation.loads):
            raise InputError("loads: allowed with the solver Newton is none of BoundaryForce, which has no energy")
        if simulation.sheet.inclusions:
            raise InputError("sheet.inclusions: allowed with the solver Newton is a sheet without rigid inclusions")

    def add(self, built: Built) -> None:
        """Add the tangent and, on a rectangle, the coarser lattices."""
        built.newton = Search(self, built)

    def march(self, built: Built, recorder: Recorder) -> str:
        """Bring every load step to rest, each a frame; returns the final status.

        After a failure the state is that of the last good load step.
        """
        return built.newton.run(recorder)


@dataclass
class Report:
    """What one search did; becomes "solve" in summary.json.

    Attributes:
        preconditioner: The one in use.
        load_steps: One entry an attempted load step: share, converged, and per lattice, coarsest first: points,
            relative residuals, accepted shares of the steps, products with the stiffness.
    """

    preconditioner: str
    load_steps: list[dict[str, Any]] = field(default_factory=list)
    seconds: float = 0.0

    def summary(self, points: int, reached: float) -> dict[str, Any]:
        """As plain numbers and lists; iterations and products are those on the finest lattice."""
        finest = [level for step in self.load_steps for level in step["lattices"] if level["points"] == points]
        return {
            "solver": "Newton",
            "preconditioner": self.preconditioner,
            "iterations": sum(len(level["shares"]) for level in finest),
            "products": sum(level["products"] for level in finest),
            "residuals": [r for level in finest for r in level["residuals"]],
            "reached": reached,
            "seconds": self.seconds,
            "load_steps": self.load_steps,
        }


class Search:
    """The search for equilibrium of one built simulation."""

    def __init__(self, newton: Newton, built: Built) -> None:
        simulation, state = built.simulation, built.state
        self.newton, self.built = newton, built
        self.path = LoadPath(simulation, newton.duration)
        self.tangent = Tangent(
            built.workspace, built.force, built.held, built.has_loads, self.path.follower, state.displacement,
            state.force, state.external, assembled=self._assembled(),
        )  # fmt: skip
        self.good = built.workspace.array("last_load_step", OWNER, built.types.vec3, shape=simulation.sheet.size)
        self.preconditioner = self._preconditioner()
        self.hierarchy = Hierarchy(self.tangent, built) if self.preconditioner == "multigrid" else None
        self.levels = self.hierarchy.levels if self.hierarchy else [self.tangent]
        self.solvers = [LinearSolver(self, index) for index in range(len(self.levels))]
        self.report = Report(self.preconditioner)
        self.tolerance = newton.tolerance or (1e-8 if built.types.bits == 64 else 1e-4)
        self.modulus = 0.0
        self._begin = 0.0

    def _assembled(self) -> bool:
        """Whether the tangent of the lattice is stored as a matrix: on a CPU, where a product is four times faster."""
        sheet, w = self.built.simulation.sheet, self.built.workspace
        return sheet.lattice is not None and not sheet.cuts and w.device.is_cpu

    def _preconditioner(self) -> str:
        newton, sheet = self.newton, self.built.simulation.sheet
        narrow = self.built.simulation.force.horizon <= WIDEST
        lattices = coarser(sheet.lattice) if sheet.lattice is not None and not sheet.cuts and narrow else []
        possible = bool(lattices)
        if sheet.lattice is not None and lattices:
            nearest = coarse_points(lattices[-1], sheet.lattice)
            held = self.built.held
            # A support that no coarse point sees would leave the coarse sheet loose.
            possible = bool((np.bitwise_or.reduce(held) & ~np.bitwise_or.reduce(held[nearest])) == 0)
        if newton.preconditioner == "auto":
            return "multigrid" if possible else "direct" if self.built.workspace.device.is_cpu else "jacobi"
        if newton.preconditioner == "multigrid" and not possible:
            raise InputError(
                "preconditioner = 'multigrid': allowed on uncut rectangles of more than 300 points, "
                f"at horizons up to {WIDEST}"
            )
        return newton.preconditioner

    # Load steps ----------------------------------------------------------------------------------------

    def run(self, recorder: Recorder) -> str:
        """Follow the load path; returns the final status."""
        self._begin, tangent, planned = perf_counter(), self.tangent, self.newton.load_steps
        reached, size, cuts = recorder.time / self.newton.duration, 1.0 / planned, 0
        wp.copy(self.good, tangent.displacement)
        while reached < 1.0 - 1e-9:
            goal = (math.floor(reached * planned + 1e-9) + 1) / planned
            share = goal if reached + size > goal - 1e-9 else reached + size
            converged, recorder.residual = self._load_step(share, recorder)
            if converged:
                reached = share
                wp.copy(self.good, tangent.displacement)
                if share == goal:
                    self._record(recorder, reached)
                continue
            wp.copy(tangent.displacement, self.good)
            cuts += 1
            size *= 0.5
            if cuts > self.newton.most_cuts:
                self._set_loads(0, reached)
                tangent.evaluate()
                if reached > recorder.time / self.newton.duration + 1e-9:
                    self._record(recorder, reached)
                recorder.solve = self.report.summary(tangent.points, reached)
                return NOT_CONVERGED
        return FINISHED

    def _record(self, recorder: Recorder, reached: float) -> None:
        """Hand the state to the recorder as the next frame."""
        if self.built.state.time is not None:
            assign(self.built.state.time, np.array([reached * self.newton.duration]))
        self.report.seconds = perf_counter() - self._begin
        before = recorder.steps
        recorder.solve = self.report.summary(self.tangent.points, reached)
        now = reached * self.newton.duration
        recorder.frame(recorder.frame_index + 1, now, recorder.solve["iterations"] - before, 0.0)

    def _load_step(self, share: float, recorder: Recorder) -> tuple[bool, float]:
        """Equilibrium at a share of the loads, from the last good load step; whether found, and the residual."""
        entry: dict[str, Any] = {"share": share, "converged": False, "lattices": []}
        self.report.load_steps.append(entry)
        last = len(self.levels) - 1
        if self.hierarchy:
            for index in range(last):
                self.levels[index].run(f"sample {index}")
        for index in reversed(range(last + 1)):
            level = self.levels[index]
            self._set_loads(index, share)
            wp.copy(level.base, level.displacement)
            if index < last and self.hierarchy and entry["lattices"][-1]["converged"]:
                self.hierarchy.start(index)
                self._prescribe(index, share)
            found = Descent(self, index, share, recorder).run()
            entry["lattices"].append(found)
            if not found["converged"] and index > 0:
                wp.copy(level.displacement, level.base)
        entry["converged"] = found["converged"]
        return found["converged"], found["residuals"][-1]

    def _set_loads(self, index: int, share: float) -> None:
        dead = self.path.dead(share)
        if index > 0 and dead is not None and self.hierarchy:
            dead = restrict_loads(dead, self.hierarchy.lattices[0], self.hierarchy.lattices[index])
        self.levels[index].set_loads(dead, self.path.pressure(share))

    def target(self, index: int, share: float) -> np.ndarray:
        """Displacement of held components at a share of the path [m], shape (N, 3); others are meaningless."""
        target = self.path.prescribed(share)
        if index > 0 and self.hierarchy:
            lattices = self.hierarchy.lattices
            return target[coarse_points(lattices[index], lattices[0])]
        return target

    def _prescribe(self, index: int, share: float) -> None:
        level = self.levels[index]
        held = (level.held[:, None] >> np.arange(3)) & 1 == 1
        if held.any():
            u = level.displacement.numpy()
            assign(level.displacement, np.where(held, self.target(index, share), u))

    def linearise(self, index: int, tension: float) -> bool:
        """Take the tangent of a level and of what preconditions it; whether it could be factorised."""
        if self.hierarchy:
            self.hierarchy.linearise(index, tension)
            return self.hierarchy.usable
        self.tangent.linearise(tension)
        return self.solvers[0].prepare()


class Descent:
    """Newton steps of one level at one share of the loads."""

    def __init__(self, search: Search, index: int, share: float, recorder: Recorder) -> None:
        self.search, self.index, self.recorder = search, index, recorder
        self.level, self.solver = search.levels[index], search.solvers[index]
        held = (self.level.held[:, None] >> np.arange(3)) & 1 == 1
        self.lift = np.zeros((self.level.points, 3))
        if held.any():
            here = self.level.displacement.numpy().astype(np.float64)
            self.lift = np.where(held, search.target(index, share) - here, 0.0)
            self.lift[np.abs(self.lift) <= 1e-12 * np.abs(here).max()] = 0.0
        self.lifting = bool(self.lift.any())
        self.tension = 0.0
        self._kept = False
        self.tolerance = search.tolerance if index == 0 else max(search.tolerance, COARSE_TOLERANCE)
        self.residuals: list[float] = []
        self.shares: list[float] = []

    def run(self) -> dict[str, Any]:
        """Steps until rest or failure, as an entry of the report."""
        before = self.solver.products
        wp.copy(self.level.base, self.level.displacement)
        norm, scale = self.level.evaluate()
        converged = False
        for iteration in range(self.search.newton.most_iterations + 1):
            relative = 0.0 if norm == 0.0 else norm / scale if scale > 0.0 else math.inf
            self.residuals.append(relative)
            if self.index == 0:
                self.recorder.progress(len(self.shares), relative, self.search.tolerance)
            if not math.isfinite(norm):
                break
            converged = relative <= self.tolerance and not self.lifting
            if converged or iteration == self.search.newton.most_iterations:
                break
            advanced = self._step(relative, norm)
            if advanced is None:
                break
            norm, scale = advanced
        return {
            "points": self.level.points,
            "converged": converged,
            "residuals": self.residuals,
            "shares": self.shares,
            "products": self.solver.products - before,
        }

    def _step(self, relative: float, norm: float) -> tuple[float, float] | None:
        """One accepted step: the new norms; None if no tension helps."""
        level, search = self.level, self.search
        while True:
            usable = self._kept or search.linearise(self.index, self.tension)
            self._kept = usable and relative <= KEPT and self.tension == 0.0
            if not search.modulus:
                search.modulus = level.modulus()
                if np.abs(level.stress.numpy()).max() < SLACK_STRESS * search.modulus:
                    self.tension = SLACK_TENSION * search.modulus
                    continue
            if usable:
                self._direct(relative)
                work = dot(level.direction, level.residual)
                if self.lifting or work > 0.0:
                    found = self._search_line(work, norm)
                    if found is not None:
                        return found
            self._kept = False
            self.tension = max(10.0 * self.tension, FIRST_TENSION * search.modulus)
            if self.tension > MOST_TENSION * search.modulus:
                return None

    def _direct(self, relative: float) -> None:
        """Newton's direction, held components included."""
        level = self.level
        right_side = level.residual.numpy().astype(np.float64)
        if self.lifting:
            assign(level.vector, self.lift)
            level.run("product")
            right_side = right_side - level.image.numpy()
        goal = self.tolerance
        accuracy = TIGHTEST
        if math.isfinite(relative) and relative > 0.0:
            accuracy = min(LOOSEST, max(relative, 0.03 * goal / relative, TIGHTEST))
        self.solver.solve(right_side, accuracy)
        if self.lifting:
            assign(level.direction, level.direction.numpy() + self.lift)

    def _search_line(self, work: float, norm: float) -> tuple[float, float] | None:
        """Accept a share of the direction; None, and back to the base, if there is none."""
        level, share = self.level, 1.0
        for _ in range(MOST_TRIALS):
            level.step_to(share)
            new_norm, scale = level.evaluate()
            left = dot(level.direction, level.residual)
            if math.isfinite(new_norm) and (self.lifting or left >= -MOST_OVERSHOOT * work or new_norm < norm):
                self._accept(share, new_norm / scale if scale > 0.0 else math.inf)
                return new_norm, scale
            share *= min(0.5, max(0.1, work / (work - left))) if math.isfinite(left) else 0.25
        level.step_to(0.0)
        level.evaluate()
        return None

    def _accept(self, share: float, relative: float) -> None:
        wp.copy(self.level.base, self.level.displacement)
        self.shares.append(share)
        if self.lifting:
            self.lift *= 1.0 - share
            self.lifting = bool(self.lift.any())
        if share == 1.0:
            self.tension = min(0.1 * self.tension, relative * self.search.modulus)
            if self.tension < LEAST_TENSION * self.search.modulus:
                self.tension = 0.0
