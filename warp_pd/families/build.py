"""Construction of the families of a sheet."""

from __future__ import annotations

from ..geometry.sheet import Sheet
from .connections import require_connected
from .horizon import checked_horizon, require_diagonals
from .lattice import lattice_families
from .tables import Families, InfluenceFunction, influence_function


def build_families(
    sheet: Sheet, horizon: float, influence: str | InfluenceFunction, depth: int = 0, intersections: bool = True
) -> Families:
    """Build the families of all points of a sheet.

    Args:
        sheet: The sheet; points of a lattice, and deep points of a grid, share one stencil.
        horizon: Horizon in spacings of the sheet [-].
        influence: Name of an influence function, or a function of r = |X| / horizon.
        depth: On a lattice, points up to this many spacings from an edge have separate rows, because corrected weights
            differ that far inside. On a grid with gaps, any depth greater than zero gives separate rows to all points
            whose corrected weights differ.
        intersections: Whether the law needs intersections of families. Without them no masks are built, and the horizon
            may be as small as one spacing.

    Raises:
        InputError: if the horizon is too small for deformation gradients, larger than the sheet or than 16 spacings, or
            a point has no neighbours; for laws without intersections also if families lie on a line, or bonds do not
            connect what triangles connect. Laws with intersections check this with `require_connected`, as a bond
            whose intersection lies on a line has no force.
    """
    checked = checked_horizon(sheet, horizon)
    function = influence_function(influence)
    if intersections:
        require_diagonals(sheet, horizon)
    if sheet.lattice is not None:
        return lattice_families(sheet, checked, function, depth, intersections)
    if sheet.layout == "grid":
        from .grid import grid_families

        families = grid_families(sheet, checked, function, depth > 0, intersections)
    else:
        from .cloud import cloud_families

        families = cloud_families(sheet, checked, function, intersections)
    if not intersections:
        require_connected(sheet, families, horizon)
    return families
