"""Pictures of the undeformed sheet."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from ..device.checks import of_kind, point_indices
from ..geometry.sheet import Sheet
from .shape_plot import VIEW, draw_shape


def draw_sheet(
    sheet: Sheet,
    path: str | os.PathLike[str] | None = None,
    *,
    title: str = "",
    view: tuple[float, float] = VIEW,
    regions: Sequence[tuple[Any, Any]] = (),
) -> Any:
    """Draw an undeformed sheet, flat or curved.

    The picture shows triangles, points (on and off a square grid in different colours), the boundary, cuts, rigid
    inclusions, stiffened points, regions of materials, named parts, and a varying thickness in colour. If there are too
    many points or triangles, it shows some of them and states how many. The two faces of a crack are drawn slightly
    apart.

    Args:
        sheet: The sheet.
        path: File of the picture (.png, .pdf or .svg); None writes no file.
        title: Title of the picture.
        view: Elevation and azimuth of the viewpoint [degrees], for a curved sheet.
        regions: Pairs of points and a material, as for `ByRegion`; `Simulation.draw` passes those of its material.

    Returns:
        The `matplotlib.figure.Figure`.

    Raises:
        InputError: if `sheet` is not a Sheet, or the path cannot be written.
    """
    of_kind("sheet", sheet, Sheet)
    named = [
        (f"region {k}: {type(material).__name__}", point_indices(f"regions[{k - 1}]", points, sheet.size))
        for k, (points, material) in enumerate(regions, start=1)
    ]
    return draw_shape(
        sheet, path, title=title, view=view, thickness=sheet.thickness, stiffness=sheet.stiffness, regions=named
    )
