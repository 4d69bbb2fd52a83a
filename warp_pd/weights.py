"""Area weights of the bonds: plain, and corrected so that a uniform stress is in equilibrium up to the edge.

The variational bond-associated form has the energy E = h sum_ij W_ij Psi(F_ij). W_ij is the area that bond
(i, j) stands for, and F_ij = sum_m y_m (x) G_ij,m is the deformation gradient of the intersection D_ij of the
families of i and j (j itself belongs to it):

    G_ij,k = w_ik a_k K_ij^-1 X_ik  for k in D_ij,   G_ij,i = -(sum of these),
    K_ij = sum_{k in D_ij} w_ik a_k X_ik (x) X_ik.

Under a uniform first Piola stress P the internal force on point m is -h P sum_ij W_ij G_ij,m. It balances
the traction on the sheet's edge if sum_ij W_ij G_ij,m = b_m at every point, where b_m is half of each
adjacent edge times its outward normal. The plain weights W0_ij = a_i |D_ij| / sum_j |D_ij| fulfil this inside
a lattice only. The corrected ones fulfil it everywhere, stay positive, and change W0 as little as they can:

    minimise  sum_q W0_q phi(W_q / W0_q)   subject to   sum_q W_q G_q,m = b_m   for every point m,
    phi(s) = (s - 1)^2 / 2 + (s - 1) / (1 - f) - log((s - f) / (1 - f)),   f = `floor`.

The square is the relative change; the logarithm keeps W above f W0. Squares alone give weights down to
-4.5 W0 at a horizon of 3.15 spacings, and Newton's method then finds no equilibrium of a sheet that is
clamped at both ends and stretched by 1.2.

The bond-associated family is that of Yang, Chen & Liu (Eng. Fract. Mech. 2024, 110131). Their published force
uses other weights and has no energy; the energy, the plain weights and the correction are this project's own.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from .checks import InputError, count, finite
from .kernels.kinematics import DEGENERATE

# Least ratio of corrected to plain weights, by default; lattices of 10 points and more allow it.
FLOOR = 0.05
# Force per unit stress, in spacings, that counts as balanced.
BALANCED = 1e-10
# Entries of the dense (points, members, members) blocks that are held at once.
_BLOCK = 2_000_000
# Where positive weights cannot balance a point, residual^2 / (2 softness) joins the objective instead.
_SOFTNESS = (1e-2, 1e-4)
# Ratio beyond which the dual is taken to have no maximum; the largest seen at one is 60.
_HOPELESS = 1e4


@dataclass(frozen=True, eq=False)
class CorrectedWeights:
    """Weights of every bond, and how far they are from balance and from the weights they started from.

    Attributes:
        weights: W_ij [m^2], shape (N, n); zero where there is no bond or its intersection spans no area.
        residual: Largest component of sum_ij W_ij G_ij,m - b_m over the balanced points [m].
        start_residual: The same of the weights they started from [m].
        smallest_ratio: Least ratio of corrected to starting weights.
        largest_ratio: Greatest ratio of corrected to starting weights.
        unbalanced_points: Number of points whose residual is more than round-off, though their balance was
            asked for: no weights above the floor balance them.
        changed_points: Number of points whose bonds were free to change.
        seconds: Wall time.
    """

    weights: np.ndarray
    residual: float
    start_residual: float
    smallest_ratio: float
    largest_ratio: float
    unbalanced_points: int
    changed_points: int
    seconds: float


@dataclass(frozen=True, eq=False)
class RectangleWeights:
    """Corrected weights of a rectangular lattice of any size, as one row a kind of place.

    Attributes:
        table: W_ij [m^2], shape (kinds along x, kinds along y, n).
        columns: Points along x.
        rows: Points along y.
        depth: Points further than this many spacings from all edges keep the plain weights.
        solved: The solve on the reduced lattice; its weights have one row a point of that lattice.
    """

    table: np.ndarray
    columns: int
    rows: int
    depth: int
    solved: CorrectedWeights

    def at(self, column: np.ndarray, row: np.ndarray) -> np.ndarray:
        """Weights [m^2] of the points in lattice places (column, row), each of shape (P,); shape (P, n)."""
        x, y = clipped_index(self.columns, self.depth), clipped_index(self.rows, self.depth)
        return np.asarray(self.table[x[column], y[row]])

    def kinds(self) -> np.ndarray:
        """Row of `table.reshape(-1, n)` of each point, shape (N,); point = column + row * columns."""
        x, y = clipped_index(self.columns, self.depth), clipped_index(self.rows, self.depth)
        return np.asarray((x[None, :] * self.table.shape[1] + y[:, None]).ravel())


def clipped_index(length: int, depth: int) -> np.ndarray:
    """Kind of each place along an edge of `length` points, shape (length,).

    0 .. depth - 1 from one end, depth in the middle, depth + 1 .. 2 depth up to the other end; if the edge is
    shorter than that, each place is a kind of its own.
    """
    index = np.arange(length)
    if length <= 2 * depth + 1:
        return index
    return np.where(index < depth, index, np.maximum(index - (length - 1 - 2 * depth), depth))


def edge_vectors(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Force of a unit stress on each point, b_m = integral of grad N_m over the triangles [m], shape (N, 2).

    Inside the sheet it is zero; on the edge it is half of each adjacent edge times its outward normal.

    Args:
        points: Reference positions [m], shape (N, 2).
        triangles: Triangulation, of either orientation, shape (F, 3).
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


def plain_weights(
    areas: np.ndarray, neighbours: np.ndarray, common: np.ndarray, usable: np.ndarray | None = None
) -> np.ndarray:
    """Plain weights W0_ij = a_i |D_ij| / sum_j |D_ij| [m^2], shape (N, n).

    Args:
        areas: Area of each point [m^2], shape (N,).
        neighbours: Index of each family member, -1 where there is none, shape (N, n).
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
    """Points in whose balance the families of the chosen points take part: these and their members.

    Of the points whose families a cut severs, these are the balances that their plain weights leave open.

    Args:
        neighbours: Index of each family member, -1 where there is none, shape (N, n).
        chosen: shape (N,), bool.

    Returns:
        shape (N,), bool.
    """
    reached = chosen.copy()
    members = neighbours[chosen]
    reached[members[members >= 0]] = True
    return reached


