"""Linear solvers on the host: conjugate gradients, GMRES (Saad and Schultz, SIAM J. Sci. Stat. Comput. 7, 1986).

GMRES is preconditioned from the left: the preconditioned residual measures the error of the solution, with soft motions
in it, which the residual hardly sees. Scalar products are not those of BLAS. Waking its threads for vectors of this
length takes longer than all products of stiffness on a GPU, a millisecond each on a host of 32 cores; on a CPU they
spin on the cores that the kernels need, and their number changes the last bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

Map = Callable[[np.ndarray], np.ndarray]
# A further cycle reduces its residual to this fraction of what is asked: the preconditioned one is not the same.
CLOSER = 0.5


def conjugate_gradients(
    product: Map, precondition: Map, right_side: np.ndarray, accuracy: float, most: int
) -> tuple[np.ndarray, bool]:
    """Solve K x = b with a symmetric K in `most` iterations; arguments and result as those of `gmres`."""
    solution, residual = np.zeros(right_side.size), np.array(right_side, dtype=np.float64)
    direction, before, least = np.zeros(right_side.size), math.inf, accuracy * norm(residual)
    for _ in range(most):
        if norm(residual) <= least:
            return solution, True
        smoothed = precondition(residual)
        now = dot(residual, smoothed)
        direction = smoothed + now / before * direction
        image = product(direction)
        curvature = dot(direction, image)
        if now == 0.0 or curvature == 0.0 or not math.isfinite(now * curvature):
            return solution, False
        solution += now / curvature * direction
        residual -= now / curvature * image
        before = now
    return solution, norm(residual) <= least


def gmres(
    product: Map, precondition: Map, right_side: np.ndarray, accuracy: float, restart: int, cycles: int
) -> tuple[np.ndarray, bool]:
    """Solve K x = b; return x, and whether its residual is at most `accuracy` times that of x = 0.

    With one cycle that is said of the preconditioned residual; otherwise the residual itself decides.

    Args:
        product: K x for x of shape (n,).
        precondition: An approximation of K^-1 r.
        right_side: b, shape (n,).
        accuracy: Residual over the norm of b.
        restart: Iterations of a cycle, which keeps as many vectors.
        cycles: Number of cycles at most.
    """
    solution, residual = np.zeros(right_side.size), np.asarray(right_side, dtype=np.float64)
    fraction, least = accuracy, accuracy * norm(residual)
    for _ in range(cycles):
        change, reached = cycle(lambda v: precondition(product(v)), precondition(residual), fraction, restart)
        solution += change
        if cycles == 1:
            return solution, reached
        residual = right_side - product(solution)
        left = norm(residual)
        if left <= least:
            return solution, True
        if not math.isfinite(left):
            break
        fraction = CLOSER * least / left
    return solution, False


def cycle(product: Map, side: np.ndarray, fraction: float, most: int) -> tuple[np.ndarray, bool]:
    """Change of x by up to `most` iterations, and whether at most a fraction of the preconditioned residual is left."""
    left = norm(side)
    goal = fraction * left
    if not left > 0.0:
        return np.zeros(side.size), left == 0.0
    basis, rest = [side / left], [left]
    rotations: list[tuple[float, float]] = []
    columns: list[list[float]] = []
    for _ in range(most):
        image = product(basis[-1])
        column: list[float] = []
        for vector in basis:
            column.append(dot(vector, image))
            image = image - column[-1] * vector
        length = norm(image)
        for i, (cosine, sine) in enumerate(rotations):
            above, below = column[i], column[i + 1]
            column[i], column[i + 1] = cosine * above + sine * below, cosine * below - sine * above
        diagonal = math.hypot(column[-1], length)
        if not diagonal > 0.0:
            break
        cosine, sine = column[-1] / diagonal, length / diagonal
        column[-1] = diagonal
        rotations.append((cosine, sine))
        columns.append(column)
        rest[-1:] = [cosine * rest[-1], -sine * rest[-1]]
        left = abs(rest[-1])
        if left <= goal:
            break
        basis.append(image / length)
    change = np.zeros(side.size)
    for weight, vector in zip(weights(columns, rest), basis, strict=False):
        change += weight * vector
    return change, left <= goal


def weights(columns: list[list[float]], rest: list[float]) -> np.ndarray:
    """Solution of a triangular system whose columns end at the diagonal."""
    triangle = np.zeros((len(columns), len(columns)))
    for k, column in enumerate(columns):
        triangle[: k + 1, k] = column
    return np.asarray(np.linalg.solve(triangle, np.array(rest[: len(columns)])))


def dot(a: np.ndarray, b: np.ndarray) -> float:
    """Scalar product of two vectors."""
    return float(np.einsum("i,i->", a, b))


def norm(a: np.ndarray) -> float:
    """Euclidean norm of a vector."""
    return math.sqrt(dot(a, a))
