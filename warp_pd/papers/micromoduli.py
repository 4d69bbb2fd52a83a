"""Micro-moduli of a bond-based law on a rectangle, corrected for equilibrium of uniform strain up to the edges.

A bond of direction n carries W_ij + W_ji, with the energy W_ij s^2 / 2 of each of its points, s = n.eps.n. The internal
force on point i under a uniform strain eps is M_i : eps with

    M_i = sum_j (W_ij + W_ji) / |X_ij|  n (x) n (x) n,

and the traction of the stress C : eps balances it if M_i = -C b_i, where b_i is the edge vector of the point: the
length of its edge times the outward normal. C is that of plane stress with Poisson's ratio 1/3, whose components are
symmetric in all indices, like M_i. The published micro-moduli c_i = g E / sum_j |X_ij| V_j balance it only in the
interior, and there with the C of the lattice, which is not isotropic. The corrected ones balance it everywhere, stay
positive, and change as little as possible, like the area weights (families/weights.py). If the outer points are inside
the edge by a fraction o of the spacing, b_i is distributed to the first and second layer by 1 + o and -o, so that it
acts on the edge. Positive weights then balance horizons of at least 3 spacings to round-off, and 1.5 and 2.015 to a
tenth of the traction; if the outer points are on the edges, all of these are balanced.

The published formula already contains the energy-based surface correction for uniform isotropic strain (Le and Bobaru,
Comput. Mech. 61, 2018, "energy method"). That correction does not balance the force.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..families.lattice import clipped_index
from ..families.weights import FLOOR, closest_balanced

# Components of a symmetric tensor of third order.
COMPONENTS = ((0, 0, 0), (0, 0, 1), (0, 1, 1), (1, 1, 1))


def balanced_micromoduli(
    published: np.ndarray,
    row_of_point: np.ndarray,
    areas: np.ndarray,
    *,
    offsets: np.ndarray,
    reverse: np.ndarray,
    dx: float,
    dy: float,
    stiffness: float,
) -> np.ndarray:
    """Corrected weights W_ij divided by the area of a cell, by row, shape (R, n).

    Args:
        published: Starting weights divided by the area of a cell, zero without a bond, shape (R, n).
        row_of_point: Row of each point, int, shape (rows, columns).
        areas: Areas of the points divided by that of a cell, shape (rows, columns).
        offsets: Lattice steps to each family member, int, shape (n, 2).
        reverse: Member index of the reverse bond, shape (n,).
        dx: Spacing along x [m].
        dy: Spacing along y [m].
        stiffness: g of the published formula [-].
    """
    from scipy import sparse

    exists = published > 0.0
    unknown = np.where(exists, np.cumsum(exists).reshape(exists.shape) - 1, -1)
    steps = offsets * (1.0, dy / dx)
    length = np.linalg.norm(steps, axis=1)
    n = steps / length[:, None]
    pull = np.stack([n[:, a] * n[:, b] * n[:, c] / length for a, b, c in COMPONENTS])
    edge_vectors = _edge_vectors(areas, dx / dy)
    tensor = stiffness / 16.0 * np.array([_isotropic(*component) for component in COMPONENTS])
    blocks: list[sparse.csr_matrix] = []
    goal: list[np.ndarray] = []
    for row, column in _places(row_of_point.shape, 2 * int(np.abs(offsets).max()) + 2):
        own = row_of_point[row, column]
        members = np.flatnonzero(exists[own])
        other = row_of_point[row + offsets[members, 1], column + offsets[members, 0]]
        bonds = np.concatenate([unknown[own, members], unknown[other, reverse[members]]])
        equation, bond = np.broadcast_arrays(np.arange(len(COMPONENTS))[:, None], bonds)
        values = np.tile(pull[:, members], 2)
        shape = (len(COMPONENTS), int(exists.sum()))
        blocks.append(sparse.csr_matrix((values.ravel(), (equation.ravel(), bond.ravel())), shape=shape))
        goal.append(-tensor @ edge_vectors[row, column])
    matrix, start = sparse.vstack(blocks, format="csr"), published[exists]
    corrected = np.zeros_like(published)
    corrected[exists] = start * closest_balanced(matrix, start, np.concatenate(goal) - matrix @ start, FLOOR)
    return corrected


def _places(shape: tuple[int, int], depth: int) -> Iterator[tuple[int, int]]:
    """One representative (row, column) for each set of points with equal distances from the edges, up to a depth."""
    rows, columns = (np.unique(clipped_index(length, depth), return_index=True)[1] for length in shape)
    yield from ((int(row), int(column)) for row in rows for column in columns)


def _edge_vectors(areas: np.ndarray, flatness: float) -> np.ndarray:
    """b_i divided by dy, shape (rows, columns, 2); `flatness` is dx / dy."""
    rows, columns = areas.shape
    x, across_x = _edge_forces(areas[rows // 2])
    y, across_y = _edge_forces(areas[:, columns // 2])
    return np.stack([np.outer(across_y, x), flatness * np.outer(y, across_x)], axis=-1)


def _edge_forces(areas: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force of a unit traction on each point of a line across two edges, and its width, both in spacings."""
    inside = float(areas[0] / areas[len(areas) // 2]) - 0.5
    force, width = np.zeros(len(areas)), np.ones(len(areas))
    force[[0, 1, -2, -1]] = -1.0 - inside, inside, -inside, 1.0 + inside
    width[[0, -1]] = 0.5 + inside
    return force, width


def _isotropic(a: int, b: int, c: int) -> np.ndarray:
    """Components abcd, d = 0, 1, of the isotropic tensor that is symmetric in all indices."""
    return np.array([(a == b) * (c == d) + (a == c) * (b == d) + (b == c) * (a == d) for d in (0, 1)], dtype=float)
