"""Which points pass through triangles between two states: exact arithmetic, apart from the package."""

from fractions import Fraction

import numpy as np
from scipy.spatial import cKDTree

from warp_pd.geometry.triangulation import directed_edges, neighbours, undirected

# Relative error of a determinant in float64, on the safe side, below which its sign is found exactly.
DOUBT = 1e-13
HALVINGS = 60


def volume(a, b, c, p):
    """Six times the volume of the tetrahedron (a, b, c, p), by exact arithmetic on fractions."""
    u, v, w = ([x - y for x, y in zip(q, a, strict=True)] for q in (b, c, p))
    return (
        u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0]) + u[2] * (v[0] * w[1] - v[1] * w[0])
    )  # fmt: skip


def exact(points):
    return [[Fraction(float(x)) for x in point] for point in points]


def sign(value):
    return (value > 0) - (value < 0)


def signs(corners, points):
    """Signs of the volumes of tetrahedra, corners of shape (P, 3, 3), points (P, 3)."""
    u, v, w = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    found = np.einsum("ij,ij->i", u, np.cross(v, w))
    scale = np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1) * np.linalg.norm(w, axis=1)
    size = np.abs(corners).max() + np.abs(points).max()
    doubtful = np.abs(found) <= DOUBT * (scale + size**3)
    result = np.sign(found).astype(int)
    for k in np.flatnonzero(doubtful):
        result[k] = sign(volume(*exact(corners[k]), *exact(points[k : k + 1])))
    return result


def inside(corners, p):
    """Whether p, in the plane of a triangle, lies in it: exact up to its distance from the plane."""
    a, b, c = corners
    normal = cross(minus(b, a), minus(c, a))
    sides = [sign(dot(cross(minus(e, s), minus(p, s)), normal)) for s, e in ((a, b), (b, c), (c, a))]
    return all(side >= 0 for side in sides)


def minus(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def passing(before, after, triangles):
    """Pairs (point, triangle) whose point passes through the triangle on the straight way between two states.

    Args:
        before: Positions [m], shape (N, 3).
        after: The same, later: both in float64.
        triangles: Shape (F, 3).
    """
    corners = before[triangles], after[triangles]
    middle = 0.25 * sum(c.mean(axis=1) for c in corners) * 2.0
    reach = max(np.linalg.norm(c - middle[:, None], axis=2).max() for c in corners)
    step = np.linalg.norm(after - before, axis=1).max()
    near = cKDTree(0.5 * (before + after)).query_ball_point(middle, reach + step)
    face = np.repeat(np.arange(len(triangles)), [len(points) for points in near])
    point = np.concatenate([np.asarray(points, int) for points in near])
    other = (triangles[face] != point[:, None]).all(axis=1) & _boxes_meet(corners, before, after, face, point)
    face, point = face[other], point[other]
    if not len(face):
        return []
    first, last = signs(corners[0][face], before[point]), signs(corners[1][face], after[point])
    found = []
    for k in np.flatnonzero(first * last <= 0):
        ends = [exact([*state[triangles[face[k]]], state[point[k]]]) for state in (before, after)]
        low, high = Fraction(0), Fraction(1)
        for _ in range(HALVINGS):
            half = (low + high) / 2
            if sign(volume(*between(*ends, half))) * first[k] > 0:
                low = half
            else:
                high = half
            if high - low < Fraction(1, 2**HALVINGS):
                break
        *triangle, p = between(*ends, high)
        if inside(triangle, p):
            found.append((int(point[k]), int(face[k])))
    return found


def _boxes_meet(corners, before, after, face, point):
    """Whether the boxes around the ways of a triangle and of a point meet."""
    room = 1e-12 * np.abs(before).max()
    low, high = (f([f(c, axis=1) for c in corners], axis=0)[face] for f in (np.min, np.max))
    ends = np.stack([before[point], after[point]])
    return ((low <= ends.max(axis=0) + room) & (ends.min(axis=0) <= high + room)).all(axis=1)


def between(start, end, share):
    """Places on the way, exact."""
    return [[x + share * (y - x) for x, y in zip(a, b, strict=True)] for a, b in zip(start, end, strict=True)]


def crossing(place, triangles):
    """Pairs (side, triangle) that cross in a state, but not near neighbours, by exact arithmetic.

    Near neighbours: a triangle at an end of the side shares a corner with one that shares a side with the triangle.
    A side and a triangle in one coordinate plane do not count.

    Args:
        place: Positions [m], shape (N, 3), in float64.
        triangles: Shape (F, 3).
    """
    edges = directed_edges(triangles)
    number = undirected(edges)
    first = np.unique(number, return_index=True)[1]
    corners_at = [set(triangles[(triangles == i).any(axis=1)].flat) for i in range(len(place))]
    one, other = neighbours(triangles)[0].T
    around = [set(corner) for corner in triangles.tolist()]
    for f, g in [*zip(one, other, strict=True), *zip(other, one, strict=True)]:
        around[f] |= set(triangles[g].tolist())
    sides = edges[first]
    centres, middles = place[triangles].mean(axis=1), place[sides].mean(axis=1)
    reach = np.linalg.norm(place[triangles] - centres[:, None], axis=2).max()
    reach += np.linalg.norm(place[sides] - middles[:, None], axis=2).max()
    near = cKDTree(middles).query_ball_point(centres, reach)
    face = np.repeat(np.arange(len(triangles)), [len(found) for found in near])
    side = np.concatenate([np.asarray(found, int) for found in near])
    corners, ends = place[triangles[face]], place[sides[side]]
    meet = ((corners.min(axis=1) <= ends.max(axis=1)) & (ends.min(axis=1) <= corners.max(axis=1))).all(axis=1)
    meet &= (np.ptp(corners, axis=1) + np.ptp(ends, axis=1) > 0.0).all(axis=1)
    meet[meet] = [
        not (corners_at[sides[s, 0]] | corners_at[sides[s, 1]]) & around[f]
        for s, f in zip(side[meet], face[meet], strict=True)
    ]
    face, side, corners, ends = face[meet], side[meet], corners[meet], ends[meet]
    if not len(face):
        return []
    through = signs(corners, ends[:, 0]) * signs(corners, ends[:, 1]) <= 0
    turns = [signs(np.stack([ends[:, 0], corners[:, k], corners[:, k - 2]], axis=1), ends[:, 1]) for k in range(3)]
    through &= (np.min(turns, axis=0) >= 0) | (np.max(turns, axis=0) <= 0)
    return list(zip(side[through].tolist(), face[through].tolist(), strict=True))
