"""Stability of an equilibrium: lowest eigenvalues of the tangent, and the number of negative ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..device.fields import assign, doubles
from .level import Level
from .linear import LinearSolver

# Accuracy of eigenvalues over the largest, and vectors of the Krylov space besides those that are wanted.
ACCURACY, FURTHER = 1e-4, 12
# Sine of the angle between eigenvectors that count as one.
SAME = 1e-3


@dataclass(frozen=True)
class Stability:
    """The lowest eigenvalues of a tangent.

    Attributes:
        negative: Number of negative eigenvalues; 0 in a stable equilibrium.
        lowest: Lowest eigenvalues, in ascending order. With displacement-dependent loads those of K x = mu K0 x, where
            K0 is the tangent without these loads [-]; otherwise the one nearest to zero [N/m].
        mode: Eigenvector of the eigenvalue nearest to zero [m], shape (N, 3), with norm 1.
    """

    negative: int
    lowest: list[float]
    mode: np.ndarray


def stability(level: Level, solver: LinearSolver, number: int) -> Stability | None:
    """Stability at the last linearisation, from a number of lowest eigenvalues; None if they are not found.

    K0 is factorised; by Sylvester's law of inertia its pivots have the signs of its eigenvalues. With
    displacement-dependent loads, K has as many negative eigenvalues as K0^-1 K if K0 has none. Otherwise the sum of
    both numbers is even or odd like the number for K, which suffices to detect a change of sign.
    """
    factors = solver.factors
    negative = None if factors is None else factors.negative()
    free = np.flatnonzero(~level.held.ravel())
    if factors is None or negative is None or not len(free):
        return None

    def whole(x: np.ndarray) -> np.ndarray:
        vector = np.zeros(3 * level.points)
        vector[free] = x.ravel()
        return vector.reshape(-1, 3)

    def solved(x: np.ndarray) -> np.ndarray:
        return np.asarray(factors(whole(x)).ravel()[free])

    def solved_product(x: np.ndarray) -> np.ndarray:
        assign(level.vector, whole(x))
        level.run("product")
        return np.asarray(factors(doubles(level.image)).ravel()[free])

    if not level.following:
        inverse = extreme(solved, len(free), 1, "LM")
        return (
            None if inverse is None else Stability(negative, [1.0 / float(inverse[0][0])], whole(inverse[1][:, 0].real))
        )
    found = _lowest(solved_product, len(free), max(1, min(number, len(free) - 2)))
    if found is None:
        return None
    values, mode = found
    return Stability(negative + int((values < 0.0).sum()), values.tolist(), whole(mode))


def _lowest(
    product: Callable[[np.ndarray], np.ndarray], size: int, number: int
) -> tuple[np.ndarray, np.ndarray] | None:
    """Lowest eigenvalues in order, all negative ones among them, and the vector of the one nearest to zero; real parts.

    A Krylov space has one vector of a multiple eigenvalue. The others are those of the operator on the quotient by the
    space of the vectors found (Schur deflation), on which the deflated operator is 1.
    """
    from scipy.linalg import orth

    basis = np.zeros((size, 0))

    def deflated(x: np.ndarray) -> np.ndarray:
        inside = basis @ (basis.T @ x)
        image = product(x - inside)
        return np.asarray(image - basis @ (basis.T @ image) + inside)

    further: list[float] = []
    found = first = extreme(deflated, size, number, "SR")
    while found is not None and (found[0] < 0.0).any() and basis.shape[1] < size // 2:
        vectors, known = found[1][:, found[0] < 0.0], basis.shape[1]
        basis = orth(np.column_stack([basis, vectors.real, vectors.imag]), rcond=SAME)
        if basis.shape[1] == known:
            return None
        found = extreme(deflated, size, number, "SR")
        further += [] if found is None else found[0][found[0] < 0.0].tolist()
    if first is None or found is None:
        return None
    values, vectors = first
    return np.sort([*values, *further]), vectors[:, np.argmin(np.abs(values))].real


def extreme(
    product: Callable[[np.ndarray], np.ndarray], size: int, number: int, which: str
) -> tuple[np.ndarray, np.ndarray] | None:
    """Real parts of the largest ("LM") or lowest ("SR") eigenvalues, in order, and their vectors, one a column."""
    from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs

    if size < number + 2:
        # Fewer than ARPACK takes.
        values, vectors = np.linalg.eig(np.column_stack([product(unit) for unit in np.eye(size)]))
        chosen = np.argsort(values.real if which == "SR" else -np.abs(values))[:number]
        values, vectors = values[chosen], vectors[:, chosen]
        order = np.argsort(values.real)
        return values.real[order], vectors[:, order]
    operator = LinearOperator((size, size), matvec=product, dtype=np.float64)
    start = np.random.default_rng(0).normal(size=size)
    krylov = min(size, 2 * number + FURTHER)
    try:
        values, vectors = eigs(operator, k=number, which=which, v0=start, tol=ACCURACY, ncv=krylov)
    except ArpackNoConvergence:
        return None
    order = np.argsort(values.real)
    return values.real[order], vectors[:, order]
