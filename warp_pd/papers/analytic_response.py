"""Exact response of a homogeneous visco-hyperelastic sheet: reference for scenes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..device.checks import InputError
from ..materials import Yeoh
from ..visco.law import Prony


def second_stress(c10: float, c20: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Second Piola stress along x [Pa] of the incompressible Yeoh sheet at stretches x, y, in plane stress."""
    third = 1.0 / (x * y)
    return np.asarray(2.0 * (c10 + 2.0 * c20 * (x**2 + y**2 + third**2 - 3.0)) * (1.0 - (third / x) ** 2))


def nominal_stress(
    material: Yeoh, prony: Sequence[Prony], time: np.ndarray, x: np.ndarray, y: np.ndarray
) -> np.ndarray:
    """First Piola stress along x [Pa] of the law Visco after a history of stretches, shape (n,).

    Relaxing stresses follow from their convolution integral, which is exact if they change linearly between the times.

    Args:
        material: Yeoh with c10 and c20.
        prony: Relaxing terms.
        time: Increasing times [s], shape (n,).
        x: Stretch along x, shape (n,); it may jump at the first time.
        y: Stretch along y, shape (n,).
    """
    return np.asarray(x * second_stress(material.c10, material.c20, x, y) + prony_stress(prony, time, x, y))


def prony_stress(prony: Sequence[Prony], time: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The part of the relaxing terms in `nominal_stress` [Pa], shape (n,)."""
    _require_rising(time)
    third = 1.0 / (x * y)
    total = np.zeros_like(x)
    change = np.sqrt(np.diff(x**2) ** 2 + np.diff(y**2) ** 2 + np.diff(third**2) ** 2)
    for term in prony:
        total = total + _relaxing(term, time, change, second_stress(term.c10, term.c20, x, y))
    return np.asarray(x * total)


def published_stress(material: Yeoh, prony: Sequence[Prony], time: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """As `nominal_stress`, for the law ViscoBondBased under equibiaxial stretch [Pa], shape (n,) (VE eqs. 46 to 55)."""
    _require_rising(time)
    excess = 2.0 * stretch**2 - 2.0
    total = (material.c10 + 2.0 * material.c20 * excess) * stretch
    middle = 0.5 * (stretch[1:] + stretch[:-1])
    change = np.abs(np.diff(stretch)) * np.sqrt(4.0 * middle**2 + 2.0 / middle**4)
    for term in prony:
        total = total + (term.c10 + 2.0 * term.c20 * excess) * _relaxing(term, time, change, stretch - 1.0)
    return np.asarray(2.0 * total)


def _relaxing(term: Prony, time: np.ndarray, change: np.ndarray, driven: np.ndarray) -> np.ndarray:
    """The integral of exp(-(t - t') / theta) d driven, with |dC| of each interval for theta."""
    _, _, relaxation, exponent = term.constants
    exponents = np.diff(time) / relaxation * (change / np.diff(time)) ** exponent
    kept = np.where(exponents > 1e-12, -np.expm1(-exponents) / np.maximum(exponents, 1e-12), 1.0)
    decay, gain = np.exp(-exponents), kept * np.diff(driven)
    result = np.empty_like(driven)
    result[0] = driven[0]
    for n in range(len(exponents)):
        result[n + 1] = decay[n] * result[n] + gain[n]
    return result


def _require_rising(time: np.ndarray) -> None:
    if len(time) < 2 or not (np.diff(time) > 0.0).all():
        raise InputError(f"time: expected at least two increasing values, got {len(time)}")
