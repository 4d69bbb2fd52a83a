"""Tearing energy from the load at which a pre-cut strip tears, through scenes such as `pure_shear_tear`.

The energy release rate of a strip in pure shear depends on its stretch, not on its tearing energy. So one run gives the
energy release rate at any load, and its value at the load at which a test tears is the tearing energy; another run
checks it.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..device.checks import InputError, positive
from ..interfaces import History
from .derivatives import Build
from .runs import finished

# Runs after which the last one is the answer.
MOST_RUNS = 5


@dataclass(frozen=True)
class TearingFit:
    """A fitted tearing energy, and the result of the run that checks it.

    Attributes:
        energy: Tearing energy of the last run [J/m^2].
        load: The measured load at tearing [N].
        check: Load [N] at which the scene tears with this energy.
        released: Energy release rate at the measured load [J/m^2]: the tearing energy of a continuum.
        runs: Number of runs.
    """

    energy: float
    load: float
    check: float
    released: float
    runs: int

    @property
    def error(self) -> float:
        """Relative difference of the two loads [-]."""
        return self.check / self.load - 1.0


def tearing_energy(
    build: Build, load: float, settings: Mapping[str, Any] | None = None, *, tolerance: float = 0.02,
    device: str | None = None,
) -> TearingFit:  # fmt: skip
    """Find the tearing energy of a test that tore at a given load.

    Args:
        build: A scene with the argument `tearing_energy`, the measures "load" and "release_ratio" (energy release rate
            over the tearing energy), and the outcome "onset_ratio", its value when the tear begins.
        load: Load at which the tear begins [N].
        settings: Arguments of `build`; `tearing_energy` is the first guess.
        tolerance: Relative difference between simulated and measured load at which the search ends.
        device: As for `Simulation.run`.

    Raises:
        InputError: if the scene lacks these, its run fails, or the strip does not tear.
        KeyboardInterrupt: if a run was interrupted.
    """
    positive("load", load)
    given = dict(settings or {})
    parameter = inspect.signature(build).parameters.get("tearing_energy")
    if parameter is None:
        raise InputError("tearing_energy: expected a scene with this argument, such as pure_shear_tear")
    energy = float(given.get("tearing_energy", parameter.default))
    for runs in range(1, MOST_RUNS + 1):
        history, onset = _run(build, {**given, "tearing_energy": energy}, device)
        loads, ratios = np.array(_until(history, onset)).T
        released = energy * float(np.interp(load, loads, ratios))
        if loads[-1] < load:
            # Beyond the tear of this run, nearly as for a linear strip.
            released *= (load / float(loads[-1])) ** 2
        found = TearingFit(energy, load, float(loads[-1]), released, runs)
        if abs(found.error) <= tolerance:
            break
        # A discrete sheet tears a little above its energy, by a fraction that hardly depends on it.
        energy = released / onset
    return found


def _run(build: Build, settings: Mapping[str, Any], device: str | None) -> tuple[History, float]:
    """History of a run, and the release ratio at which its tear begins."""
    result = finished(build(**settings).run(device=device))
    missing = {"load", "release_ratio"} - set(result.history[-1])
    if missing:
        raise InputError(f"measures: expected {' and '.join(sorted(missing))} in the scene")
    value = result.summary["measures"].get("onset_ratio", {}).get("value")
    if value is None:
        largest = max(row["release_ratio"] for row in result.history)
        raise InputError(
            f"onset_ratio: the strip did not tear at up to {largest:.3g} Gc: expected a stronger pull, or more points"
        )
    return result.history, float(value)


def _until(history: History, onset: float) -> list[tuple[float, float]]:
    """Monotonically increasing loads [N] and release ratios until the tear begins."""
    rows, largest = [], -np.inf
    for row in history:
        largest = max(largest, row["load"])
        rows.append((float(largest), float(row["release_ratio"])))
        if row["release_ratio"] >= onset:
            break
    return rows
