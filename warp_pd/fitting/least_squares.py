"""The fit: nonlinear least squares over several tests at once, with exact derivatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from time import perf_counter
from typing import Any

import numpy as np

from ..device.checks import InputError, finite, one_of
from .data import LOSSES, Curve, FieldData, Test
from .equilibrium import NoEquilibriumError
from .experiment import Experiment, Model
from .report import SINGULAR, Fit, Judgement
from .uniform import LOADINGS

# Median absolute deviation to standard deviation of normal noise.
MAD = 1.4826
# Residuals above so many standard deviations count linearly in the robust loss, and most updates of the deviation.
MARGIN, MOST_MARGINS = 2.0, 5
# Pull of the constants towards their start values, over their size: it holds those that the data do not determine, and
# the steps after the search leave nothing of it in the others.
PULL, MOST_POLISHES = 1e-7, 5
# Halvings of the first step.
MOST_HALVINGS = 8
# Size of a constant that starts at zero, before derivatives tell; change of the residuals by a change of the size of a
# constant below which the size is raised, and to which; the largest and smallest factor at once, and most times.
TINY, UNFELT, FELT, MOST_RAISED, LEAST_RAISED, MOST_RAISES = 1e-6, 1e-4, 1e-2, 1e4, 10.0, 8
# Cosine between the residuals and their change by a constant above which a search has not found the least residuals.
STEEP = 0.05
# Ratio of the medians of data and model above which a wrong unit is likely.
UNLIKELY = 50.0
# The largest stress of a uniform test [Pa] below which MPa were likely meant: soft gels carry more.
TINY_STRESS = 1e3


def fit(
    experiments: Experiment | Sequence[Experiment],
    vary: Sequence[str],
    *,
    start: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    loss: str = "linear",
    tolerance: float = 1e-4,
    max_evaluations: int = 60,
    device: str | None = None,
    precision: int | None = None,
) -> Fit:
    """Fit constants to one or more tests simultaneously.

    Experiments that share the name of a constant share the constant. Residuals are divided by the `sigma` of a test or,
    without `sigma`, by its largest value, so that curves of any unit have equal weight.

    Args:
        experiments: Tests and their simulation: `SceneTests`, `UniformTests`, or a list of them.
        vary: Names of the constants.
        start: Initial values; by default those of the scenes.
        bounds: (lowest, highest) by name; other constants are only limited by the material.
        loss: "linear", or "soft_l1" for data with outliers: residuals beyond two standard deviations then count
            linearly instead of quadratically.
        tolerance: Relative change of the constants at which the search ends; the actual error is then usually much
            smaller.
        max_evaluations: Maximum number of evaluations.
        device: As for `Simulation.run`.
        precision: As for `Simulation.run`.

    Raises:
        InputError: if names, bounds or tests are invalid, or there is no equilibrium at the initial values.
    """
    from scipy.optimize import least_squares

    begin = perf_counter()
    listed: list[Experiment] = list(experiments) if isinstance(experiments, Sequence) else [experiments]
    one_of("loss", loss, LOSSES)
    if not vary or len(set(vary)) < len(vary):
        raise InputError(f"vary = {list(vary)!r}: expected names of constants, each once")
    first = np.array([_start(name, listed, start or {}) for name in vary])
    low, high = _limits(vary, bounds or {}, first)
    problem = Problem(listed, vary, first, device, precision)
    notes = problem.check(first)
    sizes = problem.find_sizes(first)
    begin_at, pull = first / sizes, PULL * np.eye(len(first))

    def pulled(q: np.ndarray) -> np.ndarray:
        return np.concatenate([problem.residuals(q), PULL * (q - begin_at)])

    def pulled_jacobian(q: np.ndarray) -> np.ndarray:
        return np.concatenate([problem.jacobian(q), pull])

    def search(q: np.ndarray, kind: str, margin: float) -> Any:
        return least_squares(
            pulled, q, pulled_jacobian, bounds=(low / sizes, high / sizes), method="trf", x_scale="jac",
            loss=kind, f_scale=margin, xtol=tolerance, ftol=1e-12, gtol=1e-12, max_nfev=max_evaluations,
        )  # fmt: skip

    found = search(problem.linear_solution(begin_at, low / sizes, high / sizes), "linear", 1.0)
    margin = 1.0
    if loss == "soft_l1":
        for _ in range(MOST_MARGINS):
            before = margin
            margin = MARGIN * max(MAD * float(np.median(np.abs(problem.residuals(found.x)))), 1e-12)
            if abs(margin - before) < 0.1 * before:
                break
            found = search(found.x, "soft_l1", margin)
    if problem.refused:
        notes.append(f"trials without a result: {len(problem.refused)}; the last one: {problem.refused[-1]}")
    if not found.success:
        notes.append(f"the search ended after {found.nfev} evaluations without reaching its tolerance")

    def weights_of(residuals: np.ndarray) -> np.ndarray:
        return np.ones_like(residuals) if loss == "linear" else 1.0 / np.sqrt(1.0 + (residuals / margin) ** 2)

    best = problem.polished(found.x, low / sizes, high / sizes, weights_of, tolerance)
    residuals, jacobian = problem.residuals(best), problem.jacobian(best)
    weights, values = weights_of(residuals), best * sizes
    judgement = Judgement.of(vary, values, sizes, residuals, jacobian / sizes, weights)
    bounded = np.minimum(values - low, high - values) <= 1e-6 * np.abs(values)
    for name, value in ((name, value) for name, value, at in zip(vary, values, bounded, strict=True) if at):
        notes.append(f"{name} = {value:.6g} is at its bound")
    falling = [name for name, falls in zip(vary, _falls(jacobian, residuals, weights) & ~bounded, strict=True) if falls]
    if problem.refused and falling:
        notes.append(
            f"not the best fit: it still improves with {', '.join(falling)}, but trials were refused: expected bounds "
            "(--bounds) that keep to what the material takes"
        )
    constants = dict(zip(vary, values.tolist(), strict=True))
    notes += dict.fromkeys(note for experiment in listed for note in experiment.notes(constants))
    return Fit(
        tuple(vary), values, first, judgement, listed, problem.tests, problem.shaped(residuals), problem.shown(best),
        notes, problem.evaluations, perf_counter() - begin, bool(found.success),
    )  # fmt: skip


def _falls(jacobian: np.ndarray, residuals: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Whether the residuals still fall with each constant, (P,)."""
    root = np.sqrt(weights)
    slopes = np.abs((weights * residuals) @ jacobian)
    lengths = np.linalg.norm(root[:, None] * jacobian, axis=0) * np.linalg.norm(root * residuals)
    return np.asarray(slopes > STEEP * lengths)


