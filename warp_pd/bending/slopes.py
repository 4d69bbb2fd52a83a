"""Slopes of a sheet, each by the least-squares fit of a quadratic to the points around it; see docs/bending.md."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..geometry.sheet import Sheet

# Number of nearest points to which a quadratic with five coefficients is fitted, and factor on the distance of the last
# one up to which further points count as equally near.
NEAREST, SAME = 8, 1.01
# Added to the diagonal: a coefficient that no point determines is then zero, as in a sheet of two rows.
LEAST = 1e-10
CHUNK = 50_000


@dataclass(frozen=True, eq=False)
class Slopes:
    """Points to which the slope of each point is fitted, with weights: G_c = sum_j w_cj (u_j - u_c).

    Attributes:
        point: The point c of each entry, ascending, (E,).
        other: Its point j, (E,).
        weights: w_cj [1/m] in the plane of c, (E, 2).
        planes: Plane of each point, columns are two unit vectors, (N, 3, 2); one for all of a flat sheet, (1, 3, 2).
    """

    point: np.ndarray
    other: np.ndarray
    weights: np.ndarray
    planes: np.ndarray


def planes_of(sheet: Sheet) -> np.ndarray:
    """Plane of each point, see `Slopes.planes`."""
    if sheet.frames is None:
        return np.eye(3)[None, :, :2]
    normals = sheet.normals
    other = np.where(np.abs(normals[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(other, normals)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(normals, first)], axis=2)


def fitted_slopes(sheet: Sheet, clamped: np.ndarray, level: np.ndarray) -> Slopes:
    """Fit the slopes of a sheet, through its triangles, so that none reaches across a cut.

    `clamped` is the mask of points that are held in all components, (N,). A triangle of three of them is a clamp: its
    corners have its slope. `level` is the mask of points whose slope is held at zero, (N,): they have no entries.
    """
    from scipy import sparse

    n, planes, triangles = sheet.size, planes_of(sheet), sheet.triangles
    held = clamped[triangles].all(axis=1)
    in_clamp = np.zeros(n, bool)
    in_clamp[triangles[held]] = True
    adjacent = _adjacent(triangles, n)
    near = (adjacent @ adjacent + adjacent).tocsr()
    clamp = _adjacent(triangles[held], n)
    found = []
    for begin in range(0, n, CHUNK):
        every = np.arange(begin, min(begin + CHUNK, n))
        for points, graph, quadratic in (
            (every[~in_clamp[every] & ~level[every]], near, True),
            (every[in_clamp[every] & ~level[every]], clamp, False),
        ):  # fmt: skip
            if len(points):
                found.append(_fit(sheet.positions, planes, points, sparse.csr_matrix(graph[points]), quadratic))
    point, other, weights = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.argsort(point, kind="stable")
    return Slopes(point[order], other[order], weights[order], planes)


def _adjacent(triangles: np.ndarray, n: int) -> Any:
    """Points that share a side of a triangle, a sparse matrix."""
    from scipy import sparse

    ends = np.concatenate([triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0), (1, 0), (2, 1), (0, 2))])
    return sparse.csr_matrix((np.ones(len(ends), np.float32), (ends[:, 0], ends[:, 1])), shape=(n, n))


def _fit(
    positions: np.ndarray, planes: np.ndarray, points: np.ndarray, graph: Any, quadratic: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Entries of some points, see `Slopes`; `graph` has a row for each of them."""
    counts = np.diff(graph.indptr)
    row = np.repeat(np.arange(len(points)), counts)
    other = graph.indices
    kept = other != points[row]
    row, other = row[kept], other[kept]
    away = np.einsum("ec,ecb->eb", positions[other] - positions[points[row]], planes[points[row] % len(planes)])
    distance = np.linalg.norm(away, axis=1)
    order = np.argsort(row + distance / (2.0 * distance.max()), kind="stable")
    row, other, away, distance = row[order], other[order], away[order], distance[order]
    begins = np.searchsorted(row, np.arange(len(points) + 1))
    if quadratic:
        last = np.minimum(begins[:-1] + NEAREST, begins[1:]) - 1
        kept = distance <= SAME * distance[last][row]
        row, other, away, distance = row[kept], other[kept], away[kept], distance[kept]
        begins = np.searchsorted(row, np.arange(len(points) + 1))
    scale = np.minimum.reduceat(distance, begins[:-1])
    x, y = (away / scale[row, None]).T
    terms = [x, y, 0.5 * x * x, 0.5 * y * y, x * y] if quadratic else [x, y]
    # Nearer points count more: a fit with equal weights is farther from the second difference.
    weight = (scale[row] / distance) ** 4
    normal = np.zeros((len(points), len(terms), len(terms)))
    for i, first in enumerate(terms):
        for j, second in enumerate(terms[: i + 1]):
            normal[:, i, j] = normal[:, j, i] = np.add.reduceat(weight * first * second, begins[:-1])
    normal += LEAST * np.diag([0.0, 0.0, 1.0, 1.0, 1.0][: len(terms)])
    solved = np.linalg.inv(normal)
    weights = np.stack([sum(solved[row, b, t] * term for t, term in enumerate(terms)) for b in range(2)], axis=1)
    weights *= (weight / scale[row])[:, None]
    return points[row], other, weights
