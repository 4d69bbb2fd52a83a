"""Families: masks, mates and shared rows are what brute force finds; both layouts give the same forces."""

import numpy as np
import pytest
from helpers import build, internal_force, jittered, rough, square
from hypothesis import given, settings
from hypothesis import strategies as st

from warp_pd import Sheet, bonds
from warp_pd.families import build_families, pack, unpack
from warp_pd.sheet import crosses

HORIZONS = (1.5, 2.015, 3.015, 3.15, 4.15, 9.015)
MEMBERS = {1.5: 8, 2.015: 12, 3.015: 28, 3.15: 28, 4.15: 56, 9.015: 252}


@settings(max_examples=60, deadline=None)
@given(rows=st.integers(1, 5), members=st.integers(1, 100), seed=st.integers(0, 1000))
def test_pack_and_unpack(rows, members, seed):
    mask = np.random.default_rng(seed).random((rows, members)) < 0.5
    assert (unpack(pack(mask), members) == mask).all()
    assert pack(mask).shape == (rows, -(-members // 32))


@pytest.mark.parametrize("horizon", HORIZONS)
def test_stencil_size(horizon):
    families = build_families(square(25), horizon, "linear")
    assert families.members == MEMBERS[horizon]
    assert families.words == -(-MEMBERS[horizon] // 32)


@pytest.mark.parametrize("horizon", HORIZONS[:5])
@pytest.mark.parametrize("make", [square, jittered, lambda n: square(n).hole((0.05, 0.05), 0.02)])
def test_families_are_those_of_brute_force(horizon, make):
    sheet = make(11)
    families = build_families(sheet, horizon, "linear")
    reach = horizon * sheet.spacing * (1 + 1e-9)
    apart = np.linalg.norm(sheet.points[:, None] - sheet.points[None], axis=-1)
    exists = families.rows_of_points(families.exists)
    bonds = families.rows_of_points(families.bonds) if families.bonds.ndim == 3 else families.bonds[None]
    ends = sheet.points[:, None] + families.horizon * bonds
    common = unpack(families.common, families.members)
    for i in range(sheet.size):
        members = np.flatnonzero(exists[i])
        found = [int(np.argmin(np.linalg.norm(sheet.points - ends[i if bonds.shape[0] > 1 else 0, k] - (
            0 if bonds.shape[0] > 1 else sheet.points[i] - sheet.points[0]), axis=1))) for k in members]  # fmt: skip
        assert sorted(found) == sorted(np.flatnonzero((apart[i] <= reach) & (apart[i] > 0)))
        rows = common if common.ndim == 2 else common[i]
        expected = apart[np.ix_(found, found)] <= reach
        assert (rows[np.ix_(members, members)] == expected).all()


@pytest.mark.parametrize("block", [1, 3000, bonds.BLOCK])
@pytest.mark.parametrize("sheet", [jittered(12, share=0.3), square(11).as_cloud().cut((0.02, 0.053), (0.07, 0.058))])
def test_tables_of_a_cloud_are_those_of_a_loop_over_points(sheet, block, monkeypatch):
    monkeypatch.setattr(bonds, "BLOCK", block)
    families = build_families(sheet, 3.15, "linear")
    inverse, size = families.inverse_shapes()
    common, X, a = unpack(families.common, families.members), sheet.points / families.horizon, families.areas
    rows = []
    for i in range(sheet.size):
        apart = np.linalg.norm(sheet.points - sheet.points[i], axis=1)
        near = (apart <= families.horizon * (1 + 1e-9)) & (apart > 0)
        for segment in sheet.cuts:
            # The side that a bond starts from decides nothing: no point lies on this cut.
            near &= ~crosses(np.broadcast_to(sheet.points[i], sheet.points.shape), sheet.points, segment)
        rows.append(np.flatnonzero(near))
    assert families.members == max(map(len, rows))
    for i, row in enumerate(rows):
        n, bond = len(row), (sheet.points[row] - sheet.points[i]) / families.horizon
        np.testing.assert_array_equal(families.neighbours[i], np.append(row, np.full(families.members - n, -1)))
        np.testing.assert_array_equal(families.reverse[i, :n], [np.flatnonzero(rows[j] == i)[0] for j in row])
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
def test_mates_point_back(sheet):
    families = build_families(sheet, 3.15, "linear")
    exists = families.rows_of_points(families.exists)
    for i in range(sheet.size):
        for k in np.flatnonzero(exists[i]):
            if families.neighbours is None:
                j, back = i + families.shift[k], families.reverse[k]
                assert exists[j, back] and j + families.shift[back] == i
            else:
                j = families.neighbours[i, k]
                assert families.neighbours[j, families.reverse[i, k]] == i


@pytest.mark.parametrize("precision", [32, 64])
@pytest.mark.parametrize(
    ("horizon", "weights"),
    # At smaller horizons the correction of a cloud reaches one layer deeper than that of a lattice.
    [(1.5, "plain"), (1.5, "published"), (3.15, "plain"), (3.15, "published"), (3.15, "corrected")],
)
def test_lattice_and_cloud_give_the_same_forces(horizon, weights, precision):
    lattice = Sheet.rectangle(0.1, 0.08, thickness=1e-3, density=1000.0, points=(13, 11))
    displacement = rough(lattice)
    forces = [
        internal_force(build(s, horizon=horizon, weights=weights, precision=precision), displacement)
        for s in (lattice, lattice.as_cloud())
    ]
    scale = np.abs(forces[0]).max()
    assert np.abs(forces[0] - forces[1]).max() <= (1e-9 if precision == 64 else 2e-4) * scale
    assert scale > 0.0


def test_lattice_and_cloud_agree_at_a_horizon_of_nine_spacings():
    lattice = square(21)
    forces = [internal_force(build(s, horizon=9.015), rough(lattice)) for s in (lattice, lattice.as_cloud())]
    assert np.abs(forces[0] - forces[1]).max() <= 1e-9 * np.abs(forces[0]).max()


def test_lattice_and_cloud_agree_beside_a_cut():
    lattice = square(13).cut((-0.01, 0.054), (0.052, 0.054))
    forces = [internal_force(build(s, horizon=3.15), rough(lattice)) for s in (lattice, lattice.as_cloud())]
    assert np.abs(forces[0] - forces[1]).max() <= 1e-9 * np.abs(forces[0]).max()


def test_no_bond_crosses_a_cut():
    cut = square(13).cut((-0.01, 0.054), (0.11, 0.054))
    built = build(cut, horizon=3.15)
    displacement = np.zeros((cut.size, 3))
    displacement[cut.points[:, 1] > 0.054, 1] = 0.05
    assert np.abs(internal_force(built, displacement)).max() < 1e-12


def test_rows_are_few_on_a_large_lattice():
    families = build_families(square(401), 3.15, "linear")
    assert families.exists.shape[0] <= 81
    assert families.points == 401**2


def test_hole_shrinks_areas():
    whole = square(41)
    holed = whole.hole((0.05, 0.05), 0.02)
    removed = whole.areas.sum() - holed.areas.sum()
    assert removed == pytest.approx(np.pi * 0.02**2, rel=0.15)
    assert holed.lattice is None and holed.size < whole.size
