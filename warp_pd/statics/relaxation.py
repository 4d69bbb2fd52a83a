"""Static equilibrium by adaptive dynamic relaxation."""

from __future__ import annotations

import math
import weakref
from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import below_one, count, positive
from ..device.clock import Schedule, proportional
from ..device.fields import Array, assign, doubles
from ..device.launches import Stage
from ..interfaces import BuiltLaw, BuiltSolver, FrameSink, History, System
from ..interfaces.solver import DIVERGED, FINISHED, NOT_CONVERGED
from ..kernels.integrate import RIGID
from ..solvers.stepping import Snapshot, StableStep, add_motion
from ..step import NOT_IN_RELAXATION, Phase, relaxation_step
from .fictitious_mass import fictitious_mass
from .minimum import LEFT, MOST_PRODUCTS, SLACK, Falling, across, least_quotient
from .static_rounds import FARTHEST, MIN_LOAD, UNIT_ROUND_OFF, LoadScale, StaticRounds, flies

OWNER = "Relaxation"
CHECK_EVERY = 50
# Density and step follow the stiffness this often, and more often while the load rises.
STEPS_BETWEEN = 300
# Steps of a load step that tears from which another solver is better; a multiple of CHECK_EVERY.
SLOW = 5000
FIRST_ITERATIONS, LATER_ITERATIONS = 60, 10
# Contact stiffness of a point over its mass, times the squared step: what the safety leaves of the stable step.
STIFFNESS = 0.5
# Unbalanced force over what moves a stressed sheet in equilibrium; and the way that it may still have to go over that
# from the start, which counts as none below so many units of round-off.
ACCURACY, ROUNDED = 1e-4, 20.0
# Products of the stiffness in the search for a motion along which the energy falls: for each step, of which two take as
# long, and at least. Displacement over spacing by which they are found, by precision.
SHARE, FEWEST_PRODUCTS, REACH = 0.02, 4, {64: 1e-5, 32: 2e-3}
# Quotient over the largest one that counts as none where differences of forces meet a crease between slack and taut.
CREASE = 1e-5


@dataclass(frozen=True)
class Relaxation:
    """Static equilibrium by adaptive dynamic relaxation, with a fictitious density and adaptive damping.

    The fictitious density of a point is the row sum of the stiffness (HE eqs. 86 to 93,
    kernels/statics/relaxation.py), so stiff and soft points converge at the same rate. The damping of every step is
    critical by the Rayleigh quotient (HE eqs. 94 to 97, with the tangent along the motion instead of a diagonal). HE
    use a unit step, which is stable by Gershgorin's bound; here the largest frequency is estimated, which allows a
    step almost four times as long (docs/solvers.md), except for bimodular bonds, which need the bound. The true mass
    is used instead for laws without a tangent, materials without `response`, and sheets with free
    rigid inclusions, whose bodies have true masses.

    With a rupture criterion every load step relaxes, breaks the bonds that exceed the criterion, and repeats until none
    break.

    Schedules are evaluated at a load time from 0 to `duration`. Every load step is ramped over `ramp_steps` steps and
    then held constant.

    Attributes:
        tolerance: Norm of the unbalanced force divided by the norm of loads and reactions at which equilibrium is
            accepted; by default 1e-6 in float64 and 1e-4 in float32, which is limited by round-off.
        load_steps: Number of equal load steps, each brought to equilibrium and recorded as a frame.
        ramp_steps: Number of steps over which a load step is applied; increase it if the residual becomes infinite, for
            example with a prescribed volume.
        most_steps: Number of steps after which the run stops with status "not converged" and the last good load step.
        safety: Step divided by the estimated stable step.
        retries: How many times a load step whose residual becomes infinite, or in which points fly off, is computed
            again, with half the step then and later. After a tear what is torn off may fly: the run stops.
    """

    tolerance: float | None = None
    load_steps: int = 1
    ramp_steps: int = 1
    most_steps: int = 200_000
    safety: float = 0.9
    retries: int = 5
    duration: float = 1.0
    precision: int = 64

    dynamic: ClassVar[bool] = False
    steps_explicitly: ClassVar[bool] = True
    equal_frames: ClassVar[bool] = False
    # Set anew in every step.
    mass_damping: ClassVar[float | None] = 0.0

    def __post_init__(self) -> None:
        if self.tolerance is not None:
            below_one("tolerance", self.tolerance)
        positive("duration", self.duration)
        positive("safety", self.safety)
        for name in ("load_steps", "ramp_steps", "most_steps"):
            count(name, getattr(self, name), 1)
        count("retries", self.retries, 0)

    @property
    def frame_count(self) -> int:
        """Number of frames after the first, one per load step."""
        return self.load_steps

    @property
    def default_ramp(self) -> Schedule:
        """Loads without a schedule are proportional to the load factor."""
        return proportional(self.duration)

    def build(self, context: Context, law: BuiltLaw) -> BuiltSolver:
        """Build the solver on a device."""
        return BuiltRelaxation(self, context, law)


