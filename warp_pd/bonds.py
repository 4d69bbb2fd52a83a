"""Families of bonds on the host: stencil of a lattice or table of a cloud, masks of their intersections.

Lengths are divided by the horizon and areas by the mean area of a point (the reference area), so that the
tables hold numbers of order one in any units. For bond (i,j), the intersection D_ij holds the members k of
H_i with |X_k - X_j| <= horizon, j included. Masks are 32-bit words: bit k % 32 of word k // 32.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .checks import InputError, finite, one_of
from .kernels.families import WORD
from .kernels.kinematics import DEGENERATE
from .launches import Workspace, cores
from .sheet import Sheet, crosses

TOLERANCE = 1e-9
# Largest horizon in spacings: beyond, the masks of a family's intersections take gigabytes.
MOST = 16.0
# Entries of a table, or of points times members squared, that a core works on at once: they stay in its cache.
BLOCK = 200_000

InfluenceFunction = Callable[[np.ndarray], np.ndarray]
INFLUENCE: dict[str, InfluenceFunction] = {
    "linear": lambda r: 1.0 - r,
    "inverse": lambda r: 1.0 / r,
    "inverse_square": lambda r: 1.0 / r**2,
}


def influence_function(influence: str | InfluenceFunction) -> InfluenceFunction:
    """The influence function of r = |X| / horizon, by name or as it is.

    Raises:
        InputError: for an unknown name.
    """
    if callable(influence):
        return influence
    return INFLUENCE[one_of("influence", influence, INFLUENCE)]


@dataclass(eq=False)
class Families:
    """Rows of families: one a point on a cloud, one a kind of surroundings on a lattice.

    R rows of n members; a member that does not exist has `exists` False and zeros elsewhere.

    Attributes:
        horizon: [m].
        reference_area: Mean area of a point [m^2].
        exists: shape (R, n).
        bonds: X / horizon, shape (R, n, 2), or (n, 2) where all rows share a stencil.
        influence: w, shape (R, n) or (n,).
        common: Masks of the intersections over all members of the stencil or row, uint32, shape
            (R, n, words) or (n, words); empty for laws that do not read them.
        member_areas: Area of each member over the reference area, shape (R, n).
        areas: Area of the row's point over the reference area, shape (R,).
        kind: Row of each point, shape (N,), on a lattice; None on a cloud, where point i has row i.
        neighbours: Index of each member, -1 if it does not exist, shape (N, n), on a cloud.
        mates: Member index under which a member sees the point, shape (N, n), or (n,) on a lattice.
        shift: Index offset of each member, shape (n,), on a lattice.
        steps: Lattice steps to each member, shape (n, 2), on a lattice.
        first: A point of each row, shape (R,), on a lattice.
        severed: Whether the row lost members to a cut, shape (R,).
        stiffness: Factor on the moduli of the row's point, shape (R,), or None on a sheet of one material.
    """

    horizon: float
    reference_area: float
    exists: np.ndarray
    bonds: np.ndarray
    influence: np.ndarray
    common: np.ndarray
    member_areas: np.ndarray
    areas: np.ndarray
    mates: np.ndarray
    kind: np.ndarray | None = None
    neighbours: np.ndarray | None = None
    shift: np.ndarray | None = None
    steps: np.ndarray | None = None
    first: np.ndarray | None = None
    severed: np.ndarray | None = None
    stiffness: np.ndarray | None = None

    @property
    def layout(self) -> str:
        """Layout: "lattice" or "cloud"."""
        return "cloud" if self.kind is None else "lattice"

    @property
    def members(self) -> int:
        """Most members of a family."""
        return int(self.exists.shape[1])

    @property
    def words(self) -> int:
        """32-bit words of a mask."""
        return -(-self.members // WORD)

    @property
    def points(self) -> int:
        """Number of points."""
        return len(self.exists) if self.kind is None else len(self.kind)

    @property
    def member_shares(self) -> np.ndarray:
        """c_k = w a_k of each member over the reference area, shape (R, n); zero where there is none."""
        return np.where(self.exists, self.influence, 0.0) * self.member_areas

    @property
    def bond_count(self) -> int:
        """Number of bonds, each counted from both ends."""
        sizes = self.exists.sum(axis=1)
        return int(sizes.sum() if self.kind is None else sizes[self.kind].sum())

    def rows_of_points(self, values: np.ndarray) -> np.ndarray:
        """Values by row, shape (R, ...), as values by point, shape (N, ...)."""
        return values if self.kind is None else values[self.kind]

    def stiffened(self, weights: np.ndarray) -> np.ndarray:
        """Weights of the energy by row, shape (R, n), times the factor on the moduli."""
        return weights if self.stiffness is None else self.stiffness[:, None] * weights

    def inverse_shapes(self) -> tuple[np.ndarray, np.ndarray]:
        """Inverse shape tensors and sizes of the intersections of every row.

        Returns:
            K_ij^-1 (components 11, 12, 22; zero where degenerate), shape (R, n, 3), and |D_ij| over the
            reference area (zero where degenerate or where the bond does not exist), shape (R, n).
        """
        rows, n = self.exists.shape
        inverse, size = np.empty((rows, n, 3)), np.empty((rows, n))

        def fill(part: slice) -> None:
            inverse[part], size[part] = self._shapes_of(part)

        _in_blocks(rows, n * n, fill)
        return inverse, size

    def _shapes_of(self, part: slice) -> tuple[np.ndarray, np.ndarray]:
        shared = self.bonds.ndim == 2
        bonds = self.bonds[None] if shared else self.bonds[part]
        c = np.where(self.exists[part], self.influence if shared else self.influence[part], 0.0)
        c = c * self.member_areas[part]
        mask = unpack(self.common if shared else self.common[part], self.members).astype(np.float64)
        products = c[..., None] * np.stack(
            [bonds[..., 0] ** 2, bonds[..., 0] * bonds[..., 1], bonds[..., 1] ** 2], axis=-1
        )
        terms = np.concatenate(
            [products, np.where(self.exists[part], self.member_areas[part], 0.0)[..., None]], axis=-1
        )
        sums = mask @ terms
        shape, size = sums[..., :3], sums[..., 3]
        inverse, usable = inverse_shape(shape)
        usable &= self.exists[part]
        return np.where(usable[..., None], inverse, 0.0), np.where(usable, size, 0.0)


def inverse_shape(shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverse of shape tensors (11, 12, 22), shape (..., 3); zero where degenerate, and where not, shape (...)."""
    determinant = shape[..., 0] * shape[..., 2] - shape[..., 1] ** 2
    usable = determinant > DEGENERATE * (0.5 * (shape[..., 0] + shape[..., 2])) ** 2
    inverse = np.stack([shape[..., 2], -shape[..., 1], shape[..., 0]], axis=-1)
    inverse /= np.where(usable, determinant, 1.0)[..., None]
    return np.where(usable[..., None], inverse, 0.0), usable


