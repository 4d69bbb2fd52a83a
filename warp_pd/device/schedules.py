"""Schedules: piecewise linear functions of time, evaluated on the device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .checks import InputError, vector


@dataclass(frozen=True, eq=False)
class Schedule:
    """A piecewise linear function of time, constant before its first and after its last knot.

    Attributes:
        times: Knots [s], increasing, shape (K,).
        values: Values at the knots, shape (K, 3).
        name: What it is of, for messages.
    """

    times: np.ndarray
    values: np.ndarray
    name: str = ""

    def at(self, time: float) -> np.ndarray:
        """Values at a time [s], shape (3,)."""
        k = int(np.searchsorted(self.times, time, side="right")) - 1
        if k < 0 or k + 1 == len(self.times):
            return np.array(self.values[max(k, 0)])
        slope = (self.values[k + 1] - self.values[k]) / (self.times[k + 1] - self.times[k])
        return np.asarray(self.values[k] + slope * (time - self.times[k]))

    def repeated(self, number: int) -> Schedule:
        """The same from its first to its last time, so often one after the other.

        Raises:
            InputError: if its values at the last time are not those at the first.
        """
        if number == 1:
            return self
        first, last = self.values[0], self.values[-1]
        if len(self.times) < 2 or np.abs(last - first).max() > 1e-12 * np.abs(self.values).max():
            raise InputError(
                f"{self.name}.repeat = {number}: expected the values of the first time at the last time, got "
                f"{first.tolist()} and {last.tolist()}"
            )
        cycle = self.times[1:] - self.times[0]
        times = np.concatenate([self.times[:1], *(self.times[0] + n * cycle[-1] + cycle for n in range(number))])
        return Schedule(times, np.concatenate([self.values[:1], np.tile(self.values[1:], (number, 1))]), self.name)

    def changes_after(self, time: float) -> bool:
        """Whether its values change after a time [s]."""
        later = self.values[self.times > time * (1.0 + 1e-9)]
        return bool((later != self.at(time)).any())

    @property
    def shortest_change(self) -> float:
        """Shortest time between knots of different values [s]; infinite if the values are constant."""
        changes = (np.diff(self.values, axis=0) != 0.0).any(axis=1)
        return float(np.diff(self.times)[changes].min(initial=np.inf))

    def top_speed(self, time: float) -> float:
        """Largest rate of change up to a time [1/s]."""
        rates = np.diff(self.values, axis=0) / np.diff(self.times)[:, None]
        return float(np.linalg.norm(rates[self.times[:-1] < time], axis=1).max(initial=0.0))


def schedule(name: str, times: np.ndarray, values: np.ndarray) -> Schedule:
    """Create a schedule from checked times, shape (K,), and values, shape (K, 3)."""
    if times.ndim != 1 or times.size == 0 or (np.diff(times) <= 0.0).any():
        raise InputError(f"{name} times = {times.tolist()}: expected one or more increasing times")
    return Schedule(times, values, name)


def proportional(duration: float) -> Schedule:
    """The factor of a load that grows with the load factor, 0 to 1 over a load time [s]."""
    return Schedule(np.array([0.0, duration]), np.repeat([[0.0], [1.0]], 3, axis=1))


def factor_schedule(name: str, ramp: Sequence[tuple[float, float]] | None) -> Schedule | None:
    """Schedule of a factor from pairs (time, factor); None, for a constant load, stays None."""
    if ramp is None:
        return None
    try:
        pairs = np.array([vector(f"{name} ramp", pair, 2) for pair in ramp])
    except TypeError:
        raise InputError(f"{name} ramp = {ramp!r}: expected pairs (time, factor)") from None
    if len(pairs) == 0:
        raise InputError(f"{name} ramp = {ramp!r}: expected at least one pair (time, factor)")
    return schedule(f"{name} ramp", pairs[:, 0], np.repeat(pairs[:, 1:], 3, axis=1))
