"""Uniform tests, without a simulation: uniaxial, equibiaxial and planar curves."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..device.checks import InputError, one_of
from ..materials import Material, energy_density, stability_notes
from .data import Curve, Test, require_stretches
from .experiment import Model, require_arguments

LOADINGS = ("uniaxial", "equibiaxial", "planar")
# Steps of differences: of the stretch, for the stress, and of a constant.
STRETCH_STEP, CONSTANT_STEP = 2e-4, 1e-4
NEWTON_STEPS, WIDTH_STEP = 60, 1e-3
# Stress of the wrong sign, over the largest of its test, up to which it is an offset or a residual strain.
OFFSET = 0.05
# Rows whose straight line leads back to the undeformed sheet, and the stretch there below which they may be strains:
# the published tests of tests/references have 0.62 or more; their strains above 1, as stretches, 0.55 or less.
FIRST_ROWS, LEAST_ORIGIN = 3, 0.6
# Distance from 1 of a stretch that is none.
UNDEFORMED = 1e-3


def nominal_stress(material: Material, loading: str, stretch: np.ndarray) -> np.ndarray:
    """First Piola stress along the pull in a uniform state [Pa], shape of `stretch`.

    It is the derivative of the energy density by the stretch, from fourth-order differences; the width of a uniaxial
    strip minimises the energy.

    Args:
        material: Any hyperelastic material of continua.
        loading: "uniaxial", "equibiaxial" (half of the derivative: two directions are pulled) or "planar".
        stretch: Stretch [-].

    Raises:
        InputError: for any other loading.
    """
    one_of("loading", loading, LOADINGS)
    stretch = np.asarray(stretch, dtype=np.float64)
    width = _width(material, stretch) if loading == "uniaxial" else np.ones_like(stretch)

    def energy(change: float) -> np.ndarray:
        first = stretch * (1.0 + change * STRETCH_STEP)
        return energy_density(material, first, first if loading == "equibiaxial" else width, "cpu")

    slope = 8.0 * (energy(1.0) - energy(-1.0)) - (energy(2.0) - energy(-2.0))
    return np.asarray(slope / (12.0 * STRETCH_STEP * stretch) * (0.5 if loading == "equibiaxial" else 1.0))


def _origin(test: Curve) -> float:
    """Stretch at which the straight line through the first rows of a pull has no stress; 1 if they do not tell."""
    first = np.argsort(test.at, kind="stable")[:FIRST_ROWS]
    at, values = test.at[first], test.values[first]
    if at[0] <= 1.0 or np.ptp(at) < 1e-6:
        return 1.0
    slope, stress = np.polyfit(at - at[0], values, 1)
    return float(at[0] - stress / slope) if slope > 0.0 else 1.0


def _width(material: Material, stretch: np.ndarray) -> np.ndarray:
    """Transverse stretch that minimises the energy, by Newton's method, starting from that of incompressible rubber."""
    width = stretch**-0.5
    for _ in range(NEWTON_STEPS):
        h = WIDTH_STEP * width
        least, low, here, high, most = (energy_density(material, stretch, width + s * h, "cpu") for s in range(-2, 3))
        slope = (8.0 * (high - low) - (most - least)) / (12.0 * h)
        curvature = (high - 2.0 * here + low) / h**2
        step = np.where(curvature > 0.0, -slope / np.where(curvature > 0.0, curvature, 1.0), 0.0)
        step = np.clip(step, -0.2 * width, 0.2 * width)
        width = width + step
        if np.abs(step).max() <= 1e-10:
            break
    return np.asarray(width)


