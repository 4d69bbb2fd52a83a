"""Tears from the crack of an outlined sheet are as stable as those from the cut of a lattice."""

import numpy as np
import pytest
from helpers import NEO

from warp_pd import (
    BondAssociated,
    CriticalStretch,
    Explicit,
    Measure,
    Motion,
    Outcome,
    Sheet,
    Simulation,
    TearingEnergy,
    TensionField,
)
from warp_pd.measures import TearLine, worst_balance

SPACING, LENGTH, HEIGHT, CRACK = 0.002, 0.06, 0.024, 0.022
DURATION, STRETCH = 0.8, 2.4


def outlined():
    corners = [(0.0, 0.0), (LENGTH, 0.0), (LENGTH, HEIGHT), (0.0, HEIGHT)]
    crack = [(0.0, 0.5 * HEIGHT), (CRACK, 0.5 * HEIGHT)]
    return Sheet.outline(corners, cracks=[crack], spacing=SPACING, thickness=1e-3, density=1000.0)


def torn(sheet, horizon, weights, criterion):
    """A strip that is pulled until it is in two, at the default step."""
    top, bottom = sheet.edges("top"), sheet.edges("bottom")
    line, held = TearLine(sheet), np.concatenate([top, bottom])
    tip, ahead = (CRACK, 0.5 * HEIGHT), (LENGTH, 0.5 * HEIGHT)
    travel = 0.5 * (STRETCH - 1.0) * HEIGHT
    return Simulation(
        sheet,
        force=BondAssociated(TensionField(NEO), horizon=horizon, weights=weights),
        loads=[
            Motion(edge, times=[0.0, DURATION], x=0.0, y=[0.0, way], z=0.0)
            for edge, way in ((top, travel), (bottom, -travel))
        ],
        damage=criterion(held),
        solver=Explicit(DURATION, frames=40, damping=5.0),
        measures=[Measure("tip", "m", lambda built, frame: line.reach(frame.intact_faces, tip, ahead))],
        outcomes=[Outcome("worst_energy_balance", "1", worst_balance)],
    ).run(device="cpu", precision=64)


def tearing(held):
    return TearingEnergy(6.0, spared=held)


def breaking(held):
    return CriticalStretch(2.0, held)


@pytest.mark.parametrize(
    ("criterion", "horizon", "weights"), [(tearing, 2.015, "corrected"), (breaking, 3.15, "plain")]
)
def test_a_tear_from_a_crack_runs_through_the_sheet_and_keeps_its_balance(criterion, horizon, weights):
    result = torn(outlined(), horizon, weights, criterion)
    assert result.status == "finished", result.summary["message"]
    assert max(row["tip"] for row in result.history) > 0.9 * (LENGTH - CRACK)
    assert result.summary["measures"]["worst_energy_balance"]["value"] < 0.01
