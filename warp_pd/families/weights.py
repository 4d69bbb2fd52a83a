"""Area weights of the bonds: plain, and corrected so that a uniform stress is in equilibrium up to the edge.

The variational bond-associated form has the energy E = h sum_ij W_ij Psi(F_ij). W_ij is the area represented by bond
(i, j), and F_ij = sum_m y_m (x) G_ij,m is the deformation gradient of the intersection D_ij of the families of i and j
(j itself belongs to it):

    G_ij,k = w_ik a_k K_ij^-1 X_ik  for k in D_ij,   G_ij,i = -(sum of these),
    K_ij = sum_{k in D_ij} w_ik a_k X_ik (x) X_ik.

Under a uniform first Piola stress P the internal force on point m is -h P sum_ij W_ij G_ij,m. It balances
the traction on the sheet's edge if sum_ij W_ij G_ij,m = b_m at every point, where b_m is half of each
adjacent edge times its outward normal. The plain weights W0_ij = a_i |D_ij| / sum_j |D_ij| satisfy this only inside a
lattice. The corrected weights satisfy it everywhere, are positive, and differ from W0 as little as possible:

    minimise  sum_q W0_q phi(W_q / W0_q)   subject to   sum_q W_q G_q,m = b_m   for every point m,
    phi(s) = (s - 1)^2 / 2 + (s - 1) / (1 - f) - log((s - f) / (1 - f)),   f = `floor`.

The square measures the relative change; the logarithm keeps W above f W0. Squares alone give weights down to -4.5 W0 at
a horizon of 3.15 spacings, and Newton's method then finds no equilibrium for a sheet that is clamped at both ends and
stretched by 1.2.

On a curved sheet the stress is an equal tension in all directions, G_ij,m are vectors in space (R^-1 K_ij^-1 in place
of K_ij^-1, kernels/kinematics.py), and only the components along the surface are balanced. This does not fix the sum of
the weights, which must equal the area; one more constraint keeps it.

The bond-associated family is that of Yang, Chen & Liu (Eng. Fract. Mech. 2024, 110131). Their published force
uses other weights and has no energy; the energy, the plain weights and the correction were developed in this project.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..device.checks import InputError
from ..geometry.triangulation import boundary_sides, directed_edges, doubled_normals
from ..kernels.kinematics import DEGENERATE

if TYPE_CHECKING:
    from scipy import sparse

# Least ratio of corrected to plain weights; lattices of 10 points and more allow it.
FLOOR = 0.05
# Ratio of areas of points from which a sheet is uneven.
UNEVEN = 9.0
# Entries of the dense (points, members, members) blocks that are in memory at a time.
BLOCK = 2_000_000


@dataclass(frozen=True, eq=False)
class CorrectedWeights:
    """Corrected weights of all bonds, with their residual and their change from the starting weights.

    Attributes:
        weights: W_ij [m^2], shape (N, n); zero where there is no bond or its intersection spans no area.
        residual: Largest component of sum_ij W_ij G_ij,m - b_m over the balanced points [m].
        left: The same at each point [m], shape (N,); zero where no balance is asked for.
        start_residual: The same residual for the starting weights [m].
        smallest_ratio: Smallest ratio of corrected to starting weights.
        largest_ratio: Largest ratio of corrected to starting weights.
        unbalanced_points: Number of points that should be balanced but have a residual above round-off, because no
            weights above the floor balance them.
        seconds: Wall time [s].
    """

    weights: np.ndarray
    residual: float
    left: np.ndarray
    start_residual: float
    smallest_ratio: float
    largest_ratio: float
    unbalanced_points: int
    seconds: float


def edge_vectors(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Force of a unit stress on each point, b_m = integral of grad N_m over the triangles [m], shape (N, 2).

    Inside the sheet it is zero; on the edge it is half of each adjacent edge times its outward normal. Triangles may
    have either orientation.
    """
    vectors = np.zeros((len(points), 2))
    corners = points[triangles]
    side = corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]
    turn = np.sign(side[:, 0, 0] * side[:, 1, 1] - side[:, 0, 1] * side[:, 1, 0])[:, None]
    for corner in range(3):
        opposite = side[:, corner]
        inward = 0.5 * turn * np.column_stack([-opposite[:, 1], opposite[:, 0]])
        np.add.at(vectors, triangles[:, corner], inward)
    # What cancels inside leaves round-off, which would count as an edge.
    scale = np.abs(corners - corners[:, :1]).max()
    vectors[np.abs(vectors) < 1e-12 * scale] = 0.0
    return vectors