def corrected_weights(
    points: np.ndarray,
    areas: np.ndarray,
    neighbours: np.ndarray,
    influence: np.ndarray,
    common: np.ndarray,
    *,
    edge_vectors: np.ndarray,
    strip: np.ndarray | None = None,
    kind: np.ndarray | None = None,
    frozen: np.ndarray | None = None,
    unbalanced: np.ndarray | None = None,
    start: np.ndarray | None = None,
    floor: float = FLOOR,
    degenerate: float = DEGENERATE,
) -> CorrectedWeights:
    """Positive weights next to the plain ones for which a uniform stress is in equilibrium at every point.

    If no weights above `floor` do so, the points that cannot be balanced trade their residual against the
    change. They are few unless the sheet is narrow or its points very irregular; the others stay balanced.

    Args:
        points: Reference positions [m], shape (N, 2).
        areas: Area of each point [m^2], shape (N,).
        neighbours: Index of each family member, -1 where there is none, shape (N, n).
        influence: w_ij, shape (N, n), or (n,) for all points of a lattice.
        common: Membership of the intersections, shape (N, n, n) [i, j, k], or (n, n) for a lattice.
        edge_vectors: Force of a unit stress on each point [m], shape (N, 2), see `edge_vectors`.
        strip: Points whose bonds may change, shape (N,); by default those that take part in a balance which
            the starting weights leave open: near edges and holes, and everywhere in an irregular cloud.
        kind: Points of one kind get one row of weights, shape (N,); they must have equal starting weights.
        frozen: Points whose bonds keep their starting weights, shape (N,).
        unbalanced: Points whose balance is not asked for, shape (N,).
        start: Weights to start from [m^2], shape (N, n); by default the plain ones.
        floor: Least ratio of corrected to starting weights, at least 0 and below 1.
        degenerate: det K / (tr K / 2)^2 below which a bond gets no weight.

    Raises:
        InputError: for a floor outside [0, 1) or arrays whose shapes do not fit.
    """
    begin = time.perf_counter()
    floor = finite("floor", floor)
    if not 0.0 <= floor < 1.0:
        raise InputError(f"floor = {floor!r}: allowed is a number of 0 or more, below 1")
    size = len(points)
    _check_shapes(
        size,
        areas=(areas, ()),
        edge_vectors=(edge_vectors, (2,)),
        start=(start, neighbours.shape[1:]),
        strip=(strip, ()),
        kind=(kind, ()),
        frozen=(frozen, ()),
        unbalanced=(unbalanced, ()),
    )
    table = _Table(points, areas, neighbours, influence, common, degenerate)
    usable = np.concatenate([_gradients(table, part)[1] for part in _parts(np.arange(size), neighbours)])
    start = plain_weights(areas, neighbours, common, usable) if start is None else np.where(usable, start, 0.0)
    length = float(np.sqrt(areas.mean()))
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
    ratio = _closest_balanced(matrix[rows], plain, gap.ravel()[rows], floor)

    weights = start.copy()
    changed = column >= 0
    weights[changed] *= ratio[column[changed]]
    left = np.abs(gap - (matrix @ (plain * (ratio - 1.0))).reshape(gap.shape)).max(axis=1)[asked]
    return CorrectedWeights(
        weights=weights,
        residual=length * float(left.max(initial=0.0)),
        start_residual=length * float(np.abs(gap[asked]).max(initial=0.0)),
        smallest_ratio=float(ratio.min(initial=1.0)),
        largest_ratio=float(ratio.max(initial=1.0)),
        unbalanced_points=int((left > BALANCED).sum()),
        changed_points=int(free.sum()),
        seconds=time.perf_counter() - begin,
    )


