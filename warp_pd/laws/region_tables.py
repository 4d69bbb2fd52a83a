"""Families of a sheet with several materials: they end at interfaces, so interface points have several families."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..context import Context
from ..device.checks import InputError, point_indices
from ..families import Families, InfluenceFunction, pack, unpack
from ..geometry.sheet import Sheet
from ..geometry.triangulation import boundary_edges, voronoi_areas
from ..materials import Material
from .weight_tables import Tables, weight_tables

Regions = Sequence[tuple[Any, Material]]


@dataclass(eq=False)
class Region:
    """The part of a sheet with one material.

    Attributes:
        material: Index of the material.
        sheet: The region as a separate sheet.
        points: Indices of its points in the whole sheet, shape (P,).
        fraction: Fraction of the area of each point that lies in the region [-], shape (P,).
        begin: Index of the first family member of each point in the region, shape (P,).
    """

    material: int
    sheet: Sheet
    points: np.ndarray
    fraction: np.ndarray
    begin: np.ndarray


def region_tables(
    context: Context, regions: Regions, horizon: float, influence: str | InfluenceFunction, weights: str
) -> Tables:
    """Families and their tables; arguments and results as for `law_tables`.

    A point on an interface has one family per region, stored one after the other; a neighbour on the interface is
    therefore listed in each. An intersection has members of one region only. A fraction of the area of a point
    belongs to each region; the device has one area per point, and the influence function includes the fraction.

    Raises:
        InputError: for a sheet that is not a cloud, or regions that overlap or leave points without a triangle.
    """
    sheet, divided = context.whole, context.partition is not None
    if sheet.layout != "cloud":
        raise InputError("sheet: expected sheet.as_cloud() with ByRegion, because families at an interface differ")
    if sheet.cuts or sheet.bodies is not None:
        raise InputError(
            "sheet: expected no cuts and no rigid inclusions of an outline with ByRegion; use cracks of an "
            "outline, or slit"
        )
    if divided:
        raise InputError("material = ByRegion: expected a single process")
    if weights == "published":
        raise InputError("weights = 'published': expected 'plain' or 'corrected' with ByRegion")
    parts = _parts(sheet, regions)
    tables, width = [], np.zeros(sheet.size, int)
    for part in parts:
        try:
            tables.append(weight_tables(part.sheet, horizon, influence, weights))
        except InputError as error:
            raise InputError(f"{_name(part.material)}, as a sheet of its own: {error}") from error
        part.begin = width[part.points]
        width[part.points] += tables[-1][0].exists.sum(axis=1)
    reports = [report for _, _, _, report in tables if report is not None]
    worst = max(reports, key=lambda report: report["residual"]) if reports else None
    families, inverse, at_rows = _merged(sheet, parts, tables, int(width.max()))
    return families, inverse, families.scaled(at_rows), worst


def _name(material: int) -> str:
    """What a message calls the region with the material of this index."""
    return f"ByRegion.regions[{material - 1}]" if material else "ByRegion.material"


def _parts(sheet: Sheet, regions: Regions) -> list[Region]:
    """The given regions, and the rest of the sheet as another region.

    Raises:
        InputError: for a region without triangles, a triangle in two regions, or a point without triangles.
    """
    material = np.zeros(len(sheet.triangles), int)
    for n, (points, _) in enumerate(regions, start=1):
        name = _name(n)
        inside = np.isin(sheet.triangles, point_indices(name, points, sheet.size)).all(axis=1)
        if not inside.any():
            raise InputError(f"{name} contains no triangle: expected all its points, including those on its edge")
        if material[inside].any():
            raise InputError(f"{name} and regions[{material[inside].max() - 1}] overlap: expected separate triangles")
        material[inside] = n
    if material.all():
        raise InputError("ByRegion.material contains no triangle: expected regions that leave it some")
    parts = [_part(sheet, sheet.triangles[material == n], int(n)) for n in np.unique(material)]
    cells = np.zeros(sheet.size)
    for part in parts:
        cells[part.points] += part.sheet.areas
    if (cells == 0.0).any():
        raise InputError(f"points[{int(np.argmin(cells))}] has no triangle: expected triangles at all points")
    for part in parts:
        part.fraction = part.sheet.areas / cells[part.points]
        part.sheet = replace(part.sheet, areas=part.fraction * sheet.areas[part.points])
    return parts


def _part(sheet: Sheet, triangles: np.ndarray, material: int) -> Region:
    """A region with areas of points from Voronoi cells."""
    points, corners = np.unique(triangles, return_inverse=True)
    corners = corners.reshape(-1, 3).astype(np.int32)
    places, edges = sheet.points[points], boundary_edges(corners)
    areas = voronoi_areas(places, corners)
    here: dict[str, Any] = {
        name: None if (values := getattr(sheet, name)) is None else values[points]
        for name in ("spacings", "frames", "pieces")
    }
    alone = replace(
        sheet, points=places, areas=areas, triangles=corners, barriers=edges if sheet.frames is None else None,
        inclusions=(), parts={"rim": np.unique(edges)}, **here, **sheet.at_points(lambda values: values[points]),
    )  # fmt: skip
    return Region(material, alone, points, areas, np.zeros(0, int))


def _merged(
    sheet: Sheet, parts: list[Region], tables: list[Tables], width: int
) -> tuple[Families, np.ndarray, np.ndarray]:
    """Families of all regions with `width` members, their K^-1, (N, n, 3), and weights divided by area, (N, n)."""
    shape, reference = (sheet.size, width), float(sheet.areas.mean())
    curved = sheet.frames is not None
    families = Families(
        horizon=tables[0][0].horizon,
        reference_area=reference,
        exists=np.zeros(shape, bool),
        bonds=np.zeros((*shape, 2)),
        influence=np.zeros(shape),
        common=np.zeros(0),
        member_areas=np.zeros(shape),
        areas=sheet.areas / reference,
        reverses=np.zeros(shape, np.int32),
        neighbours=np.full(shape, -1, np.int32),
        severed=np.zeros(sheet.size, bool),
        factors=sheet.factors,
        frames=np.zeros((sheet.size, 3, 3)) if curved else None,
        chords=np.zeros((*shape, 3)) if curved else None,
        materials=np.zeros(shape, np.uint8),
    )
    inverse, weights, common = np.zeros((*shape, 3)), np.zeros(shape), np.zeros((*shape, width), bool)
    for part, (alone, own_inverse, own_weights, _) in zip(parts, tables, strict=True):
        assert alone.neighbours is not None and families.neighbours is not None and families.materials is not None
        here = np.nonzero(alone.exists)
        member, scale = alone.neighbours[here], alone.reference_area / reference
        to = part.points[here[0]], part.begin[here[0]] + here[1]
        families.exists[to], families.materials[to] = True, part.material
        families.neighbours[to] = part.points[member]
        families.reverses[to] = part.begin[member] + alone.reverses[here]
        families.bonds[to] = alone.bonds[here]
        families.influence[to] = alone.influence[here] * part.fraction[member]
        families.member_areas[to] = sheet.areas[part.points[member]] / reference
        inverse[to], weights[to] = own_inverse[here] / scale, own_weights[here] * scale
        rows, first, second = np.nonzero(unpack(alone.common, alone.members) & alone.exists[:, None])
        common[part.points[rows], part.begin[rows] + first, part.begin[rows] + second] = True
        if curved:
            assert families.frames is not None and families.chords is not None and alone.chords is not None
            families.frames[part.points], families.chords[to] = alone.frames, alone.chords[here]
    families.common = pack(common)
    return families, inverse, weights
