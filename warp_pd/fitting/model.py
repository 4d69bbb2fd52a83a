"""Simulated test results and their derivatives by constants, for scenes in static equilibrium."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..device.checks import InputError
from ..materials import stability_notes
from ..run.simulation import Simulation
from .data import Curve, FieldData, Test
from .derivatives import Build, Derivatives, Value, value_of
from .equilibrium import FIT_ACCURACY, Equilibrium, NoEquilibriumError, for_differences, has_equilibrium
from .experiment import Model, require_arguments
from .probes import PointField
from .runs import RunsModel

# Candidates for the value of a control at zero load: of a force or displacement, and of a stretch.
AT_REST = (0.0, 1.0)
TRIAL_FACTOR, TRIAL_SIZE, SAME = 0.37, 1e-3, 1e-9
# Relative residual of the states of a fit in float64, unless the scene has its own tolerance: data have more noise.
TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class SceneTests:
    """Tests simulated by one scene.

    Attributes:
        build: Function that builds the scene, such as `warp_pd.scenes.bulge_test.build`.
        tests: The tests.
        settings: Fixed arguments of `build`, other than those controlled by tests.
    """

    build: Build
    tests: Sequence[Test]
    settings: Mapping[str, Any] = field(default_factory=dict)

    def start(self, name: str) -> float | None:
        """The value in `settings`, or the default of `build`."""
        parameter = inspect.signature(self.build).parameters.get(name)
        value = self.settings.get(name, None if parameter is None else parameter.default)
        return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None

    def notes(self, constants: Mapping[str, float]) -> list[str]:
        """Where the material of the scene loses its stability."""
        known = {*inspect.signature(self.build).parameters, *self.settings}
        mine = {name: value for name, value in constants.items() if name in known}
        return stability_notes(self.build(**{**self.settings, **mine}).force.material)

    def model(self, vary: Sequence[str], start: np.ndarray, device: str | None, precision: int | None) -> Model:
        """Create the model: by static equilibrium if the solver is Newton, otherwise by complete runs."""
        known = inspect.signature(self.build).parameters
        for name in vary:
            if name not in known and name not in self.settings:
                raise InputError(f"vary = {name!r}: expected an argument of the scene: {', '.join(known)}")
        for test in self.tests:
            if test.control in vary:
                raise InputError(f"vary = {test.control!r}: expected a constant; the test {test.name!r} controls it")
        settings = {**self.settings, **dict(zip(vary, start.tolist(), strict=True))}
        require_arguments(self.build, settings)
        scene = self.build(**settings)
        if has_equilibrium(scene):
            return EquilibriumModel(self, vary, settings, scene, start, device, precision)
        return RunsModel(self.build, self.tests, vary, settings, start, device, precision)


@dataclass(eq=False)
class Place:
    """A state of the scene at which something was measured.

    Attributes:
        settings: Arguments other than the constants.
        factor: Load factor.
        values: Test, its rows (None for all), and function for each number measured in this state.
    """

    settings: dict[str, Any]
    factor: float
    values: list[tuple[int, int | None, Value]] = field(default_factory=list)


class EquilibriumModel(Model):
    """Tests of a scene in static equilibrium.

    When the constants change, each state starts from a prediction by du/dp of the previous one.

    Attributes:
        places: All states, by settings, then load factor.
    """

    def __init__(
        self, experiment: SceneTests, vary: Sequence[str], settings: Mapping[str, Any], scene: Simulation,
        sizes: np.ndarray, device: str | None, precision: int | None,
    ) -> None:  # fmt: skip
        double = (precision or scene.solver.precision) == 64
        self.build = _loosened(experiment.build) if double else experiment.build
        self._arguments = inspect.signature(experiment.build).parameters
        self.tests, self.vary = list(experiment.tests), list(vary)
        self.settings, self.sizes, self.device, self.precision = dict(settings), np.abs(sizes), device, precision
        self._scene = scene
        found: dict[tuple[Any, ...], Place] = {}
        for index, test in enumerate(self.tests):
            self._add(index, test, found)
        self.places = sorted(found.values(), key=lambda p: (sorted(p.settings.items()), p.factor))
        self._known: tuple[np.ndarray, list[np.ndarray], list[np.ndarray]] | None = None
        self._jacobian: list[np.ndarray] = []
        self._at: np.ndarray | None = None

    def _add(self, index: int, test: Test, found: dict[tuple[Any, ...], Place]) -> None:
        controls = np.atleast_1d(test.at)
        settings, factors = self._factors(test.control, controls)
        for row, (changed, factor) in enumerate(zip(settings, factors, strict=True)):
            place = found.setdefault((*changed.items(), float(factor)), Place(changed, float(factor)))
            place.values.append(_value(self._scene, index, row, test))

    def _factors(self, control: str, values: np.ndarray) -> tuple[list[dict[str, Any]], np.ndarray]:
        """Settings and load factor of each value of a control."""
        none: list[dict[str, Any]] = [{} for _ in values]
        if control in ("", "load_factor"):
            return none, values if control else np.ones(len(values))
        if control == "time":
            return none, values / self._scene.solver.duration
        if control not in self._arguments:
            raise InputError(f"control = {control!r}: expected an argument of the scene, 'time' or 'load_factor'")
        largest = float(values[np.argmax(np.abs(values))])
        for rest in AT_REST:
            factors = (values - rest) / (largest - rest) if largest != rest else None
            if factors is not None and (factors >= 0.0).all() and self._is_proportional(control, largest, rest):
                return [{control: largest} for _ in values], factors
        return [{control: float(value)} for value in values], np.ones(len(values))

    def _is_proportional(self, control: str, largest: float, rest: float) -> bool:
        """Whether reducing the load factor is equivalent to a smaller control, i.e. gives the same forces."""
        middle = rest + TRIAL_FACTOR * (largest - rest)
        sides = []
        for value, factor in ((largest, TRIAL_FACTOR), (middle, 1.0)):
            try:
                scene = for_differences(self.build(**{**self.settings, control: value}))
            except InputError:
                return False
            side = Equilibrium(scene, self.device, self.precision)
            extent = float(np.ptp(scene.sheet.positions, axis=0).max())
            trial = TRIAL_SIZE * extent * np.sin(np.arange(3.0 * scene.sheet.size)).reshape(-1, 3)
            side.set(side.displacement + trial, factor)
            sides.append((side.residual(), side.held_at(factor)))
        return all(_same(a, b) for a, b in zip(*sides, strict=True))

    # The model -----------------------------------------------------------------------------------------

    def evaluate(self, values: np.ndarray) -> list[np.ndarray]:
        """Bring every state to equilibrium, and keep displacements and derivatives for the next values."""
        outputs = [np.full(_shape(test), np.nan) for test in self.tests]
        slopes = [np.full((*_shape(test), len(self.vary)), np.nan) for test in self.tests]
        states, along = [], []
        derivatives: Derivatives | None = None
        before: dict[str, Any] | None = None
        path: list[tuple[float, np.ndarray]] = []
        for index, place in enumerate(self.places):
            if derivatives is None or place.settings != before:
                given = {**self.settings, **place.settings, **dict(zip(self.vary, values.tolist(), strict=True))}
                derivatives = Derivatives(
                    self.build, given, self.vary, self.sizes.tolist(), self.device, self.precision
                )
                before, path = place.settings, []
                derivatives.state.accuracy = FIT_ACCURACY[derivatives.state.built.context.bits]
            state = derivatives.state
            change = self._reach(state, place, index, values, path, derivatives)
            functions = [value for _, _, value in place.values]
            frame = state.frame()
            here = state.displacement
            path.append((place.factor, here))
            states.append(here)
            along.append(change)
            numbers = [np.asarray(f(state.built, frame), dtype=np.float64) for f in functions]
            rates = derivatives.direct(functions, change)
            for (test, row, _), number, rate in zip(place.values, numbers, rates, strict=True):
                outputs[test][row if row is not None else slice(None)] = number
                slopes[test][row if row is not None else slice(None)] = rate
            state.set(here, place.factor)
        self._known, self._jacobian, self._at = (values.copy(), states, along), slopes, values.copy()
        return outputs

    def _reach(
        self, state: Equilibrium, place: Place, index: int, values: np.ndarray, path: list[tuple[float, np.ndarray]],
        derivatives: Derivatives,
    ) -> np.ndarray:  # fmt: skip
        """Bring the sheet to a place; returns du/dp [m per unit], shape (P, N, 3)."""
        if place.factor == 0.0:
            # Nothing is loaded: the sheet lies where its supports put it, and may have no stiffness across its plane.
            state.set(state.displacement, 0.0)
            return np.array([pair.held(0.0) for pair in derivatives.pairs])
        guess = None
        if self._known is not None:
            last, states, along = self._known
            guess = states[index] + np.einsum("p,pic->ic", values - last, along[index])
        elif len(path) > 1:
            (s0, u0), (s1, u1) = path[-2:]
            guess = u1 + (place.factor - s1) / (s1 - s0) * (u1 - u0) if s0 > 0.0 else None
        state.reach(place.factor, guess)
        return derivatives.displacements()

    def take_sizes(self, sizes: np.ndarray) -> None:
        """Replace the sizes."""
        self.sizes, self._at = sizes, None

    def jacobian(self, values: np.ndarray) -> list[np.ndarray]:
        """Derivatives at the last evaluation, which is repeated if the values differ."""
        if self._at is None or not np.array_equal(values, self._at):
            self.evaluate(values)
        return self._jacobian


def _loosened(build: Build) -> Build:
    """The same scene with the tolerance of a fit, if it uses the solver's default."""

    def made(**settings: Any) -> Simulation:
        scene = build(**settings)
        solver: Any = scene.solver
        return scene if solver.tolerance is not None else replace(scene, solver=replace(solver, tolerance=TOLERANCE))

    return made


def _value(scene: Simulation, index: int, row: int, test: Test) -> tuple[int, int | None, Value]:
    if isinstance(test, Curve):
        return index, row, value_of(scene, test.measure)
    field_of = PointField.at(scene.sheet, test.places)
    if not field_of.inside.all():
        outside = int((~field_of.inside).sum())
        raise InputError(
            f"{test.name}: {outside} of {len(test.places)} places are not on the sheet; expected only places on the "
            "sheet"
        )
    return index, None, lambda built, frame: field_of.values(frame)


def _shape(test: Test) -> tuple[int, ...]:
    return test.values.shape if isinstance(test, Curve) else test.displacements.shape


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(np.abs(a - b).max() <= SAME * max(np.abs(a).max(), np.abs(b).max()))


__all__ = ["EquilibriumModel", "FieldData", "NoEquilibriumError", "SceneTests"]
