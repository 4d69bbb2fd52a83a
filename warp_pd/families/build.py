"""Construction of the families of a sheet, and checks that their bonds connect what its triangles connect."""

from __future__ import annotations

import numpy as np

from ..device.checks import InputError
from ..geometry.sheet import Sheet
from ..geometry.triangulation import components, directed_edges
from .lattice import lattice_families
from .tables import Families, InfluenceFunction, checked_horizon, influence_function, inverse_shape, require_diagonals


def build_families(
    sheet: Sheet,
    horizon: float,
    influence: str | InfluenceFunction,
    corrected: bool = False,
    intersections: bool = True,
) -> Families:
    """Build the families of all points of a sheet.

    Args:
        sheet: The sheet; points of a lattice, and deep points of a grid, share one stencil.
        horizon: Horizon in spacings of the sheet [-].
        influence: Name of an influence function, or a function of r = |X| / horizon.
        corrected: Whether points of a lattice or a grid whose corrected weights differ have separate rows.
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
        return lattice_families(sheet, checked, function, corrected, intersections)
    if sheet.layout == "grid":
        from .grid import grid_families

        families = grid_families(sheet, checked, function, corrected, intersections)
    else:
        from .cloud import cloud_families

        families = cloud_families(sheet, checked, function, intersections)
    if not intersections:
        require_connected(sheet, families, horizon)
    return families


# Shorter horizons rarely let corrected weights balance a cloud.
LEAST_OF_CLOUDS = 1.8
# Angles [degrees] between the triangles on two sides of a point from which a fold is noted, and refused.
FOLD_NOTED, FOLD_REFUSED = 80.0, 150.0
UNEVEN = ", or triangles of more even shape and size (graded = True where only their size varies)"


def require_connected(
    sheet: Sheet, families: Families, horizon: float, usable: np.ndarray | None = None, lines: bool = False
) -> None:
    """Check the families of a cloud or a grid; those of a lattice need no check beside `require_diagonals`.

    Args:
        sheet: The sheet.
        families: Its families.
        horizon: Horizon in spacings of the sheet [-].
        usable: Bonds that carry a force, shape (R, n), or families that do, shape (R, 1); by default all that exist.
        lines: Whether bonds of a family may lie on a line, because the balance of corrected weights is checked, too.

    Raises:
        InputError: if a family lies on a line, or bonds leave pieces apart that triangles connect; with a place and a
            horizon that would do.
    """
    if not len(sheet.triangles):
        return
    bonds = families.exists if usable is None else families.exists & usable
    if not lines:
        _refuse_lines(sheet, families, bonds, horizon)
    edges = np.unique(np.sort(directed_edges(np.asarray(sheet.triangles)), axis=1), axis=0)
    missing = edges[~_are_bonds(families, bonds, edges)]
    if not len(missing):
        return
    piece = _pieces(sheet, families, bonds)
    apart = missing[piece[missing[:, 0]] != piece[missing[:, 1]]]
    if len(apart):
        place, least = sheet.points[apart[0]].mean(axis=0).tolist(), _least_horizon(sheet, apart, horizon)
        if lines and sheet.layout == "cloud":
            least = max(least, LEAST_OF_CLOUDS)
        raise InputError(
            f"horizon = {horizon!r}: bonds leave {len(np.unique(piece))} pieces of what triangles connect, as across "
            f"the edge of a triangle at {_text(place)}: expected at least {least:g}{UNEVEN}"
        )


def require_unfolded(sheet: Sheet) -> None:
    """Check that no family of a curved sheet spans a fold: its bonds hardly lie in a tangent plane, whose F they give.

    Raises:
        InputError: with the place and the angle of the sharpest fold.
    """
    turn = sheet.folds
    if turn.max(initial=0.0) > FOLD_REFUSED:
        point = int(np.argmax(turn))
        raise InputError(
            f"sheet: it is folded by {turn[point]:.0f} degrees at {_text(sheet.points[point].tolist())}, where a "
            f"family has no tangent plane: expected at most {FOLD_REFUSED:g}: round the fold over some spacings; of "
            "two equal halves, as of a cushion, take pillow(half), or one flat half with its rim held in the plane of "
            "the fold: Fixed(rim, 'z')"
        )


def notes_on_folds(sheet: Sheet) -> list[str]:
    """A note if families span edges at which a curved sheet turns much."""
    turn = sheet.folds
    sharp = turn > FOLD_NOTED
    if not sharp.any():
        return []
    point = int(np.argmax(turn))
    return [
        f"sheet: it turns by up to {turn[point]:.0f} degrees at {sharp.sum()} points, most at "
        f"{_text(sheet.points[point].tolist())}; families across such an edge resist its opening and closing: round it "
        "over some spacings"
    ]


def _refuse_lines(sheet: Sheet, families: Families, bonds: np.ndarray, horizon: float) -> None:
    """Raise InputError if the bonds of a point are none or lie on a line; families at cuts and in bodies may."""
    c = np.where(bonds, families.member_coefficients, 0.0)
    x = families.bonds if families.bonds.ndim == 3 else families.bonds[None]
    shape = np.stack([(c * x[..., p] * x[..., q]).sum(axis=1) for p, q in ((0, 0), (0, 1), (1, 1))], axis=-1)
    on_line = families.rows_of_points(~inverse_shape(shape)[1])
    if families.severed is not None:
        on_line &= ~families.rows_of_points(families.severed)
    for inclusion in sheet.inclusions:
        on_line[inclusion] = False
    points = np.flatnonzero(on_line)
    if len(points):
        edges = directed_edges(np.asarray(sheet.triangles))
        least = _least_horizon(sheet, edges[on_line[edges].any(axis=1)], horizon)
        place = _text(sheet.points[points[0]].tolist())
        raise InputError(
            f"horizon = {horizon!r}: the bonds of {len(points)} points, as of that at {place}, lie on a line: expected "
            f"at least {least:g}{UNEVEN}"
        )


def _least_horizon(sheet: Sheet, edges: np.ndarray, horizon: float) -> float:
    """Horizon, in spacings and rounded up, at which edges of triangles, shape (E, 2), are bonds; above the present."""
    length = np.linalg.norm(sheet.points[edges[:, 1]] - sheet.points[edges[:, 0]], axis=1)
    spacing = sheet.spacing if sheet.spacings is None else sheet.spacings[edges].mean(axis=1)
    least = float(np.max(length / spacing, initial=0.0))
    return float(np.ceil(100.0 * (least if least > horizon else horizon + 0.1)) / 100.0)


def _are_bonds(families: Families, bonds: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Mask of the edges, shape (E, 2), that are bonds of either end."""
    found = np.zeros(len(edges), bool)
    for tail, head in ((0, 1), (1, 0)):
        here = families.members_of(edges[:, tail]) == edges[:, head, None]
        rows = edges[:, tail] if families.family_class is None else families.family_class[edges[:, tail]]
        found |= (here & bonds[rows]).any(axis=1)
    return found


def _pieces(sheet: Sheet, families: Families, bonds: np.ndarray) -> np.ndarray:
    """Index of the piece of each point, shape (N,), connected by bonds and rigid inclusions."""
    points = np.arange(sheet.size)
    members = np.where(families.rows_of_points(bonds), families.members_of(points), -1)
    tail, slot = np.nonzero(members >= 0)
    rigid = [np.column_stack([np.full(len(body), body[0]), body]) for body in sheet.inclusions]
    return components(sheet.size, np.concatenate([np.column_stack([tail, members[tail, slot]]), *rigid]))


def _text(place: list[float]) -> str:
    return f"({', '.join(f'{value + 0.0:.4g}' for value in place)}) m"
