"""Direct solution of sparse symmetric systems on the host."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..interfaces import Solve


def factorised(matrix: Any, free: np.ndarray) -> Solve | None:
    """Solver of K x = b on arrays of shape (N, 3); None if K is singular.

    Args:
        matrix: K of the free components [N/m], symmetric, in compressed columns.
        free: Which components are free, shape (3 N,); the others of x are zero.
    """
    from scipy.sparse.linalg import splu

    try:
        factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:
        return None

    def solve(b: np.ndarray) -> np.ndarray:
        x = np.zeros(free.size)
        x[free] = factors.solve(np.ascontiguousarray(b.ravel()[free], dtype=np.float64))
        return x.reshape(b.shape)

    return solve
