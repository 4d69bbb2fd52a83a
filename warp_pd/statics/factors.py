"""Factorisations of symmetric matrices on the host: in a band, as a sparse matrix, and with blocks that change."""

from __future__ import annotations

import contextlib
import ctypes
import functools
from collections.abc import Callable, Iterator
from typing import Any, Protocol

import numpy as np

# Entries of a band up to which it is faster than a sparse factorisation, by four times at 600 points: 80 MB.
MOST_ENTRIES = 10_000_000
# Most solves for changes of blocks before K is factorised again, which takes about as long as so many.
MOST_SOLVES = 50
# Change of a block over the block that counts, and cosine from which two directions are the same: they are normals of a
# body, which turn a little as points slide.
COUNTS, SAME = 0.1, 0.99


class Solve(Protocol):
    """Solves K x = b."""

    def __call__(self, b: np.ndarray) -> np.ndarray:
        """Return x for b, both of shape (N, 3) or (N, 3, M)."""
        ...

    def negative(self) -> int | None:
        """Number of negative eigenvalues of K; None if unknown."""
        ...


class Factoriser:
    """Factorises symmetric matrices whose entries are, for the most part, at the same places.

    A positive definite one is factorised in a band, in the order of Cuthill and McKee (1969) reversed: whole rows at
    once take less time than the fewer entries of sparse factors. Others, and wide bands, are sparse.

    Args:
        free: Mask of components, (3 N,), of which K has rows and columns.
    """

    def __init__(self, free: np.ndarray) -> None:
        self._free = free
        self._band: Band | None = None

    def __call__(self, matrix: Any, added: np.ndarray | None = None) -> Solve | None:
        """Factorise K [N/m], a CSC matrix; None if it is singular. `added` are blocks on its diagonal, (N, 3, 3)."""
        from scipy.sparse import bsr_matrix

        free = self._free
        if not free.any():
            # SciPy refuses a matrix without rows.
            return Factors(free, lambda b: b, lambda: 0)
        if added is not None:
            points = np.arange(len(added) + 1)
            matrix = matrix + bsr_matrix((added, points[:-1], points)).tocsr()[free][:, free].tocsc()
        if self._band is None or not self._band.fits(matrix):
            self._band = Band(matrix)
        solve = self._band.factorise(matrix) if self._band.entries <= MOST_ENTRIES else None
        if solve is not None:
            return Factors(free, solve, lambda: 0)
        return sparse_factors(matrix, free)


