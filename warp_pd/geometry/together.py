"""Sheets of several pieces, to simulate sheets in contact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..device.checks import InputError
from .pieces import Place, side_by_side
from .sheet import Sheet


def together(*sheets: Sheet) -> Sheet:
    """Combine sheets into one sheet of several pieces, side by side in the reference state, without bonds between them.

    The points of a piece are the part "sheet 1", "sheet 2", ...; names of its parts get this prefix, such as "sheet 1
    outline". All pieces have the same force law; `stiffened` makes a piece stiffer, and `ByRegion`
    gives it another material. `placed` moves the pieces to their positions, and `SelfContact` prevents
    interpenetration.

    Raises:
        InputError: for fewer than two sheets, a mixture of flat and curved sheets, or prestretched sheets.
    """
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
    positions = sheet.positions
    displacement = np.zeros_like(positions)
    for number, (place, origin) in enumerate(zip(places, sheet.origins, strict=True), start=1):
        own = sheet.pieces == number
        local = positions[own] - np.append(origin, np.zeros(3 - len(origin)))
        displacement[own] = place.of(local) - positions[own]
    return displacement
