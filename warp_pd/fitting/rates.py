"""Uniform tests at constant rates, without a simulation: constants of Prony terms and Maxwell elements."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import cast

import numpy as np

from ..device.checks import InputError, not_negative
from ..materials import Material
from ..papers.analytic_response import prony_stress
from ..visco.law import Visco
from ..visco.uniform import maxwell_stress
from .experiment import Model
from .uniform import UniformModel, UniformTests, nominal_stress

# Steps of a ramp in which the relaxing stresses are summed up.
STEPS = 800


def rate_stress(law: Visco, loading: str, rate: float, stretch: np.ndarray) -> np.ndarray:
    """First Piola stress along the pull of a sheet that is stretched at a constant rate [Pa], shape of `stretch`.

    Args:
        law: Material with Prony terms or Maxwell elements; the width of a uniaxial sheet is that of an incompressible
            one.
        loading: "uniaxial", "equibiaxial" or "planar".
        rate: |d stretch / dt| [1/s]; 0 is a test in which everything has relaxed.
        stretch: Stretches above 1 or below 1 [-], shape (n,).

    Raises:
        InputError: for stretches on both sides of 1, or another loading.
    """
    total = nominal_stress(law.material, loading, stretch)
    if rate == 0.0:
        return total
    if np.min(stretch) < 1.0 < np.max(stretch):
        raise InputError(
            f"stretch: expected all above 1 or all below 1 in a ramp, got {min(stretch):g}, {max(stretch):g}"
        )
    far = stretch[np.argmax(np.abs(stretch - 1.0))]
    # Times must rise: a ramp to 1 has a length.
    path = np.unique(np.abs(np.concatenate([np.linspace(0.0, max(abs(far - 1.0), 1e-9), STEPS), stretch - 1.0])))
    x = 1.0 + np.sign(far - 1.0) * path
    y = {"uniaxial": x**-0.5, "equibiaxial": x, "planar": np.ones_like(x)}[loading]
    relaxing = prony_stress(law.prony, path / rate, x, y)
    for branch in law.branches:
        relaxing = relaxing + maxwell_stress(branch, path / rate, x, y)
    return np.asarray(total + np.interp(np.abs(stretch - 1.0), path, relaxing))


@dataclass(frozen=True, eq=False)
class RateTests(UniformTests):
    """Uniform tests of one rubber at several rates.

    `material` is a function from constants to a `Visco` law: its material, Prony terms and Maxwell elements.

    Attributes:
        rates: |d stretch / dt| of each test [1/s]; 0 for one in which everything has relaxed.
    """

    rates: Sequence[float] = field(default=())

    def __post_init__(self) -> None:
        if len(self.rates) != len(self.tests):
            raise InputError(f"rates: expected one for each of {len(self.tests)} tests, got {len(self.rates)}")
        for rate in self.rates:
            not_negative("rates", rate)

    def made_of(self, constants: Mapping[str, float]) -> Material:
        """The material of the law with these constants."""
        return cast(Visco, super().made_of(constants)).material

    def model(self, vary: Sequence[str], start: np.ndarray, device: str | None, precision: int | None) -> Model:
        """The exact stress along the ramps."""
        plain = cast(UniformModel, super().model(vary, start, device, precision))
        return RateModel(plain.material, plain.tests, plain.vary, plain.settings, plain.sizes, tuple(self.rates))


@dataclass(eq=False)
class RateModel(UniformModel):
    """Model of tests at constant rates; `sizes` as for `Model`."""

    rates: tuple[float, ...] = ()

    def evaluate(self, values: np.ndarray) -> list[np.ndarray]:
        """The stress of every test [Pa]."""
        made_by = cast(Callable[..., Visco], self.material)
        law = made_by(**{**self.settings, **dict(zip(self.vary, values.tolist(), strict=True))})
        return [
            rate_stress(law, test.control, rate, test.at) for test, rate in zip(self.tests, self.rates, strict=True)
        ]
