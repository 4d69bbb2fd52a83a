"""Direct solution of sparse symmetric systems on the host."""

from __future__ import annotations

from typing import Any

import numpy as np


class Factors:
    """A factorisation that solves K x = b on arrays of shape (N, 3)."""

    def __init__(self, factors: Any, free: np.ndarray) -> None:
        self._factors, self._free = factors, free

    def __call__(self, b: np.ndarray) -> np.ndarray:
        """Return x for b, both of shape (N, 3)."""
        x = np.zeros(self._free.size)
        x[self._free] = self._factors.solve(np.ascontiguousarray(b.ravel()[self._free], dtype=np.float64))
        return x.reshape(b.shape)

    def negative(self) -> int | None:
        """Number of negative eigenvalues of K, which equals that of negative pivots (Sylvester's law of inertia)."""
        if (self._factors.perm_r != self._factors.perm_c).any():
            return None
        return int((self._factors.U.diagonal() < 0.0).sum())


def factorised(matrix: Any, free: np.ndarray, added: np.ndarray | None = None) -> Factors | None:
    """Factorise K and return a solver of K x = b on arrays of shape (N, 3); None if K is singular.

    `matrix` is K of the components `free` [N/m]; others of x are zero. `added` are blocks on its diagonal, (N, 3, 3).
    """
    from scipy.sparse import bsr_matrix
    from scipy.sparse.linalg import splu

    if added is not None:
        points = np.arange(len(added) + 1)
        matrix = matrix + bsr_matrix((added, points[:-1], points)).tocsr()[free][:, free].tocsc()
    try:
        factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:
        return None
    return Factors(factors, free)
