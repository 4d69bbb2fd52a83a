"""Sheets of several pieces: one simulation of sheets that touch each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..device.checks import InputError
from .pieces import Place, side_by_side
from .sheet import Sheet


def together(*sheets: Sheet) -> Sheet:
    """One sheet of several pieces, side by side in the reference state; no bond joins them.

    The points of a piece are the part "sheet 1", "sheet 2", ..., for `edges`; names of its own parts get that in front,
    as "sheet 1 outline". All pieces have one law; `stiffened` makes a piece stiffer, and `ByRegion` gives it
    another material. `placed` brings them to their places, and `SelfContact` keeps them apart.

    Raises:
        InputError: for fewer than two sheets, flat and curved ones, or sheets that were stretched before they were
            clamped.
    """
    shape = side_by_side(sheets)
    for index, sheet in enumerate(sheets):
        if sheet.stretch is not None:
            raise InputError(f"sheets[{index}] is prestretched: expected a sheet without stress")
    made = Sheet.of(shape, thickness=_joined("thickness", sheets), density=_joined("density", sheets))
    for number, sheet in enumerate(sheets, start=1):
        if sheet.stiffness is not None:
            points = made.parts[f"sheet {number}"]
            for factor in np.unique(sheet.stiffness):
                made = made.stiffened(points[sheet.stiffness == factor], float(factor))
    return made


def _joined(name: str, sheets: Sequence[Sheet]) -> float | np.ndarray:
    """Thickness or density of the pieces: the number that all have, or one for each point."""
    values = [getattr(sheet, name) for sheet in sheets]
    if all(np.ndim(value) == 0 and value == values[0] for value in values):
        return float(values[0])
    return np.concatenate([np.broadcast_to(v, sheet.size) for v, sheet in zip(values, sheets, strict=True)])


def placed(sheet: Sheet, *places: Place) -> np.ndarray:
    """Displacement that brings the pieces of a sheet from side by side to their places, for `initial_displacement`.

    Supports count displacements from the reference state too: a `Motion` begins at this displacement.

    Args:
        sheet: From `together`.
        places: One per piece, in the coordinates of the sheet that became the piece.

    Returns:
        [m], shape (N, 3).

    Raises:
        InputError: for a sheet of one piece, or another number of places.
    """
    if sheet.pieces is None or sheet.origins is None:
        raise InputError("sheet: expected one of several pieces, from `together`")
    if len(places) != len(sheet.origins):
        raise InputError(f"places holds {len(places)} places: expected {len(sheet.origins)}, one per piece")
    positions = sheet.positions
    displacement = np.zeros_like(positions)
    for number, (place, origin) in enumerate(zip(places, sheet.origins, strict=True), start=1):
        own = sheet.pieces == number
        local = positions[own] - np.append(origin, np.zeros(3 - len(origin)))
        displacement[own] = place.of(local) - positions[own]
    return displacement