def _start(name: str, experiments: Sequence[Experiment], start: Mapping[str, float]) -> float:
    if name in start:
        return finite(f"start of {name}", start[name])
    for experiment in experiments:
        value = experiment.start(name)
        if value is not None:
            return value
    raise InputError(f"vary = {name!r}: expected an argument of the scene that is a number, or a start value")


def _limits(
    vary: Sequence[str], bounds: Mapping[str, tuple[float, float]], first: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    for name in bounds:
        if name not in vary:
            raise InputError(f"bounds of {name!r}: expected one of the constants that vary, {', '.join(vary)}")
    low, high = (np.array([bounds.get(name, (-np.inf, np.inf))[side] for name in vary], float) for side in (0, 1))
    for name, value, least, most in zip(vary, first, low, high, strict=True):
        if not least < value < most:
            raise InputError(f"{name} = {value:g}: expected an initial value inside its bounds {least:g} to {most:g}")
    return low, high


class Problem:
    """Residuals and derivatives of all tests, as functions of the constants over their sizes.

    The size of a constant is the change that changes a residual by one, whatever its start value; of one that changes
    none, its start value. It is 1 until `find_sizes` finds it.

    Attributes:
        evaluations: Number of evaluations of the models so far.
        refused: Why trials had no result, one line each.
    """

    def __init__(
        self, experiments: Sequence[Experiment], vary: Sequence[str], start: np.ndarray, device: str | None,
        precision: int | None,
    ) -> None:  # fmt: skip
        self._vary = list(vary)
        self._known: list[list[int]] = []
        self._models: list[Model] = []
        used = np.zeros(len(vary), bool)
        for experiment in experiments:
            mine = [k for k, name in enumerate(vary) if len(experiments) == 1 or experiment.start(name) is not None]
            used[mine] = True
            self._known.append(mine)
            self._models.append(experiment.model([vary[k] for k in mine], start[mine], device, precision))
        for name in (name for name, there in zip(vary, used, strict=True) if not there):
            raise InputError(
                f"vary = {name!r}: expected a constant of one of the experiments; give it in their settings"
            )
        self.tests: list[Test] = [test for experiment in experiments for test in experiment.tests]
        self._measured = [_data(test) for test in self.tests]
        self._usable = [np.isfinite(data) for data in self._measured]
        self._scales = [test.scale for test in self.tests]
        self._sizes, self.evaluations = np.ones(len(vary)), 0
        self.refused: list[str] = []
        self._last: tuple[np.ndarray, list[np.ndarray]] | None = None
        if sum(int(u.sum()) for u in self._usable) <= len(vary):
            raise InputError(f"tests: expected more numbers than the {len(vary)} constants that vary")

    def outputs(self, q: np.ndarray) -> list[np.ndarray]:
        """What the tests would show."""
        if self._last is None or not np.array_equal(self._last[0], q):
            self.evaluations += 1
            found = []
            for model, mine in zip(self._models, self._known, strict=True):
                found += model.evaluate((q * self._sizes)[mine])
            self._last = q.copy(), found
        return self._last[1]

    def residuals(self, q: np.ndarray) -> np.ndarray:
        """(model - data) / scale of everything measured; infinite where there is no equilibrium."""
        try:
            outputs = self.outputs(q)
        except (NoEquilibriumError, InputError) as error:
            self.refused.append(str(error))
            return np.full(sum(int(u.sum()) for u in self._usable), np.inf)
        parts = zip(outputs, self._measured, self._usable, self._scales, strict=True)
        return np.concatenate([((o - d) / scale)[u] for o, d, u, scale in parts])

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Derivatives of the residuals by q."""
        rows, test = [], 0
        for model, mine in zip(self._models, self._known, strict=True):
            for slopes in model.jacobian((q * self._sizes)[mine]):
                full = np.zeros((int(self._usable[test].sum()), len(q)))
                full[:, mine] = slopes[self._usable[test]] / self._scales[test]
                rows.append(full)
                test += 1
        found = np.asarray(np.concatenate(rows) * self._sizes)
        endless = ~np.isfinite(found).all(axis=0)
        if endless.any():
            k = int(np.argmax(endless))
            value = q[k] * self._sizes[k]
            raise InputError(
                f"{self._vary[k]} = {value:.6g}: the tests have no finite derivatives there; expected another start "
                "value, or bounds (--bounds)"
            )
        return found

    def find_sizes(self, start: np.ndarray) -> np.ndarray:
        """Find the sizes of the constants from derivatives at the start values, shape (P,)."""
        steps = np.where(start != 0.0, np.abs(start), TINY)
        self._take_sizes(steps)
        felt = self._felt(start) * steps
        for _ in range(MOST_RAISES):
            weak = felt < UNFELT
            if not weak.any():
                break
            factors = np.clip(FELT / np.maximum(felt, 1e-300), LEAST_RAISED, MOST_RAISED)
            raised = np.where(weak, factors * steps, steps)
            self._take_sizes(raised)
            try:
                felt, steps = self._felt(start) * raised, raised
            except (NoEquilibriumError, InputError):
                self._take_sizes(steps)
                break
        sizes = np.where(felt >= UNFELT, steps / np.maximum(felt, UNFELT), np.where(start != 0.0, np.abs(start), 1.0))
        self._sizes, self._last = sizes, None
        return sizes

    def _felt(self, start: np.ndarray) -> np.ndarray:
        """Largest derivative of the residuals by each constant, shape (P,)."""
        return np.asarray(np.abs(self.jacobian(start)).max(axis=0))

    def _take_sizes(self, sizes: np.ndarray) -> None:
        """Use sizes for the steps of differences."""
        for model, mine in zip(self._models, self._known, strict=True):
            model.take_sizes(sizes[mine])

    def linear_solution(self, q: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """The solution of the linearised problem, which is that of a linear one, or a point on the way that helps."""
        step = self._step(q, np.ones_like(self.residuals(q)))
        before = float(self.residuals(q) @ self.residuals(q))
        for fraction in 0.5 ** np.arange(MOST_HALVINGS):
            there = q + fraction * step
            if ((low < there) & (there < high)).all():
                after = self.residuals(there)
                if np.isfinite(after).all() and float(after @ after) < before:
                    return np.asarray(there)
        return q

    def polished(
        self, q: np.ndarray, low: np.ndarray, high: np.ndarray, weights_of: Callable[[np.ndarray], np.ndarray],
        tolerance: float,
    ) -> np.ndarray:  # fmt: skip
        """Follow steps of Gauss and Newton, without any pull, from the best values of a search; kept if they help."""
        for _ in range(MOST_POLISHES):
            residuals = self.residuals(q)
            weights = weights_of(residuals)
            step = self._step(q, weights)
            there = np.clip(q + step, low, high)
            after = self.residuals(there)
            closer = np.isfinite(after).all() and (weights * after**2).sum() < (weights * residuals**2).sum()
            if not closer:
                break
            q = there
            if (np.abs(step) <= 1e-3 * tolerance * np.abs(q)).all():
                break
        return q

    def _step(self, q: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Solution of the linearised problem, without combinations of constants that the data do not determine."""
        root = np.sqrt(weights)
        u, s, v = np.linalg.svd(root[:, None] * self.jacobian(q), full_matrices=False)
        known = s > SINGULAR * s.max(initial=0.0)
        return np.asarray(-v[known].T @ ((u[:, known].T @ (root * self.residuals(q))) / s[known]))

    def check(self, q: np.ndarray) -> list[str]:
        """Evaluate the start values; notes on data that are far from them."""
        try:
            outputs = self.outputs(q)
        except NoEquilibriumError as error:
            raise InputError(f"start values: {error}; expected other start values, or smaller loads") from None
        notes = [
            f"{test.name or 'a test'}: stresses up to {np.abs(data).max():.3g} Pa: check the unit, expected pascals"
            for test, data in zip(self.tests, self._measured, strict=True)
            if test.control in LOADINGS and np.abs(data).max() < TINY_STRESS
        ]
        for test, output, data, usable in zip(self.tests, outputs, self._measured, self._usable, strict=True):
            model, measured = (float(np.median(np.abs(values[usable]))) for values in (output, data))
            if min(model, measured) > 0.0 and not 1.0 / UNLIKELY < measured / model < UNLIKELY:
                notes.append(
                    f"{test.name or 'a test'}: the data are {measured / model:.3g} times the model at the start: check "
                    "the unit, or the start values"
                )
        return notes

    def shaped(self, residuals: np.ndarray) -> list[np.ndarray]:
        """Scaled residuals by test, NaN where nothing was measured."""
        out, begin = [], 0
        for usable in self._usable:
            values = np.full(usable.shape, np.nan)
            values[usable] = residuals[begin : begin + int(usable.sum())]
            begin += int(usable.sum())
            out.append(values)
        return out

    def shown(self, q: np.ndarray) -> list[np.ndarray]:
        """The model by test, in SI units."""
        return [output.copy() for output in self.outputs(q)]


def _data(test: Test) -> np.ndarray:
    return test.displacements if isinstance(test, FieldData) else test.values


__all__ = ["Curve", "Fit", "fit"]
