"""Implicit time steps by generalised alpha."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import partial
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, below_one, count, not_negative, one_of, positive
from ..device.clock import Schedule
from ..device.fields import Array, assign, copy, total
from ..device.launches import Stage
from ..interfaces import BuiltLaw, BuiltSolver, DivergedError, FrameSink, History, System
from ..interfaces.solver import FINISHED
from ..kernels.implicit.motion import COEFFICIENTS, implicit_motion
from ..solvers.stepping import FramesInTime
from ..statics.descent import Descent, Secants
from ..statics.level import Level
from ..statics.newton_settings import NewtonSettings
from ..statics.static_rounds import UNIT_ROUND_OFF
from ..statics.static_system import ALGEBRAIC_FROM, StaticSystem
from ..step import NOT_IN_EQUILIBRIUM, Phase
from .generalised_alpha import coefficients
from .internal_variables import InternalVariables, internal_variables_of
from .tears import MOST_ROUNDS, Tears

OWNER = "Implicit"
# Relative residual of a step, by precision.
RESIDUAL = {64: 1e-6, 32: 1e-4}
# Residual over the last one up to which a tangent is kept, also from step to step: a factorisation takes as long as
# several steps with it, a cycle of multigrid does not.
SLOWEST = {"direct": 0.3, "algebraic": 0.2, "multigrid": 0.1, "jacobi": 0.1}
# Spectral radius of the steps of sheets that can tear, and of others.
DAMPING, KEEPING = 0.0, 0.8
# Adapted steps: aim below the tolerance, change of a step, change below which a longer step does not pay.
AIM, SHORTEN, LENGTHEN, WORTH = 0.8, 0.2, 2.0, 1.25
# Error of a step over its displacement from which the next one is not predicted by the acceleration; and the residual
# of a prediction above which a step begins at the displacement before.
SMOOTH, FAR = 0.05, 0.5
# Displacement that counts as some, over the spacing: what begins at rest has no displacement to which an error relates.
SOME = 1e-5
# First adapted step over the duration, and times that count as one, over it.
FIRST, SAME = 1e-4, 1e-10
# Without inertia the velocity jumps at a knot and at the start, and is forgotten in two steps: their errors are those
# of the jump, at any step. They count as small at this share of the way to the next stop.
FORGOTTEN, JUMP = 2, 1e-4
# Error of the energy balance from which a note tells of schedules that steps do not resolve.
OFF = 0.01


@dataclass(frozen=True)
class Implicit(FramesInTime, NewtonSettings):
    """Implicit time steps: generalised alpha (Chung and Hulbert 1993), each step solved as `Newton` does.

    Steps may be as long as the motion allows, since no wave limits them. The method takes the forces, tangents and
    internal variables of every law as they are, and damps what its steps do not resolve; energy-momentum methods need
    a stress of their own between two displacements, with an unsymmetric tangent, and damp nothing.

    Steps end at the knots of all schedules and at frames. Where Newton's method fails, a step is halved.

    Attributes:
        duration: Simulated time [s].
        frames: Number of equally spaced frames after the first one; or their increasing times [s], the last one equal
            to the duration.
        steps: Number of equal steps, or more where knots and frames divide them.
        tolerance: Error of the displacement in a step, over its largest so far (root mean squares), to which steps are
            adapted instead; 1e-4 is a good value. Without inertia, where a law has internal variables, also the change
            of the energy balance in a step, over the largest energy so far.
        inertia: Whether the sheet has inertia. Without it and damping every step ends in equilibrium, for slow
            processes, and the run begins with that under the loads at time 0.
        radius: Spectral radius of the steps for the highest frequencies: 1 conserves, 0 damps in one step. By default
            0.8, and 0 with contact, which takes no other, and in a sheet that can tear: steps seldom resolve what its
            bonds release.
        damping: Mass damping c [1/s]: a force -c m v on every point.
        residual: Relative residual of a step; by default 1e-6 in float64 and 1e-4 in float32.
        history_every: Time between rows of `Result.fine_history` [s], recorded at the next step; None for none.
        most_iterations: Number of Newton steps after which a time step counts as failed.
        most_cuts: How many times a time step is halved at most.
        preconditioner: As for `Newton`.
    """

    duration: float
    frames: int | Sequence[float] = 100
    _: KW_ONLY
    steps: int | None = None
    inertia: bool = True
    radius: float | None = None
    damping: float = 0.0
    residual: float | None = None
    history_every: float | None = None
    most_cuts: int = 10

    dynamic: ClassVar[bool] = True
    steps_explicitly: ClassVar[bool] = False
    default_ramp: ClassVar[Schedule | None] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_frames()
        if (self.steps is None) == (self.tolerance is None):
            raise InputError(f"steps = {self.steps!r}, tolerance = {self.tolerance!r}: expected one of them")
        if self.steps is not None:
            count("steps", self.steps, 1)
        one_of("inertia", self.inertia, (True, False))
        if self.radius is not None and not 0.0 <= not_negative("radius", self.radius) <= 1.0:
            raise InputError(f"radius = {self.radius!r}: expected a number from 0 to 1")
        not_negative("damping", self.damping)
        if self.residual is not None:
            below_one("residual", self.residual)
        if self.history_every is not None:
            positive("history_every", self.history_every)

    def build(self, context: Context, law: BuiltLaw) -> BuiltSolver:
        """Build the solver on a device."""
        return BuiltImplicit(self, context, law)


class BuiltImplicit(StaticSystem):
    """Implicit time steps on a device.

    Attributes:
        internal: Internal variables of the law, or None.
        before: Displacement at the beginning of the step [m], (N,) vec3.
    """

    name = "Implicit"
    definite = True
    without = tuple(phase for phase in NOT_IN_EQUILIBRIUM if phase is not Phase.INTERNAL_VARIABLES)
    settings: Implicit
    before: Array

    def __init__(self, settings: Implicit, context: Context, law: BuiltLaw) -> None:
        self.internal: InternalVariables | None = internal_variables_of(law)
        self.moves, self.has_inertia = settings.inertia or settings.damping > 0.0, settings.inertia
        super().__init__(settings, context, law)
        # A factorisation serves many steps.
        self.factorised = ALGEBRAIC_FROM if context.device.is_cpu else 0
        self.tolerance = settings.residual or RESIDUAL[context.bits]
        self._radius = 0.0
        least = UNIT_ROUND_OFF[context.bits]
        if settings.tolerance is not None and settings.tolerance < least:
            # The error of a shorter step is no smaller: it is the round-off of the displacement.
            raise InputError(
                f"tolerance = {settings.tolerance!r}: expected at least {least:.1g} in precision {context.bits}"
            )
        self._wanted = FIRST * settings.duration if settings.steps is None else settings.duration / settings.steps
        # Coefficients are those of this step [s]; whether the tangent is that of it.
        self._dt, self._known = 0.0, False
        # The last step [s], whether its acceleration was smooth, and its error of the displacement [m^2].
        self._last, self._smooth, self._squared_error = 0.0, True, 0.0
        self._set: tuple[float, bool, float] | None = None
        sheet = context.sheet
        self._largest = SOME * sheet.spacing * math.sqrt(sheet.size)
        # Steps since the start or the last knot; error of the energy balance at the end of the last one.
        self._since, self._balance = 0, 0.0
        self._counts = dict.fromkeys(("steps", "iterations", "products", "halved", "refused", "rounds"), 0)
        self._rests, self._residual, self._largest_residual = True, 0.0, 0.0
        self.tears: Tears | None = None

    def prepare(self, system: System) -> None:
        """Add the stages of a step."""
        rupture = system.rupture
        if rupture is not None and rupture.tear_energy == 0.0:
            raise InputError(
                f"{rupture.label}: not supported by the solver Implicit; expected a TearingEnergy alone, or Explicit"
            )
        self._radius = self._spectral_radius(system)
        # Forces of other parts that are no loads have no tangent, and their internal variables no exact update.
        system.refuse_phases(self.name, [Phase.INTERNAL_FORCE, Phase.INTERNAL_VARIABLES], besides=system.law)
        context, state = self.context, self.context.state
        if not self.settings.inertia and state.velocity.numpy().any():
            raise InputError("initial_velocity: expected None with inertia = False")
        n, vec3 = context.sheet.size, context.types.vec3
        self._coefficients = context.array(
            "step_coefficients", OWNER, context.types.real, shape=len(COEFFICIENTS), per="once"
        )
        self.before = context.array("displacement_before", OWNER, vec3, shape=n, restart=True)
        self._rest = context.array("rest", OWNER, vec3, shape=n) if self.moves else None
        kept: dict[str, Any] = {
            name: context.array(name, OWNER, vec3, shape=n, restart=True) for name in ("acceleration", "force_before")
        }
        kept["loads_before"] = (
            context.array("loads_before", OWNER, vec3, shape=n, restart=True) if context.options.tracked else None
        )
        if rupture is not None and context.options.tracked:
            self.moved = context.array("moved_in_step", OWNER, vec3, shape=n)
        self._error = context.array("squared_error", OWNER, wp.float64, shape=n)
        stressed = bool(context.initial_displacement.any())
        self._kernels = implicit_motion(context.options, stressed)
        super().prepare(system)
        common: dict[str, Any] = {"c": self._coefficients, "mass": state.mass, "velocity": state.velocity}
        context.stage("begin step", "every implicit step").launch(
            OWNER, self._kernels.begin, n, **common, acceleration=kept["acceleration"],
            force_before=kept["force_before"], displacement=state.displacement, before=self.before, rest=self._rest,
            inertia=self.levels[0].inertia,
        )  # fmt: skip
        forces: dict[str, Any] = {"held_mask": state.held_mask, "force": state.force, "external": state.external}
        context.stage("finish step", "every implicit step").launch(
            OWNER, self._kernels.finish, n, **common, **forces, **kept, displacement=state.displacement,
            before=self.before, work=state.work, dissipated=state.dissipated, error=self._error,
        )  # fmt: skip
        context.stage("first acceleration", "once at the start").launch(
            OWNER, self._kernels.first, n, **common, **forces, **kept, moves=int(self.settings.inertia)
        )
        if context.layout.remembers:
            system.law.add(Phase.RUPTURE, context.stage("remember", "every implicit step"))
        self._secants = Secants() if self.solvers[0].kind == "direct" and not self.levels[0].following else None
        self._masses = [self._mass_of(level) for level in self.levels]
        self._stops = self._all_stops()
        if rupture is not None:
            self.tears = Tears(system, self.rounds, self._wanted * 0.5**self.settings.most_cuts)

    def _spectral_radius(self, system: System) -> float:
        """The spectral radius of the steps. Raises InputError for one that would not damp contact."""
        radius = self.settings.radius
        for contact in system.external.contacts:
            # A point that is kept on a body takes the mean of forces of which it bears only the last.
            if radius:
                raise InputError(
                    f"radius = {radius!r}: expected 0 or None with {contact.label}, which others throw off"
                )
            return 0.0
        usual = KEEPING if system.rupture is None else DAMPING
        return usual if radius is None else radius

    def add_inertia(self, stage: Stage, finest: Level) -> None:
        """Add inertia and damping to the unbalanced force."""
        if self._rest is None:
            return
        stage.launch(
            OWNER, self._kernels.unbalance, finest.points, held_mask=self.context.state.held_mask,
            displacement=finest.displacement, before=self.before, rest=self._rest, inertia=finest.inertia,
            **finest.sums_of_forces(),
        )  # fmt: skip

    def _no_lattices(self) -> str:
        """Why the preconditioner cannot be multigrid though it can be algebraic."""
        if self.internal is not None:
            return "force: expected a law without internal variables"
        return super()._no_lattices()

    @staticmethod
    def _mass_of(level: Level) -> np.ndarray:
        sheet = level.context.sheet
        return np.asarray(sheet.areas * sheet.thickness * sheet.density)

    def _all_stops(self) -> np.ndarray:
        """Times of frames and knots, at which steps end [s]."""
        solver, end, schedules = self.settings, self.settings.duration, self._schedules()
        frames = np.array([solver.frame_time(index) for index in range(1, solver.frame_count + 1)])
        self._knots = np.unique(np.concatenate([schedule.times for schedule in schedules] or [np.zeros(0)]))
        every = np.unique(np.concatenate([frames, self._knots]))
        every = every[(every > SAME * end) & (every <= (1.0 + SAME) * end)]
        # Where two are the same but for round-off the later one stays: the last is a frame.
        return every[np.diff(every, append=math.inf) > SAME * end]

    def _schedules(self) -> list[Schedule]:
        """Those of loads, parts and supports."""
        schedules = list(self.context.clock.schedules)
        for constraint in self.system.constraints:
            schedules += [constraint.motion] if constraint.motion is not None else []
            schedules += [constraint.turn.angle] if constraint.turn is not None else []
        return schedules

    # A run ----------------------------------------------------------------------------------------------

    def first_step(self, sink: FrameSink) -> float:
        """Find the acceleration at the start, or equilibrium there; return the step that follows [s]."""
        self._begin = perf_counter()
        if not self.moves:
            self._set_contact_stiffness()
            self._begin_in_equilibrium(sink)
            sink.solve = self._account()
        self._set_coefficients(self._next(0.0, float(self._stops[0])))
        self.levels[0].scale.begin()
        self.context.run("first acceleration")
        return self._dt

    def _begin_in_equilibrium(self, sink: FrameSink) -> None:
        """Find the displacement under the loads at time 0, to which internal variables have not begun to respond."""
        if self.internal is not None:
            self.internal.begin_step(SAME * self.settings.duration, False)
        self.system.set_clock(0.0, self.settings.duration, 0.0)
        target = self.system.prescribed(0.0)
        if self.tears is not None:
            self.tears.begin()
        if not self._descent(target, False, sink) or not self._follow_rounds(target, sink):
            cause = self._without_supports() or (
                "the loads there are too large for one step from the initial displacement; expected loads that grow in "
                "time (ramp)"
            )
            raise DivergedError(f"diverged: Newton's method does not converge at t = 0; likely cause: {cause}")
        if self.tears is not None:
            self.tears.accept(0.0, 0.0)
        if self.internal is not None:
            self.internal.end_step()
            self.internal.settle()

    def _without_supports(self) -> str:
        """Why nothing balances the loads of a sheet that has neither supports nor inertia; "" for others."""
        if self.settings.inertia or self.levels[0].held.any():
            return ""
        return "no support holds the sheet, and nothing else balances its loads; expected Fixed or Motion"

    def run(self, sink: FrameSink) -> str:
        """Run to the end, passing every frame to the sink; return the final status."""
        self._begin = perf_counter()
        if sink.solve is not None:
            self._begin -= sink.solve["seconds"]
            self._counts = {name: sink.solve[name] for name in self._counts}
            self._largest_residual = sink.solve["residual"]
        self._set_contact_stiffness()
        for index in range(sink.frame_index + 1, self.settings.frame_count + 1):
            steps = self._advance(self.settings.frame_time(index), sink)
            self._settle()
            sink.solve = self._account()
            # A resumed run has no tangent of an earlier step.
            self._known = self._known and not sink.restarts
            sink.frame(index, self.settings.frame_time(index), steps, self._dt)
        return FINISHED

    def _settle(self) -> None:
        if self.internal is not None:
            self.internal.settle()

    def _account(self) -> dict[str, Any]:
        return {
            "solver": self.name, "preconditioner": self.preconditioner, **self._counts,
            "residual": self._largest_residual, "seconds": perf_counter() - self._begin,
        }  # fmt: skip

    def _advance(self, end: float, sink: FrameSink) -> int:
        """Take the steps up to a frame [s]; return their number."""
        now, taken, row = sink.time, 0, sink.time
        same = SAME * self.settings.duration
        every = self.settings.history_every
        while now < end - same:
            sink.keep_going()
            stop = float(self._stops[np.searchsorted(self._stops, now + same, side="right")])
            dt = self._next(now, stop)
            now = self._step(now, dt, stop, sink)
            taken += 1
            sink.stepped(now, dt, taken)
            if every is not None and now - row >= every * (1.0 - 1e-9):
                self._settle()
                sink.row(now, self._dt)
                row = now
        return taken

    def _next(self, now: float, stop: float) -> float:
        """The next step [s]: equal steps up to a stop, no longer than wanted."""
        left = stop - now
        dt = left / max(1, math.ceil(left / self._wanted * (1.0 - 1e-6)))
        return self._dt if math.isclose(dt, self._dt, rel_tol=1e-6) else dt

    def _step(self, now: float, dt: float, stop: float, sink: FrameSink) -> float:
        """Take a step of at most dt [s]; return the time at its end [s]."""
        planned, cuts, refused = self._wanted, 0, False
        jumps = not self.moves and self._since < FORGOTTEN
        tears = self.tears
        if tears is not None:
            tears.begin()
        self.kept.keep()
        while True:
            then = stop if now + dt > stop - 0.5 * dt else now + dt
            self._set_coefficients(dt)
            if self._solve(then, sink, refused):
                factor = self._factor(then, dt, jumps and dt <= JUMP * (stop - now), sink)
                if factor >= 1.0:
                    break
                self._counts["refused"] += 1
                dt *= max(factor, SHORTEN)
                if dt < SAME * self.settings.duration:
                    raise DivergedError(
                        f"diverged: at t = {now:.6g} s the error of a step stays above the tolerance, down to steps of "
                        f"{dt:.3g} s; likely cause: tolerance = {self.settings.tolerance:g} is finer than the residual "
                        f"of {self.tolerance:g} resolves"
                    )
            elif tears is not None and tears.runs(dt) and not self.moves:
                raise DivergedError(
                    f"diverged: at t = {now:.6g} s a tear runs on without end; likely cause: the load there tears the "
                    "sheet in two, which takes inertia = True"
                )
            else:
                cuts += 1
                self._counts["halved"] += 1
                dt *= 0.5
            self.kept.restore()
            self._wanted, refused = dt, True
            if cuts > self.settings.most_cuts:
                cause = self._without_supports() or "the load is far too large"
                if not self.settings.inertia:
                    cause += ", or there is no equilibrium nearby (a limit point), which takes inertia = True to pass"
                raise DivergedError(
                    f"diverged: Newton's method does not converge at t = {now:.6g} s with a step of {2.0 * dt:.3g} s; "
                    f"likely cause: {cause}"
                )
        if self.settings.steps is not None:
            # Steps that were shortened become longer again.
            self._wanted = min(LENGTHEN * self._wanted, self.settings.duration / self.settings.steps)
            if not refused:
                self._wanted = max(self._wanted, planned)
        elif factor > WORTH:
            self._wanted = min(factor, LENGTHEN) * dt
        if tears is not None:
            self._wanted = min(self._wanted, max(tears.factor, SHORTEN) * dt)
            tears.accept(then, dt)
        self._counts["steps"] += 1
        self._largest_residual = max(self._largest_residual, self._residual)
        self._last, self._smooth = dt, self._is_smooth()
        at_knot = bool((np.abs(self._knots - then) <= SAME * self.settings.duration).any())
        self._since = 0 if at_knot else self._since + 1
        return then

    def _is_smooth(self) -> bool:
        """Whether the acceleration changed little in the last step; its noise is damped, but slowly."""
        level = self.levels[0]
        moved = level.displacement.numpy() - self.before.numpy()
        size = float(np.einsum("ic,ic->", moved, moved, dtype=np.float64))
        return self._squared_error <= SMOOTH**2 * size

    def _factor(self, then: float, dt: float, jumps: bool, sink: FrameSink) -> float:
        """Factor on a step of dt [s], less than 1 if its error is above the tolerance, or damage grew too much.

        `then`: the time at its end [s]. `jumps`: the error is that of a velocity that jumps.
        """
        tears = self.tears
        if tears is not None and tears.look(dt):
            # It was given up before the damage had grown as far as it would.
            return min(tears.factor, 0.5)
        # Without inertia the sheet follows the damage at once, and no shorter step has less error.
        follows = tears is not None and tears.growth > 0.0 and not self.moves
        if self.settings.tolerance is None or follows:
            return 1.0
        size = self.levels[0].displacement.numpy() - self.context.initial_displacement
        largest = max(self._largest, math.sqrt(float(np.einsum("ic,ic->", size, size, dtype=np.float64))))
        balance = self._balance_after(then, dt, sink)
        error = max(math.sqrt(self._squared_error) / largest, abs(balance - self._balance))
        found = error / self.settings.tolerance
        if found <= 1.0 or jumps:
            self._largest, self._balance = largest, balance
            return max(1.0, AIM / math.cbrt(max(found, 1e-6)))
        return max(SHORTEN, AIM / math.cbrt(found))

    def _balance_after(self, then: float, dt: float, sink: FrameSink) -> float:
        """Error of the energy balance after a step of dt [s], where internal variables may be what it does not resolve.

        With inertia the error of the displacement sees all that is fast, and steps damp what they do not resolve.
        """
        if self.internal is None or self.moves:
            return 0.0
        self.internal.settle()
        return sink.balance(then, dt) or 0.0

    def _set_coefficients(self, dt: float) -> None:
        """Set the coefficients of a step, the inertia of coarser lattices, and whether the tangent may be kept."""
        predicted = (dt, self._smooth, dt / self._last if self._last > 0.0 else 0.0)
        if predicted == self._set:
            return
        self._set, settings = predicted, self.settings
        scheme = coefficients(dt, self._radius, settings.inertia, settings.damping)
        every = {**scheme, "smooth": float(predicted[1]), "ahead": predicted[2]}
        assign(self._coefficients, np.array([every[name] for name in COEFFICIENTS]))
        if dt == self._dt:
            return
        self._known, self._dt = self._known and not self.moves, dt
        for level, mass in zip(self.levels[1:], self._masses[1:], strict=True):
            if level.inertia is not None:
                factor = scheme["at_end"] * scheme["A"] + scheme["damping"] * scheme["B"]
                assign(level.inertia, factor * mass)

    def _solve(self, then: float, sink: FrameSink, again: bool) -> bool:
        """Find the displacement at the end of a step, at the time `then` [s]; return whether it was found."""
        level = self.levels[0]
        if self.internal is not None:
            self.internal.begin_step(self._dt, again)
        self.system.set_clock(0.0, self.settings.duration, then)
        level.run("begin step")
        target = self.system.prescribed(then) if level.held.any() else None
        if not self._descent(target, True, sink):
            copy(level.displacement, self.before)
            if not self._descent(target, False, sink):
                return False
        if not self._follow_rounds(target, sink):
            return False
        if self.internal is not None:
            self.internal.end_step()
        level.run("finish step")
        self._squared_error = total(self._error)
        if self.context.layout.remembers:
            level.run("remember")
        return True

    def _follow_rounds(self, target: np.ndarray | None, sink: FrameSink) -> bool:
        """Let the damage grow and the sheet follow until both are in equilibrium; return whether they are."""
        entry = {"rounds": 0}
        for _ in range(MOST_ROUNDS):
            if self.moved is not None:
                assign(self.moved, self.levels[0].displacement.numpy() - self.before.numpy())
            then = self.rounds.following(entry, self._rests, self.tolerance)
            if then is None:
                return not self.rounds.passed()
            self._counts["rounds"] += 1
            if self.tears is not None and self.tears.look(self._dt):
                # The step is refused.
                return True
            if not self._descent(target, False, sink, then.tolerance):
                return False
        return False

    def _descent(
        self, target: np.ndarray | None, predicted: bool, sink: FrameSink, tolerance: float | None = None
    ) -> bool:
        """Newton's steps from the present displacement, with supports at their place if it is predicted."""
        level, solver = self.levels[0], self.solvers[0]
        if target is not None and predicted:
            assign(level.displacement, np.where(level.held, target, level.displacement.numpy()))

        def report(steps: int, residual: float) -> None:
            sink.keep_going()

        slowest = SLOWEST[solver.kind]
        known = self._known and solver.prepared
        found = Descent(
            self.settings, level, solver, partial(self.linearise, 0),
            np.zeros((level.points, 3)) if target is None else target, self.sizes, tolerance or self.tolerance, report,
            slowest if known else None, FAR if predicted else math.inf, self._secants,
        ).run()  # fmt: skip
        self._counts["iterations"] += len(found["shares"])
        self._counts["products"] += found["products"]
        self._rests, self._residual = self._settled(found), found["residuals"][-1]
        # A prediction that is too far leaves the tangent as it was.
        self._known = found["converged"] or (known and not found["shares"])
        return bool(found["converged"])

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes on tears that ran, and on schedules that steps do not resolve if the energy balance is off."""
        notes = [] if self.tears is None else self.tears.notes(self.settings.inertia)
        if (
            self.settings.steps is None
            or max((abs(row.get("balance_error", 0.0)) for row in history), default=0.0) < OFF
        ):
            return notes
        step = self.settings.duration / self.settings.steps
        shortest = {schedule.name: schedule.shortest_change for schedule in self._schedules()}
        return notes + [
            f"Implicit: {name or 'a schedule'} changes within {time:.3g} s, but steps have {step:.3g} s and do not "
            f"resolve the motion that this starts: expected a longer change, more steps than {self.settings.steps}, or "
            "a tolerance"
            for name, time in shortest.items()
            if time < step * (1.0 - SAME)
        ]

    # Restarts -------------------------------------------------------------------------------------------

    def host_state(self) -> dict[str, Any]:
        """The scales and the step, for a bitwise identical restart."""
        return {
            **super().host_state(), "wanted": self._wanted, "largest": self._largest, "last": self._last,
            "smooth": self._smooth, "since": self._since, "balance": self._balance,
            "jumps": self.tears.jumps if self.tears else [],
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore the result of `host_state`."""
        super().restore(state)
        self._wanted, self._largest = state["wanted"], state["largest"]
        self._last, self._smooth, self._since = state["last"], state["smooth"], state["since"]
        self._balance = state["balance"]
        if self.tears is not None:
            self.tears.jumps = [tuple(jump) for jump in state["jumps"]]
        if self._last > 0.0:
            self._set_coefficients(self._last)
