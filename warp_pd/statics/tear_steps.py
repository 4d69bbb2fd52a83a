"""Steps of a path while a damage field grows: its energy controls the path in place of the arc length."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..device.fields import assign
from ..interfaces import FrameSink, System
from .corrector import Corrector, Origin, norm
from .descent import Secants
from .level import OWNER

# Accuracy of the energy over its growth in a step, and largest number of trials, each way.
CLOSE, MOST_TRIALS = 1e-3, 40
# Relative change of the load factor at which a step has settled, and growth of the energy of the damage field, over
# what was wanted, below which the tear has stopped.
STILL, GROWS = 1e-4, 1e-3
# Rounds of alternate minimisation after which such a step counts as failed.
MOST_ROUNDS = 100
# Smallest growth, over `BuiltRupture.tear_energy`, down to which the last ligament of a falling load is followed.
LEAST_RELEASE = 1.0 / 16.0


class TearSteps(Corrector):
    """Steps in which the energy of a damage field grows by a given amount.

    Attributes:
        direction: Derivative of the displacement by the arc length [-], (N,) vec3.
        tear_energy: `BuiltRupture.tear_energy`, or 0.
    """

    tear_energy = 0.0

    def prepare(self, system: System) -> None:
        """Add the stages of residual and tangent."""
        super().prepare(system)
        self.direction = self.context.array(
            "path_direction", OWNER, self.context.types.vec3, shape=self.context.sheet.size, restart=True
        )
        if system.rupture is not None:
            self.tear_energy = system.rupture.tear_energy

    def tear(self, origin: Origin, sink: FrameSink) -> bool:
        """Try one step in which the energy of the damage field grows by `release`; return whether it was found.

        The load factor changes by at most `increment`.
        """
        entry = self._new_entry(origin.factor)
        stored, sign, begin = self.rounds.energy(), math.copysign(1.0, origin.factor), abs(origin.factor)
        most = min(1.0, begin + self.settings.increment)
        motion = sign * origin.direction / origin.rate
        factor = self.alternate(origin.displacement, motion, begin, most, sink, sign)
        if factor is None:
            return False
        if factor < begin - self.settings.increment:
            return self.fail(f"the load falls by more than {self.settings.increment:g} while the damage grows")
        grown = (self.rounds.energy() - stored) / (self.state.release * self.tear_energy)
        if self.state.heading * sign < 0.0 and factor == most and GROWS < grown and self.state.release > LEAST_RELEASE:
            return self.fail("what is left tears at once")
        if grown <= GROWS and abs(factor - begin) <= STILL * begin:
            return self.fail("neither the load nor the tear goes on")
        entry |= {"share": sign * factor, "converged": True}
        return self._accept_tear(origin, sign * factor, grown)

    def alternate(
        self, there: np.ndarray, motion: np.ndarray, here: float, most: float, sink: FrameSink, sign: float = 1.0
    ) -> float | None:
        """Find damage and displacement in equilibrium by alternate minimisation; return the load factor.

        The energy of the damage field grows by `release`, or less if the load factor would exceed `most`. In every
        round it follows from that energy for displacements on a straight line.

        Args:
            there: Displacement at the start [m], shape (N, 3).
            motion: Derivative of the displacement by the load factor [m], shape (N, 3).
            here: Absolute load factor at the start.
            most: Largest absolute load factor.
            sink: Where progress goes.
            sign: Sign of the load factor.

        Returns:
            None if no equilibrium was found.
        """
        level, rounds, entry, secants = self.levels[0], self.rounds, self.report.load_steps[-1], Secants()
        stored, unit = rounds.energy(), self.state.release * self.tear_energy
        least, stride = 1e-3 * self.settings.increment, 0.1 * self.settings.increment
        residual, tolerance = math.inf, max(self.tolerance, rounds.close_enough)
        for again in range(MOST_ROUNDS):

            def move(factor: float, there: np.ndarray = there, here: float = here) -> None:
                assign(level.displacement, there + (factor - here) * motion)

            def excess(factor: float, again: int = again, move: Callable[[float], None] = move) -> float:
                move(factor)
                return (rounds.energy(again) - stored) / unit - 1.0

            factor = load_factor(excess, here, stride, most)
            if factor is None:
                self.fail("no load factor was found at which the damage grows as wanted")
                return None
            move(factor)
            if not rounds.breaks(again) and abs(factor - here) <= STILL * here:
                assign(level.displacement, there)
                if residual <= self.tolerance:
                    return here
                factor, tolerance = here, self.tolerance
            self.set_loads(sign * factor)
            title = f"round {again + 1} of rupture"
            # A run that goes on from a file has no tangent of an earlier step.
            found = self._descend(0, sign * factor, sink, tolerance, title, secants if again else None)
            entry["lattices"].append(found)
            entry["rounds"] = again + 1
            residual = sink.residual = found["residuals"][-1]
            if not found["converged"]:
                self.fail_to_converge(residual)
                return None
            there = self.position()
            here, stride = factor, max(abs(factor - here), least)
        self.fail(f"the damage still grew after {MOST_ROUNDS} rounds")
        return None

    def _accept_tear(self, origin: Origin, factor: float, grown: float) -> bool:
        """Accept the current equilibrium as the next point; return whether the tangent is of use.

        `grown` is the growth of the energy of the damage field over what was wanted.
        """
        state, sign = self.state, math.copysign(1.0, factor)
        along = self.tangent_at(factor, sign)
        if along is None:
            return self.fail("the tangent cannot be factorised")
        rate, heading = sign / norm(along), math.copysign(1.0, factor - origin.factor)
        if heading != state.heading:
            self.record("maximum" if heading < 0.0 else "minimum", origin.factor, state.step, 0)
        self.move_to(self.point(factor, rate))
        state.length = self.settings.increment / abs(rate)
        state.tears, state.release = grown > GROWS, min(1.0, 2.0 * state.release)
        assign(self.direction, sign * along / norm(along))
        return True


def load_factor(excess: Callable[[float], float], here: float, stride: float, most: float) -> float | None:
    """Load factor at which an increasing function is zero, by the Illinois method; None if none is found.

    The value of the function at the result is the last one computed.

    Args:
        excess: The function.
        here: First guess.
        stride: First distance from there, which doubles until the zero is enclosed.
        most: Largest load factor; it is the result if the function is negative there.
    """
    a, at_a = here, excess(here)
    if abs(at_a) <= CLOSE or (here >= most and at_a < 0.0):
        return a
    b, at_b, step = a, at_a, math.copysign(stride, -at_a)
    for _ in range(MOST_TRIALS):
        a, at_a, b = b, at_b, min(b + step, most)
        at_b = excess(b)
        if at_a * at_b <= 0.0:
            break
        if b == most:
            return b
        step *= 2.0
    else:
        return None
    for _ in range(MOST_TRIALS):
        if abs(at_b) <= CLOSE or a == b:
            return b
        c = b - at_b * (b - a) / (at_b - at_a)
        at_c = excess(c)
        if at_c * at_b < 0.0:
            a, at_a = b, at_b
        else:
            at_a *= 0.5
        b, at_b = c, at_c
    return b