class BuiltRelaxation(BuiltSolver):
    """Dynamic relaxation on a device."""

    label = "solver = Relaxation"
    divides = True
    system: System
    stable_step: StableStep
    rounds: StaticRounds

    def __init__(self, solver: Relaxation, context: Context, law: BuiltLaw) -> None:
        self.solver, self.context, self.law = solver, context, law
        n, types = context.sheet.size, context.types
        self._sums = context.array("motion_sums", OWNER, wp.float64, shape=(2, context.own_blocks), per="block")
        self._previous = context.array("previous_force", OWNER, types.vec3, shape=n, restart=True)
        self._unbalanced = context.array("unbalanced", OWNER, types.vec3, shape=n)
        self._squared = context.array("squared_unbalanced", OWNER, wp.float64, shape=n)
        self._inertia: Array | None = None
        self._dt, self._halvings = 0.0, 0
        # Squared loads and reactions of a state in equilibrium.
        self._largest = 0.0
        self.tolerance = solver.tolerance or (1e-6 if context.bits == 64 else 1e-4)
        self._scale = LoadScale(context, OWNER, self.tolerance, ACCURACY)
        # Displacement at the last checks of a stressed sheet [m], and how far it moved between them.
        self._before: np.ndarray | None = None
        self._moved = math.inf
        # Whether loads are lost in the round-off of its stress, at this check and in an equilibrium.
        self._hidden = self._lost_loads = False
        # Why the last load step has no equilibrium, and how far points may move in it [m].
        self._lost, self._prescribed = "", math.inf
        # At which load factor a tear under a load took very many steps; 0 for none.
        self._slow_tear = 0.0
        self._falling: Falling | None = None
        # Steps of this run, and entries of the report, one per load step.
        self._done = 0
        self._entries: list[dict[str, Any]] = []

    def inertia(self) -> Array:
        """The fictitious mass, or the true mass if there is none; adds the stage that updates it."""
        if self._inertia is None:
            stage = self.context.stage("fictitious mass", f"every {STEPS_BETWEEN} steps of relaxation")
            found = None if (self.context.held & RIGID).any() else fictitious_mass(self.law, stage)
            self._inertia = self.context.state.mass if found is None else found
        return self._inertia

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add drift, kick, and the damping of the step."""
        context, state = self.context, self.context.state
        add_motion(phase, stage, context, self.inertia())
        if phase is Phase.DAMPING:
            following = bool(self.system.external.following)
            from ..kernels.statics.relaxation import adaptive_damping

            measure_motion, set_damping = adaptive_damping(context.bits, following)
            arrays = {
                "mass": self.inertia(), "held_mask": state.held_mask, "velocity": state.velocity, "force": state.force,
                "external": state.external, "previous": self._previous,
            }  # fmt: skip
            context.launch_on_blocks(stage, OWNER, measure_motion, arrays, {"sums": self._sums}, ["previous"])
            sums = context.few_blocks(stage, self._sums, "motion_sums_of_all", OWNER)
            stage.launch(OWNER, set_damping, 1, sums=sums, step=state.step, damping=state.damping)

    def prepare(self, system: System) -> None:
        """Compose the step, the residual and the stable step."""
        # Which has the solver.
        self.system: System = weakref.proxy(system)
        context = self.context
        system.refuse_phases("Relaxation", NOT_IN_RELAXATION)
        dead = system.external.keep_dead_apart()
        step = context.stage("step", "every step")
        relaxation_step(system, step)
        self.rounds = StaticRounds(system)
        self.stable_step = StableStep(system, self.inertia())
        self._snapshot = Snapshot(context, OWNER, step)
        stage = context.stage("residual", f"every {CHECK_EVERY} steps of relaxation")
        self._scale.add(stage, dead, self._unbalanced, self._squared)

    def run(self, sink: FrameSink) -> str:
        """Bring every load step to equilibrium and record it as a frame; return the final status."""
        load_steps, duration = self.solver.load_steps, self.solver.duration
        # A resumed run also reports the earlier load steps, but counts most_steps anew.
        earlier = sink.solve or {"iterations": 0, "seconds": 0.0, "load_steps": []}
        begin, self._entries, self._done = perf_counter() - earlier["seconds"], list(earlier["load_steps"]), 0
        self._set_contact_stiffness()
        self._scale.begin()
        for index in range(round(sink.time / duration * load_steps) + 1, load_steps + 1):
            before = self._done
            self._snapshot.keep()
            converged = self._load_step(index, sink)
            while self._diverged() and self._halvings < self.solver.retries:
                self._entries.pop()
                self._snapshot.restore()
                self._halvings += 1
                sink.repeat()
                converged = self._load_step(index, sink)
            sink.residual = self._entries[-1]["residuals"][-1]
            sink.solve = {
                "solver": "Relaxation",
                "iterations": earlier["iterations"] + self._done,
                "rounds": sum(entry["rounds"] for entry in self._entries),
                "residuals": [r for entry in self._entries for r in entry["residuals"]],
                "reached": (index if converged else index - 1) / load_steps,
                "seconds": perf_counter() - begin,
                "load_steps": self._entries,
                "lost": self._lost,
            }
            if not converged and (index > 1 or self._lost):
                self._snapshot.restore()
                sink.steps += self._entries[-1]["steps"]
            else:
                # The first load step has no good one before it: its last state says more than the start, and is
                # where --resume goes on.
                time = duration * index / load_steps if converged else 0.0
                sink.frame(sink.frame_index + 1, time, self._done - before, self._dt)
            if not converged:
                return NOT_CONVERGED if math.isfinite(sink.residual) else DIVERGED
        self._falling = self._fall(sink.stable_dt) if self._done else None
        return FINISHED

    def _fall(self, stable_dt: float | None) -> Falling | None:
        """A motion along which the energy of the final equilibrium falls, if one is found.

        It is not sought where forces have no energy, or contact may hold points, nor on a GPU, where a step takes less
        time than the host for its part of a search.
        """
        context, law = self.context, self.law
        conservative = law.has_energy and law.weights != "published"
        conservative &= all(load.symmetric and load.at_rest is None for load in self.system.external.following)
        if not (conservative and stable_dt and context.device.is_cpu and context.partition is None):
            return None
        sheet, mass = context.sheet, doubles(self.inertia())[:, None]
        free = (context.held[:, None] >> np.arange(3)) & 1 == 0
        free &= (context.held[:, None] & RIGID) == 0
        mean, largest, size = float(mass.mean()), (2.0 / stable_dt) ** 2, float(sheet.extent.max())
        reach = REACH[context.bits]
        noise = ROUNDED * UNIT_ROUND_OFF[context.bits] * size / (reach * sheet.spacing) * largest
        if law.goes_slack:
            noise = max(noise, CREASE * largest)
        left = LEFT * math.sqrt(context.total(self._squared)) / size
        slack = SLACK * law.slack_stiffness * float(np.mean(sheet.thickness))
        root = np.sqrt(mass)

        def product(x: np.ndarray) -> np.ndarray:
            motion = x.reshape(-1, 3) / root
            return np.asarray(root * self.stable_step.respond(motion, reach * sheet.spacing)).ravel()

        most = min(MOST_PRODUCTS, max(FEWEST_PRODUCTS, round(SHARE * self._done)))
        here = doubles(context.state.displacement)
        start = np.where(free, root * across(sheet, here), 0.0).ravel()
        enough = -noise - (left + slack) / mean
        x, value = least_quotient(product, lambda r: r, start, most, enough)
        if not value < enough:
            return None
        return Falling.along(x.reshape(-1, 3) / root, 1.0, sheet, here)

    def _diverged(self) -> bool:
        """Whether the last load step ended with an infinite residual, or a point flew off without a tear."""
        entry = self._entries[-1]
        return not math.isfinite(entry["residuals"][-1]) or bool(self._lost and not entry["rounds"])

    def _load_step(self, index: int, sink: FrameSink) -> bool:
        """Apply a load step, alternating relaxation and rounds; return whether it reached a final equilibrium."""
        solver, rounds = self.solver, self.rounds
        end = index / solver.load_steps
        entry: dict[str, Any] = {"share": end, "steps": self._done, "rounds": 0, "residuals": []}
        self._entries.append(entry)
        self._lost = ""
        duration, count = solver.duration, solver.load_steps
        self.system.set_clock(duration / (count * solver.ramp_steps), duration * index / count)
        self._prescribed = float(np.abs(self.system.prescribed(duration * end)).max())
        converged = self._relax(entry, sink, self.tolerance, solver.ramp_steps)
        while converged:
            then = rounds.following(entry, entry["residuals"][-1] <= self.tolerance, self.tolerance)
            if then is None:
                break
            converged = self._relax(entry, sink, then.tolerance, 0, then.title) and not rounds.runs_through(entry)
        converged = converged and not rounds.passed()
        entry.update(steps=self._done - entry["steps"], converged=converged)
        return converged

    def _relax(
        self, entry: dict[str, Any], sink: FrameSink, tolerance: float, ramp_steps: int, title: str = ""
    ) -> bool:
        """Take steps until the residual is small, checking it at least once; return whether it became small."""
        start, ten, measure = self._done, self.context.sequence("step", repeat=10), self.context.sequence("residual")
        while self._done == start or self._done < self.solver.most_steps:
            since = self._done - start
            if since % STEPS_BETWEEN == 0 and self._flies():
                return False
            if since % STEPS_BETWEEN == 0 or since < ramp_steps:
                sink.stable_dt = self._set_step()
            for _ in range(CHECK_EVERY // 10):
                ten.run()
            self._done += CHECK_EVERY
            if self._done - entry["steps"] == SLOW and self._yields_to_loads(entry):
                self._slow_tear = entry["share"]
                sink.say(self._advice())
            measure.run()
            residual = self._residual()
            self._hidden = False
            if self._scale.initial is not None and residual > tolerance and self._rests():
                against_all = self._residual(against_all=True)
                entry["round_off"] = against_all <= tolerance
                residual = min(residual, against_all)
            entry["residuals"].append(residual)
            sink.progress(self._done, residual, tolerance, title)
            if not math.isfinite(residual):
                return False
            if residual <= tolerance and self._done - start >= ramp_steps:
                self._largest = max(self._largest, self.context.total(self._scale.reaction))
                self._lost_loads = self._lost_loads or self._hidden
                return True
        return False

    def _yields_to_loads(self, entry: Mapping[str, Any]) -> bool:
        """Whether a damage field has grown in this load step under loads, as `ArcLength` follows it."""
        rupture = self.system.rupture
        of_field = rupture is not None and rupture.tear_energy > 0.0
        return of_field and entry["rounds"] > 0 and self.context.options.loaded and not self.rounds.contacts

    def _advice(self) -> str:
        """What to try in place of relaxation where loads tear the sheet."""
        return (
            f"Relaxation: the tear takes more than {SLOW} steps at load factor {self._slow_tear:.4g}, as where no load "
            "as large has an equilibrium: ArcLength follows it past the largest load in fewer steps"
        )

    def _flies(self) -> bool:
        """Whether a point is too far from its place for any equilibrium; then says why in `_lost`."""
        context = self.context
        if flies(context, context.own(context.state.displacement).numpy(), self._prescribed):
            self._lost = (
                f"a point has moved more than {FARTHEST:g} times the size of the sheet, as a piece does that has torn "
                "off: try more load_steps, prescribe the displacement (Motion) instead of the load, or follow the tear "
                "with Explicit and damping"
            )
        return bool(self._lost)

    def _set_step(self) -> float:
        """Update the fictitious mass and the step; return the stable step [s]."""
        self.context.sequence("fictitious mass").run()
        omega = self.stable_step.omega(FIRST_ITERATIONS if self._dt == 0.0 else LATER_ITERATIONS)
        if self._inertia is not self.context.state.mass:
            # What is slack now may be taut a step later, and the step of the slack sheet then too long.
            omega = max(omega, self.law.slack_frequency or 0.0)
        stable = 2.0 / omega if omega > 0.0 else math.inf
        self._dt = math.ldexp(self.solver.safety * stable if omega > 0.0 else 1.0, -self._halvings)
        assert self.context.state.step is not None
        assign(self.context.state.step, np.array([self._dt]))
        return stable

    def _set_contact_stiffness(self) -> None:
        """Give contact a stiffness that the step allows."""
        if self.rounds.contacts:
            self._set_step()
            areas = self.context.sheet.areas
            stiffness = STIFFNESS * float(np.mean(self.inertia().numpy() / areas)) / self._dt**2
            for contact in self.rounds.contacts:
                contact.set_stiffness(stiffness)

    def _residual(self, against_all: bool = False) -> float:
        """Unbalanced force divided by loads and reactions, from the last run of the stage "residual".

        Those of a stressed sheet are as `LoadScale.size`, or, with `against_all`, include the reactions of its stress.
        """
        total = self.context.total
        unbalanced, reaction = total(self._squared), total(self._scale.reaction)
        if self._scale.initial is not None and not against_all:
            reaction = self._scale.size(total) ** 2
        else:
            reaction = max(reaction, MIN_LOAD**2 * self._largest)
        reaction = max(reaction, self.law.slack_force**2)
        if unbalanced == 0.0:
            return 0.0
        return math.sqrt(unbalanced / reaction) if reaction > 0.0 else math.inf

    def _rests(self) -> bool:
        """Whether a stressed sheet has come to rest: it will move no further by more than ACCURACY of its way.

        Round-off can hide a load in the unbalanced force of a stressed sheet, but not in the way that the sheet moves.
        """
        context = self.context
        here = doubles(context.state.displacement)
        start = context.initial_displacement
        before, self._before = self._before, here
        last, self._moved = self._moved, math.inf if before is None else float(np.linalg.norm(here - before))
        way, round_off = (
            float(np.linalg.norm(here - start)),
            ROUNDED * UNIT_ROUND_OFF[context.bits] * np.linalg.norm(here),
        )
        shrinking = self._moved / last if 0.0 < last < math.inf else 1.0
        ahead = self._moved * shrinking / (1.0 - shrinking) if shrinking < 1.0 else math.inf
        hidden = not context.communicator.any(bool(way > round_off))
        rests = hidden or not context.communicator.any(bool(ahead > ACCURACY * way))
        self._hidden = hidden and context.options.loaded
        return rests

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes on tears that ran through, and on loads that round-off hides."""
        notes = self.rounds.notes()
        if self._falling is not None:
            notes.append(self._falling.note("Relaxation", self.context.sheet))
        if self._slow_tear:
            notes.append(self._advice())
        if self._lost_loads:
            finer = "64, or " if self.context.bits == 32 else ""
            notes.append(
                f"precision = {self.context.bits}: the loads move the sheet less than the round-off of its stress; its "
                f"displacement may be wrong; expected {finer}the solver Newton"
            )
        return notes

    def host_state(self) -> dict[str, Any]:
        """The step, the largest load, the halvings of the step, and the number of estimates."""
        return {
            "dt": self._dt, "largest": self._largest, "halvings": self._halvings,
            "estimates": self.stable_step.host_state(),
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore the result of `host_state`."""
        self._dt, self._largest, self._halvings = state["dt"], state["largest"], state["halvings"]
        self.stable_step.restore(state["estimates"])