def rectangle_corrected(
    columns: int,
    rows: int,
    spacing: float | tuple[float, float],
    *,
    offsets: np.ndarray,
    influence: np.ndarray,
    common: np.ndarray,
    depth: int | None = None,
    floor: float = FLOOR,
) -> RectangleWeights:
    """Corrected weights of a rectangular lattice of any size, whose outer points lie on its edges.

    Places with the same distances from the edges, up to `depth`, share their weights. A lattice with just
    enough points that its middle does not feel its edges has all kinds of places; the weights found on it
    balance every larger one exactly.

    Args:
        columns: Points along x.
        rows: Points along y.
        spacing: Distance of neighbouring points, or (along x, along y) [m].
        offsets: Lattice steps to each family member, int, shape (n, 2).
        influence: w of each member, shape (n,).
        common: Whether member k belongs to the intersection of member j, shape (n, n) [j, k].
        depth: Layers of points along the edges that may change; by default twice the reach of
            the families, 3 at least.
        floor: Least ratio of corrected to plain weights.

    Raises:
        InputError: for fewer than 2 points along an edge, or a depth less than the reach of the families.
    """
    columns, rows = count("columns", columns, 2), count("rows", rows, 2)
    reach = int(np.abs(offsets).max())
    depth = max(2 * reach, 3) if depth is None else count("depth", depth, reach)
    step = np.broadcast_to(np.asarray(spacing, dtype=np.float64), (2,))
    lengths = tuple(min(length, 2 * (depth + reach) + 1) for length in (columns, rows))
    place = np.indices(lengths).reshape(2, -1)

    target = place[:, :, None] + offsets.T[:, None, :]
    exists = ((target >= 0) & (target < np.array(lengths)[:, None, None])).all(axis=0)
    neighbours = np.where(exists, target[0] * lengths[1] + target[1], -1).astype(np.int32)
    share, normal = np.empty((2, place.shape[1])), np.empty((2, place.shape[1]))
    for axis in range(2):
        low, high = place[axis] == 0, place[axis] == lengths[axis] - 1
        share[axis] = step[axis] * np.where(low | high, 0.5, 1.0)
        normal[axis] = high.astype(np.float64) - low

    clip = [clipped_index(length, depth) for length in lengths]
    kind = clip[0][place[0]] * (clip[1].max() + 1) + clip[1][place[1]]
    deep = np.logical_and.reduce([(lengths[a] > 2 * depth) & (clip[a][place[a]] == depth) for a in range(2)])
    # The balance of a point feels families up to one reach away: beyond depth + reach all are the same.
    balance = [clipped_index(length, depth + reach) for length in lengths]
    balance_kind = balance[0][place[0]] * (balance[1].max() + 1) + balance[1][place[1]]
    repeated = np.ones(place.shape[1], bool)
    repeated[np.unique(balance_kind, return_index=True)[1]] = False
    solved = corrected_weights(
        points=(place * step[:, None]).T,
        areas=share[0] * share[1],
        neighbours=neighbours,
        influence=influence,
        common=common,
        edge_vectors=(normal * share[::-1]).T,
        strip=~deep,
        kind=kind,
        unbalanced=repeated,
        floor=floor,
    )
    first = np.unique(kind, return_index=True)[1]
    table = solved.weights[first].reshape(clip[0].max() + 1, clip[1].max() + 1, -1)
    return RectangleWeights(table, columns, rows, depth, solved)


