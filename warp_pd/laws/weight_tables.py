"""Families and weights of the bond-associated law, and of laws with one gradient per point, on host and device."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError
from ..device.result_cache import ResultCache
from ..families import (
    Families,
    InfluenceFunction,
    build_families,
    inverse_shape,
    pack,
    require_connected,
    require_diagonals,
    require_unfolded,
    unpack,
)
from ..families.tables import in_blocks
from ..geometry.sheet import Sheet
from ..geometry.triangulation import local_spacings
from ..kernels.families import family_functions
from ..kernels.numeric import Numeric

if TYPE_CHECKING:
    from ..families.lattice import RectangleWeights
    from ..families.weights import CorrectedWeights

# Largest horizon at which weights are corrected, and largest number of points with families not deep inside a grid,
# which take 4 GB.
MAX_CORRECTED = 4.5
MAX_CORRECTED_CLOUD = 1_000_000
# Largest horizon in spacings of the place, where triangles are smaller than elsewhere: beyond, no weights balance the
# families around, which are much smaller.
MAX_LOCAL = 7.0
# Force on a point per unit stress that the weights leave unbalanced, in spacings: more than the first is noted, more
# than the second is refused.
LEFT_NOTED, LEFT_REFUSED = 1e-3, 0.3
# Horizons that are tried where weights cannot be balanced, on sheets of up to so many points.
TRIED, MOST_TRIED = (1.8, 2.015, 2.5, 3.15), 3000


Tables = tuple[Families, np.ndarray, np.ndarray, dict[str, float] | None]
# A sweep, a fit, and the coarser lattices of a path ask for the same tables many times.
TABLES = ResultCache()


def law_tables(context: Context, horizon: float, influence: str | InfluenceFunction, weights: str) -> Tables:
    """Families of the local points and their tables; arguments and results as for `weight_tables`."""
    settings, partition = (horizon, influence, weights), context.partition
    if partition is None:
        tables = weight_tables(context.whole, *settings)
    else:
        tables = context.communicator.tables_here(context.whole, partition, settings)
    families, inverse, found, correction = tables
    return families, inverse, families.scaled(found), correction


def weight_tables(sheet: Sheet, horizon: float, influence: str | InfluenceFunction, weights: str) -> Tables:
    """Families and their tables.

    Args:
        sheet: The sheet.
        horizon: Horizon in spacings of the sheet [-].
        influence: Influence function, see `BondAssociated`.
        weights: "published", "plain" or "corrected".

    Returns:
        The families; K^-1 by row, shape (R, n, 3); weights divided by the reference area by row, shape (R, n) (for
        "published" the sizes |D_ij|); a report on the correction, or None.

    Raises:
        InputError: if weights cannot be corrected for this horizon or so large a cloud, or leave much unbalanced.
    """

    def at(tried: float) -> Tables:
        return TABLES.result(_weight_tables, sheet, tried, influence, weights)

    return _balanced(sheet, horizon, "plain", at)


def _weight_tables(sheet: Sheet, horizon: float, influence: str | InfluenceFunction, weights: str) -> Tables:
    if sheet.frames is not None:
        require_unfolded(sheet)
    families, rectangle = _families(sheet, horizon, influence, weights == "corrected")
    inverse, size = families.inverse_shapes()
    if sheet.lattice is None:
        require_connected(sheet, families, horizon, size > 0.0, lines=weights == "corrected")
    if weights == "published":
        return families, inverse, size, None
    plain = plain_weights(families, size)
    if weights == "plain":
        return families, inverse, plain, None
    return families, inverse, *_corrected(families, sheet, rectangle, plain)


def plain_weights(families: Families, size: np.ndarray) -> np.ndarray:
    """Weights in proportion to the sizes of the intersections, divided by the reference area, shape (R, n)."""
    total = size.sum(axis=1)
    return np.asarray((families.areas / np.where(total > 0.0, total, 1.0))[:, None] * size)


def point_tables(sheet: Sheet, horizon: float, influence: str | InfluenceFunction, corrected: bool) -> Tables:
    """Families without intersections and their tables.

    Args:
        sheet: The sheet.
        horizon: Horizon in spacings of the sheet [-].
        influence: Influence function, see `BondAssociated`.
        corrected: Whether to use corrected weights, one per bond, for which a uniform stress is in equilibrium.

    Returns:
        The families; K_i^-1 by row (11, 12, 22; zero where degenerate), shape (R, 1, 3); 2 / tr K_i, shape (R, 1), or
        the corrected weights divided by the reference area, shape (R, n); a report on the correction, or None.

    Raises:
        InputError: if weights cannot be corrected for this horizon or so large a cloud, or leave much unbalanced.
    """
    return _balanced(sheet, horizon, "published", lambda tried: _point_tables(sheet, tried, influence, corrected))


def _point_tables(sheet: Sheet, horizon: float, influence: str | InfluenceFunction, corrected: bool) -> Tables:
    families, rectangle = _families(sheet, horizon, influence, corrected, intersections=False)
    require_diagonals(sheet, horizon)
    shape = _shapes(families)
    inverse = inverse_shape(shape)[0][:, None]
    if not corrected:
        return families, inverse, (2.0 / _trace(shape))[:, None], None
    # The published force, as the part of the point's area that each bond stands for.
    published = (families.areas / _trace(shape))[:, None] * families.member_coefficients * families.lengths**2
    return families, inverse, *_corrected(families, sheet, rectangle, published, intersections=False)


def _families(
    sheet: Sheet, horizon: float, influence: str | InfluenceFunction, corrected: bool, intersections: bool = True
) -> tuple[Families, RectangleWeights | None]:
    """Families with a separate row for each point whose weights are corrected, and those weights on a rectangle."""
    if corrected:
        _require_correctable(sheet, horizon, "plain" if intersections else "published")
    families = build_families(sheet, horizon, influence, corrected, intersections)
    return families, _rectangle(families, sheet, intersections) if corrected and sheet.lattice is not None else None


def _corrected(
    families: Families, sheet: Sheet, rectangle: RectangleWeights | None, start: np.ndarray, intersections: bool = True
) -> tuple[np.ndarray, dict[str, float]]:
    """Corrected weights over the reference area, shape (R, n), from those to correct, and the report."""
    if rectangle is not None:
        return _of_rectangle(families, sheet, rectangle, start), _report(rectangle.solved, sheet, None)
    at_rows, solved, at = _correction(families, sheet, start, intersections)
    return at_rows / families.reference_area, _report(solved, sheet, at)


def _balanced(sheet: Sheet, horizon: float, instead: str, at: Callable[[float], Tables]) -> Tables:
    """The tables that `at` makes for the horizon. Raises InputError if corrected weights leave too much unbalanced."""
    families, inverse, weights, report = at(horizon)
    if report is not None and report["left"] > LEFT_REFUSED:
        raise _unbalanced(sheet, horizon, report, instead, at)
    # Tables may be kept, and a run may write to its report.
    return families, inverse, weights, None if report is None else dict(report)


def _unbalanced(
    sheet: Sheet, horizon: float, report: dict[str, float], instead: str, at: Callable[[float], Tables]
) -> InputError:
    """The error for weights that leave much unbalanced, with the place and a horizon that would do."""
    expected = f"horizon = {_other(horizon)}"
    if sheet.size <= MOST_TRIED:
        expected = "triangles of more even size"
        for tried in (each for each in TRIED if each > horizon + 0.05):
            try:
                found = at(tried)[3]
            except InputError:
                continue
            if found is not None and found["left"] <= LEFT_NOTED:
                expected = f"horizon = {tried:g}"
                break
    return InputError(
        f"weights = 'corrected' at horizon = {horizon!r}: {balance_left(report, sheet)}: expected {expected}, or "
        f"weights {instead!r}"
    )


def balance_left(report: dict[str, float], sheet: Sheet) -> str:
    """What a report of a correction says on points left unbalanced, with the place of the worst."""
    place = ""
    if report["worst_point"] >= 0:
        place = f", most at ({', '.join(f'{x:.4g}' for x in sheet.points[int(report['worst_point'])])}) m"
    return (
        f"no positive weights balance a uniform stress at {report['points_left_unbalanced']} points, up to "
        f"{100.0 * report['left']:.2g} % of the traction on a spacing{place}"
    )


def notes_on_balance(report: dict[str, float] | None, sheet: Sheet, horizon: float) -> list[str]:
    """A note if corrected weights leave points unbalanced at a horizon [spacings]."""
    if report is None or report["left"] <= LEFT_NOTED:
        return []
    return [f"weights: {balance_left(report, sheet)}; another horizon, such as {_other(horizon)}, may balance them"]


def _other(horizon: float) -> str:
    """Horizons that balance most sheets [spacings], but for the one in use."""
    return " or ".join(f"{each:g}" for each in (2.015, 3.15) if abs(each - horizon) > 0.01 * each)


def notes_on_areas(weights: str, sheet: Sheet) -> list[str]:
    """A note if published weights act on points of half areas, which the papers do not have."""
    if weights != "published" or sheet.lattice is None or sheet.areas.min() > 0.75 * sheet.areas.max():
        return []
    return [
        "weights = 'published': points on edges have half areas; BA and NN count one area a point, which changes "
        "answers by some percent: Sheet.rectangle(areas='whole')"
    ]


def _shapes(families: Families) -> np.ndarray:
    """K_i of every row (11, 12, 22) divided by the squared horizon and the reference area, shape (R, 3)."""
    bonds = families.bonds if families.bonds.ndim == 3 else families.bonds[None]
    c = families.member_coefficients
    return np.stack([(c * bonds[..., p] * bonds[..., q]).sum(axis=1) for p, q in ((0, 0), (0, 1), (1, 1))], axis=-1)


def _trace(shape: np.ndarray) -> np.ndarray:
    return np.asarray(shape[:, 0] + shape[:, 2])


def _require_correctable(sheet: Sheet, horizon: float, instead: str) -> None:
    if horizon > MAX_CORRECTED:
        raise InputError(
            f"weights = 'corrected' at horizon = {horizon!r}: expected a horizon up to {MAX_CORRECTED}; "
            f"or use weights {instead!r}"
        )
    if sheet.layout == "cloud":
        _require_few(sheet.size, instead)
        _require_even(sheet, horizon, instead)


def _require_even(sheet: Sheet, horizon: float, instead: str) -> None:
    """Check that no triangles of a cloud are much smaller than the horizon, which has one length everywhere."""
    if sheet.spacings is not None or not len(sheet.triangles):
        return
    local = local_spacings(sheet.points, sheet.triangles)
    finest = int(np.argmin(local))
    ratio = horizon * sheet.spacing / float(local[finest])
    if ratio > MAX_LOCAL:
        place = ", ".join(f"{x:.4g}" for x in sheet.points[finest])
        raise InputError(
            f"weights = 'corrected' at horizon = {horizon!r}, which is {ratio:.3g} spacings of the triangles at "
            f"({place}) m: expected at most {MAX_LOCAL:g}; take graded = True, for a horizon that follows the "
            f"triangles, triangles of more even size, or weights {instead!r}"
        )


def _of_rectangle(families: Families, sheet: Sheet, rectangle: RectangleWeights, plain: np.ndarray) -> np.ndarray:
    """Weights by row over the reference area, shape (R, n): corrected, but plain for families crossed by a cut."""
    assert sheet.lattice is not None and families.first is not None and families.severed is not None
    columns = sheet.lattice.columns
    corrected = rectangle.at(families.first % columns, families.first // columns) / families.reference_area
    return np.where(families.severed[:, None], plain, corrected)


def _rectangle(families: Families, sheet: Sheet, intersections: bool) -> RectangleWeights:
    from ..families.lattice import rectangle_corrected

    assert sheet.lattice is not None and families.steps is not None
    lattice = sheet.lattice
    return rectangle_corrected(
        lattice.columns,
        lattice.rows,
        (lattice.dx, lattice.dy),
        offsets=families.steps,
        influence=families.influence,
        common=unpack(families.common, families.members) if intersections else None,
    )


def _correction(
    families: Families, sheet: Sheet, plain: np.ndarray, intersections: bool
) -> tuple[np.ndarray, CorrectedWeights, np.ndarray]:
    """Corrected weights by row [m^2], shape (R, n), of a cloud or grid; their solution, and its points, shape (P,).

    Points that share a row keep their plain weights, because they and their surroundings are in equilibrium. The solve
    includes the points with separate rows, the points whose equilibrium these affect, and the members of those points'
    families.
    """
    from ..families.weights import corrected_weights, reached_points

    assert families.severed is not None
    own = np.ones(sheet.size, bool) if families.family_class is None else families.family_class > 0
    _require_few(int(own.sum()), "plain" if intersections else "published")
    balanced = _with_members(families, own)
    known = _with_members(families, balanced)
    at = np.flatnonzero(_with_members(families, known))
    here = known[at]
    rows = at[here] if families.family_class is None else families.family_class[at[here]]

    def by_point(values: np.ndarray) -> np.ndarray:
        table = np.zeros((len(at), *values.shape[1:]), values.dtype)
        table[here] = values[rows]
        return table

    neighbours = np.full((len(at), families.members), -1)
    members = families.members_of(at[here])
    neighbours[here] = np.where(members >= 0, np.searchsorted(at, members), -1)
    severed = by_point(families.severed)
    rigid = np.zeros(len(at), bool) if sheet.bodies is None else sheet.bodies[at] > 0
    solved = corrected_weights(
        sheet.points[at],
        sheet.areas[at],
        neighbours,
        by_point(families.influence),
        unpack(by_point(families.common), families.members) if intersections else None,
        edge_vectors=_edges(sheet)[at],
        start=by_point(plain) * families.reference_area,
        frozen=severed | rigid | ~own[at],
        unbalanced=reached_points(neighbours, severed) | severed | rigid | ~balanced[at],
        length=float(np.sqrt(sheet.areas.mean())),
        frames=None if families.frames is None else by_point(families.frames),
    )
    at_rows = plain * families.reference_area
    mine = own[at[here]]
    at_rows[rows[mine]] = solved.weights[here][mine]
    return at_rows, solved, at


def _edges(sheet: Sheet) -> np.ndarray:
    from ..families.weights import edge_vectors, edge_vectors_of, rim_vectors

    if sheet.frames is not None:
        return rim_vectors(sheet.points, sheet.triangles, sheet.frames)
    if sheet.barriers is None:
        return edge_vectors(sheet.points, sheet.triangles)
    return edge_vectors_of(sheet.points, sheet.barriers)


def _with_members(families: Families, points: np.ndarray) -> np.ndarray:
    """Extend a mask of points by all members of their families."""
    members = families.members_of(np.flatnonzero(points))
    reached = points.copy()
    reached[members[members >= 0]] = True
    return reached


def _require_few(points: int, instead: str) -> None:
    if points > MAX_CORRECTED_CLOUD:
        raise InputError(
            f"weights = 'corrected' on a cloud of {points} points, besides those deep inside a grid: expected up to "
            f"{MAX_CORRECTED_CLOUD}; or use weights {instead!r}"
        )


def _report(solved: CorrectedWeights, sheet: Sheet, at: np.ndarray | None) -> dict[str, float]:
    """Report on the correction for summary.json; residuals in spacings, `left` in those of the place.

    `at` are the points of the solution; None on a lattice, where it has other points than the sheet.
    """
    local: float | np.ndarray = sheet.spacing if at is None or sheet.spacings is None else sheet.spacings[at]
    left = solved.left / local
    return {
        "residual": solved.residual / sheet.spacing,
        "residual_of_plain": solved.start_residual / sheet.spacing,
        "smallest_ratio": solved.smallest_ratio,
        "largest_ratio": solved.largest_ratio,
        "points_left_unbalanced": solved.unbalanced_points,
        "left": float(left.max(initial=0.0)),
        "worst_point": -1 if at is None else int(at[np.argmax(left)]),
        "seconds": solved.seconds,
    }


# Tables are read with indices of 32 bits.
MAX_ENTRIES = 2**32
# (name, values, type) -> a table on the device.
Put = Callable[[str, np.ndarray | None, Any], Any]


def _by_member(values: np.ndarray, scalar: Any, axes: tuple[int, ...] = (1, 0)) -> np.ndarray:
    """A table by point, shape (N, n, ...), with permuted axes and in the precision of the device."""
    table = np.empty([values.shape[axis] for axis in axes], scalar)
    by_point = table.transpose(np.argsort(axes))

    def fill(part: slice) -> None:
        by_point[part] = values[part]

    in_blocks(len(values), max(1, values[0].size), fill)
    return table


def family_struct(
    families: Families,
    context: Context,
    owner: str,
    inverse: np.ndarray | None,
    weights: np.ndarray,
) -> Any:
    """Copy the tables to the device, as the struct of `kernels.families`.

    K^-1, shape (R, n, 3), is None for laws without intersections, for which no masks are stored either. Weights, shape
    (R, n), are divided by the reference area.
    """
    s: Any = family_functions(context.layout).struct()
    s.members, s.words = families.members, families.words
    s.horizon, s.inverse_horizon = families.horizon, 1.0 / families.horizon

    def put(name: str, values: np.ndarray | None, dtype: Any) -> Any:
        return context.array(name, owner, dtype, values, per="table")

    fill = _put_stencil if families.layout == "lattice" else _put_tables
    fill(s, put, context.types, families, inverse, weights)
    return s


def _put_stencil(
    s: Any, put: Put, types: Numeric, families: Families, inverse: np.ndarray | None, weights: np.ndarray
) -> None:
    """Copy the tables of a lattice: those of its stencil, and those by row."""
    s.stencil_shift = put("stencil_shift", families.shift, wp.int32)
    s.stencil_reverse = put("stencil_reverse", families.reverses, wp.int32)
    s.stencil_bond = put("stencil_bond", families.bonds, types.vec2)
    s.stencil_influence = put("stencil_influence", families.influence, types.real)
    if families.common.size:
        s.stencil_common = put("stencil_common", families.common, wp.uint32)
    s.family_class = put("family_class", families.family_class, wp.int32)
    s.class_initial = put("class_initial", pack(families.exists), wp.uint32)
    if inverse is not None:
        s.class_shape = put("class_shape", inverse, types.vec3)
    s.class_weight = put("class_weight", weights, types.real)
    s.class_area = put("class_area", families.areas, types.real)
    s.class_family_area = put("class_family_area", families.member_areas.sum(axis=1), types.real)


def _put_tables(
    s: Any, put: Put, types: Numeric, families: Families, inverse: np.ndarray | None, weights: np.ndarray
) -> None:
    """Copy the tables of a cloud or a grid, by member and row."""
    assert families.neighbours is not None
    rows, real = len(families.exists), wp.dtype_to_numpy(types.real)
    if rows * s.members >= MAX_ENTRIES:
        raise InputError(
            f"{rows} families of up to {s.members} members: expected fewer than 2^32 entries in each table; "
            "choose a shorter horizon or fewer points"
        )
    if families.common.size:
        s.commons = put("commons", _by_member(families.common, np.uint32, (1, 2, 0)), wp.uint32)
    s.initials = put("initials", pack(families.exists).T, wp.uint32)
    s.weights = put("weights", _by_member(weights, real), types.real)
    s.areas = put("areas", families.areas, types.real)
    s.family_areas = put("family_areas", families.member_areas.sum(axis=1), types.real)
    s.influences = put("influences", _by_member(families.influence, real), types.real)
    s.rows = rows
    if families.centres is not None and families.steps is not None:
        steps = np.zeros((families.members, 2), np.int32)
        steps[: len(families.steps)] = families.steps
        s.family_class = put("family_class", families.family_class, wp.int32)
        s.centres = put("centres", families.centres, wp.int32)
        s.stencil_line = put("stencil_line", steps[:, 1] + len(families.centres) // 2, wp.int32)
        s.stencil_right = put("stencil_right", steps[:, 0], wp.int32)
    s.neighbours = put("neighbours", _by_member(families.neighbours, np.int32), wp.int32)
    s.reverses = put("reverses", _by_member(families.reverses, np.int32), wp.int32)
    s.bonds = put("bonds", _by_member(families.bonds, real, (1, 0, 2)), types.vec2)
    if inverse is not None:
        s.shapes = put("shapes", _by_member(inverse, real, (1, 0, 2)), types.vec3)
    if families.materials is not None:
        s.materials = put("bond_materials", _by_member(families.materials, np.uint8), wp.uint8)
    if families.frames is not None and families.chords is not None:
        s.frames = put("frames", families.frames, types.mat33)
        s.chords = put("chords", _by_member(families.chords, real, (1, 0, 2)), types.vec3)
        if inverse is not None:
            s.tilts = put("tilts", _by_member(families.tilts(inverse), real, (1, 0, 2)), types.vec2)


def moments_of(families: Families) -> np.ndarray:
    """(c_k X_k / horizon, 1 / c_k) of each row, shape (n, R, 3); zero for missing members."""
    c = families.member_coefficients
    moments = np.zeros((families.members, len(c), 3))
    moments[..., :2] = (c[..., None] * families.bonds).transpose(1, 0, 2)
    np.divide(1.0, c.T, out=moments[..., 2], where=c.T > 0.0)
    return moments
