"""Lattices, clouds and their families, and a slow independent balance of weights, for the tests of weights."""

import numpy as np
from scipy.spatial import cKDTree

from warp_pd.families.weights import edge_vectors


def stencil(horizon, step=(1.0, 1.0)):
    """Offsets, influences and intersections of a lattice's family; the horizon is in units of `step`."""
    reach = int(horizon / min(step)) + 1
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    offsets = np.column_stack([x.ravel(), y.ravel()])
    length = np.linalg.norm(offsets * step, axis=1)
    inside = (length > 0) & (length <= horizon * (1 + 1e-9))
    offsets, length = offsets[inside], length[inside]
    apart = np.linalg.norm((offsets[:, None] - offsets[None]) * step, axis=-1)
    return {
        "offsets": offsets,
        "influence": np.maximum(1.0 - length / horizon, 0.0),
        "common": apart <= horizon * (1 + 1e-9),
    }


def lattice(columns, rows, step=(1.0, 1.0)):
    """Points, areas and triangles of a rectangle; point = column + row * columns."""
    y, x = np.mgrid[:rows, :columns]
    x, y = x.ravel(), y.ravel()
    areas = step[0] * step[1] * np.where((x == 0) | (x == columns - 1), 0.5, 1.0)
    areas = areas * np.where((y == 0) | (y == rows - 1), 0.5, 1.0)
    first = (np.arange(columns - 1) + np.arange(rows - 1)[:, None] * columns).ravel()
    lower = np.column_stack([first, first + 1, first + 1 + columns])
    upper = np.column_stack([first, first + 1 + columns, first + columns])
    return np.column_stack([x, y]) * np.array(step), areas, np.concatenate([lower, upper])


def lattice_neighbours(columns, rows, offsets):
    y, x = np.mgrid[:rows, :columns]
    to_x, to_y = x.ravel()[:, None] + offsets[:, 0], y.ravel()[:, None] + offsets[:, 1]
    exists = (to_x >= 0) & (to_x < columns) & (to_y >= 0) & (to_y < rows)
    return np.where(exists, to_x + to_y * columns, -1).astype(np.int32)


def cloud(points, horizon, severed=None):
    """Neighbours, influences and intersections of any points."""
    found = cKDTree(points).query_ball_point(points, horizon * (1 + 1e-9))
    families = [
        [j for j in sorted(members) if j != i and not (severed and severed(points[i], points[j]))]
        for i, members in enumerate(found)
    ]
    neighbours = np.full((len(points), max(map(len, families))), -1, np.int32)
    for i, members in enumerate(families):
        neighbours[i, : len(members)] = members
    exists = neighbours >= 0
    place = np.where(exists[..., None], points[neighbours], np.inf)
    length = np.where(exists, np.linalg.norm(np.where(exists[..., None], place, 0) - points[:, None], axis=-1), 0)
    near = np.where(exists[..., None], place, 1e9)
    common = np.linalg.norm(near[:, :, None] - near[:, None], axis=-1) <= horizon * (1 + 1e-9)
    common &= exists[:, :, None] & exists[:, None, :]
    return neighbours, np.where(exists, 1 - length / horizon, 0), common


def third_areas(points, triangles):
    """A third of the area of each adjacent triangle, for every point."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    signed = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    areas = np.zeros(len(points))
    for k in range(3):
        np.add.at(areas, triangles[:, k], np.abs(signed) / 6)
    return areas


def jittered_lattice(jitter):
    """Points and triangles of a 21 x 21 lattice whose points are moved at random; edge points stay on their edge."""
    points, _, triangles = lattice(21, 21)
    shift = np.random.default_rng(1).uniform(-jitter, jitter, points.shape)
    return points + np.where((points == 0) | (points == 20), 0.0, shift), triangles


def out_of_balance(points, areas, family, weights, triangles):
    """sum W G - b of every point, bond by bond as in theory 3b; independent of the module."""
    neighbours, influence, common = family
    total = -edge_vectors(points, triangles)
    for i in range(len(points)):
        row = influence if influence.ndim == 1 else influence[i]
        table = common if common.ndim == 2 else common[i]
        real = np.flatnonzero(neighbours[i] >= 0)
        for j in real[weights[i, real] != 0]:
            members = real[table[j, real]]
            bonds = points[neighbours[i, members]] - points[i]
            c = row[members] * areas[neighbours[i, members]]
            shape = np.einsum("k,ka,kb->ab", c, bonds, bonds)
            gradients = weights[i, j] * c[:, None] * np.linalg.solve(shape, bonds.T).T
            np.add.at(total, neighbours[i, members], gradients)
            total[i] -= gradients.sum(axis=0)
    return total
