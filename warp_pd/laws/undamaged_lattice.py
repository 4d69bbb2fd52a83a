"""Data of a lattice for the fast path of the bond-associated law."""

from __future__ import annotations

import numpy as np

from ..families import Families, unpack
from ..kernels.families import WORD
from ..kernels.undamaged_lattice import Stencil

TOLERANCE = 1e-9


def undamaged_stencil(families: Families, inverse: np.ndarray, weights: np.ndarray) -> tuple[Stencil, int] | None:
    """Stencil of the undamaged families inside a lattice or grid, and the row that they share; None if there are none.

    There are none on clouds, on lattices that are not square, with more than 32 members, and on sheets so small that
    no family is complete and has equal weights.

    Args:
        families: The families.
        inverse: K^-1 by row, shape (R, n, 3).
        weights: W divided by the reference area by row, shape (R, n).
    """
    if families.family_class is None or families.steps is None or len(families.steps) > WORD:
        return None
    steps = [(int(x), int(y)) for x, y in families.steps]
    turned = [steps.index((-y, x)) if (-y, x) in steps else -1 for x, y in steps]
    n, gridded = len(steps), families.layout == "grid"
    row = families.commonest_row
    area, weight = families.areas[row], weights[row, :n] / families.areas[row]
    bonds, influence, common = (
        table[row, :n] if gridded else table for table in (families.bonds, families.influence, families.common)
    )
    if min(turned) < 0 or not families.exists[row, :n].all() or not families.has_common:
        return None
    uneven = (
        np.ptp(families.member_areas[row, :n]) / area,
        np.abs(bonds[turned] - np.column_stack([-bonds[:, 1], bonds[:, 0]])).max(),
        np.abs(weight[turned] / weight - 1.0).max(),
    )
    if max(uneven) > TOLERANCE:
        return None
    quarter = [k for k, (x, y) in enumerate(steps) if x > 0 and y >= 0]
    inside = unpack(common, n)
    stencil = Stencil(
        steps=tuple(steps),
        turned=tuple(turned),
        moments=tuple((_even(x), _even(y)) for x, y in influence[:, None] * bonds),
        quarter=tuple(quarter),
        inside=tuple(tuple(bool(b) for b in inside[j]) for j in quarter),
        inverse=tuple((_even(a), _even(b), _even(c)) for a, b, c in inverse[row, quarter] * area),
        weights=tuple(_even(w) for w in weight[quarter]),
    )
    return stencil, row


def _even(value: float) -> float:
    """The number without its last digits, which depend on the size of the sheet, so that sheets share kernels."""
    return float(f"{value:.14g}")
