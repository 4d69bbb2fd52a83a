"""Sheets of several pieces, to simulate sheets in contact, and sheets joined along an edge to one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..device.checks import InputError, of_kind, point_indices, show
from ..geometry.sheet import edge_names
from ..geometry.triangulation import crowded_edges, doubled_normals, neighbours
from .clouds import cloud
from .pieces import Place, side_by_side
from .sheet import Sheet
from .surfaces import surface

# Largest distance of two points that become one, in spacings, and least cosine of the angle at which sheets may meet: a
# family across the seam has one tangent plane.
COINCIDENT, STRAIGHT = 1e-4, 0.9
# Fields of a sheet that `glued` does not join, and what a sheet with one is or has.
NOT_GLUED = {
    "stretch": "is prestretched",
    "spacings": "has graded spacing",
    "pieces": "consists of pieces",
    "bodies": "contains rigid bodies",
    "cuts": "has cuts",
    "inclusions": "contains rigid bodies",
}


def together(*sheets: Sheet) -> Sheet:
    """Combine sheets into one sheet of several pieces, side by side in the reference state, without bonds between them.

    The points of a piece are the part "sheet 1", "sheet 2", ...; names of its edges get this prefix, such as "sheet 1
    left", and "all" is those of all pieces. All pieces have the same force law; `stiffened` makes a piece stiffer, and
    `ByRegion` gives it another material. `placed` moves the pieces to their positions, and `SelfContact` prevents
    interpenetration.

    Raises:
        InputError: for fewer than two sheets, a mixture of flat and curved sheets, or prestretched sheets.
    """
    for index, sheet in enumerate(sheets):
        of_kind(f"sheets[{index}]", sheet, Sheet)
    shape = side_by_side(sheets)
    for index, sheet in enumerate(sheets):
        if sheet.stretch is not None:
            raise InputError(f"sheets[{index}] is prestretched; expected a stress-free sheet")
    made = Sheet.of(shape, thickness=_joined("thickness", sheets), density=_joined("density", sheets))
    for number, sheet in enumerate(sheets, start=1):
        if sheet.stiffness is not None:
            points = made.parts[f"sheet {number}"]
            for factor in np.unique(sheet.stiffness):
                made = made.stiffened(points[sheet.stiffness == factor], float(factor))
    return made


def _joined(name: str, sheets: Sequence[Sheet]) -> float | np.ndarray:
    """Thickness or density of the pieces: a number if all are equal, otherwise one value per point."""
    values = [getattr(sheet, name) for sheet in sheets]
    if all(np.ndim(value) == 0 and value == values[0] for value in values):
        return float(values[0])
    return np.concatenate([np.broadcast_to(v, sheet.size) for v, sheet in zip(values, sheets, strict=True)])


def placed(sheet: Sheet, *places: Place) -> np.ndarray:
    """Displacement that moves the pieces of a sheet from side by side to their places, for `initial_displacement`.

    Displacements of supports are also relative to the reference state, so a `Motion` must begin at this displacement.

    Args:
        sheet: A result of `together`.
        places: One place per piece, in the coordinates of the original sheet.

    Returns:
        Displacement [m], shape (N, 3).

    Raises:
        InputError: if the sheet has only one piece, or the number of places differs.
    """
    if sheet.pieces is None or sheet.origins is None:
        raise InputError("sheet: expected a sheet of several pieces, from `together`")
    if len(places) != len(sheet.origins):
        raise InputError(f"places: expected {len(sheet.origins)}, one per piece, got {len(places)}")
    for index, place in enumerate(places):
        of_kind(f"places[{index}]", place, Place)
    positions = sheet.positions
    displacement = np.zeros_like(positions)
    for number, (place, origin) in enumerate(zip(places, sheet.origins, strict=True), start=1):
        own = sheet.pieces == number
        local = positions[own] - np.append(origin, np.zeros(3 - len(origin)))
        displacement[own] = place.of(local) - positions[own]
    return displacement


def glued(first: Sheet, edge: Any, second: Sheet, other_edge: Any, place: Place | None = None) -> Sheet:
    """Join two sheets along an edge to one sheet: the points of both edges become one, and families span the seam.

    The seam is as stiff and as strong as the sheets; it may have a `TearingEnergy` of its own. The result is a cloud.
    Its parts are "sheet 1" and "sheet 2", in the order of the points of the sheets, "seam", and those of the sheets
    with their prefix. Thickness and density of the seam are means over the areas on both sides. For sheets that meet at
    an angle, three at one edge, grids that do not match and joints that break, see `Joint`.

    Args:
        first: A sheet.
        edge: Points on an edge of it: a name for `Sheet.edges`, or indices.
        second: The other sheet.
        other_edge: Its points on the edge.
        place: Where the second sheet lies, in the coordinates of the first; None for where it is.

    Raises:
        InputError: for edges whose points do not coincide, sheets that meet at an angle or overlap, prestretched or
            graded sheets, and sheets with cuts, rigid inclusions or pieces.
    """
    if place is not None:
        of_kind("place", place, Place)
    sheets, edges = (first, second), []
    for name, sheet, given in (("first", first, edge), ("second", second, other_edge)):
        of_kind(name, sheet, Sheet)
        _require_plain(name, sheet)
        try:
            points = sheet.edges(given) if isinstance(given, str) else given
        except InputError as error:
            raise InputError(f"glued: {name}: {error}") from None
        if np.ndim(points) == 0:
            raise InputError(f"glued: edge of {name} = {show(given)}: expected a name or point indices")
        edges.append(point_indices(f"glued: edge of {name}", points, sheet.size))
    here, there = first.positions, second.positions if place is None else place.of(second.positions)
    seam, other = edges[0], _matched(here[edges[0]], there[edges[1]], first.spacing, edges[1])
    new = np.setdiff1d(np.arange(second.size), other)
    index = np.empty(second.size, np.int32)
    index[other], index[new] = seam, first.size + np.arange(len(new))
    places = np.vstack([here, there[new]])
    triangles = np.vstack([first.triangles, index[second.triangles]])
    spacing = max(first.spacing, second.spacing)
    _require_straight(places, triangles, len(first.triangles))
    if first.frames is None and second.frames is None and np.ptp(places[:, 2]) < COINCIDENT * spacing:
        shape = cloud(places[:, :2], triangles, None, spacing)
    else:
        shape = surface(places, triangles, spacing)
    own, areas = np.concatenate([np.arange(first.size), index]), np.concatenate([first.areas, second.areas])

    def mean(values: float | np.ndarray, weights: np.ndarray) -> float | np.ndarray:
        return values if np.ndim(values) == 0 else np.bincount(own, weights * values) / np.bincount(own, weights)

    parts = {**shape.parts, "seam": seam}
    for number, (sheet, members) in enumerate(((first, own[: first.size]), (second, index)), start=1):
        parts |= {f"sheet {number}": members.astype(np.int32)}
        parts |= {f"sheet {number} {name}": np.unique(members[points]) for name, points in edge_names(sheet).items()}
    thickness, factors = _joined("thickness", sheets), None
    if first.stiffness is not None or second.stiffness is not None:
        given = [np.ones(sheet.size) if sheet.stiffness is None else sheet.stiffness for sheet in sheets]
        factors = np.asarray(mean(np.concatenate(given), areas * thickness))
    made = Sheet.of(
        replace(shape, areas=np.bincount(own, areas), parts=parts, notes=(*first.notes, *second.notes)),
        thickness=mean(thickness, areas),
        density=mean(_joined("density", sheets), areas * thickness),
    )
    return replace(made, stiffness=factors)


def _require_plain(name: str, sheet: Sheet) -> None:
    for field, fault in NOT_GLUED.items():
        if getattr(sheet, field) is not None and len(getattr(sheet, field)):
            raise InputError(
                f"glued: {name} {fault}: expected a sheet of uniform spacing, not prestretched, without cuts, rigid "
                "bodies or pieces"
            )
    if len(sheet.triangles) == 0:
        raise InputError(f"glued: {name} has no triangles: expected a sheet")


def _matched(here: np.ndarray, there: np.ndarray, spacing: float, other: np.ndarray) -> np.ndarray:
    """The points of `other`, at `there`, in the order of the points at `here` that they coincide with."""
    from scipy.spatial import cKDTree

    apart, at = cKDTree(there).query(here)
    if len(here) != len(there) or apart.max() > COINCIDENT * spacing or len(np.unique(at)) < len(at):
        raise InputError(
            f"glued: edges of {len(here)} and {len(there)} points, up to {apart.max():.3g} m apart: expected points "
            "that coincide one by one; place the second sheet, give both edges the same points, or use Joint"
        )
    return np.asarray(other[at])


def _require_straight(places: np.ndarray, triangles: np.ndarray, firsts: int) -> None:
    """Check that sheets continue each other, with their upper sides alike; the first `firsts` triangles are of one."""
    pairs, turned = np.zeros((0, 2), np.int64), np.zeros(0, bool)
    if len(crowded_edges(triangles)) == 0:
        pairs, turned = neighbours(triangles)
        across = (pairs < firsts).sum(axis=1) == 1
        pairs, turned = pairs[across], turned[across]
    if len(pairs) == 0:
        raise InputError("glued: expected points along an edge that exactly two sheets share")
    normals = doubled_normals(places, triangles)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    cosine = float((normals[pairs[:, 0]] * normals[pairs[:, 1]]).sum(axis=1).min())
    if cosine < STRAIGHT:
        raise InputError(
            f"glued: the sheets meet at {np.degrees(np.arccos(max(cosine, -1.0))):.3g} degrees: expected at most "
            f"{np.degrees(np.arccos(STRAIGHT)):.2g}, both with the same side up; use Joint for sheets at an angle"
        )
    if turned.any():
        raise InputError(
            "glued: the sheets lie on the same side of the seam: expected one on each; use Joint over an area"
        )
