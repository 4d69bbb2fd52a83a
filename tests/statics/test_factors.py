"""Factorisations: those in a band and sparse ones beside dense solutions, blocks that change, threads of OpenBLAS."""

import numpy as np
import pytest
from scipy import sparse

from warp_pd.statics.factors import MOST_SOLVES, ChangedBlocks, Factoriser, one_thread, openblas

RANDOM = np.random.default_rng(0)
SIDE, POINTS = 6, 36


def lattice(shift):
    """Springs between neighbours of a square lattice, and a stiffness of each component: (3 N, 3 N)."""
    numbers = np.arange(POINTS).reshape(SIDE, SIDE)
    pairs = np.concatenate(
        [np.c_[numbers[:, :-1].ravel(), numbers[:, 1:].ravel()], np.c_[numbers[:-1].ravel(), numbers[1:].ravel()]]
    )
    whole = shift * np.eye(3 * POINTS)
    for a, b in pairs:
        along = RANDOM.normal(size=3)
        ends = np.zeros(3 * POINTS)
        ends[3 * a : 3 * a + 3], ends[3 * b : 3 * b + 3] = along, -along
        whole += np.outer(ends, ends)
    return whole


FREE = RANDOM.random(3 * POINTS) > 0.1
SIDES = RANDOM.normal(size=(POINTS, 3, 4))


def solution(whole, sides):
    x = np.zeros((3 * POINTS, *sides.shape[2:]))
    x[FREE] = np.linalg.solve(whole[np.ix_(FREE, FREE)], sides.reshape(3 * POINTS, *sides.shape[2:])[FREE])
    return x.reshape(sides.shape)


def of_free(whole):
    return sparse.csc_matrix(whole[np.ix_(FREE, FREE)])


@pytest.mark.parametrize("shift", [0.1, -1.0])
def test_a_factorisation_solves_and_counts_negative_eigenvalues(shift):
    whole = lattice(shift)
    factors = Factoriser(FREE)(of_free(whole))
    negative = int((np.linalg.eigvalsh(whole[np.ix_(FREE, FREE)]) < 0.0).sum())
    assert factors.negative() == negative and (negative == 0) == (shift > 0.0)
    for sides in (SIDES, SIDES[:, :, 0]):
        np.testing.assert_allclose(factors(sides), solution(whole, sides), atol=1e-9)


def test_one_factoriser_takes_matrices_with_other_entries_and_blocks():
    factorise, whole = Factoriser(FREE), lattice(0.1)
    further = whole.copy()
    further[:3, -3:] = further[-3:, :3] = 0.01 * np.eye(3)
    added = RANDOM.random((POINTS, 1, 1)) * np.eye(3)
    for matrix in (whole, further, 2.0 * whole):
        expected = matrix + np.diag(added[:, np.arange(3), np.arange(3)].ravel())
        np.testing.assert_allclose(factorise(of_free(matrix), added)(SIDES), solution(expected, SIDES), atol=1e-9)


def test_without_free_components_all_of_the_solution_is_zero():
    """As where a motion moves all points."""
    factors = Factoriser(np.zeros_like(FREE))(sparse.csc_matrix((0, 0)))
    assert factors.negative() == 0
    for sides in (SIDES, SIDES[:, :, 0]):
        assert factors(sides).shape == sides.shape and not factors(sides).any()


def test_a_singular_matrix_has_no_factors():
    assert Factoriser(FREE)(of_free(np.zeros((3 * POINTS, 3 * POINTS)))) is None


def normal_blocks(points, stiffness, normals):
    blocks = np.zeros((POINTS, 3, 3))
    blocks[points] = stiffness * np.einsum("na,nb->nab", normals[points], normals[points])
    return blocks


def test_blocks_that_change_are_as_a_factorisation_with_them():
    """Points begin to touch a body and cease to; those that stay have their own stiffness."""
    whole, normals = lattice(0.1), RANDOM.normal(size=(POINTS, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    first = normal_blocks([3, 4, 20], 50.0, normals)
    changing = ChangedBlocks(Factoriser(FREE)(of_free(whole), first), first)
    for points in ([3, 4, 20, 21, 30], [21], [], [3, 4, 20]):
        blocks = normal_blocks(points, 50.0, normals)
        assert changing.take(blocks)
        expected = solution(whole + sparse.block_diag(list(blocks)).toarray(), SIDES[:, :, 0])
        np.testing.assert_allclose(changing(SIDES[:, :, 0]), expected, atol=1e-7)
    assert changing.negative() == 0
    assert not changing.take(normal_blocks(np.arange(POINTS), 50.0, normals) + 40.0 * np.eye(3))
    assert len(changing._points) <= MOST_SOLVES


def test_openblas_has_its_threads_afterwards():
    library, prefix = openblas()
    if library is None:
        pytest.skip("SciPy calls another library")
    threads = getattr(library, f"{prefix}openblas_get_num_threads")
    before = threads()
    with pytest.raises(ZeroDivisionError), one_thread():
        assert threads() == 1
        raise ZeroDivisionError
    assert threads() == before