class Band:
    """Places of the entries of a symmetric matrix in its lower band.

    Attributes:
        entries: Number of entries of the band.
    """

    def __init__(self, matrix: Any) -> None:
        from scipy.sparse.csgraph import reverse_cuthill_mckee

        matrix.sort_indices()
        self._rows, self._starts = matrix.indices, matrix.indptr
        size = matrix.shape[0]
        self._order = reverse_cuthill_mckee(matrix.T, symmetric_mode=True)
        place = np.empty(size, np.int64)
        place[self._order] = np.arange(size)
        column = np.repeat(place, np.diff(self._starts))
        below = place[self._rows] - column
        self._lower = np.flatnonzero(below >= 0)
        self._shape = int(below.max(initial=0)) + 1, size
        self._places = below[self._lower] + column[self._lower] * self._shape[0]
        self.entries = self._shape[0] * size

    def fits(self, matrix: Any) -> bool:
        """Whether a matrix, with ascending rows, has entries at the same places."""
        return np.array_equal(matrix.indptr, self._starts) and np.array_equal(matrix.indices, self._rows)

    def factorise(self, matrix: Any) -> Callable[[np.ndarray], np.ndarray] | None:
        """Solver of K x = b on arrays (n,) and (n, M); None if K is not positive definite."""
        from scipy.linalg.lapack import dpbtrf, dpbtrs

        band, order = np.zeros(self.entries), self._order
        band[self._places] = matrix.data[self._lower]
        with one_thread():
            factors, failed = dpbtrf(band.reshape(self._shape, order="F"), lower=1, overwrite_ab=1)
        if failed:
            return None

        def solve(b: np.ndarray) -> np.ndarray:
            x = np.empty(b.shape)
            x[order] = dpbtrs(factors, b[order], lower=1)[0].reshape(b.shape)
            return x

        return solve


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Let OpenBLAS, in the wheels of SciPy, work in one thread: others spin on the cores that the kernels need."""
    library, prefix = openblas()
    if library is None:
        yield
        return
    most = getattr(library, f"{prefix}openblas_get_num_threads")()
    limit = getattr(library, f"{prefix}openblas_set_num_threads")
    limit(1)
    try:
        yield
    finally:
        limit(most)


@functools.cache
def openblas() -> tuple[ctypes.CDLL | None, str]:
    """The library that SciPy calls, and the prefix of its names; None if it is another one."""
    from scipy.linalg import _flapack

    library = ctypes.CDLL(_flapack.__file__)
    found = [prefix for prefix in ("scipy_", "") if hasattr(library, f"{prefix}openblas_set_num_threads")]
    return (library, found[0]) if found else (None, "")


class Factors:
    """A factorisation that solves K x = b.

    Args:
        free: Mask of components, (3 N,), of which K has rows and columns; others of x are zero.
        solve: Solves for these, (n,) or (n, M).
        negative: Tells how many eigenvalues are negative, or None.
    """

    def __init__(
        self, free: np.ndarray, solve: Callable[[np.ndarray], np.ndarray], negative: Callable[[], int | None]
    ) -> None:
        self._free, self._solve, self.negative = free, solve, negative

    def __call__(self, b: np.ndarray) -> np.ndarray:
        """Return x for b, both of shape (N, 3) or (N, 3, M)."""
        sides = b.reshape(self._free.size, *b.shape[2:])
        x = np.zeros(sides.shape)
        x[self._free] = self._solve(np.ascontiguousarray(sides[self._free], dtype=np.float64))
        return x.reshape(b.shape)


def sparse_factors(matrix: Any, free: np.ndarray) -> Factors | None:
    """Sparse factors of K; None if it is singular."""
    from scipy.sparse.linalg import splu

    try:
        factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:
        return None

    def negative() -> int | None:
        # As many as negative pivots (Sylvester's law of inertia), if none was chosen off the diagonal.
        return None if (factors.perm_r != factors.perm_c).any() else int((factors.U.diagonal() < 0.0).sum())

    return Factors(free, factors.solve, negative)


class ChangedBlocks:
    """A factorisation of K that solves with K + V S V^T, whose diagonal blocks are others (Woodbury 1950).

    Args:
        factors: The factorisation of K.
        blocks: What may change in its diagonal blocks, (N, 3, 3).
    """

    def __init__(self, factors: Solve, blocks: np.ndarray) -> None:
        self._factors, self._blocks = factors, blocks
        # Points and directions of V, (M,) and (M, 3), and K^-1 V, (N, 3, M), also those of earlier changes: points come
        # and go.
        self._points, self._along = np.zeros(0, int), np.zeros((0, 3))
        self._solved = np.zeros((*blocks.shape[:2], 0))
        # Columns of the present changes, and K^-1 V (S^-1 + V^T K^-1 V)^-1.
        self._present, self._correction = np.zeros(0, int), self._solved

    def __call__(self, b: np.ndarray) -> np.ndarray:
        """Return x for b, both of shape (N, 3)."""
        x, present = self._factors(b), self._present
        if not len(present):
            return x
        moved = np.einsum("ac,ac->a", self._along[present], x[self._points[present]])
        return np.asarray(x - np.einsum("ica,a->ic", self._correction, moved))

    def negative(self) -> int | None:
        """Number of negative eigenvalues; None after a change."""
        return None if len(self._present) else self._factors.negative()

    def take(self, blocks: np.ndarray) -> bool:
        """Change the blocks to others, (N, 3, 3); return whether that takes fewer solves than a factorisation."""
        change = blocks - self._blocks
        least = COUNTS * np.maximum(np.abs(blocks), np.abs(self._blocks)).max(axis=(1, 2))
        changed = np.flatnonzero(np.abs(change).max(axis=(1, 2)) > least)
        values, vectors = np.linalg.eigh(change[changed])
        which, axis = np.nonzero(np.abs(values) > least[changed, None])
        points, along, values = changed[which], vectors[which, :, axis], values[which, axis]
        if not self._solve_for(points, along):
            return False
        same = self._same(points, along)
        present = same.argmax(axis=1) if len(points) else np.zeros(0, int)
        solved = self._solved[:, :, present]
        small = np.diag(1.0 / values) + np.einsum("ac,acb->ab", self._along[present], solved[points])
        try:
            self._correction = np.einsum("icb,ba->ica", solved, np.linalg.inv(small))
        except np.linalg.LinAlgError:
            return False
        self._present = present
        return True

    def _same(self, points: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Which directions are those of which columns, (directions, columns)."""
        cosines = np.abs(np.einsum("ac,bc->ab", along, self._along))
        return np.asarray((points[:, None] == self._points) & (cosines > SAME))

    def _solve_for(self, points: np.ndarray, along: np.ndarray) -> bool:
        """Solve for directions without a column; return whether these are not too many."""
        new = np.flatnonzero(~self._same(points, along).any(axis=1))
        if len(self._points) + len(new) > MOST_SOLVES:
            return False
        if len(new):
            sides = np.zeros((*self._blocks.shape[:2], len(new)))
            sides[points[new], :, np.arange(len(new))] = along[new]
            self._points, self._along = np.append(self._points, points[new]), np.vstack([self._along, along[new]])
            self._solved = np.concatenate([self._solved, self._factors(sides)], axis=2)
        return True
