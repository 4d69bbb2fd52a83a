"""Divergence: what is wrong, where, and the likely cause."""

import json
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from helpers import GENT, build, jittered, square
from small_runs import cli, run

from warp_pd import (
    BondAssociated,
    Explicit,
    Fixed,
    Motion,
    NeoHookean,
    Place,
    Pressure,
    Sheet,
    Simulation,
    TearingEnergy,
    TensionField,
    placed,
    together,
)
from warp_pd.__main__ import build_scene
from warp_pd.distributed.partition import partition_sheet
from warp_pd.interfaces import DivergedError, UnbalancedError
from warp_pd.kernels.block_sums import BLOCK
from warp_pd.parts.frame_checks import FrameChecks
from warp_pd.run.checks import Soundness
from warp_pd.run.recorder import Recorder


@pytest.mark.parametrize("field", ["displacement", "velocity"])
@pytest.mark.parametrize("bad", [(0,), (255, 256), (288,), (280, 3)])
def test_the_first_point_that_is_not_finite_is_named(field, bad):
    built = build(square(17))
    values = np.zeros((17**2, 3))
    values[list(bad), 1] = np.inf if field == "velocity" else np.nan
    getattr(built.state, field).assign(values)
    with pytest.raises(DivergedError, match=f"point {min(bad)} at"):
        Recorder(built, []).frame(0, 0.0, 0, 0.0)


def test_the_first_bad_point_of_several_processes_has_its_number_in_the_whole_sheet():
    """Each process tells of each of its blocks of points the first bad one of its own, or too large a number."""
    sheet = square(33)
    begins = np.arange(0, sheet.size, BLOCK)
    partition = partition_sheet(sheet, 2.015, 1, 3)
    first = partition.bounds[partition.block_owner_of(begins)]
    checks = FrameChecks.__new__(FrameChecks)
    for bad in ([0], [255, 256], [767, 800], [1000, 1088], []):
        checks.not_finite = np.full(len(begins), sheet.size)
        for point in bad[::-1]:
            checks.not_finite[point // BLOCK] = point - first[point // BLOCK]
        checks.context = SimpleNamespace(partition=partition, whole=sheet, whole_array=np.copy)
        assert checks.first_not_finite() == min(bad, default=None)


@pytest.mark.parametrize("precision", [32, 64])
def test_the_point_that_crosses_a_horizon_in_a_step_is_named(precision):
    built = build(square(17), precision=precision)
    velocity = np.random.default_rng(0).uniform(-1.0, 1.0, (17**2, 3))
    velocity[77] = (0.0, -3.0, 4.0)
    built.state.velocity.assign(velocity.astype(built.state.velocity.numpy().dtype))
    horizon = built.law.families.horizon

    def recorded(dt):
        # A step that follows waves has a stable one.
        recorder = Recorder(built, [])
        recorder.stable_dt = dt
        recorder.frame(0, 0.0, 0, dt)

    recorded(0.999 * horizon / 5.0)
    with pytest.raises(DivergedError, match="point 77 moves more than a horizon"):
        recorded(1.001 * horizon / 5.0)


def test_gent_near_its_lock_ends_with_the_cause():
    sheet = square(7)
    simulation = Simulation(
        sheet, BondAssociated(GENT, weights="plain"), Explicit(1.0, frames=50, retries=0),
        loads=[Fixed(sheet.edges("left")), Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, 2.0])],
    )  # fmt: skip
    result = simulation.run(device="cpu")
    assert result.status == "diverged"
    assert "lock" in result.summary["message"]
    assert np.isfinite(result.frame.displacement).all()


@pytest.mark.parametrize(("waves", "motion"), [(5.0, True), (0.5, False)])
def test_edges_pulled_faster_than_waves_are_the_cause(waves, motion):
    """Waves of small strain go at sqrt(4 mu / density) = 2 m/s."""
    sheet, pulled = jittered(13), waves * 2.0
    sides = (("left", -1), ("right", 1))
    ends = [Motion(sheet.edges(name), [0.0, 1.0], x=[0.0, side * pulled]) for name, side in sides]
    law = BondAssociated(GENT, weights="plain", horizon=2.015)
    result = Simulation(sheet, law, Explicit(0.5 / pulled, frames=50, retries=0), loads=ends).run(device="cpu")
    assert result.status == "diverged"
    said = f"supports move points at {pulled:g} m/s, faster than any wave"
    assert (said in result.summary["message"]) == motion, result.summary["message"]


