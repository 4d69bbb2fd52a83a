"""Exact stress of uniform, incompressible sheets with Maxwell elements, along a history of stretches."""

from __future__ import annotations

import numpy as np

from .law import Maxwell


def maxwell_stress(branch: Maxwell, time: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """First Piola stress along x of a branch [Pa], shape (n,).

    The births of its chains M relax towards C^-1 (docs/visco.md): exact where that is linear between the times.

    Args:
        branch: The branch.
        time: Increasing times [s], shape (n,).
        x: Stretch along x, shape (n,).
        y: Stretch along y, shape (n,).
    """
    inverse = np.stack([x**-2, (x * y) ** 2])
    steps = np.diff(time) / branch.time
    kept = np.exp(-steps)
    lag = np.where(steps > 1e-12, -np.expm1(-steps) / np.maximum(steps, 1e-12), 1.0)
    behind = np.zeros((2, len(time)))
    behind[:, 0] = 1.0 - inverse[:, 0]
    for n, change in enumerate(np.diff(inverse).T):
        behind[:, n + 1] = kept[n] * behind[:, n] - lag[n] * change
    births = inverse + behind
    return np.asarray(branch.modulus * (x * births[0] - births[1] / (x**3 * y**2)))
