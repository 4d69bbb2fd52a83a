"""Secants of earlier Newton steps, which improve the direction from a tangent that was kept."""

from __future__ import annotations

import numpy as np

# Secants that are remembered, and the smallest singular value over the largest that counts.
REMEMBERED, INDEPENDENT = 4, 1e-6


class Secants:
    """Pairs of a step s and w = K^-1 (r before - r after), which would be s with the tangent along it.

    The direction K^-1 r gets sum g (s - w), with g from the least squares of K^-1 r - sum g w (Anderson, J. ACM 12,
    1965; Fang and Saad, Numer. Linear Algebra Appl. 16, 2009). Pairs stay from one time step to the next, as the
    tangent does.
    """

    def __init__(self) -> None:
        self._pairs: list[tuple[np.ndarray, np.ndarray]] = []
        self._last: tuple[np.ndarray, np.ndarray] | None = None

    def clear(self) -> None:
        """Forget all, for a new tangent."""
        self._pairs, self._last = [], None

    def begin(self) -> None:
        """Let the next direction follow no earlier one."""
        self._last = None

    def improved(self, direction: np.ndarray) -> np.ndarray:
        """The direction that takes the place of K^-1 r, shape (N, 3), for a full step."""
        if self._last is not None:
            step, before = self._last
            self._pairs = [*self._pairs, (step, before - direction)][-REMEMBERED:]
        better = direction
        if self._pairs:
            w = np.stack([change for _, change in self._pairs])
            gram = np.einsum("aic,bic->ab", w, w)
            weights = np.linalg.lstsq(gram, np.einsum("aic,ic->a", w, direction), rcond=INDEPENDENT**2)[0]
            better = direction + sum(g * (s - c) for g, (s, c) in zip(weights, self._pairs, strict=True))
        self._last = better, direction
        return better
