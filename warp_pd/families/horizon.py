"""The horizon of a sheet, converted from spacings to meters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.checks import InputError, finite
from ..geometry.sheet import Sheet
from .tables import TOLERANCE

# Largest horizon in spacings: beyond it the masks of a family's intersections take gigabytes.
MAX_HORIZON = 16.0


@dataclass(frozen=True)
class Horizon:
    """Maximum length of a bond; on a graded sheet for a pair with the mean spacing.

    Attributes:
        ratio: Horizon in spacings of the sheet [-].
        length: Horizon [m].
    """

    ratio: float
    length: float

    @staticmethod
    def of(sheet: Sheet, ratio: float) -> Horizon:
        """Create the horizon from its length in spacings of a sheet."""
        return Horizon(ratio, ratio * sheet.spacing)

    def reach(self, step: float) -> int:
        """Number of lattice steps of length `step` [m] within the horizon along an axis."""
        return int(self.length / step + 1e-6)


def checked_horizon(sheet: Sheet, horizon: float) -> Horizon:
    """Check the horizon in spacings of a sheet and create it. Raises InputError if it is too small or too large."""
    ratio = finite("horizon", horizon)
    if ratio < 1.0:
        raise InputError(f"horizon = {horizon!r}: expected at least 1 spacing, and 1.42 on a lattice")
    across = float(sheet.extent.max()) / sheet.spacing * (1.0 + TOLERANCE)
    if ratio > min(across, MAX_HORIZON):
        raise InputError(
            f"horizon = {horizon!r}: expected at most {min(across, MAX_HORIZON):.4g} spacings, "
            + (
                f"because the sheet is {across:.4g} spacings long"
                if across < MAX_HORIZON
                else "as families become too large beyond"
            )
        )
    return Horizon.of(sheet, ratio)


def require_diagonals(sheet: Sheet, horizon: float) -> None:
    """Check that the families of a lattice determine deformation gradients."""
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