def pack(mask: np.ndarray) -> np.ndarray:
    """Booleans, shape (..., n), as words of 32 bits, uint32, shape (..., words)."""
    n = mask.shape[-1]
    words = -(-n // WORD)
    padded = np.zeros((*mask.shape[:-1], words * WORD), bool)
    padded[..., :n] = mask
    packed = np.packbits(padded, axis=-1, bitorder="little")
    return np.ascontiguousarray(packed).view("<u4").astype(np.uint32)


def unpack(words: np.ndarray, members: int) -> np.ndarray:
    """The inverse of `pack`."""
    as_bytes = np.ascontiguousarray(words.astype("<u4")).view(np.uint8)
    return np.unpackbits(as_bytes, axis=-1, bitorder="little")[..., :members].astype(bool)


def build_families(
    sheet: Sheet, horizon: float, influence: str | InfluenceFunction, depth: int = 0, intersections: bool = True
) -> Families:
    """Families of every point.

    Args:
        sheet: The sheet; a lattice shares one stencil.
        horizon: Horizon over the spacing of the sheet [-].
        influence: Name of an influence function, or a function of r = |X| / horizon.
        depth: On a lattice, points up to this many spacings from an edge keep rows of their own, more than
            the families alone would need (corrected weights differ that far inside).
        intersections: Whether the law asks for intersections of families; without them no masks are made, and
            the horizon may be as short as one spacing.

    Raises:
        InputError: for a horizon too small for any intersection to hold two directions, one larger than the sheet
            or than 16 spacings, or a point without neighbours.
    """
    ratio = finite("horizon", horizon)
    if ratio < 1.0:
        raise InputError(f"horizon = {horizon!r}: allowed is 1 spacing or more, and 1.42 on a lattice")
    across = float(np.ptp(sheet.points, axis=0).max()) / sheet.spacing * (1.0 + TOLERANCE)
    if ratio > min(across, MOST):
        raise InputError(
            f"horizon = {horizon!r}: allowed is up to {min(across, MOST):.4g} spacings, "
            + (f"for the sheet is {across:.4g} spacings long" if across < MOST else "beyond, families get too large")
        )
    function = influence_function(influence)
    if intersections:
        require_diagonals(sheet, horizon)
    if sheet.lattice is not None:
        return _lattice_families(sheet, ratio * sheet.spacing, function, depth, intersections)
    return _cloud_families(sheet, ratio * sheet.spacing, function, intersections)


def require_diagonals(sheet: Sheet, horizon: float) -> None:
    """Check that the families of a lattice determine deformation gradients.

    Raises:
        InputError: for a horizon, over the spacing, that leaves out the diagonal neighbours.
    """
    if sheet.lattice is None:
        return
    if horizon * sheet.spacing < np.hypot(sheet.lattice.dx, sheet.lattice.dy) * (1.0 - TOLERANCE):
        raise InputError(
            f"horizon = {horizon!r}: allowed on a lattice is 1.42 or more, "
            f"so that families hold their diagonal neighbours"
        )


def _lattice_families(
    sheet: Sheet, horizon: float, function: InfluenceFunction, depth: int, intersections: bool
) -> Families:
    lattice = sheet.lattice
    assert lattice is not None
    reach_x, reach_y = int(horizon / lattice.dx + 1e-6), int(horizon / lattice.dy + 1e-6)
    if lattice.rows == 1:
        reach_y = 0
    oy, ox = np.mgrid[-reach_y : reach_y + 1, -reach_x : reach_x + 1]
    length = np.hypot(ox * lattice.dx, oy * lattice.dy)
    inside = (length > 0.0) & (length <= horizon * (1.0 + TOLERANCE))
    ox, oy, r = ox[inside], oy[inside], np.minimum(length[inside] / horizon, 1.0)
    offsets = np.column_stack([ox * lattice.dx, oy * lattice.dy])
    apart = np.linalg.norm(offsets[:, None] - offsets[None], axis=-1)
    mates = np.array([int(np.flatnonzero((ox == -a) & (oy == -b))[0]) for a, b in zip(ox, oy, strict=True)])

    # Points whose surroundings are the same up to `reach` share a row.
    reach = max(reach_x, reach_y, depth) + 1
    ix, iy = np.arange(lattice.columns), np.arange(lattice.rows)
    near_x = _edge_code(lattice.columns, reach)
    near_y = _edge_code(lattice.rows, reach)
    code = near_y[:, None].astype(np.int64) * (near_x.max() + 1) + near_x[None, :]
    column, row = (grid.ravel() for grid in np.meshgrid(ix, iy))
    code = code.ravel()
    severed = _severed(sheet, column, row, ox, oy)
    if severed is not None:
        touched, lost = severed
        patterns, which = np.unique(pack(lost), axis=0, return_inverse=True)
        code = code * (len(patterns) + 1)
        code[touched] += 1 + which.ravel()
    if sheet.stiffness is not None:
        factors, which = np.unique(sheet.stiffness, return_inverse=True)
        code = code * len(factors) + which.ravel()
    _, first, kind = np.unique(code, return_index=True, return_inverse=True)

    to_x, to_y = column[first, None] + ox, row[first, None] + oy
    exists = (to_x >= 0) & (to_x < lattice.columns) & (to_y >= 0) & (to_y < lattice.rows)
    severed_rows = np.zeros(len(first), bool)
    if severed is not None:
        touched, lost = severed
        position = np.full(sheet.size, -1)
        position[touched] = np.arange(len(touched))
        here = position[first]
        exists[here >= 0] &= ~lost[here[here >= 0]]
        severed_rows[here >= 0] = lost[here[here >= 0]].any(axis=1)
    reference_area = float(sheet.areas.mean())
    member = np.where(exists, to_y * lattice.columns + to_x, 0)
    return Families(
        horizon=horizon,
        reference_area=reference_area,
        exists=exists,
        bonds=offsets / horizon,
        influence=function(r),
        common=pack(apart <= horizon * (1.0 + TOLERANCE)) if intersections else np.zeros((0, 0), np.uint32),
        member_areas=np.where(exists, sheet.areas[member], 0.0) / reference_area,
        areas=sheet.areas[first] / reference_area,
        mates=mates,
        kind=kind.ravel().astype(np.int32),
        shift=(oy * lattice.columns + ox).astype(np.int32),
        steps=np.column_stack([ox, oy]),
        first=first,
        severed=severed_rows,
        stiffness=None if sheet.stiffness is None else sheet.stiffness[first],
    )


def _edge_code(length: int, reach: int) -> np.ndarray:
    """0 .. reach - 1 from one end, reach inside, reach + 1 .. from the other end; all distinct if short."""
    index = np.arange(length)
    if length <= 2 * reach + 1:
        return index
    return np.where(index < reach, index, np.where(index >= length - reach, index - length + 2 * reach + 1, reach))


def _severed(
    sheet: Sheet, column: np.ndarray, row: np.ndarray, ox: np.ndarray, oy: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Points near a cut and which of their members lie across it; None without cuts."""
    if not sheet.cuts or sheet.lattice is None:
        return None
    offsets = np.column_stack([ox * sheet.lattice.dx, oy * sheet.lattice.dy])
    reach = float(np.linalg.norm(offsets, axis=1).max())
    touched = np.flatnonzero(_near_cuts(sheet, reach))
    tail = np.repeat(sheet.points[touched][:, None], len(offsets), axis=1)
    lost = np.zeros((len(touched), len(offsets)), bool)
    for segment in sheet.cuts:
        lost |= crosses(tail, tail + offsets, segment)
    return touched, lost


def _near_cuts(sheet: Sheet, reach: float) -> np.ndarray:
    """Which points lie within `reach` of a cut, shape (N,)."""
    near = np.zeros(sheet.size, bool)
    for start, end in sheet.cuts:
        a, b = np.array(start), np.array(end)
        share = np.clip((sheet.points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        near |= np.linalg.norm(sheet.points - a - share[:, None] * (b - a), axis=1) <= reach * (1.0 + 1e-6)
    return near


def _cloud_families(sheet: Sheet, horizon: float, function: InfluenceFunction, intersections: bool) -> Families:
    points, (neighbours, mates, severed) = sheet.points, _cloud_neighbours(sheet, horizon)
    size, n = neighbours.shape
    exists = neighbours >= 0
    reference_area = float(sheet.areas.mean())
    bonds, influence, member_areas = np.empty((size, n, 2)), np.empty((size, n)), np.empty((size, n))

    def fill(part: slice) -> None:
        here, member = exists[part], np.maximum(neighbours[part], 0)
        bonds[part] = np.where(here[..., None], points[member] - points[part, None], 0.0) / horizon
        r = np.minimum(np.linalg.norm(bonds[part], axis=-1), 1.0)
        influence[part] = np.where(here, function(np.where(here, r, 1.0)), 0.0)
        member_areas[part] = np.where(here, sheet.areas[member], 0.0) / reference_area

    _in_blocks(size, n, fill)
    return Families(
        horizon=horizon,
        reference_area=reference_area,
        exists=exists,
        bonds=bonds,
        influence=influence,
        common=_cloud_common(bonds, exists) if intersections else np.zeros((0, 0, 0), np.uint32),
        member_areas=member_areas,
        areas=sheet.areas / reference_area,
        mates=mates,
        neighbours=neighbours,
        severed=severed,
        stiffness=sheet.stiffness,
    )


def _cloud_neighbours(sheet: Sheet, horizon: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tables of neighbours, in rising order, and mates, shape (N, n); points that lost bonds to a cut, shape (N,)."""
    from scipy import sparse
    from scipy.spatial import cKDTree

    points, size = sheet.points, sheet.size
    pairs = cKDTree(points).query_pairs(horizon * (1.0 + TOLERANCE), output_type="ndarray")
    severed = np.zeros(size, bool)
    for segment in sheet.cuts:
        across = crosses(points[pairs[:, 0]], points[pairs[:, 1]], segment)
        severed[pairs[across]] = True
        pairs = pairs[~across]
    half = sparse.coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(size, size)).tocsr()
    graph = half + half.T
    sizes = np.diff(graph.indptr)
    if (sizes == 0).any():
        lone = int(np.flatnonzero(sizes == 0)[0])
        raise InputError(
            f"points[{lone}] at {points[lone].tolist()} has no neighbour within the horizon "
            f"{horizon:.6g} m: allowed are points with at least one; raise the horizon or remove the point"
        )
    member = np.arange(int(sizes.max()), dtype=np.int32)
    exists = member < sizes[:, None]
    neighbours = np.full(exists.shape, -1, np.int32)
    neighbours[exists] = graph.indices
    # Bond (i, j) is entry e by rows; by columns, entry e is its mate.
    slot = np.broadcast_to(member, exists.shape)[exists]
    mates = np.zeros(exists.shape, np.int32)
    mates[exists] = sparse.csr_array((slot, graph.indices, graph.indptr), shape=graph.shape).tocsc().data
    return neighbours, mates, severed


def _cloud_common(bonds: np.ndarray, exists: np.ndarray) -> np.ndarray:
    points, n = exists.shape
    common = np.empty((points, n, -(-n // WORD)), np.uint32)
    limit = (1.0 + TOLERANCE) ** 2

    def fill(part: slice) -> None:
        x, y, here = bonds[part, :, 0], bonds[part, :, 1], exists[part]
        apart = (x[:, :, None] - x[:, None]) ** 2
        apart += (y[:, :, None] - y[:, None]) ** 2
        common[part] = pack((apart <= limit) & here[:, :, None] & here[:, None])

    _in_blocks(points, n * n, fill)
    return common


def _in_blocks(rows: int, entries: int, work: Callable[[slice], None]) -> None:
    """Do the work on slices of the rows, of so many entries each, on all cores."""
    step = max(1, BLOCK // entries)
    for _ in cores().map(work, [slice(begin, min(begin + step, rows)) for begin in range(0, rows, step)]):
        pass


def _by_member(values: np.ndarray, scalar: Any, axes: tuple[int, ...] = (1, 0)) -> np.ndarray:
    """A table by point, shape (N, n, ...), with its axes in another order, in the type of the device."""
    table = np.empty([values.shape[axis] for axis in axes], scalar)
    by_point = table.transpose(np.argsort(axes))

    def fill(part: slice) -> None:
        by_point[part] = values[part]

    _in_blocks(len(values), max(1, values[0].size), fill)
    return table


def family_struct(
    families: Families,
    functions: Any,
    types: Any,
    workspace: Workspace,
    owner: str,
    inverse: np.ndarray | None,
    weights: np.ndarray,
) -> Any:
    """The tables on the device, as the struct of `kernels.families`.

    Args:
        families: The rows.
        functions: FamilyFunctions of the layout.
        types: Numeric types.
        workspace: Takes the arrays.
        owner: Who asked.
        inverse: K^-1 by row, shape (R, n, 3); None where the law knows no intersections: neither these nor
            their masks are put on the device then.
        weights: W over the reference area by row, shape (R, n).
    """
    import warp as wp

    s = functions.struct()
    s.members, s.words = families.members, families.words
    family_areas = families.member_areas.sum(axis=1)
    real = wp.dtype_to_numpy(types.real)

    def put(name: str, values: np.ndarray, dtype: Any) -> Any:
        return workspace.array(name, owner, dtype, values)

    if families.layout == "lattice":
        s.stencil_shift = put("stencil_shift", families.shift, wp.int32)  # type: ignore[arg-type]
        s.stencil_mate = put("stencil_mate", families.mates, wp.int32)
        s.stencil_bond = put("stencil_bond", families.bonds, types.vec2)
        s.stencil_influence = put("stencil_influence", families.influence, types.real)
        if families.common.size:
            s.stencil_common = put("stencil_common", families.common, wp.uint32)
        s.kind = put("kind", families.kind, wp.int32)  # type: ignore[arg-type]
        s.kind_whole = put("kind_whole", pack(families.exists), wp.uint32)
        if inverse is not None:
            s.kind_shape = put("kind_shape", inverse, types.vec3)
        s.kind_weight = put("kind_weight", weights, types.real)
        s.kind_area = put("kind_area", families.areas, types.real)
        s.kind_family_area = put("kind_family_area", family_areas, types.real)
        return s
    s.neighbours = put("neighbours", _by_member(families.neighbours, np.int32), wp.int32)  # type: ignore[arg-type]
    s.mates = put("mates", _by_member(families.mates, np.int32), wp.int32)
    s.bonds = put("bonds", _by_member(families.bonds, real, (1, 0, 2)), types.vec2)
    s.influences = put("influences", _by_member(families.influence, real), types.real)
    if families.common.size:
        s.commons = put("commons", _by_member(families.common, np.uint32, (1, 2, 0)), wp.uint32)
    s.wholes = put("wholes", pack(families.exists).T, wp.uint32)
    if inverse is not None:
        s.shapes = put("shapes", _by_member(inverse, real, (1, 0, 2)), types.vec3)
    s.weights = put("weights", _by_member(weights, real), types.real)
    s.areas = put("areas", families.areas, types.real)
    s.family_areas = put("family_areas", family_areas, types.real)
    return s
