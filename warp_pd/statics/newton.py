"""Newton's method for static equilibrium: load steps, cutbacks, rounds of contact and rupture."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..context import Context
from ..device.checks import count, one_of
from ..device.clock import Schedule, proportional
from ..device.fields import assign, copy, doubles, on_cpu
from ..interfaces import BuiltLaw, BuiltSolver, FrameSink, History, System
from ..interfaces.solver import FINISHED, NOT_CONVERGED
from .descent import Secants
from .level import OWNER
from .minimum import Falling, SearchOfFall
from .newton_settings import StaticSolver
from .static_rounds import FARTHEST, flies
from .static_system import StaticSystem

STIFFNESSES = ("tangent", "constant")
# A note reports a load step that moves the sheet JUMP times as far as each of the last COMPARED ones. Towards a maximum
# of the load, where the displacement has a square root, equal load steps move it 2.4 times as far at most.
JUMP, COMPARED = 4.0, 3
# Newton steps that a slack sheet may take.
SLACK_ITERATIONS = 200


@dataclass(frozen=True, kw_only=True)
class Newton(StaticSolver):
    """Newton's method for static equilibrium, for force laws with an energy ("plain" or "corrected" weights).

    The load factor s runs from 0 to 1: schedules are evaluated at the time s * duration, and loads without a schedule
    are multiplied by s. A load step that fails is halved (a cutback). On an uncut rectangle every load step is first
    solved on coarser lattices; elsewhere load steps after the first start from a linear extrapolation of the last two
    states. With a rupture criterion every load step finds equilibrium, breaks the bonds that exceed the criterion, and
    repeats until none break.

    A Newton step is accepted based on the work of the unbalanced force along it (Matthies and Strang, Int. J. Numer.
    Meth. Eng. 14, 1979), unless that force grows tenfold. This needs no potential, so it also works for follower
    pressure. No step turns a family inside out, unless the material goes slack. Unsymmetric tangents are solved by
    GMRES, symmetric ones by conjugate gradients. If a step fails, or the initial state is slack, an isotropic tension
    is added to the tangent (not to the force) and removed as steps succeed.

    Attributes:
        tolerance: Norm of the unbalanced force divided by the norm of loads and reactions at which equilibrium is
            accepted; by default 1e-8 in float64 and 1e-4 in float32, which is limited by round-off.
        load_steps: Number of equal load steps, before cutbacks; each is recorded as a frame.
        most_iterations: Number of Newton steps after which a load step counts as failed.
        most_cuts: Maximum number of cutbacks over the whole path.
        preconditioner: "multigrid" (coarser lattices; uncut rectangles of more than 300 points, horizons up to 2.5),
            "algebraic" (aggregates of points by PyAMG; any sheet of more than 300 points whose bonds do not break,
            horizons up to 2.5), "direct" (a factorisation on the host), "jacobi" (3x3 blocks), or "auto":
            multigrid where possible, otherwise algebraic on a CPU from 2000 points, direct below, and jacobi on a GPU.
            The bond-based law has no multigrid and is solved directly on both, up to 100 000 points.
        stiffness: "tangent", or, for the bond-based law, "constant": the published method without the geometric
            stiffness of the bonds (IM eq. 16, with current directions and moduli) and with full steps. For comparison
            only: it becomes slow and then oscillates as deformations and the ratio of moduli grow.
    """

    load_steps: int = 1
    stiffness: str = "tangent"

    def __post_init__(self) -> None:
        super().__post_init__()
        count("load_steps", self.load_steps, 1)
        one_of("stiffness", self.stiffness, STIFFNESSES)

    @property
    def frame_count(self) -> int:
        """Number of frames after the first, one per planned load step."""
        return self.load_steps

    @property
    def default_ramp(self) -> Schedule:
        """Loads without a schedule are proportional to the load factor."""
        return proportional(self.duration)

    def build(self, context: Context, law: BuiltLaw) -> BuiltSolver:
        """Build the solver on a device."""
        return BuiltNewton(self, context, law)


class BuiltNewton(StaticSystem):
    """Newton's method on a device; a failed run ends in the state of its last good load step.

    Attributes:
        good: Displacement of the last good load step [m], (N,) vec3.
        earlier: That of the last good load step but one [m], (N,) vec3.
        jumps: Load steps that moved the sheet much farther than those before.
    """

    name = "Newton"
    definite = True
    takes_unsymmetric = True
    settings: Newton

    def __init__(self, settings: Newton, context: Context, law: BuiltLaw) -> None:
        super().__init__(settings, context, law)
        self._size, self._cutbacks = 1.0 / settings.load_steps, 0
        self._earlier_factor: float | None = None
        self._kept_factor: float | None = None
        self._resumed = False
        # Lengths of the last load steps, and how far they moved the sheet [m].
        self._moved: list[tuple[float, float]] = []
        self.jumps: list[dict[str, float]] = []
        self._flew_at: float | None = None
        self._falling: Falling | None = None

    def prepare(self, system: System) -> None:
        """Add the stages of residual and tangent."""
        super().prepare(system)
        context = self.context
        self.good = self.kept.of(context.state.displacement)
        self.earlier = context.array(
            "earlier_load_step", OWNER, context.types.vec3, shape=context.sheet.size, restart=True
        )

    def host_state(self) -> dict[str, Any]:
        """The state of the search, for a bitwise identical restart."""
        return {
            **super().host_state(), "size": self._size, "cutbacks": self._cutbacks, "moved": self._moved,
            "earlier_factor": self._earlier_factor, "kept_factor": self._kept_factor, "jumps": self.jumps,
            "falling": None if self._falling is None else asdict(self._falling),
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore the result of `host_state`."""
        super().restore(state)
        self._size, self._cutbacks = state["size"], state["cutbacks"]
        self._earlier_factor, self._kept_factor = state["earlier_factor"], state["kept_factor"]
        self._moved, self.jumps = state["moved"], state["jumps"]
        self._falling = None if state["falling"] is None else Falling(**state["falling"])
        self._resumed = True

    def equilibrate(self, factor: float, sink: FrameSink, guess: np.ndarray | None = None) -> bool:
        """Find equilibrium at a load factor from a guess [m], shape (N, 3), or from the current state."""
        if guess is None:
            return self._load_step(factor, sink)[0]
        self.set_loads(factor)
        assign(self.levels[0].displacement, guess)
        return bool(self._descend(0, factor, sink, self.tolerance)["converged"])

    def run(self, sink: FrameSink) -> str:
        """Follow the load path; return the final status."""
        finest, planned = self.levels[0], self.settings.load_steps
        self._start_report(sink)
        finest.scale.begin()
        self._set_contact_stiffness()
        reached = sink.time / self.settings.duration
        self._keep(reached)
        while reached < 1.0 - 1e-9:
            goal = (math.floor(reached * planned + 1e-9) + 1) / planned
            factor = goal if reached + self._size > goal - 1e-9 else reached + self._size
            converged, sink.residual = self._equilibrium(factor, sink)
            if converged and self._flies():
                # Round-off of a tangent that nothing holds is no equilibrium, whatever its residual.
                converged, self._flew_at = False, factor
                self.report.load_steps[-1]["converged"] = False
            if converged:
                self._compare(reached, factor)
                reached = factor
                self._keep(reached)
                if factor == goal:
                    self._falling = self._fall(reached) if reached > 1.0 - 1e-9 else None
                    self._record(sink, reached)
                continue
            self.kept.restore()
            self._earlier_factor = self._kept_factor = None
            self._cutbacks += 1
            self._size *= 0.5
            if self._cutbacks > self.settings.most_cuts:
                self.set_loads(reached)
                finest.evaluate()
                if reached > sink.time / self.settings.duration + 1e-9:
                    self._record(sink, reached)
                sink.solve = self._summary(reached)
                return NOT_CONVERGED
        return FINISHED

    def _fall(self, factor: float) -> Falling | None:
        """A motion along which the energy of the final equilibrium falls, if one is found."""
        if self.settings.stiffness == "constant" or not self.solvers[0].prepared or not self.sizes.modulus:
            return None
        level, steps = self.levels[0], self._summary(factor)["iterations"]
        motion = SearchOfFall(level, self.solvers[0], self.sizes.modulus, steps).motion()
        if not on_cpu(level.displacement):
            # A product without a stored matrix leaves its own forces of bonds to the frame.
            level.run("evaluate")
        if motion is None:
            return None
        return Falling.along(motion, factor, self.context.sheet, doubles(level.displacement))

    def _compare(self, before: float, reached: float) -> None:
        """Record a load step in which the sheet moved much farther than before and than its supports."""
        here, good = (doubles(array) for array in (self.levels[0].displacement, self.good))
        moved, length = np.abs(here - good), reached - before
        far, prescribed = float(moved.max()), float(moved[self.levels[0].held].max(initial=0.0))
        usual = max((m * max(1.0, length / earlier) for earlier, m in self._moved), default=0.0)
        if 0.0 < usual < far / JUMP and prescribed < far / JUMP:
            self.jumps.append({"from": before, "to": reached, "moved": far, "times": far / usual})
        self._moved = [*self._moved, (length, far)][-COMPARED:]

    def _flies(self) -> bool:
        """Whether a point is too far from its place for any equilibrium."""
        moved = np.abs(self.levels[0].displacement.numpy()).astype(np.float64)
        return flies(self.context, moved, float(moved[self.levels[0].held].max(initial=0.0)))

    def _keep(self, reached: float) -> None:
        """Store the state as the last good load step."""
        # A resumed run already has the last two load steps.
        known = self._resumed and self._kept_factor is not None
        self._resumed = False
        if self._kept_factor is not None and not known:
            copy(self.earlier, self.good)
        self.kept.keep()
        if not known:
            self._earlier_factor, self._kept_factor = self._kept_factor, reached

    def _equilibrium(self, factor: float, sink: FrameSink) -> tuple[bool, float]:
        """Find equilibrium at a load factor in which no more bonds break; return whether found, and the residual.

        With a damage field this is alternate minimisation of the energy by displacement and damage.
        """
        s0, s1 = self._earlier_factor, self._kept_factor
        if s0 is not None and s1 is not None and self.hierarchy is None:
            # Extrapolate linearly from the last two load steps; prescribed components are set later.
            u0, u1 = (doubles(array) for array in (self.earlier, self.good))
            assign(self.levels[0].displacement, u1 + (factor - s1) / (s1 - s0) * (u1 - u0))
        converged, residual = self._load_step(factor, sink)
        entry, secants = self.report.load_steps[-1], Secants()
        found = whole = entry["lattices"][-1]
        while converged and (then := self.rounds.following(entry, self._settled(found), self.tolerance)) is not None:
            if then.broken:
                self._kept_factor = None
            # Rounds of contact, and those of a damage field, change little; a criterion breaks many bonds at once.
            many = then.broken and self.rounds.close_enough == 0.0
            secants = Secants() if many else secants
            found = self._descend(0, factor, sink, then.tolerance, then.title, None if many else secants)
            whole["round_off"] = found["round_off"]
            for name in ("residuals", "shares", "products"):
                whole[name] += found[name]
            converged, residual = found["converged"] and not self.rounds.runs_through(entry), found["residuals"][-1]
            whole["converged"] = converged
        entry["converged"] = converged = converged and not self.rounds.passed()
        return converged, residual

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes on load steps between which the sheet may have jumped, or that multigrid did not solve."""
        # A path takes a damage field, and no other criterion.
        by_path = self.system.rupture is None or self.rounds.close_enough > 0.0
        advice = "the solver ArcLength follows what lies between, or prescribe" if by_path else "prescribe"
        return [
            f"Newton: between load factors {jump['from']:.4g} and {jump['to']:.4g} the sheet moved "
            f"{jump['moved']:.3g} m, {jump['times']:.1f} times as far as in the load steps before: it may have "
            f"jumped over a maximum of the load (a limit point), or buckled; {advice} a displacement (Motion) or the "
            "volume (EnclosedVolume)"
            for jump in self.jumps
        ] + [*self._falling_notes(), *self._unsolved_notes(), *self.rounds.notes()]

    def _falling_notes(self) -> list[str]:
        return [] if self._falling is None else [self._falling.note("Newton", self.context.sheet)]

    def _unsolved_notes(self) -> list[str]:
        """Notes on what to try if the run ended on a load step that was not solved."""
        steps, notes = self.report.load_steps, []
        if not steps or steps[-1]["converged"]:
            return []
        if self._flew_at == steps[-1]["share"]:
            return [
                f"Newton: at load factor {self._flew_at:.4g} a point moved more than {FARTHEST:g} times the size of "
                "the sheet, as one does that no support holds: add Fixed or Motion, or prescribe the displacement"
            ]
        if self.preconditioner == "multigrid":
            notes.append(
                f"Newton: the load step to {steps[-1]['share']:.4g} did not converge with 'multigrid', whose "
                "coarser lattices do not see slack regions of a few spacings: try 'algebraic'"
            )
        if self.system.law.goes_slack:
            stiffer = "a slack_stiffness of the TensionField, of a thousandth of the shear modulus, "
            stiffer = "" if self.system.law.slack_stiffness > 0.0 else stiffer
            # From a slack sheet the number of iterations does not fall with the load.
            few = self.settings.most_iterations < SLACK_ITERATIONS
            more = f"load_steps=1 with most_iterations={SLACK_ITERATIONS}, " if few else ""
            notes.append(
                "Newton: wrinkled and slack regions, as behind a crack, come and go between iterations, which converge "
                f"slowly: try {stiffer}{more}Explicit with damping, or Relaxation"
            )
        return notes
