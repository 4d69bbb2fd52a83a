"""Families of every point of a sheet."""

from __future__ import annotations

import numpy as np

from ..device.checks import InputError, finite
from ..geometry.sheet import Sheet
from .cloud import cloud_families
from .grid import grid_families
from .lattice import lattice_families
from .tables import TOLERANCE, Families, InfluenceFunction, influence_function

# Largest horizon in spacings: beyond it the masks of a family's intersections take gigabytes.
MAX_HORIZON = 16.0


def build_families(
    sheet: Sheet, horizon: float, influence: str | InfluenceFunction, depth: int = 0, intersections: bool = True
) -> Families:
    """Families of every point.

    Args:
        sheet: The sheet; on a lattice and deep inside a grid, points share one stencil.
        horizon: Horizon in spacings of the sheet [-].
        influence: Name of an influence function, or a function of r = |X| / horizon.
        depth: On a lattice, points up to this many spacings from an edge have separate rows, more than the families
            alone would need (corrected weights differ that far inside). On a grid with gaps, any depth above zero keeps
            rows apart that corrected weights change.
        intersections: Whether the law needs intersections of families; without them no masks are made, and
            the horizon may be as small as one spacing.

    Raises:
        InputError: for a horizon too small for any intersection to contain two directions, one larger than the sheet
            or than 16 spacings, or a point without neighbours.
    """
    ratio = checked_horizon(sheet, horizon)
    function = influence_function(influence)
    if intersections:
        require_diagonals(sheet, horizon)
    if sheet.lattice is not None:
        return lattice_families(sheet, ratio * sheet.spacing, function, depth, intersections)
    if sheet.layout == "grid":
        return grid_families(sheet, ratio * sheet.spacing, function, depth > 0, intersections)
    return cloud_families(sheet, ratio * sheet.spacing, function, intersections)


def checked_horizon(sheet: Sheet, horizon: float) -> float:
    """A horizon in spacings, if it fits the sheet.

    Raises:
        InputError: otherwise.
    """
    ratio = finite("horizon", horizon)
    if ratio < 1.0:
        raise InputError(f"horizon = {horizon!r}: expected at least 1 spacing, and 1.42 on a lattice")
    across = float(sheet.extent.max()) / sheet.spacing * (1.0 + TOLERANCE)
    if ratio > min(across, MAX_HORIZON):
        raise InputError(
            f"horizon = {horizon!r}: expected at most {min(across, MAX_HORIZON):.4g} spacings, "
            + (
                f"as the sheet is {across:.4g} spacings long"
                if across < MAX_HORIZON
                else "as families become too large beyond"
            )
        )
    return ratio


def require_diagonals(sheet: Sheet, horizon: float) -> None:
    """Check that the families of a lattice determine deformation gradients.

    Raises:
        InputError: for a horizon in spacings that excludes the diagonal neighbours.
    """
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
