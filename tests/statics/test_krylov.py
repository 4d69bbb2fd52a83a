"""Conjugate gradients and GMRES against a factorisation."""

import numpy as np
import pytest

from warp_pd.statics.krylov import conjugate_gradients, gmres

RANDOM = np.random.default_rng(0)
MATRIX = np.diag(np.linspace(1.0, 30.0, 40)) + RANDOM.normal(size=(40, 40))
SIDE = RANDOM.normal(size=40)


def solved(accuracy, restart, cycles, precondition=lambda r: r, matrix=MATRIX, side=SIDE):
    """Solution, whether it counts as one, and the number of products."""
    products = []

    def product(x):
        products.append(x)
        return matrix @ x

    return *gmres(product, precondition, side, accuracy, restart, cycles), len(products)


@pytest.mark.parametrize("accuracy", [1e-2, 1e-6, 1e-10])
@pytest.mark.parametrize("restart", [10, 60])
def test_the_residual_is_as_small_as_asked(accuracy, restart):
    x, reached, _ = solved(accuracy, restart, 200)
    left = np.linalg.norm(SIDE - MATRIX @ x) / np.linalg.norm(SIDE)
    assert reached
    assert 1e-3 * accuracy < left <= accuracy


def test_no_vector_of_its_space_leaves_less():
    x, reached, products = solved(1e-12, 5, 1)
    powers = [SIDE]
    for _ in range(4):
        powers.append(MATRIX @ powers[-1] / np.linalg.norm(powers[-1]))
    images = MATRIX @ np.stack(powers, axis=1)
    least = SIDE - images @ np.linalg.lstsq(images, SIDE, rcond=None)[0]
    assert not reached
    assert products == 5
    assert np.linalg.norm(SIDE - MATRIX @ x) == pytest.approx(np.linalg.norm(least), rel=1e-9)


def test_an_exact_preconditioner_takes_one_product():
    x, reached, products = solved(1e-9, 60, 1, lambda r: np.linalg.solve(MATRIX, r))
    assert reached
    assert products == 1
    assert x == pytest.approx(np.linalg.solve(MATRIX, SIDE), rel=1e-9)


def test_a_side_in_a_small_space_ends_there():
    side = np.zeros(40)
    side[3:5] = 1.0
    x, reached, products = solved(1e-9, 60, 1, matrix=np.diag(np.arange(1.0, 41.0)), side=side)
    assert reached
    assert products == 2
    assert x[3:5] == pytest.approx([1.0 / 4.0, 1.0 / 5.0])


@pytest.mark.parametrize(
    ("matrix", "side", "reached"),
    [(MATRIX, np.zeros(40), True), (np.zeros((40, 40)), SIDE, False), (np.full((40, 40), np.nan), SIDE, False)],
)
def test_no_side_and_no_matrix(matrix, side, reached):
    x, found, _ = solved(1e-6, 10, 3, matrix=matrix, side=side)
    assert found is reached
    assert (x == 0.0).all()


SYMMETRIC = MATRIX @ MATRIX.T


def test_conjugate_gradients_end_when_the_residual_is_as_small_as_asked():
    for accuracy in (1e-2, 1e-6):
        x, reached = conjugate_gradients(lambda v: SYMMETRIC @ v, lambda r: r, SIDE, accuracy, 200)
        left = np.linalg.norm(SIDE - SYMMETRIC @ x) / np.linalg.norm(SIDE)
        assert reached
        assert 1e-3 * accuracy < left <= 1.01 * accuracy


def test_conjugate_gradients_with_an_exact_preconditioner_take_one_iteration():
    x, reached = conjugate_gradients(
        lambda v: SYMMETRIC @ v, lambda r: np.linalg.solve(SYMMETRIC, r), SIDE, 1e-9, 1
    )  # fmt: skip
    assert reached
    assert x == pytest.approx(np.linalg.solve(SYMMETRIC, SIDE), rel=1e-6)


def test_conjugate_gradients_leave_what_they_have_after_the_last_iteration():
    x, reached = conjugate_gradients(lambda v: SYMMETRIC @ v, lambda r: r, SIDE, 1e-12, 3)
    steps = [SIDE, SYMMETRIC @ SIDE, SYMMETRIC @ SYMMETRIC @ SIDE]
    basis = np.linalg.qr(np.stack(steps, axis=1))[0]
    best = basis @ np.linalg.solve(basis.T @ SYMMETRIC @ basis, basis.T @ SIDE)
    assert not reached
    assert x == pytest.approx(best, rel=1e-6)


@pytest.mark.parametrize(("value", "side", "reached"), [(1.0, 0.0, True), (0.0, 1.0, False), (np.nan, 1.0, False)])
def test_conjugate_gradients_without_side_or_matrix(value, side, reached):
    x, found = conjugate_gradients(lambda v: value * v, lambda r: r, np.full(4, side), 1e-6, 9)
    assert found is reached
    assert (x == 0.0).all()
