"""Families of bonds on the host, and the shape tensors of their intersections.

Lengths are divided by the horizon and areas by the mean area of a point (the reference area), so that the
tables contain numbers of order one in any units. For bond (i,j), the intersection D_ij contains the members k of
H_i with |X_k - X_j| <= horizon, j included.

In a mask of members, k is bit k % 32 of word k // 32.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..device.checks import InputError, evaluate, finite, numbers, one_of
from ..device.cores import cores
from ..geometry.sheet import Sheet
from ..geometry.triangulation import Lattice
from ..kernels.families import WORD
from ..kernels.kinematics import DEGENERATE

# Relative tolerance of lengths that are compared with the horizon.
TOLERANCE = 1e-9
# Entries of a table, or of points times members squared, that a core processes at once: they stay in its cache.
BLOCK = 200_000

InfluenceFunction = Callable[[np.ndarray], np.ndarray]
INFLUENCE: dict[str, InfluenceFunction] = {
    "linear": lambda r: 1.0 - r,
    "inverse": lambda r: 1.0 / r,
    "inverse_square": lambda r: 1.0 / r**2,
}


def influence_function(influence: str | InfluenceFunction) -> InfluenceFunction:
    """The influence function of r = |X| / horizon, given by name or as a function."""
    if callable(influence):
        ratios = np.array([0.25, 0.5, 1.0])
        values = numbers("influence(array)", evaluate("influence(array)", influence, [ratios]))
        if values.shape != ratios.shape:
            raise InputError(f"influence(array): expected shape {ratios.shape} as the array, got {values.shape}")
        return influence
    return INFLUENCE[one_of("influence", influence, INFLUENCE)]


@dataclass(frozen=True)
class WholeFamilies:
    """Properties of the whole sheet's families, kept by the families of a part.

    Attributes:
        commonest_row: Row of the largest number of points, see `Families`.
        has_common: Whether any point has this row.
    """

    bonds: int
    commonest_row: int
    has_common: bool


@dataclass(eq=False)
class Families:
    """Rows of families: one per point on a cloud, one per family class (points with equal families) on a lattice.

    On a grid with gaps, row 0 is shared by all deep points, and every other point has a separate row. There are R rows
    of n members; a nonexistent member has `exists` False and zeros elsewhere.

    Attributes:
        horizon: Horizon [m].
        reference_area: Mean area of a point [m^2].
        exists: Mask of existing members, shape (R, n).
        bonds: X / horizon, shape (R, n, 2), or (n, 2) if all rows share a stencil.
        influence: Influence function w, shape (R, n) or (n,).
        common: Bit masks of the intersections, uint32, shape (R, n, words) or (n, words); empty for laws that do not
            use them.
        member_areas: Area of each member divided by the reference area, shape (R, n).
        areas: Area of the row's point divided by the reference area, shape (R,).
        family_class: Row of each point, shape (N,); None on a cloud, where point i has row i.
        neighbours: Index of each member, -1 if it does not exist, shape (R, n), on a cloud or grid; -1 throughout row 0
            of a grid.
        reverses: Member index of the reverse bond (the point in the family of its member), shape (R, n), or (n,) on a
            lattice.
        shift: Index offset of each member, shape (n,), on a lattice.
        steps: Lattice steps to each member, shape (n, 2), on a lattice; on a grid those of row 0, which may be fewer
            than n.
        centres: Index of the grid point straight above or below each point of row 0, one entry for each line of the
            stencil, from below, shape (lines, N), on a grid; meaningless for other points.
        first: A point of each row, shape (R,), on a lattice or grid.
        severed: Mask of rows that lost members to a cut, shape (R,).
        factors: Factor on the energy of the row's point (`Sheet.factors`), shape (R,), or None for 1 everywhere.
        frames: Tangent vectors and normal of each point, in columns, shape (N, 3, 3), on a curved sheet. `bonds` are
            then projections on the tangent plane, in this frame.
        chords: X / horizon in space, shape (N, n, 3), on a curved sheet.
        materials: Index of the material of each bond, uint8, shape (N, n), on a cloud of several; or None.
        whole: Properties of the whole sheet's families, if these are the families of a part of it.
    """

    horizon: float
    reference_area: float
    exists: np.ndarray
    bonds: np.ndarray
    influence: np.ndarray
    common: np.ndarray
    member_areas: np.ndarray
    areas: np.ndarray
    reverses: np.ndarray
    family_class: np.ndarray | None = None
    neighbours: np.ndarray | None = None
    shift: np.ndarray | None = None
    steps: np.ndarray | None = None
    centres: np.ndarray | None = None
    first: np.ndarray | None = None
    severed: np.ndarray | None = None
    factors: np.ndarray | None = None
    frames: np.ndarray | None = None
    chords: np.ndarray | None = None
    materials: np.ndarray | None = None
    whole: WholeFamilies | None = None

    @property
    def layout(self) -> str:
        """Layout: "lattice", "grid" or "cloud"."""
        if self.family_class is None:
            return "cloud"
        return "lattice" if self.centres is None else "grid"

    @property
    def members(self) -> int:
        """Maximum number of members of a family."""
        return int(self.exists.shape[1])

    @property
    def words(self) -> int:
        """32-bit words of a mask."""
        return -(-self.members // WORD)

    @property
    def points(self) -> int:
        """Number of points."""
        return len(self.exists) if self.family_class is None else len(self.family_class)

    @property
    def lengths(self) -> np.ndarray:
        """|X| / horizon of each member, shape (R, n) or (n,)."""
        return np.asarray(np.linalg.norm(self.bonds if self.chords is None else self.chords, axis=-1))

    @property
    def member_coefficients(self) -> np.ndarray:
        """c_k = w a_k of each member divided by the reference area, shape (R, n); zero for missing members."""
        return np.asarray(np.where(self.exists, self.influence, 0.0) * self.member_areas)

    def points_of_rows(self) -> np.ndarray:
        """Number of points that use each row, shape (R,), on a lattice or grid."""
        assert self.family_class is not None
        return np.bincount(self.family_class, minlength=len(self.exists))

    @property
    def commonest_row(self) -> int:
        """The row used by most points of the whole sheet, on a lattice or grid; on a grid the row of deep points."""
        if self.whole is not None:
            return self.whole.commonest_row
        return 0 if self.layout == "grid" else int(self.points_of_rows().argmax())

    @property
    def has_common(self) -> bool:
        """Whether any point of the whole sheet uses the commonest row."""
        return self.whole.has_common if self.whole else bool(np.any(self.family_class == self.commonest_row))

    @property
    def bond_count(self) -> int:
        """Number of bonds, each counted from both ends."""
        if self.whole is not None:
            return self.whole.bonds
        sizes = self.exists.sum(axis=1)
        return int(sizes.sum() if self.family_class is None else (sizes * self.points_of_rows()).sum())

    def rows_of_points(self, values: np.ndarray) -> np.ndarray:
        """Expand values by row, shape (R, ...), to values by point, shape (N, ...)."""
        return values if self.family_class is None else values[self.family_class]

    def heads(self, points: np.ndarray, members: np.ndarray) -> np.ndarray:
        """Point indices of members of points (broadcast); meaningless for bonds that do not exist."""
        if self.shift is not None:
            return np.asarray(np.asarray(points, dtype=np.int64) + self.shift[members])
        assert self.neighbours is not None
        found = np.asarray(self.neighbours[self._rows(points), members], dtype=np.int64)
        if self.family_class is None or self.centres is None or self.steps is None:
            return found
        step = self.steps[np.minimum(members, len(self.steps) - 1)]
        line = step[..., 1] + len(self.centres) // 2
        return np.asarray(np.where(self.family_class[points] > 0, found, self.centres[line, points] + step[..., 0]))

    def reverse_members(self, points: np.ndarray, members: np.ndarray) -> np.ndarray:
        """Member indices of the reverse bonds (broadcast)."""
        if self.reverses.ndim == 1:
            return np.asarray(self.reverses[members])
        return np.asarray(self.reverses[self._rows(points), members])

    def _rows(self, points: np.ndarray) -> np.ndarray:
        return points if self.family_class is None else np.asarray(self.family_class[points])

    def index_reach(self) -> int:
        """Largest difference of the indices of two points that share a bond."""
        if self.shift is not None:
            return int(np.abs(self.shift).max())
        assert self.neighbours is not None
        index = np.arange(self.points) if self.first is None else self.first
        apart = np.where(self.neighbours >= 0, self.neighbours - index[:, None], 0)
        reach = int(np.abs(apart).max())
        if self.centres is not None and self.steps is not None:
            deep = np.flatnonzero(self.family_class == 0)
            for y, line in enumerate(self.centres, start=-(len(self.centres) // 2)):
                widest = np.abs(self.steps[self.steps[:, 1] == y, 0]).max()
                reach = max(reach, int(np.abs(line[deep] - deep).max(initial=0) + widest))
        return reach

    def members_of(self, points: np.ndarray) -> np.ndarray:
        """Members of the given points' undamaged families, shape (P, members); -1 where there is none."""
        points = np.asarray(points, dtype=np.int64)
        exists = self.exists[self._rows(points)]
        heads = self.heads(points[:, None], np.arange(self.members)[None])
        return np.where(exists, heads, -1)

    def scaled(self, weights: np.ndarray) -> np.ndarray:
        """Weights of the energy by row, shape (R, n), multiplied by the factor of the row's point."""
        return weights if self.factors is None else self.factors[:, None] * weights

    def inverse_shapes(self) -> tuple[np.ndarray, np.ndarray]:
        """K_ij^-1 (11, 12, 22), (R, n, 3), and |D_ij| over the reference area, (R, n); zero where degenerate."""
        rows, n = self.exists.shape
        if self.bonds.ndim == 3:
            from .rows import shapes_by_row

            return shapes_by_row(self.bonds, self.influence, self.member_areas, self.exists, self.common)
        inverse, size = np.empty((rows, n, 3)), np.empty((rows, n))

        def fill(part: slice) -> None:
            inverse[part], size[part] = self._shapes_of(part)

        in_blocks(rows, n * n, fill)
        return inverse, size

    @property
    def rises(self) -> np.ndarray:
        """Heights of the members over the tangent plane / horizon, shape (N, n), on a curved sheet."""
        assert self.frames is not None and self.chords is not None
        return np.asarray(np.einsum("nka,na->nk", self.chords, self.frames[..., 2]))

    def tilts(self, inverse: np.ndarray) -> np.ndarray:
        """Tilts of the intersections of a curved sheet against tangent planes (kernels/kinematics.py), (N, n, 2)."""
        rises, tilts = self.rises, np.empty((*inverse.shape[:2], 2))

        def fill(part: slice) -> None:
            c = np.where(self.exists[part], self.influence[part], 0.0) * self.member_areas[part]
            mask = unpack(self.common[part], self.members).astype(np.float64)
            moment = mask @ ((c * rises[part])[..., None] * self.bonds[part])
            a, b, d = np.moveaxis(inverse[part], -1, 0)
            first, second = a * moment[..., 0] + b * moment[..., 1], b * moment[..., 0] + d * moment[..., 1]
            tilts[part] = tilts_of(np.stack([first, second], axis=-1))

        in_blocks(len(inverse), self.members**2, fill)
        return tilts

    def _shapes_of(self, part: slice) -> tuple[np.ndarray, np.ndarray]:
        bonds = self.bonds[None]
        c = np.where(self.exists[part], self.influence, 0.0) * self.member_areas[part]
        mask = unpack(self.common, self.members).astype(np.float64)
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


