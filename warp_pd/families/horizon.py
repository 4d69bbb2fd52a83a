"""The horizon of a sheet: users give it in spacings, families use it in meters."""

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
    """Largest length of a bond; on a graded sheet that of a pair whose spacings are the mean one.

    Attributes:
        ratio: In spacings of the sheet [-].
        length: [m].
    """

    ratio: float
    length: float

    @staticmethod
    def of(sheet: Sheet, ratio: float) -> Horizon:
        """The horizon from its length in spacings of a sheet."""
        return Horizon(ratio, ratio * sheet.spacing)

    def reach(self, step: float) -> int:
        """How many steps [m] of a lattice it reaches along one of its axes."""
        return int(self.length / step + 1e-6)


def checked_horizon(sheet: Sheet, horizon: float) -> Horizon:
    """The horizon of a sheet from its length in spacings, if it fits.

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
    return Horizon.of(sheet, ratio)


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
