"""Pictures of a sheet before anything runs."""

from __future__ import annotations

import os
from typing import Any

from ..device.checks import InputError, said
from ..geometry.shape_plot import VIEW, draw_shape
from ..geometry.sheet import Sheet


def draw_sheet(
    sheet: Sheet,
    path: str | os.PathLike[str] | None = None,
    *,
    title: str = "",
    view: tuple[float, float] = VIEW,
) -> Any:
    """Draw a sheet, flat or curved. No device is touched.

    The picture shows triangles, points (of a sheet with a square grid: those on it, and the others), the boundary,
    cuts, rigid inclusions, stiffened points, named parts, and in colour a thickness that varies. Where there are too
    many points or triangles to tell apart it shows some of them and says how many. The two faces of a crack are drawn a
    little apart.

    Args:
        sheet: The sheet.
        path: Of the picture, .png, .pdf or .svg; None to write none.
        title: First line above the picture.
        view: Elevation and azimuth of the eye [degrees], for a curved sheet.

    Returns:
        The `matplotlib.figure.Figure`.

    Raises:
        InputError: for anything but a sheet, or a path that cannot be written.
    """
    if not isinstance(sheet, Sheet):
        raise InputError(f"sheet = {said(sheet)}: expected a Sheet")
    return draw_shape(sheet, path, title=title, view=view, thickness=sheet.thickness, stiffness=sheet.stiffness)
