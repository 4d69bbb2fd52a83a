"""Interfaces of a fit: tests, and their results as a function of the constants."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from ..device.checks import InputError
from .data import Test


class Model(Protocol):
    """Simulated results of tests as a function of the constants (interface).

    Attributes:
        sizes: Sizes of the constants, shape (P,), for the steps of differences where a constant is smaller.
    """

    sizes: np.ndarray

    def evaluate(self, values: np.ndarray) -> list[np.ndarray]:
        """Simulated results, one array per test, shaped like its data.

        Raises:
            NoEquilibriumError: if the solver finds no equilibrium.
            InputError: if the scene refuses the values.
        """
        ...

    def jacobian(self, values: np.ndarray) -> list[np.ndarray]:
        """Derivatives by the constants, one array per test, with the constants on the last axis."""
        ...

    def take_sizes(self, sizes: np.ndarray) -> None:
        """Replace the sizes; derivatives that were found with others are found again."""
        self.sizes = sizes


class Experiment(Protocol):
    """Tests and their simulation (interface)."""

    @property
    def tests(self) -> Sequence[Test]:
        """The tests."""
        ...

    def model(self, vary: Sequence[str], start: np.ndarray, device: str | None, precision: int | None) -> Model:
        """Create the model of the tests."""
        ...

    def start(self, name: str) -> float | None:
        """Initial value of a constant, or None if it has none."""
        ...

    def notes(self, constants: Mapping[str, float]) -> list[str]:
        """Notes on the fitted constants, of which the experiment may take some, one line each."""
        ...


def require_arguments(made_by: Callable[..., Any], given: Collection[str]) -> None:
    """Check that a scene or material gets all arguments without a default."""
    for name, parameter in inspect.signature(made_by).parameters.items():
        optional = parameter.default is not parameter.empty or parameter.kind in (
            parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD,
        )  # fmt: skip
        if not optional and name not in given:
            raise InputError(
                f"{name} has no default: expected a value in settings (--set {name}=VALUE) or its name in vary"
            )
