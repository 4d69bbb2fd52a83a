"""Torn edges have no zero-energy modes: what moves without a force there is a rigid motion."""

import numpy as np
import pytest
from helpers import build, internal_force, jittered, sever, square

from warp_pd import CriticalStretch

TEAR = ((-0.01, 0.0557), (0.0557, 0.0557))


def spectrum(built):
    """Eigenvalues of the stiffness in the plane by differences, divided by the largest, in ascending order."""
    sheet = built.simulation.sheet
    step = 1e-7 * sheet.spacing
    stiffness = np.zeros((2 * sheet.size, 2 * sheet.size))
    for i in range(2 * sheet.size):
        move = np.zeros((sheet.size, 3))
        move[i // 2, i % 2] = step
        difference = internal_force(built, move) - internal_force(built, -move)
        stiffness[i] = -difference[:, :2].ravel() / (2.0 * step)
    values = np.linalg.eigvalsh(0.5 * (stiffness + stiffness.T))
    return values / values[-1]


@pytest.mark.parametrize(("sheet", "horizon"), [(square(9), 3.15), (jittered(9), 2.015)], ids=["lattice", "cloud"])
def test_a_torn_sheet_is_as_stiff_as_one_that_was_cut(sheet, horizon):
    torn = build(sheet, horizon=horizon, damage=CriticalStretch(1e3))
    sever(torn, TEAR)
    found, cut = spectrum(torn), spectrum(build(sheet.cut(*TEAR), horizon=horizon))
    # Two shifts and a turn.
    assert np.abs(found[:3]).max() < 1e-7
    ratio = found[3:30] / cut[3:30]
    assert ratio.min() > 0.6, f"softest modes {found[3:8]}, of the sheet that was cut {cut[3:8]}"
