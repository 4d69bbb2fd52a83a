"""The weights closest to given ones that balance a uniform stress: a convex problem, solved via its dual."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...device.checks import InputError

if TYPE_CHECKING:
    from scipy import sparse

# Force per unit stress, in spacings, that counts as balanced.
BALANCED = 1e-10
# Most components of force out of balance; beyond, factors take several GB and the solve minutes.
MAX_BALANCES = 200_000
# Most of them for dense sums.
MOST_DENSE = 3000
# Where positive weights cannot balance a point, residual^2 / (2 softness) joins the objective instead.
SOFTNESS = 1e-4
# Most Newton steps; solvable problems took up to 15.
MOST_STEPS = 40
# Ratio beyond which the dual is taken to have no maximum; the largest seen at one is 60.
HOPELESS = 200.0


def closest_balanced(
    matrix: sparse.csr_matrix, plain: np.ndarray, gap: np.ndarray, floor: float, family: np.ndarray | None = None
) -> np.ndarray:
    """Ratios s, shape (U,), above the floor with the smallest change that satisfy matrix (plain (s - 1)) = gap.

    `family`, ascending, shape (U,), numbers the columns of one family, whose rows are about the same: steps are then
    faster, at more memory.
    """
    if np.abs(gap).max(initial=0.0) <= BALANCED:
        return np.ones(len(plain))
    if len(gap) > MAX_BALANCES:
        raise InputError(
            f"weights = 'corrected': {len(gap)} components of force out of balance in an irregular cloud, expected up "
            f"to {MAX_BALANCES}; take a more even cloud, an outline, or other weights"
        )
    blocks = None if family is None or len(gap) > MOST_DENSE else _Blocks(matrix, family)
    problem = _Dual(matrix, matrix.T.tocsr(), plain, gap, floor, blocks)
    nothing = np.zeros(len(gap))
    _, ratio, balanced = _maximise(problem, nothing, nothing)
    if balanced:
        return ratio
    multiplier, ratio, _ = _maximise(problem, nothing, np.full(len(gap), SOFTNESS))
    # Most points can be balanced all the same: stay soft only where much is left.
    left = np.abs(SOFTNESS * multiplier)
    for fraction in (0.3, 0.1, 0.03):
        local = np.where(left > fraction * left.max(), SOFTNESS, 0.0)
        _, local_ratio, balanced = _maximise(problem, multiplier, local)
        if balanced:
            return local_ratio
    return ratio


class _Blocks:
    """Products A diag(d) A^T of a sparse matrix A, (M, U), as sums of dense ones of the columns of each family."""

    def __init__(self, matrix: sparse.csr_matrix, family: np.ndarray) -> None:
        columns = matrix.tocsc()
        self._size = matrix.shape[0]
        self._parts: list[tuple[slice, np.ndarray, np.ndarray]] = []
        begins = np.flatnonzero(np.diff(family, prepend=-1))
        for begin, end in zip(begins, np.append(begins[1:], len(family)), strict=True):
            mine = columns[:, begin:end]
            rows = np.unique(mine.indices)
            self._parts.append((slice(begin, end), rows, mine[rows].toarray()))

    def product(self, scale: np.ndarray) -> sparse.csc_matrix:
        """A diag(scale) A^T, (M, M), for a scale of shape (U,)."""
        from scipy import sparse

        found = np.zeros((self._size, self._size))
        for columns, rows, block in self._parts:
            found[rows[:, None], rows] += (block * scale[columns]) @ block.T
        return sparse.csc_matrix(found)


class _Dual(NamedTuple):
    """The problem of `_closest_balanced`, in units of the spacing."""

    matrix: sparse.csr_matrix
    transposed: sparse.csr_matrix
    plain: np.ndarray
    gap: np.ndarray
    floor: float
    blocks: _Blocks | None = None

    def curvature(self, slope: np.ndarray) -> sparse.spmatrix:
        """Minus the second derivative of the dual without softness, (M, M), for ds / dz, shape (U,)."""
        from scipy import sparse

        if self.blocks is not None:
            return self.blocks.product(self.plain * slope)
        return self.matrix @ sparse.diags(self.plain * slope) @ self.transposed

    def left(self, ratio: np.ndarray) -> np.ndarray:
        """The remaining gap for the ratios, shape (M,)."""
        return np.asarray(self.gap - self.matrix @ (self.plain * (ratio - 1.0)))

    def value(self, multiplier: np.ndarray, softness: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """The dual's value, the ratios s with phi'(s) = z, z = G lambda, and ds / dz, shape (U,)."""
        pull = self.transposed @ multiplier
        above, slope = _above_floor(pull, self.floor)
        ratio = self.floor + above
        conjugate = pull * (ratio - 1.0) - _change(above, self.floor)
        value = multiplier @ self.gap - self.plain @ conjugate - 0.5 * softness @ multiplier**2
        return float(value), ratio, slope


def _maximise(problem: _Dual, multiplier: np.ndarray, softness: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
    """Newton's method on the dual, which is smooth and has no constraints, from a first multiplier, shape (M,).

    Where `softness`, shape (M,), is positive, the penalty residual^2 / (2 softness) replaces the constraint. Returns
    multipliers, shape (M,); ratios, shape (U,); whether the optimum was reached.
    """
    from scipy import sparse
    from scipy.sparse.linalg import splu

    value, ratio, slope = problem.value(multiplier, softness)
    for _ in range(MOST_STEPS):
        gradient = problem.left(ratio) - softness * multiplier
        if np.abs(gradient).max() <= 1e-12 or ratio.max() > HOPELESS:
            break
        curvature = problem.curvature(slope)
        # Multipliers that translate, turn or shear the sheet pull on no bond: their curvature is zero.
        shift = softness + 1e-13 * float(curvature.diagonal().max())
        factors = splu(
            (curvature + sparse.diags(shift)).tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        direction = factors.solve(gradient)
        rise = float(gradient @ direction)
        fraction = 1.0
        while fraction > 1e-8:
            trial = multiplier + fraction * direction
            trial_value, trial_ratio, trial_slope = problem.value(trial, softness)
            if trial_value >= value + 1e-4 * fraction * rise - 1e-13 * abs(value):
                break
            fraction *= 0.5
        else:
            break
        multiplier, value, ratio, slope = trial, trial_value, trial_ratio, trial_slope
    gradient = problem.left(ratio) - softness * multiplier
    return multiplier, ratio, float(np.abs(gradient).max()) <= BALANCED


def _change(above: np.ndarray, floor: float) -> np.ndarray:
    """phi(s) for s = floor + above, with its minimum, zero, at s = 1 and infinite at the floor."""
    room = 1.0 - floor
    return 0.5 * (above - room) ** 2 + (above - room) / room - np.log(above / room)


def _above_floor(pull: np.ndarray, floor: float) -> tuple[np.ndarray, np.ndarray]:
    """Solve phi'(s) = (s - 1) + 1 / (1 - floor) - 1 / (s - floor) = pull for s - floor; return it and ds / dpull."""
    room = 1.0 - floor
    half = 0.5 * (pull + room - 1.0 / room)
    root = np.sqrt(half * half + 1.0)
    # Of the two equal forms of the root, the one without cancellation.
    above = np.where(half >= 0.0, half + root, 1.0 / (root + np.abs(half)))
    return above, 1.0 / (1.0 + above**-2)
