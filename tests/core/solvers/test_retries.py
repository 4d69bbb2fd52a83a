"""Frames in which a run diverges are computed again with a shorter step."""

import numpy as np
import pytest
from helpers import GENT, square
from resumed_runs import require_same_when_stopped

from warp_pd import (
    BondAssociated,
    EnclosedGas,
    Explicit,
    Fixed,
    Gent,
    Motion,
    NeoHookean,
    Pressure,
    Simulation,
    TensionField,
)
from warp_pd.device.checks import InputError
from warp_pd.run.built import compose


def becomes_taut(**settings):
    """A slack sheet under pressure: as it becomes taut, it stiffens faster than the estimate of the step follows."""
    sheet, law = square(21), BondAssociated(TensionField(NeoHookean(1e5, 1e7)), horizon=2.015)
    solver = Explicit(0.1, frames=20, safety=0.9, **settings)
    return Simulation(sheet, law, solver, loads=[Fixed(sheet.edges("all")), Pressure(100.0)])


def test_a_frame_that_diverges_is_computed_again():
    alone = becomes_taut(retries=0).run(device="cpu")
    assert alone.status == "diverged" and alone.summary["repeated"] == 0
    result = becomes_taut().run(device="cpu")
    assert result.status == "finished" and result.summary["repeated"] > 0
    assert any("computed again" in note for note in result.summary["notes"])
    assert max(abs(row["balance_error"]) for row in result.history) < 0.01
    # Each frame is there once, the first with the same bits.
    assert np.diff([row["time"] for row in result.history]) == pytest.approx(0.005)
    assert result.history[:2] == alone.history[:2]


def test_a_repeated_frame_is_that_of_shorter_steps(device):
    result = becomes_taut().run(device=device)
    assert result.summary["repeated"] > 0
    short = becomes_taut(retries=0, step=2e-5).run(device=device)
    most = max(row["external"] for row in short.history)
    for row, exact in zip(result.history, short.history, strict=True):
        for column in ("strain", "kinetic", "external"):
            assert row[column] == pytest.approx(exact[column], abs=0.005 * most)


def test_a_shorter_step_is_judged_by_its_own_energy():
    """A step at the limit hides energy of motion from point to point, which a shorter step shows and does not add."""
    sheet, law = square(21), BondAssociated(TensionField(NeoHookean(1e5, 1e7)), horizon=2.015)
    gas = EnclosedGas(chamber=1e-4, amount=[(0.0, 1.0), (0.05, 1.01)])
    loads = [Fixed(sheet.edges("all")), gas]
    result = Simulation(sheet, law, Explicit(0.1, frames=20, safety=0.9), loads=loads).run(device="cpu")
    assert result.status == "finished" and 0 < result.summary["repeated"] <= 3
    assert result.summary["steps"] < 450, "by less than a factor of 4"


def test_a_step_that_was_halved_is_doubled_after_sound_frames():
    """Damped, the sheet is soon as still as it was before it became taut."""
    steps = np.array([row["step"] for row in becomes_taut(damping=400.0).run(device="cpu").history[1:]])
    ratio = steps[1:] / steps[:-1]
    assert ratio.min() < 0.6 and ratio.max() > 1.8


def test_a_resumed_run_has_the_same_shortened_steps(tmp_path):
    result = require_same_when_stopped(becomes_taut, tmp_path, [3, 9, 14])
    assert result.summary["repeated"] > 0


def test_rows_between_frames_are_those_of_the_last_attempt(tmp_path):
    result = becomes_taut(history_every=1e-3).run(device="cpu")
    assert result.status == "finished" and result.summary["repeated"] > 0
    times = [row["time"] for row in result.fine_history]
    assert (np.diff(times) > 0.0).all() and max(abs(row["balance_error"]) for row in result.history) < 0.01


def test_a_run_that_shorter_steps_do_not_save_diverges():
    """Pulled beyond the stretch at which its material locks."""
    sheet = square(7)
    loads = [Fixed(sheet.edges("left")), Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, 2.0])]
    law = BondAssociated(Gent(1e3, 1e5, 5.0), weights="plain")
    once, often = (
        Simulation(sheet, law, Explicit(1.0, frames=100, retries=retries), loads=loads).run(device="cpu")
        for retries in (0, 2)
    )
    assert once.status == often.status == "diverged" and "lock" in often.summary["message"]
    assert often.summary["repeated"] >= 2
    assert len(often.history) >= len(once.history) > 2


@pytest.mark.parametrize("settings", [{"retries": 0}, {"step": 1e-6}])
def test_a_run_without_retries_has_no_copies(settings):
    with_copies, without = (compose(becomes_taut(**some), "cpu", None).context.fields for some in ({}, settings))
    assert any(stored.owner == "retries" for stored in with_copies)
    assert not any(stored.owner == "retries" for stored in without)


@pytest.mark.parametrize("retries", [-1, 1.5, "many"])
def test_retries_are_a_number(retries):
    with pytest.raises(InputError, match=r"retries = .*expected"):
        Explicit(1.0, retries=retries)


def test_a_gent_sheet_is_pulled_to_its_lock():
    """Its stiffness grows by orders of magnitude within a frame, and energy is conserved."""
    sheet = square(7)
    loads = [Fixed(sheet.edges("left")), Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, 1.1])]
    law = BondAssociated(GENT, weights="plain")
    result = Simulation(sheet, law, Explicit(0.6, frames=30), loads=loads).run(device="cpu")
    assert result.status == "finished" and result.summary["repeated"] > 0
    assert max(abs(row["balance_error"]) for row in result.history) < 0.01