def test_a_slack_sheet_that_becomes_taut_has_a_step_that_follows():
    """And the message names such a step to who has chosen a longer one."""
    sheet, law = square(21), BondAssociated(TensionField(NeoHookean(1e5, 1e7)), horizon=2.015)
    loads = [Fixed(sheet.edges("all")), Pressure(100.0)]
    default, long = (
        Simulation(sheet, law, Explicit(0.1, frames=10, safety=safety, retries=0), loads=loads).run(device="cpu")
        for safety in (None, 0.9)
    )
    assert default.status == "finished" and max(abs(row["balance_error"]) for row in default.history) < 0.005
    assert long.status == "diverged" and "try a safety of 0.4" in long.summary["message"]


@pytest.mark.parametrize(
    ("gain", "error", "sound"),
    [(0.009, 0.009, True), (-0.011, 0.0, False), (0.002, 0.02, False), (-0.002, 0.02, True), (-0.002, -0.02, False),
     (0.0005, 0.02, True)],
)  # fmt: skip
def test_a_frame_is_judged_by_what_it_gains_and_by_what_the_run_has_gained(gain, error, sound):
    soundness = Soundness.__new__(Soundness)
    if sound:
        soundness.require_balance(gain, error, 1)
    else:
        with pytest.raises(UnbalancedError, match="in frame 1"):
            soundness.require_balance(gain, error, 1)


def test_a_pressure_that_goes_on_after_the_burst_is_the_cause():
    sheet = Sheet.rectangle(0.2, 0.2, thickness=1e-3, density=1000.0, points=21).cut((0.07, 0.1), (0.13, 0.1))
    edge = sheet.edges("all")
    simulation = Simulation(
        sheet, BondAssociated(TensionField(NeoHookean(4e5, 4e7))), Explicit(0.1, frames=40, damping=50.0),
        loads=[Fixed(edge), Pressure(1e5, ramp=[(0.0, 0.0), (0.1, 1.0)])], damage=TearingEnergy(2e3, spared=edge),
    )  # fmt: skip
    result = simulation.run(device="cpu")
    assert result.status == "diverged" and "let it fall after the burst" in result.summary["message"]


def test_a_diverging_run_ends_with_code_3_and_its_cause(tmp_path):
    done = cli("run", "pressure_static", "--points", "11", "--set", "pressure=500", "--device", "cpu", "--no-usd",
               "--no-pictures", "--out", tmp_path)  # fmt: skip
    assert done.exit_code == 3
    assert "diverged" in done.output and "likely cause: no equilibrium near" in done.output
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["status"] == "diverged"
    with h5py.File(tmp_path / "frames.vtkhdf") as file:
        assert np.isfinite(file["VTKHDF/Points"][:]).all()


def test_a_start_that_is_not_finite_ends_with_code_3_and_leaves_nothing(tmp_path):
    done = cli("run", "double_notch", "--points", "20", "--horizon", "2.015", "--set", "roughness=100", "--set",
               "critical_stretch=2", "--device", "cpu", "--quiet", "--out", tmp_path)  # fmt: skip
    assert done.exit_code == 3, done.output
    assert "is NaN or Inf at the start" in done.output and "initial displacement" in done.output
    assert not list(tmp_path.iterdir())


def test_the_likely_cause_fits_the_scene():
    """Nothing can tear here, and no step in time could be smaller."""
    result = build_scene("pressure_static", {"points": 11, "pressure": 500.0}).run(device="cpu")
    assert result.status == "diverged"
    assert "try a smaller load" in result.summary["message"]
    assert "torn" not in result.summary["message"] and "safety" not in result.summary["message"]


@pytest.mark.parametrize("precision", [32, 64])
def test_a_sheet_that_was_placed_and_waits_does_not_diverge(precision):
    """All its energy is round-off of the placement."""
    sheet = together(square(9), square(9))
    start = placed(sheet, Place(), Place((0.0, 0.0, 0.05), degrees=15.0))
    result = run(sheet, Explicit(0.01, frames=2), precision=precision, initial_displacement=start)
    assert result.status == "finished"
    assert result.history[-1]["strain"] > 0.0
