"""Loads and supports along a load path, evaluated on the host once a load step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..checks import point_indices
from ..loads import BodyForce, Fixed, Load, Motion, PointForce, Pressure

if TYPE_CHECKING:
    from ..simulation import Simulation


class LoadPath:
    """Supports and loads at a share s of the path: schedules at the time s duration, loads without one times s.

    Attributes:
        follower: Whether a pressure follows the surface.
    """

    def __init__(self, simulation: Simulation, duration: float) -> None:
        self.duration, self.size = duration, simulation.sheet.size
        start = simulation.initial_displacement
        self._start = np.zeros((self.size, 3)) if start is None else np.asarray(start, dtype=np.float64)
        self._motions = [(m, point_indices("Motion.points", m.points, self.size), m.schedule())
                         for m in simulation.loads if isinstance(m, Motion)]  # fmt: skip
        loads = [p for p in simulation.loads if isinstance(p, Pressure | BodyForce | PointForce)]
        self._followers = [p for p in loads if isinstance(p, Pressure) and p.follower]
        self.follower = bool(self._followers)
        self._dead = []
        for load in loads:
            if load not in self._followers:
                points, force = load.dead_forces(simulation.sheet)
                self._dead.append((load, points, force))

    def _factor(self, load: Load, share: float) -> float:
        assert not isinstance(load, Fixed)
        ramp = load.schedule()
        return share if ramp is None else float(np.interp(share * self.duration, ramp.times, ramp.values[:, 0]))

    def prescribed(self, share: float) -> np.ndarray:
        """Displacement of held components [m], shape (N, 3); free components keep the initial one."""
        target = self._start.copy()
        for motion, points, knots in self._motions:
            for c in range(3):
                if motion.mask() & (1 << c):
                    target[points, c] = np.interp(share * self.duration, knots.times, knots.values[:, c])
        return target

    def dead(self, share: float) -> np.ndarray | None:
        """Sum of the dead loads [N], shape (N, 3); None without external loads."""
        if not self._dead and not self.follower:
            return None
        total = np.zeros((self.size, 3))
        for load, points, force in self._dead:
            total[points] += self._factor(load, share) * force
        return total

    def pressure(self, share: float) -> float:
        """Sum of the follower pressures [Pa]."""
        return sum(self._factor(p, share) * p.value for p in self._followers)
