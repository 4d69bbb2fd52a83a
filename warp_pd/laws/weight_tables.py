"""Families with the weights of the bond-associated law."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..checks import InputError
from ..families import Families, InfluenceFunction, build_families, unpack
from ..sheet import Sheet

if TYPE_CHECKING:
    from ..weights import CorrectedWeights, RectangleWeights

# Largest horizon at which weights are corrected, and most points whose families are not deep inside a grid: beyond, the
# solve takes minutes.
MAX_CORRECTED = 4.5
MAX_CORRECTED_CLOUD = 100_000


def weight_tables(
    sheet: Sheet, horizon: float, influence: str | InfluenceFunction, weights: str
) -> tuple[Families, np.ndarray, np.ndarray, dict[str, float] | None]:
    """Families and their tables.

    Args:
        sheet: The sheet.
        horizon: Over the spacing of the sheet [-].
        influence: Influence function, see `BondAssociated`.
        weights: "published", "plain" or "corrected".

    Returns:
        The families; K^-1 by row, shape (R, n, 3); weights over the reference area by row, shape (R, n) (for
        "published" the sizes |D_ij| instead); what the correction did, or None.

    Raises:
        InputError: if the weights cannot be corrected at this horizon or on so large a cloud.
    """
    if weights == "corrected":
        _require_correctable(horizon)
        if sheet.layout == "cloud":
            _require_few(sheet.size)
    families = build_families(sheet, horizon, influence, int(weights == "corrected" and sheet.layout == "grid"))
    if weights == "corrected" and sheet.lattice is not None:
        rectangle = _rectangle(families, sheet)
        families = build_families(sheet, horizon, influence, rectangle.depth)
    inverse, size = families.inverse_shapes()
    if weights == "published":
        return families, inverse, size, None
    total = size.sum(axis=1)
    plain = (families.areas / np.where(total > 0.0, total, 1.0))[:, None] * size
    if weights == "plain":
        return families, inverse, plain, None
    if sheet.lattice is None:
        at_rows, solved = _correction(families, sheet, plain)
        return families, inverse, at_rows / families.reference_area, _report(solved, sheet)
    assert families.first is not None and families.severed is not None
    columns = sheet.lattice.columns
    corrected = rectangle.at(families.first % columns, families.first // columns) / families.reference_area
    return families, inverse, np.where(families.severed[:, None], plain, corrected), _report(rectangle.solved, sheet)


def _require_correctable(horizon: float) -> None:
    if horizon > MAX_CORRECTED:
        raise InputError(
            f"weights = 'corrected' at horizon = {horizon!r}: expected a horizon up to {MAX_CORRECTED}; "
            f"take weights 'plain'"
        )


def _rectangle(families: Families, sheet: Sheet) -> RectangleWeights:
    from ..weights import rectangle_corrected

    assert sheet.lattice is not None and families.steps is not None
    lattice = sheet.lattice
    return rectangle_corrected(
        lattice.columns,
        lattice.rows,
        (lattice.dx, lattice.dy),
        offsets=families.steps,
        influence=families.influence,
        common=unpack(families.common, families.members),
    )


def _correction(families: Families, sheet: Sheet, plain: np.ndarray) -> tuple[np.ndarray, CorrectedWeights]:
    """Corrected weights by row [m^2], shape (R, n), of a cloud or grid.

    Points that share a row keep their plain weights: they and all around them are in balance. So the solve needs the
    points with rows of their own, those in whose balance these take part, and the families of the latter's members.
    """
    from ..weights import corrected_weights, reached_points

    assert families.severed is not None
    own = np.ones(sheet.size, bool) if families.family_class is None else families.family_class > 0
    _require_few(int(own.sum()))
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
        unpack(by_point(families.common), families.members),
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
    return at_rows, solved


def _edges(sheet: Sheet) -> np.ndarray:
    from ..weights import edge_vectors, edge_vectors_of, rim_vectors

    if sheet.frames is not None:
        return rim_vectors(sheet.points, sheet.triangles, sheet.frames)
    if sheet.barriers is None:
        return edge_vectors(sheet.points, sheet.triangles)
    return edge_vectors_of(sheet.points, sheet.barriers)


def _with_members(families: Families, points: np.ndarray) -> np.ndarray:
    """A mask of points with all members of their families."""
    members = families.members_of(np.flatnonzero(points))
    reached = points.copy()
    reached[members[members >= 0]] = True
    return reached


def _require_few(points: int) -> None:
    if points > MAX_CORRECTED_CLOUD:
        raise InputError(
            f"weights = 'corrected' on a cloud of {points} points, besides those deep inside a grid: expected up to "
            f"{MAX_CORRECTED_CLOUD}; take weights 'plain'"
        )


def _report(solved: CorrectedWeights, sheet: Sheet) -> dict[str, float]:
    """What the correction did, for summary.json; residuals in spacings."""
    return {
        "residual": solved.residual / sheet.spacing,
        "residual_of_plain": solved.start_residual / sheet.spacing,
        "smallest_ratio": solved.smallest_ratio,
        "largest_ratio": solved.largest_ratio,
        "points_left_unbalanced": solved.unbalanced_points,
        "seconds": solved.seconds,
    }
