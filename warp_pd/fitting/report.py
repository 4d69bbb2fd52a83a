"""Report of a fit: constants, their standard errors, and the constants that the data do not determine."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..device.checks import InputError
from ..run.folder import FIT
from ..run.simulation import Simulation
from .data import Curve, Test
from .experiment import Experiment
from .model import SceneTests

# The data do not determine a combination of constants if its singular value is below this fraction of the largest, or
# its relative uncertainty above this; a single constant is determined poorly above the third number.
SINGULAR, UNTOLD, BADLY = 1e-6, 10.0, 0.3
# Size of a constant that is zero, over the change that changes a residual by one.
SMALL = 1e-3
# A constant belongs to a combination from this fraction of it on.
FRACTION = 0.3
CORRELATED = 0.95
# Standard deviations from the fit, by the median, of an outlier.
OUTLIER, MAD = 5.0, 1.4826
MOST_OUTLIERS = 10


@dataclass(frozen=True, eq=False)
class Judgement:
    """Uncertainty of the constants.

    Attributes:
        deviation: Standard deviation of the scaled residuals [-].
        errors: Standard errors, shape (P,); infinite for constants that the data do not determine.
        correlations: Correlation matrix, shape (P, P).
        words: Notes on poorly determined constants, one line each.
    """

    deviation: float
    errors: np.ndarray
    correlations: np.ndarray
    words: list[str]

    @staticmethod
    def of(
        vary: Sequence[str], values: np.ndarray, sizes: np.ndarray, residuals: np.ndarray, jacobian: np.ndarray,
        weights: np.ndarray,
    ) -> Judgement:  # fmt: skip
        """Compute from residuals, (M,), and their derivatives by the constants, (M, P), at the best values."""
        freedom = max(float(weights.sum()) - len(vary), 1.0)
        deviation = math.sqrt(float((weights * residuals**2).sum()) / freedom)
        # A constant that is zero has no relative uncertainty, but its size has one.
        relative = np.maximum(np.abs(values), SMALL * sizes)
        _, s, v = np.linalg.svd(np.sqrt(weights)[:, None] * jacobian * relative, full_matrices=False)
        spread = np.where(s > 0.0, deviation / np.where(s > 0.0, s, 1.0), np.inf)
        lost = (spread > UNTOLD) | (s <= SINGULAR * s.max(initial=0.0))
        words = [_untold(vary, direction) for direction in v[lost]]
        kept = ~lost
        covariance = (v[kept].T * spread[kept] ** 2) @ v[kept]
        errors = relative * np.sqrt(np.diag(covariance))
        for direction in v[lost]:
            errors[np.abs(direction) > FRACTION * np.abs(direction).max()] = np.inf
        for name, error, value in zip(vary, errors, values, strict=True):
            if math.isfinite(error) and error > BADLY * abs(value):
                words.append(
                    f"the data determine {name} poorly: its standard error is {100.0 * error / abs(value):.0f} %"
                )
        scale = np.sqrt(np.diag(covariance))
        correlations = covariance / np.where(scale > 0.0, scale, 1.0) / np.where(scale > 0.0, scale, 1.0)[:, None]
        for a in range(len(vary)):
            for b in range(a):
                if np.isfinite(errors[[a, b]]).all() and abs(correlations[a, b]) > CORRELATED:
                    words.append(
                        f"{vary[b]} and {vary[a]} are correlated by {correlations[a, b]:+.3f}: the data say little "
                        "more than a combination of the two"
                    )
        return Judgement(deviation, errors, correlations, words)


def _untold(vary: Sequence[str], direction: np.ndarray) -> str:
    fraction = direction / np.abs(direction).max()
    names = [name for name, part in zip(vary, fraction, strict=True) if abs(part) > FRACTION]
    if len(names) == 1:
        return f"the data do not determine {names[0]}"
    sign = np.sign(fraction[np.argmax(np.abs(fraction))])
    powers = " ".join(
        f"{name}^{sign * part:+.2f}" for name, part in zip(vary, fraction, strict=True) if abs(part) > FRACTION
    )
    return (
        f"the data cannot tell {' from '.join(names) if len(names) == 2 else ', '.join(names) + ' apart'}: "
        f"they may change together as {powers}"
    )


@dataclass(frozen=True, eq=False)
class Fit:
    """Constants fitted to tests.

    Attributes:
        names: Names of the constants.
        values: Their values in SI units, shape (P,).
        start: Initial values, shape (P,).
        judgement: Their uncertainty.
        experiments: The fitted experiments.
        tests: The tests of all experiments.
        residuals: (model - data) / scale of every test, shaped like its data.
        model: Results of the fitted model for every test, in SI units.
        notes: Notes of the fit, one line each.
        evaluations: Number of evaluations of the model.
        seconds: Wall time [s].
        converged: Whether the search reached its tolerance.
    """

    names: tuple[str, ...]
    values: np.ndarray
    start: np.ndarray
    judgement: Judgement
    experiments: Sequence[Experiment]
    tests: Sequence[Test]
    residuals: Sequence[np.ndarray]
    model: Sequence[np.ndarray]
    notes: list[str]
    evaluations: int
    seconds: float
    converged: bool

    @property
    def estimates(self) -> dict[str, float]:
        """The constants by name."""
        return dict(zip(self.names, self.values.tolist(), strict=True))

    @property
    def errors(self) -> dict[str, float]:
        """Standard errors by name."""
        return dict(zip(self.names, self.judgement.errors.tolist(), strict=True))

    def simulation(self, **changed: Any) -> Simulation:
        """The scene of the first experiment that has one, with the fitted constants, ready to run.

        Args:
            **changed: Other arguments of the scene.

        Raises:
            InputError: if the fit has no scene.
        """
        for experiment in self.experiments:
            if isinstance(experiment, SceneTests):
                return experiment.build(**{**experiment.settings, **self.estimates, **changed})
        raise InputError("experiments: none has a scene: expected at least one SceneTests")

    def outliers(self) -> list[str]:
        """Notes on measured values far from the fit, one line each."""
        lines = []
        everything = np.concatenate([r[np.isfinite(r)].ravel() for r in self.residuals])
        spread = MAD * float(np.median(np.abs(everything)))
        for test, residual in zip(self.tests, self.residuals, strict=True):
            far = np.argwhere(np.abs(np.nan_to_num(residual)) > OUTLIER * max(spread, 1e-9))
            for place in far[:MOST_OUTLIERS]:
                k = tuple(place)
                row = f"row {place[0] + 1}" if test.rows is None else f"line {test.rows[place[0]]}"
                times = abs(residual[k]) / max(spread, 1e-9)
                lines.append(
                    f"{test.name or 'a test'}, {row}: {times:.0f} standard deviations from the fit: an outlier?"
                )
            if len(far) > MOST_OUTLIERS:
                lines.append(f"{test.name or 'a test'}: {len(far) - MOST_OUTLIERS} more like these")
        return lines

    def table(self) -> str:
        """The constants, their errors and correlations, and the notes of the fit, as text."""
        lines = [f"{'constant':14s} {'estimate':>13s} {'standard error':>15s} {'':>9s} {'start':>12s}"]
        for name, value, error, start in zip(self.names, self.values, self.judgement.errors, self.start, strict=True):
            fraction = f"{100.0 * error / abs(value):8.3g} %" if value and math.isfinite(error) else ""
            lines.append(f"{name:14s} {value:13.6g} {error:15.3g} {fraction:>10s} {start:12.6g}")
        if len(self.names) > 1:
            lines.append("correlations")
            for name, row in zip(self.names, self.judgement.correlations, strict=True):
                lines.append(f"  {name:12s} " + " ".join(f"{c:+.3f}" for c in row))
        lines.append(
            f"residuals: {100.0 * self.judgement.deviation:.3g} % of each test's scale; {self.evaluations} evaluations "
            f"in {self.seconds:.1f} s"
        )
        return "\n".join([*lines, *self.notes, *self.judgement.words, *self.outliers()])

    def draw(self, path: str | Path) -> None:
        """Draw data, model and residuals of every test."""
        from ..output.quantities import with_unit
        from ..viewer.plots import fitted

        panels = []
        for test, model, residual in zip(self.tests, self.model, self.residuals, strict=True):
            if isinstance(test, Curve):
                across, upwards = with_unit(test.control, test.units[0]), with_unit(test.measure, test.units[1])
                panels.append((test.name, across, upwards, test.at, test.values, model, residual))
            else:
                size, shown = (np.linalg.norm(np.nan_to_num(u), axis=1) for u in (test.displacements, model))
                far = np.sqrt(np.nanmean(residual**2, axis=1))
                panels.append(
                    (test.name, "number of the place", "displacement (m)", np.arange(len(size)) + 1.0, size, shown, far)
                )
        fitted(Path(path), panels)

    def save(self, folder: str | Path, command: str = "") -> Path:
        """Write fit.json, fit.png and a table of every test into a folder, and return the folder."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        summary = {
            "constants": {
                name: {"value": value, "standard_error": error if math.isfinite(error) else None, "start": start}
                for name, value, error, start in zip(
                    self.names, self.values.tolist(), self.judgement.errors.tolist(), self.start.tolist(), strict=True
                )
            },
            "correlations": self.judgement.correlations.tolist(),
            "deviation": self.judgement.deviation,
            "evaluations": self.evaluations, "seconds": self.seconds, "converged": self.converged,
            "notes": [*self.notes, *self.judgement.words, *self.outliers()],
            "run": command,
        }  # fmt: skip
        (folder / FIT).write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
        for k, (test, model) in enumerate(zip(self.tests, self.model, strict=True)):
            self._write(folder / f"test-{k + 1}.csv", test, model)
        self.draw(folder / "fit.png")
        return folder

    @staticmethod
    def _write(path: Path, test: Test, model: np.ndarray) -> None:
        if isinstance(test, Curve):
            header, columns = f"{test.control},{test.measure},model", [test.at, test.values, model]
        else:
            header = ",".join([*"xyz"[: test.places.shape[1]], "u,v,w,model_u,model_v,model_w"])
            columns = [*test.places.T, *test.displacements.T, *model.T]
        np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="")
