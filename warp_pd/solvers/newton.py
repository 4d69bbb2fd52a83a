"""Newton's method for sheets at rest: load steps, line search, a tension for what is slack."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..checks import InputError, count, one_of, positive
from ..forces.bond_based import BondBased, BondBasedForce
from ..loads import BoundaryForce
from .bond_tangent import BondTangent
from .equilibrium import OWNER, assign, dot
from .linear import LinearSolver
from .load_path import LoadPath
from .multigrid import Hierarchy, coarse_points, coarser, restrict_loads
from .rupture import LEAST_LOAD, MOST_ROUNDS, Rupture
from .tangent import Tangent

if TYPE_CHECKING:
    from ..runner import Recorder
    from ..simulation import Built, Simulation

STIFFNESSES = ("tangent", "constant")
PRECONDITIONERS = ("auto", "multigrid", "direct", "jacobi")
# A step is accepted unless the work of the unbalanced force along it turned to less than minus this share.
MOST_OVERSHOOT = 0.5
MOST_TRIALS = 12
# Added tension over the mean modulus: at a slack start, after a failed step, where it is given up and dropped.
SLACK_TENSION, FIRST_TENSION, MOST_TENSION, LEAST_TENSION = 0.1, 1e-3, 100.0, 1e-7
# A linear solve reaches this share of the residual at most, and no further than the tolerance asks.
LOOSEST, TIGHTEST = 0.05, 1e-6
# A wider family hardly feels a checkerboard, so no sweep over the points smooths it: the V-cycle fails at 3.15.
WIDEST = 2.5
# A tangent taken at a residual below this one is kept.
KEPT = 1e-4
# Points up to which a bond-based sheet on a GPU is factorised on the host.
MOST_DIRECT = 100_000
# Residual to which coarser lattices are solved: their discretisation error is larger.
COARSE_TOLERANCE = 1e-3
FINISHED, NOT_CONVERGED = "finished", "not converged"


@dataclass(frozen=True)
class Newton:
    """Newton's method on the unbalanced force; for force laws with an energy ("plain", "corrected" weights).

    The load path runs over shares s from 0 to 1: schedules at the time s duration, loads without one times s.
    A load step that fails is cut in half. On an uncut rectangle every load step is solved on coarser lattices
    first; elsewhere the second and later ones start on the line through the two states before. With the
    bond-based law and a rupture criterion every load step comes to rest, breaks what is over-stretched, and comes
    to rest again.

    A step of Newton is accepted by the work of the unbalanced force along it (Matthies and Strang, Int. J. Numer.
    Meth. Eng. 14, 1979), which asks for no potential, so follower pressure is no exception; its unsymmetric tangent
    goes to GMRES, symmetric tangents to conjugate gradients. Where the step fails, or the start is slack, an
    isotropic tension is added to the tangent (not to the force) and taken back as the steps succeed.

    Attributes:
        tolerance: Norm of the unbalanced force over the norm of loads and reactions at which the sheet is at
            rest; by default 1e-8 in float64 and 1e-4 in float32, whose round-off allows no better.
        load_steps: Number of equal load steps, as long as none fails; each is recorded as a frame.
        most_iterations: Newton steps of one load step after which it counts as failed.
        most_cuts: Times that a load step may be cut in half, over the whole path.
        preconditioner: "multigrid" (uncut rectangles of more than 300 points, horizons up to 2.5), "direct" (a
            sparse factorisation on the host), "jacobi" (3x3 blocks), or "auto": multigrid where that is allowed,
            else direct on a CPU and jacobi on a GPU. The bond-based law has no multigrid, and is solved directly
            on either up to 100 000 points.
        stiffness: "tangent", or, for the bond-based law, "constant": without the part of the bonds' tension
            (IM eq. 16, with directions and moduli of the bonds as they are), always in full steps, as published.
            For comparison: it becomes slow, then oscillates, as deformations and the ratio of moduli grow.
    """

    tolerance: float | None = None
    load_steps: int = 1
    most_iterations: int = 30
    most_cuts: int = 6
    preconditioner: str = "auto"
    stiffness: str = "tangent"
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
        one_of("stiffness", self.stiffness, STIFFNESSES)

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
                f"force = {type(simulation.force).__name__}: allowed with the solver Newton are BondAssociated and "
                f"BondBased, which have a tangent; take the solver Relaxation"
            )
        if simulation.force.weights == "published":
            raise InputError(
                "weights = 'published': allowed with the solver Newton are 'plain' and 'corrected', which have an "
                "energy; take the solver Relaxation"
            )
        bond_based = isinstance(simulation.force, BondBased)
        for name, part in (("contact", simulation.contact), ("damage", None if bond_based else simulation.damage)):
            if part is not None:
                raise InputError(f"{name} = {type(part).__name__}: allowed with the solver Newton is None")
        if any(isinstance(load, BoundaryForce) for load in simulation.loads):
            raise InputError("loads: allowed with the solver Newton is none of BoundaryForce, which has no energy")
        if simulation.sheet.inclusions:
            raise InputError("sheet.inclusions: allowed with the solver Newton is a sheet without rigid inclusions")
        if self.stiffness == "constant" and not bond_based:
            raise InputError("stiffness = 'constant': allowed is 'tangent', and 'constant' with the law BondBased")

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
        simulation = built.simulation
        self.newton, self.built = newton, built
        self.path = LoadPath(simulation, newton.duration)
        self.good = built.workspace.array("last_load_step", OWNER, built.types.vec3, shape=simulation.sheet.size)
        self.tangent = self._tangent()
        self.rupture = Rupture(built)
        self.preconditioner = self._preconditioner()
        self.hierarchy = None
        if self.preconditioner == "multigrid":
            assert isinstance(self.tangent, Tangent)
            self.hierarchy = Hierarchy(self.tangent, built)
        self.levels: Sequence[Tangent | BondTangent] = self.hierarchy.levels if self.hierarchy else [self.tangent]
        self.solvers = [LinearSolver(self, index) for index in range(len(self.levels))]
        self.report = Report(self.preconditioner)
        self.tolerance = newton.tolerance or (1e-8 if built.types.bits == 64 else 1e-4)
        self.modulus = 0.0
        self.largest = 0.0
        self._begin = 0.0
        self._earlier: tuple[float, np.ndarray] | None = None
        self._kept: tuple[float, np.ndarray] | None = None

    def _tangent(self) -> Tangent | BondTangent:
        built, state, force = self.built, self.built.state, self.built.force
        field = (state.displacement, state.force, state.external)
        if isinstance(force, BondBasedForce):
            return BondTangent(
                built.workspace,
                force,
                built.held,
                built.has_loads,
                self.path.follower,
                *field,
                self.newton.stiffness == "tangent",
            )
        return Tangent(
            built.workspace, force, built.held, built.has_loads, self.path.follower, *field, self._assembled()
        )

    def _assembled(self) -> bool:
        """Whether the tangent of the lattice is stored as a matrix: on a CPU, where a product is four times faster."""
        sheet, w = self.built.simulation.sheet, self.built.workspace
        return sheet.lattice is not None and not sheet.cuts and w.device.is_cpu

    def _preconditioner(self) -> str:
        newton, sheet = self.newton, self.built.simulation.sheet
        if isinstance(self.built.force, BondBasedForce):
            if newton.preconditioner == "multigrid":
                raise InputError("preconditioner = 'multigrid': allowed with the law BondBased are 'direct', 'jacobi'")
            direct = self.built.workspace.device.is_cpu or sheet.size <= MOST_DIRECT
            return ("direct" if direct else "jacobi") if newton.preconditioner == "auto" else newton.preconditioner
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
        tangent, planned = self.tangent, self.newton.load_steps
        self._begin = perf_counter()
        if recorder.solve is not None:
            # A resumed run reports the load steps before it, too.
            self._begin -= recorder.solve["seconds"]
            self.report.load_steps += recorder.solve["load_steps"]
        reached, size, cuts = recorder.time / self.newton.duration, 1.0 / planned, 0
        standing = self._keep(reached)
        while reached < 1.0 - 1e-9:
            goal = (math.floor(reached * planned + 1e-9) + 1) / planned
            share = goal if reached + size > goal - 1e-9 else reached + size
            converged, recorder.residual = self._rest(share, recorder)
            if converged:
                reached = share
                standing = self._keep(reached)
                if share == goal:
                    self._record(recorder, reached)
                continue
            wp.copy(tangent.displacement, self.good)
            self._earlier = self._kept = None
            if self.rupture.alive is not None:
                self.rupture.alive.assign(standing)
            cuts += 1
            size *= 0.5
            if cuts > self.newton.most_cuts:
                self._set_loads(0, reached)
                tangent.evaluate()
                if reached > recorder.time / self.newton.duration + 1e-9:
                    self._record(recorder, reached)
                recorder.solve = self._summary(reached)
                return NOT_CONVERGED
        return FINISHED

    def _keep(self, reached: float) -> np.ndarray | None:
        """Remember the state as the last good load step; its standing bonds, if any can break."""
        wp.copy(self.good, self.tangent.displacement)
        self._earlier, self._kept = self._kept, (reached, self.good.numpy().astype(np.float64))
        return None if self.rupture.alive is None else self.rupture.alive.numpy().copy()

    def _rest(self, share: float, recorder: Recorder) -> tuple[bool, float]:
        """Equilibrium at a share of the loads in which nothing breaks; whether found, and the residual."""
        if self._earlier is not None and self._kept is not None and self.hierarchy is None:
            # On along the line through the last two load steps; what is held goes where it belongs all the same.
            (s0, u0), (s1, u1) = self._earlier, self._kept
            assign(self.tangent.displacement, u1 + (share - s1) / (s1 - s0) * (u1 - u0))
        converged, residual = self._load_step(share, recorder)
        rounds = 0
        while converged and self.rupture.breaks():
            rounds += 1
            self._kept = None
            converged, residual = self._load_step(share, recorder)
            converged = converged and rounds < MOST_ROUNDS
        return converged, residual

    def _summary(self, reached: float) -> dict[str, Any]:
        self.report.seconds = perf_counter() - self._begin
        return self.report.summary(self.tangent.points, reached)

    def _record(self, recorder: Recorder, reached: float) -> None:
        """Hand the state to the recorder as the next frame."""
        if self.built.state.time is not None:
            assign(self.built.state.time, np.array([reached * self.newton.duration]))
        before = recorder.steps
        recorder.solve = self._summary(reached)
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

    def relative(self, norm: float, scale: float) -> float:
        """Unbalanced force over loads and reactions, these at least LEAST_LOAD of the largest at rest so far."""
        scale = max(scale, LEAST_LOAD * self.largest)
        return _ratio(norm, scale)


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
            relative = self.search.relative(norm, scale) if self.index == 0 else _ratio(norm, scale)
            self.residuals.append(relative)
            if self.index == 0:
                self.recorder.progress(len(self.shares), relative, self.search.tolerance)
            if not math.isfinite(norm):
                break
            converged = relative <= self.tolerance and not self.lifting
            if converged and self.index == 0:
                self.search.largest = max(self.search.largest, scale)
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
            least = level.least_tension(relative) if isinstance(level, BondTangent) else 0.0
            usable = self._kept or search.linearise(self.index, max(self.tension, least))
            self._kept = usable and relative <= KEPT and self.tension == 0.0 and self._shrinks()
            if not search.modulus:
                search.modulus = level.modulus()
                if search.newton.stiffness == "tangent" and level.slack():
                    self.tension = SLACK_TENSION * search.modulus
                    continue
            if usable:
                self._direct(relative)
                if search.newton.stiffness == "constant":
                    return self._full_step()
                work = dot(level.direction, level.residual)
                if self.lifting or work > 0.0:
                    found = self._search_line(work, norm)
                    if found is not None:
                        return found
            if search.newton.stiffness == "constant":
                return None
            self._kept = False
            self.tension = max(10.0 * self.tension, FIRST_TENSION * search.modulus)
            if self.tension > MOST_TENSION * search.modulus:
                return None

    def _shrinks(self) -> bool:
        """Whether the last step left less than a tenth of the residual: bonds that go slack ask for a new tangent."""
        return len(self.residuals) > 1 and self.residuals[-1] < 0.1 * self.residuals[-2]

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
                self._accept(share, _ratio(new_norm, scale))
                return new_norm, scale
            share *= min(0.5, max(0.1, work / (work - left))) if math.isfinite(left) else 0.25
        level.step_to(0.0)
        level.evaluate()
        return None

    def _full_step(self) -> tuple[float, float]:
        """Take the whole direction, whatever comes of it."""
        self.level.step_to(1.0)
        norm, scale = self.level.evaluate()
        self._accept(1.0, _ratio(norm, scale))
        return norm, scale

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


def _ratio(norm: float, scale: float) -> float:
    return 0.0 if norm == 0.0 else norm / scale if scale > 0.0 else math.inf
