"""Rigid inclusions: they move as bodies, and keep momentum and energy."""

import numpy as np
import pytest
from helpers import square
from small_runs import run

from warp_pd import Explicit, Fixed, Motion


def test_a_rigid_inclusion_moves_as_a_body():
    sheet = square(17).inclusion((0.05, 0.05), 0.018)
    members = sheet.inclusions[0]
    result = run(
        sheet, solver=Explicit(0.3, frames=6, safety=0.5),
        loads=[Fixed(sheet.edges("left")), Motion(sheet.edges("right"), [0.0, 0.3], x=[0.0, 0.03], y=[0.0, 0.03], z=[0.0, 0.02])],  # noqa: E501
    )  # fmt: skip
    reference = np.column_stack([sheet.points, np.zeros(sheet.size)])
    moved = reference + result.frame.displacement
    before = np.linalg.norm(reference[members][:, None] - reference[members], axis=-1)
    after = np.linalg.norm(moved[members][:, None] - moved[members], axis=-1)
    assert after == pytest.approx(before, abs=1e-9)
    assert np.linalg.norm(result.frame.displacement[members], axis=1).min() > 1e-3
    assert abs(result.history[-1]["balance_error"]) < 0.01


def test_a_free_sheet_with_an_inclusion_keeps_its_momentum():
    sheet = square(9).inclusion((0.05, 0.05), 0.02)
    spin = np.column_stack([-sheet.points[:, 1], sheet.points[:, 0], 0.3 * sheet.points[:, 0]])
    spin[sheet.inclusions[0]] = 0.0
    result = run(sheet, initial_velocity=spin, solver=Explicit(0.3, frames=3, safety=0.3))
    mass = result.built.to_numpy(result.built.state.mass)[:, None]
    before, after = (mass * spin).sum(axis=0), (mass * result.frame.velocity).sum(axis=0)
    assert after == pytest.approx(before, abs=1e-10 * np.abs(mass * spin).sum())
    total = [row["kinetic"] + row["strain"] for row in result.history]
    assert total[-1] == pytest.approx(total[0], rel=5e-3)
