"""Tables of families: members, intersections, reverse bonds and shape tensors are those that brute force finds."""

import numpy as np
import pytest
from helpers import jittered, square

from warp_pd.families import build_families, tables, unpack
from warp_pd.geometry.triangulation import crosses

HORIZONS = (1.5, 2.015, 3.015, 3.15, 4.15)


@pytest.mark.parametrize("horizon", HORIZONS)
@pytest.mark.parametrize("make", [square, jittered, lambda n: square(n).hole((0.05, 0.05), 0.02)])
def test_families_are_those_of_brute_force(horizon, make):
    sheet = make(11)
    families = build_families(sheet, horizon, "linear")
    reach = horizon * sheet.spacing * (1 + 1e-9)
    apart = np.linalg.norm(sheet.points[:, None] - sheet.points[None], axis=-1)
    exists = families.rows_of_points(families.exists)
    bonds = families.rows_of_points(families.bonds) if families.bonds.ndim == 3 else families.bonds[None]
    ends = sheet.points[:, None] + families.horizon * bonds
    common = families.common if families.common.ndim == 2 else families.rows_of_points(families.common)
    common = unpack(common, families.members)
    for i in range(sheet.size):
        members = np.flatnonzero(exists[i])
        found = [int(np.argmin(np.linalg.norm(sheet.points - ends[i if bonds.shape[0] > 1 else 0, k] - (
            0 if bonds.shape[0] > 1 else sheet.points[i] - sheet.points[0]), axis=1))) for k in members]  # fmt: skip
        assert sorted(found) == sorted(np.flatnonzero((apart[i] <= reach) & (apart[i] > 0)))
        rows = common if common.ndim == 2 else common[i]
        expected = apart[np.ix_(found, found)] <= reach
        assert (rows[np.ix_(members, members)] == expected).all()


@pytest.mark.parametrize("sheet", [jittered(17, share=0.3), square(17).as_cloud().cut((0.02, 0.053), (0.07, 0.058))])
def test_tables_of_a_cloud_are_those_of_a_loop_over_points(sheet):
    families = build_families(sheet, 3.15, "linear")
    # More than one block of points.
    assert sheet.size * families.members**2 > tables.BLOCK
    inverse, size = families.inverse_shapes()
    common, X, a = unpack(families.common, families.members), sheet.points / families.horizon, families.areas
    rows = []
    for i in range(sheet.size):
        apart = np.linalg.norm(sheet.points - sheet.points[i], axis=1)
        near = (apart <= families.horizon * (1 + 1e-9)) & (apart > 0)
        for segment in sheet.cuts:
            # No point lies on this cut, so it does not matter which point a bond starts from.
            near &= ~crosses(np.broadcast_to(sheet.points[i], sheet.points.shape), sheet.points, segment)
        rows.append(np.flatnonzero(near))
    assert families.members == max(map(len, rows))
    for i, row in enumerate(rows):
        n, bond = len(row), (sheet.points[row] - sheet.points[i]) / families.horizon
        np.testing.assert_array_equal(families.neighbours[i], np.append(row, np.full(families.members - n, -1)))
        np.testing.assert_array_equal(families.reverses[i, :n], [np.flatnonzero(rows[j] == i)[0] for j in row])
        np.testing.assert_array_equal(families.bonds[i, :n], bond)
        together = ((bond[:, None] - bond[None]) ** 2).sum(axis=-1) <= (1 + 1e-9) ** 2
        np.testing.assert_array_equal(common[i, :n, :n], together)
        assert not common[i, n:].any() and not common[i, :, n:].any() and not families.exists[i, n:].any()
        c = (1 - np.minimum(np.linalg.norm(X[row] - X[i], axis=1), 1.0)) * a[row]
        shape = np.einsum("jk,k,ka,kb->jab", together, c, bond, bond)
        expected = np.linalg.inv(shape)[:, [0, 0, 1], [0, 1, 1]]
        np.testing.assert_allclose(inverse[i, :n], expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())
        np.testing.assert_allclose(size[i, :n], together @ a[row], rtol=1e-12)
        assert not inverse[i, n:].any() and not size[i, n:].any()


@pytest.mark.parametrize("sheet", [square(9), jittered(9), square(9).cut((0.0, 0.053), (0.05, 0.053))])
def test_reverse_bonds_point_back(sheet):
    families = build_families(sheet, 3.15, "linear")
    exists = families.rows_of_points(families.exists)
    assert families.bond_count == exists.sum() > 0
    for i in range(sheet.size):
        for k in np.flatnonzero(exists[i]):
            if families.neighbours is None:
                j, reverse = i + families.shift[k], families.reverses[k]
                assert exists[j, reverse] and j + families.shift[reverse] == i
            else:
                j, reverse = families.neighbours[i, k], families.reverses[i, k]
                assert families.neighbours[j, reverse] == i
            assert families.heads(i, k) == j and families.reverse_members(i, k) == reverse
