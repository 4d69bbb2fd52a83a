"""Against finite elements: BA 6.1 and 6.2 (references and their sources stand in the scenes)."""

import functools
from pathlib import Path

import numpy as np

from warp_pd.__main__ import build_scene

DATA = Path(__file__).parent / "data"


def error(scene, measure, **settings):
    result = build_scene(scene, settings).run(device="cpu", precision=64)
    assert result.status == "finished"
    return result.summary["measures"][measure]["error"]


def test_pressure_corrected():
    assert abs(error("pressure", "center_deflection", points=51, horizon=2.015)) < 1.5e-3


def test_pressure_corrected_fine():
    assert abs(error("pressure", "center_deflection", points=101, horizon=1.5)) < 5e-4


def test_pressure_dead():
    assert abs(error("pressure", "center_deflection", points=51, horizon=1.5, follower=False)) < 1.5e-3


def test_tension_corrected():
    assert abs(error("tension", "edge_contraction", points=51, horizon=2.015)) < 1.5e-3


def test_tension_grip_force():
    assert abs(error("tension", "grip_force", points=51, horizon=1.5)) < 2e-3


@functools.cache
def lifted(wrinkles):
    """Displacement of the lifted sheet at 1.5 s."""
    settings = {"points": 51, "duration": 1.5, "frames": 1, "wrinkles": wrinkles, "safety": 0.8}
    return build_scene("out_of_plane", settings).run(device="cpu").frame.displacement


def lifted_error(wrinkles, stored):
    """Relative distance from the elements at 1.5 s, and that of the mean deflection."""
    exact = np.load(DATA / "out_of_plane.npz")[f"{stored}_t1.5"]
    found = lifted(wrinkles).reshape(51, 51, 3).transpose(2, 1, 0)
    return np.linalg.norm(found - exact) / np.linalg.norm(exact), found[2].mean() / exact[2].mean() - 1.0


def test_the_lifted_sheet_meets_the_elements():
    """NN 6.2 with the relaxed energy, which has a limit; 10.1 % here, 5.9 % with 101 points, 2.6 % at 1.5."""
    field, mean = lifted_error("relaxed", "relaxed_u")
    assert field < 0.11
    assert abs(mean) < 0.095


def test_resolved_wrinkles_are_another_state_than_relaxed_ones():
    """Same sheet, same pull: the compression that wrinkles carry makes the difference, not the method."""
    assert lifted_error("resolved", "u")[0] < 0.15
    assert lifted_error("relaxed", "u")[0] > 0.3
