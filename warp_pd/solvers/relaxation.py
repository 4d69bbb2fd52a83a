"""Rest under load by adaptive dynamic relaxation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from ..checks import count, positive
from ..forces.bond_associated import BondAssociated
from ..forces.bond_based import BondBasedForce
from ..forces.hyperelastic_bonds import HyperelasticBondsForce
from .rupture import LEAST_LOAD, MOST_ROUNDS, Rupture
from .stable_step import BLOCK, StableStep

if TYPE_CHECKING:
    from ..runner import Recorder
    from ..simulation import Built, Simulation

OWNER = "Relaxation"
CHECK_EVERY = 50
# Density and step follow the stiffness this often, and more often while the load rises.
STEPS_BETWEEN = 300
FIRST_ITERATIONS, LATER_ITERATIONS = 60, 10
FINISHED, NOT_CONVERGED = "finished", "not converged"


@dataclass(frozen=True)
class Relaxation:
    """Adaptive dynamic relaxation: a fictitious density from the stiffness, damping for the motion that is left.

    The density of a point is the sum of its row of the stiffness (HE eqs. 86 to 93, kernels/relaxation.py), so
    that stiff and soft points move at one rate; the damping of every step is critical by Rayleigh's quotient
    (HE eqs. 94 to 97, with the tangent along the motion in place of a diagonal). Where HE take a unit step,
    stable by Gershgorin's bound, the largest frequency is estimated instead, which allows a step almost four
    times as long (docs/solvers.md). The true mass takes no part: relaxation with it is the special
    case of equal points. A law without a tangent, a material without `response`, and a sheet with rigid
    inclusions, whose bodies have true masses, keep it.

    With a rupture criterion every load step relaxes, breaks what is over-stretched, and relaxes again until
    nothing breaks.

    Schedules run in a load time from 0 to `duration`; every load step ramps over `ramp_steps` steps, then rests.

    Attributes:
        tolerance: Norm of the unbalanced force over the norm of loads and reactions at which the sheet is at
            rest; by default 1e-6 in float64 and 1e-4 in float32, whose round-off allows no better.
        load_steps: Equal load steps, each brought to rest and recorded as a frame.
        ramp_steps: Steps over which a load step is applied.
        most_steps: Steps after which the run gives up, with status "not converged" and the last good load step.
        safety: Step over the estimated stable step.
    """

    tolerance: float | None = None
    load_steps: int = 1
    ramp_steps: int = 1
    most_steps: int = 200_000
    safety: float = 0.9
    duration: float = 1.0
    precision: int = 64

    damping = 0.0
    adaptive_damping = True
    in_time = False
    steps_explicitly = True

    def __post_init__(self) -> None:
        if self.tolerance is not None:
            positive("tolerance", self.tolerance)
        positive("duration", self.duration)
        positive("safety", self.safety)
        for name in ("load_steps", "ramp_steps", "most_steps"):
            count(name, getattr(self, name), 1)

    @property
    def frame_count(self) -> int:
        """One a load step."""
        return self.load_steps

    def check(self, simulation: Simulation) -> None:
        """Nothing: any parts will do."""

    def inertia(self, built: Built) -> Any:
        """The fictitious density [N/m], shape (N,), and the launches that renew it; the mass without `response`."""
        from ..kernels.relaxation import row_sums

        simulation, force, w, t = built.simulation, built.force, built.workspace, built.types
        law = simulation.force
        if simulation.sheet.inclusions:
            return built.mass
        if isinstance(force, BondBasedForce | HyperelasticBondsForce):
            density = w.array("density", OWNER, t.real, shape=simulation.sheet.size)
            force.add_density("density", built.state.displacement, density)
            return density
        if not isinstance(law, BondAssociated) or not hasattr(law.material, "response"):
            return built.mass
        layout, material, broken, form = law.signature(force.families.layout, built.breakable)
        rows, total = row_sums(layout, t.bits, material, law.material.response, broken, form, w.module)
        n = simulation.sheet.size
        density = w.array("density", OWNER, t.real, shape=n)
        own = w.array("own_row", OWNER, t.real, shape=n)
        family = {"family": force.struct, "alive": force.alive}
        w.launch(
            "density", OWNER, rows, n,
            **family, displacement=built.state.displacement, constants=force.constants,
            inverse_horizon=force.inverse_horizon, unit_stiffness=force.unit_volume * force.inverse_horizon**2,
            row=force.bond_force, own=own,
        )  # fmt: skip
        scale = law.material.constants[0] * simulation.sheet.thickness
        w.launch(
            "density", OWNER, total, n, **family, row=force.bond_force, own=own, least=1e-3 * scale, density=density
        )
        return density

    def add_before_kick(self, built: Built) -> None:
        """Add the launches that set the damping of this step."""
        import warp as wp

        from ..kernels.integrate import adaptive_damping

        w, n, state = built.workspace, built.simulation.sheet.size, built.state
        measure_motion, set_damping = adaptive_damping(built.types.bits, w.module)
        blocks = -(-n // BLOCK)
        sums = w.array("motion_sums", OWNER, wp.float64, shape=(2, blocks))
        previous = w.array("previous_force", OWNER, built.types.vec3, shape=n)
        w.launch(
            "step", OWNER, measure_motion, blocks,
            mass=built.inertia, held_mask=built.held_mask, velocity=state.velocity, force=state.force, block=BLOCK,
            previous=previous, sums=sums,
        )  # fmt: skip
        w.launch("step", OWNER, set_damping, 1, sums=sums, step=built.step, damping=built.damping)

    def add(self, built: Built) -> None:
        """Add the residual, the stable step and the last good load step."""
        import warp as wp

        w, n, state = built.workspace, built.simulation.sheet.size, built.state
        built.stable_step = StableStep(built)
        built.unbalanced = w.array("unbalanced", OWNER, wp.float64, shape=n)
        built.reaction = w.array("reaction", OWNER, wp.float64, shape=n)
        w.launch(
            "residual", OWNER, built.integration.residual, n,
            held_mask=built.held_mask, force=state.force, external=state.external,
            unbalanced=built.unbalanced, reaction=built.reaction,
        )  # fmt: skip

    def march(self, built: Built, recorder: Recorder) -> str:
        """Bring every load step to rest, each a frame; returns the final status."""
        return Relaxing(self, built, recorder).run()


class Relaxing:
    """One run of the relaxation."""

    def __init__(self, solver: Relaxation, built: Built, recorder: Recorder) -> None:
        self.solver, self.built, self.recorder = solver, built, recorder
        self.tolerance = solver.tolerance or (1e-6 if built.types.bits == 64 else 1e-4)
        sequence = built.workspace.sequence
        self.ten, self.residual_launches = sequence("step", repeat=10), sequence("residual")
        self.density, self.rupture = sequence("density"), Rupture(built)
        # A resumed run reports the load steps before it, too, but may take most_steps of its own.
        earlier = recorder.solve or {"iterations": 0, "seconds": 0.0, "load_steps": []}
        self.done, self.earlier = 0, earlier["iterations"]
        self.begin = perf_counter() - earlier["seconds"]
        self.dt = 0.0
        self.largest = 0.0  # squared loads and reactions of a state at rest
        self.entries: list[dict[str, Any]] = list(earlier["load_steps"])

    def run(self) -> str:
        """Follow the load path; returns the final status."""
        recorder = self.recorder
        load_steps, duration = self.solver.load_steps, self.solver.duration
        for index in range(round(recorder.time / duration * load_steps) + 1, load_steps + 1):
            before = self.done
            good = self._remember()
            converged = self._load_step(index)
            recorder.residual = self.entries[-1]["residuals"][-1]
            recorder.solve = {
                "solver": "Relaxation",
                "iterations": self.earlier + self.done,
                "residuals": [r for entry in self.entries for r in entry["residuals"]],
                "reached": (index if converged else index - 1) / load_steps,
                "seconds": perf_counter() - self.begin,
                "load_steps": self.entries,
            }
            if not converged:
                # The first load step has no good one before it: its last state says more than the start, and is
                # where --resume goes on.
                if index > 1:
                    self._restore(good)
                else:
                    recorder.frame(recorder.frame_index + 1, 0.0, self.done - before, self.dt)
                return NOT_CONVERGED
            recorder.frame(recorder.frame_index + 1, duration * index / load_steps, self.done - before, self.dt)
        return FINISHED

    def _load_step(self, index: int) -> bool:
        """Apply a load step and relax, break, relax; whether it came to rest with nothing left to break."""
        entry: dict[str, Any] = {"share": index / self.solver.load_steps, "steps": self.done, "residuals": []}
        self.entries.append(entry)
        self._advance_clock(index)
        converged = self._relax(entry, ramp=True)
        rounds = 0
        while converged and self.rupture.breaks() and rounds < MOST_ROUNDS:
            rounds += 1
            converged = self._relax(entry, ramp=False)
        entry.update(steps=self.done - entry["steps"], rounds=rounds, converged=converged and rounds < MOST_ROUNDS)
        return bool(entry["converged"])

    def _relax(self, entry: dict[str, Any], ramp: bool) -> bool:
        """Steps until the residual is small; whether it became so. The residual is looked at once at least."""
        start, solver = self.done, self.solver
        ramp_steps = solver.ramp_steps if ramp else 0
        while self.done == start or self.done < solver.most_steps:
            since = self.done - start
            if since % STEPS_BETWEEN == 0 or since < ramp_steps:
                self._set_step()
            for _ in range(CHECK_EVERY // 10):
                self.ten.run()
            self.done += CHECK_EVERY
            self.residual_launches.run()
            residual = self._residual()
            entry["residuals"].append(residual)
            self.recorder.progress(self.done, residual, self.tolerance)
            if not math.isfinite(residual):
                return False
            if residual <= self.tolerance and self.done - start >= ramp_steps:
                self.largest = max(self.largest, float(self.built.reaction.numpy().sum()))
                return True
        return False

    def _advance_clock(self, index: int) -> None:
        duration, load_steps = self.solver.duration, self.solver.load_steps
        self.built.set_clock(duration / (load_steps * self.solver.ramp_steps), duration * index / load_steps)

    def _residual(self) -> float:
        unbalanced, reaction = float(self.built.unbalanced.numpy().sum()), float(self.built.reaction.numpy().sum())
        reaction = max(reaction, LEAST_LOAD**2 * self.largest)
        if unbalanced == 0.0:
            return 0.0
        return math.sqrt(unbalanced / reaction) if reaction > 0.0 else math.inf

    def _set_step(self) -> None:
        built = self.built
        assert built.stable_step is not None
        self.density.run()
        omega = built.stable_step.omega(FIRST_ITERATIONS if self.dt == 0.0 else LATER_ITERATIONS)
        self.recorder.stable_dt = 2.0 / omega if omega > 0.0 else math.inf
        self.dt = self.solver.safety * self.recorder.stable_dt if omega > 0.0 else 1.0
        built.step.assign(np.array([self.dt], dtype=built.step.numpy().dtype))

    def _remember(self) -> dict[str, np.ndarray]:
        state = self.built.state
        arrays = {"displacement": state.displacement, "alive": self.built.force.alive, "time": state.time}
        return {name: array.numpy().copy() for name, array in arrays.items() if array is not None}

    def _restore(self, good: dict[str, np.ndarray]) -> None:
        """Put the last good load step back; its frame is written already, so nothing new is recorded."""
        state = self.built.state
        state.displacement.assign(good["displacement"])
        state.velocity.zero_()
        if "alive" in good:
            self.built.force.alive.assign(good["alive"])
        if "time" in good:
            state.time.assign(good["time"])
        self.recorder.steps += self.entries[-1]["steps"]