@dataclass(frozen=True, eq=False)
class UniformTests:
    """Uniform tests of one material.

    Attributes:
        material: Function from constants to a material, such as the class `Yeoh` or `Ogden.of`.
        tests: Curves of nominal stress [Pa] against stretch, whose `control` is the loading: "uniaxial",
            "equibiaxial" or "planar".
        settings: Fixed constants.
    """

    material: Callable[..., Any]
    tests: Sequence[Test]
    settings: Mapping[str, float] = field(default_factory=dict)

    def start(self, name: str) -> float | None:
        """The value in `settings`, or None."""
        return self.settings.get(name)

    def notes(self, constants: Mapping[str, float]) -> list[str]:
        """Where the material loses its stability, and stresses of the wrong sign."""
        return [*stability_notes(self.made_of(constants)), *self.wrong_signs()]

    def wrong_signs(self) -> list[str]:
        """Notes on tests whose stresses do not vanish at a stretch of 1, as those of strains do not.

        That is a pull below 1 or a push above it, beyond small offsets and residual strains, a stress at 1, or stresses
        all above 1 that point to an undeformed sheet far below it.
        """
        said = []
        for number, test in enumerate(self.tests, 1):
            if isinstance(test, Curve):
                size = np.abs(test.values)
                slack = np.isclose(test.at, 1.0, atol=UNDEFORMED)
                wrong = (slack | (test.values * (test.at - 1.0) < 0.0)) & (size > OFFSET * size.max())
                if wrong.any():
                    first = int(np.argmax(wrong))
                    said.append(
                        f"{test.name or f'test {number}'}: a stress of {test.values[first]:g} Pa at a stretch of "
                        f"{test.at[first]:g} ({wrong.sum()} such rows): expected pull above a stretch of 1, push "
                        "(below 0) under it, none at 1; add 1 to strains"
                    )
                elif (origin := _origin(test)) < LEAST_ORIGIN:
                    said.append(
                        f"{test.name or f'test {number}'}: the first rows, from {test.at.min():g}, point to an "
                        f"undeformed sheet at {origin:.2g}: expected stretches, 1 there; add 1 to strains"
                    )
        return said

    def made_of(self, constants: Mapping[str, float]) -> Any:
        """What `material` makes of these constants, of which it may take some."""
        known = inspect.signature(self.material).parameters
        open_ended = any(parameter.kind is parameter.VAR_KEYWORD for parameter in known.values())
        mine = {name: value for name, value in constants.items() if open_ended or name in known}
        return self.material(**{**self.settings, **mine})

    def model(self, vary: Sequence[str], start: np.ndarray, device: str | None, precision: int | None) -> Model:
        """The exact stress."""
        known = inspect.signature(self.material).parameters
        open_ended = any(parameter.kind is parameter.VAR_KEYWORD for parameter in known.values())
        for name in vary:
            if name not in known and not open_ended:
                raise InputError(f"vary = {name!r}: expected a constant of the material: {', '.join(known)}")
        require_arguments(self.material, {*vary, *self.settings})
        curves = []
        for test in self.tests:
            if not isinstance(test, Curve):
                raise InputError("UniformTests: expected curves")
            one_of("control", test.control, LOADINGS)
            require_stretches(test.name or "a test", test.at)
            curves.append(test)
        return UniformModel(self.material, curves, list(vary), dict(self.settings), np.abs(start))


@dataclass(eq=False)
class UniformModel(Model):
    """Model of uniform tests; `sizes` as for `Model`."""

    material: Callable[..., Any]
    tests: list[Curve]
    vary: list[str]
    settings: dict[str, float]
    sizes: np.ndarray

    def evaluate(self, values: np.ndarray) -> list[np.ndarray]:
        """The stress of every test [Pa]."""
        material = self.material(**{**self.settings, **dict(zip(self.vary, values.tolist(), strict=True))})
        return [nominal_stress(material, test.control, test.at) for test in self.tests]

    def jacobian(self, values: np.ndarray) -> list[np.ndarray]:
        """Differences of fourth order by the constants; of second, to one side, where the material ends."""
        columns = []
        for k, value in enumerate(values):
            step = CONSTANT_STEP * max(abs(value), self.sizes[k])

            def at(n: int, k: int = k, step: float = step) -> list[np.ndarray]:
                return self.evaluate(values + n * step * np.eye(len(values))[k])

            try:
                weights = [(8.0, at(1)), (-8.0, at(-1)), (-1.0, at(2)), (1.0, at(-2))]
            except InputError:
                weights = [(-18.0, at(0)), (24.0, at(1)), (-6.0, at(2))]
            columns.append([sum(w * side[t] for w, side in weights) / (12.0 * step) for t in range(len(self.tests))])
        return [np.stack([column[t] for column in columns], axis=-1) for t in range(len(self.tests))]