def edge_vectors_of(points: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """As `edge_vectors` [m], shape (N, 2), from edges, pairs of points with the sheet on the left, shape (B, 2)."""
    along = points[edges[:, 1]] - points[edges[:, 0]]
    half = 0.5 * np.column_stack([along[:, 1], -along[:, 0]])
    vectors = np.zeros((len(points), 2))
    for end in (0, 1):
        np.add.at(vectors, edges[:, end], half)
    return vectors


def rim_vectors(points: np.ndarray, triangles: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """As `edge_vectors`, on a curved sheet: half of each adjacent open edge times its outward in-surface normal.

    Returns components along the tangent vectors `frames`, shape (N, 3, 2). Triangles are counter-clockwise seen from
    outside.
    """
    sides = boundary_sides(triangles)
    ends = directed_edges(triangles)[sides]
    along = points[ends[:, 1]] - points[ends[:, 0]]
    normal = doubled_normals(points, triangles[sides % len(triangles)])
    half = 0.5 * np.cross(along, normal / np.linalg.norm(normal, axis=1)[:, None])
    vectors = np.zeros_like(points)
    for end in range(2):
        np.add.at(vectors, ends[:, end], half)
    return np.asarray(np.einsum("nc,nca->na", vectors, frames))


def plain_weights(
    areas: np.ndarray, neighbours: np.ndarray, common: np.ndarray, usable: np.ndarray | None = None
) -> np.ndarray:
    """Plain weights W0_ij = a_i |D_ij| / sum_j |D_ij| [m^2], shape (N, n).

    Args:
        areas: Area of each point [m^2], shape (N,).
        neighbours: Index of each family member, -1 for none, shape (N, n).
        common: Whether member k of a family belongs to the intersection of its member j, bool, shape
            (N, n, n) [i, j, k], or one table (n, n) for all points of a lattice.
        usable: Bonds whose intersection spans an area, shape (N, n); by default all that exist.
    """
    exists = neighbours >= 0
    usable = exists if usable is None else usable & exists
    member_areas = np.where(exists, areas[neighbours], 0.0)
    if common.ndim == 2:
        sizes = member_areas @ common.T.astype(np.float64)
    else:
        sizes = np.einsum("ijk,ik->ij", common, member_areas)
    sizes = np.where(usable, sizes, 0.0)
    total = sizes.sum(axis=1, keepdims=True)
    return np.asarray(areas[:, None] * sizes / np.where(total > 0.0, total, 1.0))


def reached_points(neighbours: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Mask of the points whose balance the families of the chosen points affect: these points and their members."""
    reached = chosen.copy()
    members = neighbours[chosen]
    reached[members[members >= 0]] = True
    return reached


def corrected_weights(
    points: np.ndarray,
    areas: np.ndarray,
    neighbours: np.ndarray,
    influence: np.ndarray,
    common: np.ndarray | None,
    *,
    edge_vectors: np.ndarray,
    strip: np.ndarray | None = None,
    kind: np.ndarray | None = None,
    frozen: np.ndarray | None = None,
    unbalanced: np.ndarray | None = None,
    start: np.ndarray | None = None,
    length: float | None = None,
    frames: np.ndarray | None = None,
) -> CorrectedWeights:
    """The positive weights closest to the plain ones for which a uniform stress is in equilibrium at every point.

    If no weights above the floor achieve this, the residual of the points that cannot be balanced is minimised together
    with the change. These points are few unless the sheet is narrow or very irregular; the others stay balanced.

    Args:
        points: Reference positions [m], shape (N, 2); of a curved sheet (N, 3).
        areas: Area of each point [m^2], shape (N,).
        neighbours: Index of each family member, -1 for none, shape (N, n).
        influence: w_ij, shape (N, n), or (n,) for all points of a lattice.
        common: Membership of the intersections, shape (N, n, n) [i, j, k], or (n, n) for a lattice. None for laws
            without intersections on flat sheets: G_ij,j = 2 X_ij / |X_ij|^2, and zero for other members.
        edge_vectors: Force of a unit stress on each point [m], shape (N, 2), see `edge_vectors` and `rim_vectors`.
        strip: Points whose bonds may change, shape (N,); by default those that take part in a balance which
            the starting weights leave open: near edges and holes, and everywhere in an irregular cloud.
        kind: Points of one kind get one row of weights, shape (N,); they must have equal starting weights.
        frozen: Points whose bonds keep their starting weights, shape (N,).
        unbalanced: Points whose balance is not asked for, shape (N,).
        start: Weights to start from [m^2], shape (N, n); by default the plain ones.
        length: Unit of lengths [m]; by default the root of the mean area of the points.
        frames: Tangent vectors and normals of a curved sheet, in columns, shape (N, 3, 3). The stress is then an equal
            tension in all directions, and the balance that along the surface.
    """
    begin = time.perf_counter()
    size = len(points)
    table = _Table(points, areas, neighbours, influence, common, frames)
    usable = np.concatenate([_gradients(table, part)[1] for part in _parts(np.arange(size), neighbours)])
    start = _start(table, usable) if start is None else np.where(usable, start, 0.0)
    length = float(np.sqrt(areas.mean())) if length is None else length
    gap = (edge_vectors - _forces(table, start)) / length
    asked = np.ones(size, bool) if unbalanced is None else ~unbalanced
    if strip is None:
        open_points = (np.abs(gap).max(axis=1) > BALANCED) & asked
        strip = open_points | (open_points[neighbours] & (neighbours >= 0)).any(axis=1)
    free = strip if frozen is None else strip & ~frozen

    column, unknown_start = _unknowns(free, start, kind)
    matrix = _balance_matrix(table, column, len(unknown_start)) * length
    plain = unknown_start / length**2
    rows = np.flatnonzero(np.repeat(asked, 2) & (np.diff(matrix.indptr) > 0))
    asked_matrix, asked_gap = matrix[rows], gap.ravel()[rows]
    if frames is not None and len(unknown_start):
        from scipy import sparse

        # On a flat sheet the balance keeps the sum of the weights; on a curved one nothing else would.
        counts = np.bincount(column[column >= 0], minlength=len(unknown_start))
        same_sum = sparse.csr_matrix(counts / np.sqrt(len(unknown_start)))
        asked_matrix, asked_gap = sparse.vstack([asked_matrix, same_sum], format="csr"), np.append(asked_gap, 0.0)
    # On uneven sheets the search takes many steps.
    uneven = kind is None and areas.max() > UNEVEN * areas.min()
    family = np.sort(np.nonzero(column >= 0)[0]) if uneven else None
    ratio = closest_balanced(asked_matrix, plain, asked_gap, FLOOR, family)

    weights = start.copy()
    changed = column >= 0
    weights[changed] *= ratio[column[changed]]
    left = np.where(asked, np.abs(gap - (matrix @ (plain * (ratio - 1.0))).reshape(gap.shape)).max(axis=1), 0.0)
    return CorrectedWeights(
        weights=weights,
        residual=length * float(left.max(initial=0.0)),
        left=length * left,
        start_residual=length * float(np.abs(gap[asked]).max(initial=0.0)),
        smallest_ratio=float(ratio.min(initial=1.0)),
        largest_ratio=float(ratio.max(initial=1.0)),
        unbalanced_points=int((left > BALANCED).sum()),
        seconds=time.perf_counter() - begin,
    )


def _start(table: _Table, usable: np.ndarray) -> np.ndarray:
    """Plain weights [m^2]; without intersections a_i c_ij |X_ij|^2 / tr K_i."""
    if table.common is not None:
        return plain_weights(table.areas, table.neighbours, table.common, usable)
    bonds = table.points[table.neighbours] - table.points[:, None]
    pull = np.where(usable, table.influence * table.areas[table.neighbours] * (bonds**2).sum(axis=-1), 0.0)
    return np.asarray(table.areas[:, None] * pull / pull.sum(axis=1, keepdims=True))


class _Table(NamedTuple):
    """Arrays of the families, see `corrected_weights`."""

    points: np.ndarray
    areas: np.ndarray
    neighbours: np.ndarray
    influence: np.ndarray
    common: np.ndarray | None
    frames: np.ndarray | None


def _parts(at: np.ndarray, neighbours: np.ndarray) -> list[np.ndarray]:
    """Split the point indices `at` into parts whose dense blocks fit in memory."""
    return np.array_split(at, max(1, len(at) * neighbours.shape[1] ** 2 // BLOCK))


def _gradients(table: _Table, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vectors G_ij,k of the bonds of the P points `at`; that of the point itself is minus their sum over k.

    Returns:
        Vectors [1/m], shape (P, n, n, 2) [i, j, k], on a curved sheet in space, (P, n, n, 3); whether the intersection
        spans an area, shape (P, n).
    """
    member = table.neighbours[at]
    exists = member >= 0
    influence = table.influence if table.influence.ndim == 1 else table.influence[at]
    bonds = np.where(exists[..., None], table.points[member] - table.points[at][:, None], 0.0)
    rises = None
    if table.frames is not None:
        bonds = bonds @ table.frames[at]
        bonds, rises = bonds[..., :2], bonds[..., 2]
    if table.common is None:
        squared = np.where(exists, (bonds**2).sum(axis=-1), 1.0)
        return np.eye(exists.shape[1])[:, :, None] * (2.0 * bonds / squared[..., None])[:, :, None], exists
    coefficient = np.where(exists, table.areas[member] * influence, 0.0)
    common = table.common[None] if table.common.ndim == 2 else table.common[at]
    inside = common & exists[:, :, None] & exists[:, None, :]
    moments = np.einsum("ik,ika,ikb->ikab", coefficient, bonds, bonds).reshape(*exists.shape, 4)
    shape = (inside.astype(np.float64) @ moments).reshape(*exists.shape, 2, 2)
    determinant = shape[..., 0, 0] * shape[..., 1, 1] - shape[..., 0, 1] ** 2
    trace = shape[..., 0, 0] + shape[..., 1, 1]
    usable = exists & (determinant > DEGENERATE * (0.5 * trace) ** 2)
    inverse = np.linalg.inv(np.where(usable[..., None, None], shape, np.eye(2)))
    vectors = np.einsum("ijab,ik,ikb->ijka", inverse, coefficient, bonds, optimize=True)
    if table.frames is not None and rises is not None:
        tilts = np.einsum("ijka,ik,ijk->ija", vectors, rises, inside)
        vectors = np.einsum("icd,ijkd->ijkc", table.frames[at], _tilted(vectors, tilts), optimize=True)
    return np.where((inside & usable[..., None])[..., None], vectors, 0.0), usable


def _tilted(vectors: np.ndarray, tilts: np.ndarray) -> np.ndarray:
    """O R^-1 v = (I; g) C0^-1 v (kernels/kinematics.py) of vectors v, shape (P, n, n, 2), and tilts g, (P, n, 2)."""
    g = tilts[:, :, None]
    along = (g * vectors).sum(axis=-1, keepdims=True) / (1.0 + (g * g).sum(axis=-1, keepdims=True))
    return np.concatenate([vectors - along * g, along], axis=-1)


def _forces(table: _Table, weights: np.ndarray) -> np.ndarray:
    """sum_ij W_ij G_ij,m for every point m [m], shape (N, 2); on a curved sheet along its tangent vectors."""
    total = np.zeros_like(table.points)
    for part in _parts(np.arange(len(total)), table.neighbours):
        on_members = np.einsum("ij,ijka->ika", weights[part], _gradients(table, part)[0])
        exists = table.neighbours[part] >= 0
        np.add.at(total, table.neighbours[part][exists], on_members[exists])
        total[part] -= on_members.sum(axis=1)
    if table.frames is not None:
        return np.asarray(np.einsum("nc,nca->na", total, table.frames[..., :2]))
    return total


def _unknowns(free: np.ndarray, start: np.ndarray, kind: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Index of the unknown of each bond (-1 if fixed), shape (N, n); starting weight of each unknown, shape (U,)."""
    n = start.shape[1]
    key = (np.arange(len(start)) if kind is None else kind)[:, None] * n + np.arange(n)
    loose = free[:, None] & (start > 0.0)
    _, first, inverse = np.unique(key[loose], return_index=True, return_inverse=True)
    column = np.full(start.shape, -1)
    column[loose] = inverse
    return column, start[loose][first]


def _balance_matrix(table: _Table, column: np.ndarray, unknowns: int) -> sparse.csr_matrix:
    """G of the free bonds [1/m], with rows 2 m + component and one column per unknown, shape (2 N, U)."""
    from scipy import sparse

    neighbours, extent = table.neighbours, (2 * len(table.points), unknowns)
    total = sparse.csr_matrix(extent)
    for part in _parts(np.flatnonzero((column >= 0).any(axis=1)), neighbours):
        vectors, _ = _gradients(table, part)
        own = -vectors.sum(axis=2, keepdims=True)
        target = np.concatenate([neighbours[part], part[:, None]], axis=1)
        vectors = np.concatenate([vectors, own], axis=2)
        keep = (np.abs(vectors).max(axis=-1) > 0.0) & (column[part] >= 0)[..., None]
        i, j, k = np.nonzero(keep)
        entries = vectors[keep]
        if table.frames is not None:
            entries = np.einsum("ec,eca->ea", entries, table.frames[target[i, k]][..., :2])
        row = 2 * target[i, k][:, None] + np.arange(2)
        col = np.repeat(column[part][i, j][:, None], 2, axis=1)
        total += sparse.csr_matrix((entries.ravel(), (row.ravel(), col.ravel())), shape=extent)
    total.sum_duplicates()
    return total


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
    return ratio if balanced else _softened(problem)


def _softened(problem: _Dual) -> np.ndarray:
    """Ratios, shape (U,), where no positive weights balance all points."""
    size = len(problem.gap)
    multiplier, ratio, _ = _maximise(problem, np.zeros(size), np.full(size, SOFTNESS))
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
    """The problem of `closest_balanced`, in units of the spacing."""

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
