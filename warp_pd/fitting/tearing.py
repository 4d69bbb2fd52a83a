"""Tearing energy from the load at which a pre-cut strip tears, through scenes such as `pure_shear_tear`.

The energy release rate of a strip in pure shear depends on how far it is stretched, not on what it takes to tear it. So
one run tells it at any load, and the load at which a test tears then tells the tearing energy; another run checks it.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..checks import InputError, positive
from ..interfaces import History
from .sensitivity import Build

# A run that tears below the measured load is repeated with so many times the energy.
LARGER, MOST_RUNS = 3.0, 4


@dataclass(frozen=True)
class TearingFit:
    """A tearing energy, and the run that checks it.

    Attributes:
        energy: Tearing energy of the last run [J/m^2].
        load: The measured load at tearing [N].
        check: Load [N] at which the scene tears with that energy.
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
    """Tearing energy of a test that tore at a load.

    Args:
        build: A scene with the argument `tearing_energy`, the measures "load" and "release_ratio" (energy release rate
            over the tearing energy), and the outcome "onset_ratio", its value when the tear begins.
        load: Load at which the tear begins [N].
        settings: Arguments of `build`; `tearing_energy` is the first guess.
        tolerance: Relative difference of the load of the last run from the measured one at which the search ends.
        device: As for `Simulation.run`.

    Raises:
        InputError: for a scene without these, or a load that no run reaches.
    """
    import inspect

    positive("load", load)
    given = dict(settings or {})
    parameter = inspect.signature(build).parameters.get("tearing_energy")
    if parameter is None:
        raise InputError("tearing_energy: expected a scene with this argument, such as pure_shear_tear")
    energy = float(given.get("tearing_energy", parameter.default))
    released, found, runs = None, None, 0
    while runs < MOST_RUNS:
        history, onset = _run(build, {**given, "tearing_energy": energy}, device)
        runs += 1
        loads, ratios = np.array(_until(history, onset)).T
        found = energy, float(loads[-1])
        if released is None and loads[-1] < load:
            energy *= LARGER
            continue
        if released is None:
            # What the test released when it tore, whatever it takes to tear it.
            released = energy * float(np.interp(load, loads, ratios))
        if abs(loads[-1] / load - 1.0) <= tolerance:
            break
        # A discrete sheet tears a little above its energy, by a share that hardly depends on it.
        energy = released / onset
    assert found is not None
    if released is None:
        raise InputError(f"load = {load:g} N: expected one that the scene reaches, got {found[1]:g} N at most")
    return TearingFit(found[0], load, found[1], released, runs)


def _run(build: Build, settings: Mapping[str, Any], device: str | None) -> tuple[History, float]:
    """History of a run, and the release ratio at which its tear begins."""
    result = build(**settings).run(device=device)
    missing = {"load", "release_ratio"} - set(result.history[-1])
    if missing:
        raise InputError(f"measures: expected {' and '.join(sorted(missing))} in the scene")
    value = result.summary["measures"].get("onset_ratio", {}).get("value")
    if value is None:
        raise InputError("onset_ratio: the strip did not tear: expected a longer or stronger pull")
    return result.history, float(value)


def _until(history: History, onset: float) -> list[tuple[float, float]]:
    """Loads that only rise [N], and release ratios, up to the beginning of the tear."""
    rows, largest = [], -np.inf
    for row in history:
        largest = max(largest, row["load"])
        rows.append((float(largest), float(row["release_ratio"])))
        if row["release_ratio"] >= onset:
            break
    return rows
