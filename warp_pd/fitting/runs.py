"""Tests simulated by complete runs (dynamics or relaxation); derivatives are central differences over runs.

Runs are bitwise reproducible, so differences have no noise. But results may jump or kink due to adaptive time steps,
contact or breaking bonds. The difference step is a hundredth of a constant, which gives errors of about 1e-4 for smooth
results. See docs/fitting.md for the limits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..device.checks import InputError
from ..interfaces.solver import FINISHED, STOPPED
from ..run.result import Result
from .data import Curve, Test
from .derivatives import Build
from .experiment import Model

STEP = 1e-2


def finished(result: Result) -> Result:
    """The result of a run to its end.

    Raises:
        InputError: if the run failed, with its reason.
        KeyboardInterrupt: if it was interrupted.
    """
    if result.status == STOPPED:
        raise KeyboardInterrupt
    if result.status != FINISHED:
        raise InputError(f"the run of the scene {result.status}: {result.summary['message']}")
    return result


class RunsModel(Model):
    """Tests of a scene simulated by complete runs."""

    def __init__(
        self, build: Build, tests: Sequence[Test], vary: Sequence[str], settings: Mapping[str, Any],
        sizes: np.ndarray, device: str | None, precision: int | None,
    ) -> None:  # fmt: skip
        self.sizes = np.abs(sizes)
        self.build, self.vary, self.settings = build, list(vary), dict(settings)
        self.device, self.precision = device, precision
        self.tests: list[Curve] = []
        for test in tests:
            if not isinstance(test, Curve):
                raise InputError(f"{test.name}: a field: expected a scene with the solver Newton")
            self.tests.append(test)

    def evaluate(self, values: np.ndarray) -> list[np.ndarray]:
        """Run the scene once, or once per value of an argument that a test controls."""
        return [self._curve(test, dict(zip(self.vary, values.tolist(), strict=True))) for test in self.tests]

    def _curve(self, test: Curve, constants: Mapping[str, float]) -> np.ndarray:
        if test.control in ("time", "load_factor"):
            history, duration = self._history(constants)
            times = test.at * (duration if test.control == "load_factor" else 1.0)
            return _column(history, test, times)
        out = []
        for value in test.at:
            history, _ = self._history({**constants, test.control: float(value)})
            out.append(_column(history, test, np.array([history[-1]["time"]]))[0])
        return np.array(out)

    def _history(self, constants: Mapping[str, Any]) -> tuple[list[dict[str, float]], float]:
        scene = self.build(**{**self.settings, **constants})
        result = finished(scene.run(device=self.device, precision=self.precision))
        return result.history, scene.solver.duration

    def jacobian(self, values: np.ndarray) -> list[np.ndarray]:
        """Central differences, two runs for every constant."""
        columns = []
        for k, value in enumerate(values):
            step = STEP * max(abs(value), self.sizes[k])
            sides = [
                self.evaluate(np.where(np.arange(len(values)) == k, value + s * step, values)) for s in (1.0, -1.0)
            ]
            columns.append([(a - b) / (2.0 * step) for a, b in zip(*sides, strict=True)])
        return [np.stack([column[t] for column in columns], axis=-1) for t in range(len(self.tests))]


def _column(history: list[dict[str, float]], test: Curve, times: np.ndarray) -> np.ndarray:
    if test.measure not in history[-1]:
        raise InputError(f"measure = {test.measure!r}: expected a column of the history: {', '.join(history[-1])}")
    at = np.array([row["time"] for row in history])
    if times.max() > at[-1] * (1.0 + 1e-9):
        raise InputError(f"{test.name}: time {times.max():g} s: expected at most the {at[-1]:g} s of the scene")
    found = np.asarray(np.interp(times, at, [row[test.measure] for row in history]))
    if not np.isfinite(found).all():
        raise InputError(
            f"measure = {test.measure!r}: expected a number in every frame that the test uses, but one has none"
        )
    return found