class _Table(NamedTuple):
    """Arrays of the families, see `corrected_weights`."""

    points: np.ndarray
    areas: np.ndarray
    neighbours: np.ndarray
    influence: np.ndarray
    common: np.ndarray
    degenerate: float


def _check_shapes(size: int, **arrays: tuple[np.ndarray | None, tuple[int, ...]]) -> None:
    for name, (array, inner) in arrays.items():
        if array is not None and array.shape != (size, *inner):
            raise InputError(f"{name} has shape {array.shape}: allowed is {(size, *inner)} for {size} points")


def _parts(at: np.ndarray, neighbours: np.ndarray) -> list[np.ndarray]:
    """The point indices `at` in parts whose dense blocks fit in memory."""
    return np.array_split(at, max(1, len(at) * neighbours.shape[1] ** 2 // _BLOCK))


def _gradients(table: _Table, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vectors G_ij,k of the bonds of the P points `at`; that of the point itself is minus their sum over k.

    Returns:
        Vectors [1/m], shape (P, n, n, 2) [i, j, k]; whether the intersection spans an area, shape (P, n).
    """
    member = table.neighbours[at]
    exists = member >= 0
    influence = table.influence if table.influence.ndim == 1 else table.influence[at]
    bonds = np.where(exists[..., None], table.points[member] - table.points[at][:, None], 0.0)
    coefficient = np.where(exists, table.areas[member] * influence, 0.0)
    common = table.common[None] if table.common.ndim == 2 else table.common[at]
    inside = common & exists[:, :, None] & exists[:, None, :]
    moments = np.einsum("ik,ika,ikb->ikab", coefficient, bonds, bonds).reshape(*exists.shape, 4)
    shape = (inside.astype(np.float64) @ moments).reshape(*exists.shape, 2, 2)
    determinant = shape[..., 0, 0] * shape[..., 1, 1] - shape[..., 0, 1] ** 2
    trace = shape[..., 0, 0] + shape[..., 1, 1]
    usable = exists & (determinant > table.degenerate * (0.5 * trace) ** 2)
    inverse = np.linalg.inv(np.where(usable[..., None, None], shape, np.eye(2)))
    vectors = np.einsum("ijab,ik,ikb->ijka", inverse, coefficient, bonds, optimize=True)
    return np.where((inside & usable[..., None])[..., None], vectors, 0.0), usable


def _forces(table: _Table, weights: np.ndarray) -> np.ndarray:
    """sum_ij W_ij G_ij,m of every point m [m], shape (N, 2)."""
    total = np.zeros_like(table.points)
    for part in _parts(np.arange(len(total)), table.neighbours):
        on_members = np.einsum("ij,ijka->ika", weights[part], _gradients(table, part)[0])
        exists = table.neighbours[part] >= 0
        np.add.at(total, table.neighbours[part][exists], on_members[exists])
        total[part] -= on_members.sum(axis=1)
    return total


def _unknowns(free: np.ndarray, start: np.ndarray, kind: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Unknown of each bond, -1 where fixed, shape (N, n); starting weight of each unknown, shape (U,)."""
    n = start.shape[1]
    key = (np.arange(len(start)) if kind is None else kind)[:, None] * n + np.arange(n)
    loose = free[:, None] & (start > 0.0)
    _, first, inverse = np.unique(key[loose], return_index=True, return_inverse=True)
    column = np.full(start.shape, -1)
    column[loose] = inverse
    return column, start[loose][first]


def _balance_matrix(table: _Table, column: np.ndarray, unknowns: int) -> sparse.csr_matrix:
    """G of the free bonds [1/m]: row 2 m + component, one column an unknown, shape (2 N, U)."""
    neighbours, extent = table.neighbours, (2 * len(table.points), unknowns)
    total = sparse.csr_matrix(extent)
    for part in _parts(np.flatnonzero((column >= 0).any(axis=1)), neighbours):
        vectors, _ = _gradients(table, part)
        own = -vectors.sum(axis=2, keepdims=True)
        target = np.concatenate([neighbours[part], part[:, None]], axis=1)
        vectors = np.concatenate([vectors, own], axis=2)
        keep = (np.abs(vectors).max(axis=-1) > 0.0) & (column[part] >= 0)[..., None]
        i, j, k = np.nonzero(keep)
        row = 2 * target[i, k][:, None] + np.arange(2)
        col = np.repeat(column[part][i, j][:, None], 2, axis=1)
        total += sparse.csr_matrix((vectors[keep].ravel(), (row.ravel(), col.ravel())), shape=extent)
    total.sum_duplicates()
    return total


def _closest_balanced(matrix: sparse.csr_matrix, plain: np.ndarray, gap: np.ndarray, floor: float) -> np.ndarray:
    """Ratios s above the floor that close the gap, matrix (plain (s - 1)) = gap, with the least change.

    Returns:
        Ratios, shape (U,).
    """
    if np.abs(gap).max(initial=0.0) <= BALANCED:
        return np.ones(len(plain))
    problem = _Dual(matrix, matrix.T.tocsr(), plain, gap, floor)
    nothing = np.zeros(len(gap))
    _, ratio, balanced = _maximise(problem, nothing, nothing)
    if balanced:
        return ratio
    multiplier = nothing
    for price in _SOFTNESS:
        multiplier, ratio, _ = _maximise(problem, multiplier, np.full(len(gap), price))
    # Most points can be balanced all the same: stay soft only where much is left.
    left = np.abs(price * multiplier)
    for share in (0.3, 0.1, 0.03):
        local = np.where(left > share * left.max(), price, 0.0)
        _, local_ratio, balanced = _maximise(problem, multiplier, local)
        if balanced:
            return local_ratio
    return ratio


class _Dual(NamedTuple):
    """The problem of `_closest_balanced`, in units of the spacing."""

    matrix: sparse.csr_matrix
    transposed: sparse.csr_matrix
    plain: np.ndarray
    gap: np.ndarray
    floor: float

    def left(self, ratio: np.ndarray) -> np.ndarray:
        """The gap that the ratios leave, shape (M,)."""
        return np.asarray(self.gap - self.matrix @ (self.plain * (ratio - 1.0)))

    def value(self, multiplier: np.ndarray, softness: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """The dual's value, the ratios s with phi'(s) = z, z = G lambda, and ds / dz, shape (U,)."""
        pull = self.transposed @ multiplier
        above, slope = _above_floor(pull, self.floor)
        ratio = self.floor + above
        conjugate = pull * (ratio - 1.0) - _change(above, self.floor)
        value = multiplier @ self.gap - self.plain @ conjugate - 0.5 * softness @ multiplier**2
        return float(value), ratio, slope


def _maximise(
    problem: _Dual, multiplier: np.ndarray, softness: np.ndarray, steps: int = 40
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Newton's method on the dual, which is smooth and has no constraints.

    Args:
        problem: With M balances and U unknowns.
        multiplier: Where to start, shape (M,).
        softness: Where it is above zero, residual^2 / (2 softness) replaces the constraint, shape (M,).
        steps: Most Newton steps; problems that have a solution took up to 15.

    Returns:
        Multipliers, shape (M,); ratios, shape (U,); whether the optimum was reached.
    """
    value, ratio, slope = problem.value(multiplier, softness)
    for _ in range(steps):
        gradient = problem.left(ratio) - softness * multiplier
        if np.abs(gradient).max() <= 1e-12 or ratio.max() > _HOPELESS:
            break
        curvature = problem.matrix @ sparse.diags(problem.plain * slope) @ problem.transposed
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
    """phi(s) of s = floor + above: zero and smallest at s = 1, infinite at the floor."""
    room = 1.0 - floor
    return 0.5 * (above - room) ** 2 + (above - room) / room - np.log(above / room)


def _above_floor(pull: np.ndarray, floor: float) -> tuple[np.ndarray, np.ndarray]:
    """The s - floor with phi'(s) = (s - 1) + 1 / (1 - floor) - 1 / (s - floor) = pull, and ds / dpull."""
    room = 1.0 - floor
    half = 0.5 * (pull + room - 1.0 / room)
    root = np.sqrt(half * half + 1.0)
    # Of the two equal forms of the root, the one without cancellation.
    above = np.where(half >= 0.0, half + root, 1.0 / (root + np.abs(half)))
    return above, 1.0 / (1.0 + above**-2)
