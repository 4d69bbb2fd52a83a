"""The deformation gradient of every complete family of a flat sheet as sparse matrices."""

from __future__ import annotations

from typing import Any

import numpy as np

from .tables import Families, inverse_shape


def point_gradient(families: Families) -> tuple[Any, Any]:
    """Matrices (B1, B2) [1/m], shape (N, N): F e_a = e_a + B_a u, with F of the complete family of each point.

    Rows of families that determine no F are zero.
    """
    from scipy import sparse

    bonds = families.bonds if families.bonds.ndim == 3 else families.bonds[None]
    c = families.member_coefficients
    shape = np.stack([(c * bonds[..., p] * bonds[..., q]).sum(axis=1) for p, q in ((0, 0), (0, 1), (1, 1))], -1)
    inverse, _ = inverse_shape(shape)
    moments = c[..., None] * bonds
    rows = []
    for first, second in ((inverse[:, 0], inverse[:, 1]), (inverse[:, 1], inverse[:, 2])):
        rows.append((first[:, None] * moments[..., 0] + second[:, None] * moments[..., 1]) / families.horizon)
    point, member = np.nonzero(families.rows_of_points(families.exists))
    heads, n = families.heads(point, member), families.points
    matrices = []
    for row in rows:
        values = families.rows_of_points(row)[point, member]
        entries = np.concatenate([values, -values]), (np.tile(point, 2), np.concatenate([heads, point]))
        matrices.append(sparse.csr_matrix(entries, shape=(n, n)))
    return matrices[0], matrices[1]


def surface_vector_matrix(gradient: tuple[Any, Any], displacement: np.ndarray, factors: np.ndarray) -> Any:
    """Derivative of factor_i (F e1 x F e2)_i by the displacement [m], shape (N, 3): sparse, shape (3 N, 3 N).

    `gradient` is a result of `point_gradient`, `factors` has shape (N,).
    """
    from scipy import sparse

    first, second = gradient
    F1, F2 = first @ displacement + [1.0, 0.0, 0.0], second @ displacement + [0.0, 1.0, 0.0]
    # d(F1 x F2) = -[F2]x dF1 + [F1]x dF2, with [a]x b = a x b.
    one = sparse.identity(3)
    return -_crosses(factors[:, None] * F2) @ sparse.kron(first, one) + _crosses(factors[:, None] * F1) @ sparse.kron(
        second, one
    )


def _crosses(vectors: np.ndarray) -> Any:
    """Block diagonal matrix of the cross products a x, for vectors a of shape (N, 3)."""
    from scipy import sparse

    n = len(vectors)
    blocks = np.zeros((n, 3, 3))
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        blocks[:, b, c], blocks[:, c, b] = -vectors[:, a], vectors[:, a]
    return sparse.bsr_matrix((blocks, np.arange(n), np.arange(n + 1)), shape=(3 * n, 3 * n)).tocsr()
