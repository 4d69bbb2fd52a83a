"""Newton's search for equilibrium: load steps, cutbacks, coarser lattices."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import warp as wp

from ..device.fields import assign
from ..interfaces import FrameSink, System, Tangent
from .level import OWNER
from .newton_settings import StaticSolver
from .static_rupture import Kept, put_back
from .static_system import FINISHED, NOT_CONVERGED, StaticSystem

# A note tells of a load step that moves the sheet so many times as far as each of the last few. Towards a maximum of
# the load, where the displacement has a square root, equal load steps move it 2.4 times as far at most.
JUMP, COMPARED = 4.0, 3


class Search(StaticSystem):
    """The search for equilibrium of one simulation.

    Attributes:
        planned: Number of load steps, as long as none fails.
        earlier: Displacement of the last good load step but one [m], (N,) vec3.
    """

    name = "Newton"
    definite = True

    def __init__(self, settings: StaticSolver, planned: int, system: System, tangent: Tangent) -> None:
        """Add all stages.

        Raises:
            InputError: if the sheet does not allow the preconditioner.
        """
        super().__init__(settings, system, tangent)
        context = system.context
        self.earlier = context.array(
            "earlier_load_step", OWNER, context.types.vec3, shape=context.sheet.size, restart=True
        )
        self.planned, self._size, self._cutbacks = planned, 1.0 / planned, 0
        self._earlier_factor: float | None = None
        self._kept_factor: float | None = None
        self._resumed = False
        # Lengths of the last load steps, and how far they moved the sheet [m]; load steps that moved it much farther.
        self._moved: list[tuple[float, float]] = []
        self.jumps: list[dict[str, float]] = []

    def host_state(self) -> dict[str, Any]:
        """The state of the search, for a bitwise identical restart."""
        return {
            **super().host_state(), "size": self._size, "cutbacks": self._cutbacks, "moved": self._moved,
            "earlier_factor": self._earlier_factor, "kept_factor": self._kept_factor, "jumps": self.jumps,
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore the result of `host_state`."""
        super().restore(state)
        self._size, self._cutbacks = state["size"], state["cutbacks"]
        self._earlier_factor, self._kept_factor = state["earlier_factor"], state["kept_factor"]
        self._moved, self.jumps = state["moved"], state["jumps"]
        self._resumed = True

    # Load steps ----------------------------------------------------------------------------------------

    def settle(self, factor: float, sink: FrameSink, guess: np.ndarray | None = None) -> bool:
        """Find equilibrium at a load factor from a guess [m], shape (N, 3), or from the current state."""
        if guess is None:
            return self._load_step(factor, sink)[0]
        self.set_loads(factor)
        assign(self.levels[0].displacement, guess)
        return bool(self._descend(0, factor, sink, self.tolerance)["converged"])

    def run(self, sink: FrameSink) -> str:
        """Follow the load path; return the final status."""
        finest, planned = self.levels[0], self.planned
        self._start_report(sink)
        self._stiffen()
        reached = sink.time / self.settings.duration
        kept = self._keep(reached)
        while reached < 1.0 - 1e-9:
            goal = (math.floor(reached * planned + 1e-9) + 1) / planned
            factor = goal if reached + self._size > goal - 1e-9 else reached + self._size
            converged, sink.residual = self._equilibrium(factor, sink)
            if converged:
                self._compare(reached, factor)
                reached = factor
                kept = self._keep(reached)
                if factor == goal:
                    self._record(sink, reached)
                continue
            wp.copy(finest.displacement, self.good)
            self._earlier_factor = self._kept_factor = None
            put_back(kept)
            self._cutbacks += 1
            self._size *= 0.5
            if self._cutbacks > self.settings.most_cuts:
                self._set_loads(0, reached)
                finest.evaluate()
                if reached > sink.time / self.settings.duration + 1e-9:
                    self._record(sink, reached)
                sink.solve = self._summary(reached)
                return NOT_CONVERGED
        return FINISHED

    def _compare(self, before: float, reached: float) -> None:
        """Record a load step in which the sheet moved much farther than before and than its supports."""
        here, good = (array.numpy().astype(np.float64) for array in (self.levels[0].displacement, self.good))
        moved, length = np.abs(here - good), reached - before
        far, prescribed = float(moved.max()), float(moved[self.levels[0].held].max(initial=0.0))
        usual = max((m * max(1.0, length / earlier) for earlier, m in self._moved), default=0.0)
        if 0.0 < usual < far / JUMP and prescribed < far / JUMP:
            self.jumps.append({"from": before, "to": reached, "moved": far, "times": far / usual})
        self._moved = [*self._moved, (length, far)][-COMPARED:]

    def _keep(self, reached: float) -> Kept:
        """Store the state as the last good load step; return that of contact and rupture."""
        # A run that went on from a load step has that and the one before it already.
        known = self._resumed and self._kept_factor is not None
        self._resumed = False
        if self._kept_factor is not None and not known:
            wp.copy(self.earlier, self.good)
        wp.copy(self.good, self.levels[0].displacement)
        if not known:
            self._earlier_factor, self._kept_factor = self._kept_factor, reached
        return self.irreversible()

    def _equilibrium(self, factor: float, sink: FrameSink) -> tuple[bool, float]:
        """Find equilibrium at a load factor in which no more bonds break; return whether found, and the residual.

        With a damage field this is alternate minimisation of the energy by displacement and damage.
        """
        s0, s1 = self._earlier_factor, self._kept_factor
        if s0 is not None and s1 is not None and self.hierarchy is None:
            # On along the line through the last two load steps; what is held goes where it belongs all the same.
            u0, u1 = (array.numpy().astype(np.float64) for array in (self.earlier, self.good))
            assign(self.levels[0].displacement, u1 + (factor - s1) / (s1 - s0) * (u1 - u0))
        converged, residual = self._load_step(factor, sink)
        entry = self.report.load_steps[-1]
        while converged:
            # Bonds break only after contact has settled.
            settles = sum(contact.settle() for contact in self.levels[0].contacts) > 0
            breaks = settles or self.rupture.breaks(entry["rounds"])
            if not breaks and residual <= self.tolerance:
                break
            if breaks:
                entry["rounds"] += 1
            if breaks and not settles:
                self._kept_factor = None
            tolerance = max(self.tolerance, self.rupture.close_enough) if breaks and not settles else self.tolerance
            round_of = f"round {entry['rounds']} of {'contact' if settles else 'rupture'}" if entry["rounds"] else ""
            found, whole = self._descend(0, factor, sink, tolerance, round_of), entry["lattices"][-1]
            for name in ("residuals", "shares", "products"):
                whole[name] += found[name]
            converged, residual = found["converged"] and not self.rupture.goes_on(entry), found["residuals"][-1]
            whole["converged"] = entry["converged"] = converged
        if converged and sum(contact.passed() for contact in self.levels[0].contacts):
            converged = entry["converged"] = False
        return converged, residual