def tilts_of(slopes: np.ndarray) -> np.ndarray:
    """Tilts of slopes, both of shape (..., 2), see kernels/kinematics.py."""
    s = np.sqrt(1.0 + (slopes**2).sum(axis=-1, keepdims=True))
    return np.asarray(slopes / np.sqrt(s * (1.0 + s)))


def inverse_shape(shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverse of shape tensors (11, 12, 22), shape (..., 3), zero where degenerate; mask of the others, shape (...)."""
    determinant = shape[..., 0] * shape[..., 2] - shape[..., 1] ** 2
    usable = determinant > DEGENERATE * (0.5 * (shape[..., 0] + shape[..., 2])) ** 2
    inverse = np.stack([shape[..., 2], -shape[..., 1], shape[..., 0]], axis=-1)
    inverse /= np.where(usable, determinant, 1.0)[..., None]
    return np.where(usable[..., None], inverse, 0.0), usable


def in_blocks(rows: int, entries: int, work: Callable[[slice], None]) -> None:
    """Call `work` on slices of the rows, each row with `entries` entries, on all cores."""
    step = max(1, BLOCK // entries)
    for _ in cores().map(work, [slice(begin, min(begin + step, rows)) for begin in range(0, rows, step)]):
        pass


def pack(mask: np.ndarray) -> np.ndarray:
    """Pack booleans, shape (..., n), into 32-bit words, uint32, shape (..., words)."""
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


# Largest horizon in spacings: beyond it the masks of a family's intersections take gigabytes.
MAX_HORIZON = 16.0
# Spacings along x and y that differ by a smaller fraction are meant to be equal.
ALIKE = 0.1
# Members that a family lacks along one axis, as a fraction of all, from which a note says so.
LOPSIDED = 0.1


@dataclass(frozen=True)
class Horizon:
    """Maximum length of a bond; on a graded sheet for a pair with the mean spacing.

    Attributes:
        ratio: Horizon in spacings of the sheet [-].
        length: Horizon [m].
    """

    ratio: float
    length: float

    @staticmethod
    def of(sheet: Sheet, ratio: float) -> Horizon:
        """Create the horizon from its length in spacings of a sheet."""
        return Horizon(ratio, ratio * sheet.spacing)

    def reach(self, step: float) -> int:
        """Number of lattice steps of length `step` [m] within the horizon along an axis."""
        return int(self.length / step + 1e-6)


def checked_horizon(sheet: Sheet, horizon: float) -> Horizon:
    """Check the horizon in spacings of a sheet and create it. Raises InputError if it is too small or too large."""
    ratio = finite("horizon", horizon)
    if ratio < 1.0:
        raise InputError(f"horizon = {horizon!r}: expected at least 1 spacing, and 1.42 on a lattice")
    across = float(sheet.extent.max()) / sheet.spacing * (1.0 + TOLERANCE)
    if ratio > min(across, MAX_HORIZON):
        raise InputError(
            f"horizon = {horizon!r}: expected at most {min(across, MAX_HORIZON):.4g} spacings, "
            + (
                f"because the sheet is {across:.4g} spacings long"
                if across < MAX_HORIZON
                else "as families become too large beyond"
            )
        )
    return Horizon.of(sheet, ratio)


def require_diagonals(sheet: Sheet, horizon: float) -> None:
    """Check that the families of a lattice determine deformation gradients."""
    if sheet.lattice is None:
        return
    if horizon * sheet.spacing < np.hypot(sheet.lattice.dx, sheet.lattice.dy) * (1.0 - TOLERANCE):
        dx, dy = sheet.lattice.dx, sheet.lattice.dy
        least = np.hypot(dx, dy) / sheet.spacing
        uneven = f", or spacings more alike than {dx:.4g} and {dy:.4g} m" if least > 1.42 else ""
        raise InputError(
            f"horizon = {horizon!r}: expected at least {np.ceil(100.0 * least) / 100.0:g} on a lattice, "
            f"so that families contain their diagonal neighbours{uneven}"
        )


def notes_on_reach(sheet: Sheet, length: float) -> list[str]:
    """A note if families of a horizon [m] reach further along one axis of a nearly square lattice than along the other.

    They are exact in uniform strain, but cracks along x and y, and waves, are then not alike.
    """
    lattice = sheet.lattice
    if lattice is None or lattice.rows == 1 or abs(lattice.dx / lattice.dy - 1.0) > ALIKE:
        return []
    members, longest = _lopsided(lattice, length)
    if len(longest) < LOPSIDED * members:
        return []
    enough = np.ceil(100.0 * longest.max() / sheet.spacing) / 100.0
    cured = not len(_lopsided(lattice, enough * sheet.spacing)[1])
    return [
        f"the spacings along x and y are {lattice.dx:.4g} and {lattice.dy:.4g} m: families of {members} members reach "
        f"further along one axis than along the other; expected numbers of points with equal spacings"
        + (f", or a horizon of {enough:g}" if cured else "")
    ]


def _lopsided(lattice: Lattice, length: float) -> tuple[int, np.ndarray]:
    """Number of members of a family, and lengths [m] of the steps that it lacks and has with x and y exchanged."""
    reach = int(length / min(lattice.dx, lattice.dy)) + 1
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    lengths = np.hypot(x * lattice.dx, y * lattice.dy)
    inside = lengths <= length * (1.0 + TOLERANCE)
    return int(inside.sum()) - 1, lengths[inside.T & ~inside]
