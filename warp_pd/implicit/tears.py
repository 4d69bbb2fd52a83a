"""Growth of a damage field in implicit steps."""

from __future__ import annotations

from ..interfaces import System
from ..statics.static_rounds import StaticRounds

# Rounds of alternate minimisation after which a step has failed.
MOST_ROUNDS = 100
# Aim below the largest growth of a step.
AIM = 0.8


class Tears:
    """Control of steps by the energy of a damage field, in units of `BuiltRupture.tear_energy`.

    It may grow by one unit in a step, a quarter of the energy of a tear as long as the field. The shortest step may
    exceed it: there the tear runs.

    Attributes:
        growth: Growth in the step so far.
        jumps: Times [s] and growth of steps that exceeded the limit.
    """

    def __init__(self, system: System, rounds: StaticRounds, shortest: float) -> None:
        assert system.rupture is not None
        self._rounds, self._unit, self._shortest = rounds, system.rupture.tear_energy, shortest
        self._before: float | None = None
        self.growth = 0.0
        self.jumps: list[tuple[float, float]] = []

    def begin(self) -> None:
        """Begin a step."""
        self._before = self._energy() if self._before is None else self._before
        self.growth = 0.0

    def look(self, dt: float) -> bool:
        """Find the growth in a step of dt [s] so far; return whether it is too much."""
        assert self._before is not None
        self.growth = self._energy() - self._before
        return self.growth > 1.0 and dt > self._shortest

    @property
    def factor(self) -> float:
        """Factor on a step that would have grown the damage as much as allowed."""
        return AIM / self.growth if self.growth > 0.0 else float("inf")

    def runs(self, dt: float) -> bool:
        """Whether the tear runs in a step of dt [s], however short."""
        return self.growth > 1.0 and dt <= self._shortest

    def accept(self, then: float, dt: float) -> None:
        """Accept a step of dt [s] that ends at a time [s]."""
        assert self._before is not None
        if self.runs(dt):
            self.jumps.append((then, self.growth))
        self._before += self.growth

    def _energy(self) -> float:
        return self._rounds.energy() / self._unit

    def notes(self, inertia: bool) -> list[str]:
        """A note on tears that ran in the shortest steps."""
        if not self.jumps:
            return []
        (time, growth), count = max(self.jumps, key=lambda jump: jump[1]), len(self.jumps)
        return [
            f"Implicit: {count} steps of the shortest length grew the damage by more than a quarter of the energy of "
            f"a tear as long as its field, at most {growth:.3g} times, at {time:.6g} s: the tear runs there"
            + ("" if inertia else ", and without inertia it runs at once")
        ]
