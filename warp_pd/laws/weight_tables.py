"""Families with the weights of the bond-associated law."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..checks import InputError
from ..families import Families, InfluenceFunction, build_families, unpack
from ..sheet import Sheet

if TYPE_CHECKING:
    from ..weights import CorrectedWeights, RectangleWeights

# Largest horizon at which weights are corrected: beyond, the solve takes minutes.
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
        _require_correctable(horizon, sheet)
    depth = 0
    families = build_families(sheet, horizon, influence)
    if weights == "corrected" and sheet.lattice is not None:
        rectangle = _rectangle(families, sheet)
        depth = rectangle.depth
        families = build_families(sheet, horizon, influence, depth)
    inverse, size = families.inverse_shapes()
    if weights == "published":
        return families, inverse, size, None
    total = size.sum(axis=1)
    plain = (families.areas / np.where(total > 0.0, total, 1.0))[:, None] * size
    if weights == "plain":
        return families, inverse, plain, None
    if sheet.lattice is None:
        solved = _cloud_correction(families, sheet, plain)
        return families, inverse, solved.weights / families.reference_area, _report(solved, sheet)
    assert families.first is not None and families.severed is not None
    columns = sheet.lattice.columns
    corrected = rectangle.at(families.first % columns, families.first // columns) / families.reference_area
    return families, inverse, np.where(families.severed[:, None], plain, corrected), _report(rectangle.solved, sheet)


def _require_correctable(horizon: float, sheet: Sheet) -> None:
    if horizon > MAX_CORRECTED:
        raise InputError(
            f"weights = 'corrected' at horizon = {horizon!r}: expected a horizon up to {MAX_CORRECTED}; "
            f"take weights 'plain'"
        )
    if sheet.lattice is None and sheet.size > MAX_CORRECTED_CLOUD:
        raise InputError(
            f"weights = 'corrected' on a cloud of {sheet.size} points: expected up to {MAX_CORRECTED_CLOUD}; "
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


def _cloud_correction(families: Families, sheet: Sheet, plain: np.ndarray) -> CorrectedWeights:
    from ..weights import corrected_weights, edge_vectors, edge_vectors_of, reached_points

    assert families.neighbours is not None and families.severed is not None
    rigid = np.zeros(sheet.size, bool) if sheet.bodies is None else sheet.bodies > 0
    if sheet.barriers is None:
        edges = edge_vectors(sheet.points, sheet.triangles)
    else:
        edges = edge_vectors_of(sheet.points, sheet.barriers)
    return corrected_weights(
        sheet.points,
        sheet.areas,
        families.neighbours,
        families.influence,
        unpack(families.common, families.members),
        edge_vectors=edges,
        start=plain * families.reference_area,
        frozen=families.severed | rigid,
        unbalanced=reached_points(families.neighbours, families.severed) | families.severed | rigid,
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
