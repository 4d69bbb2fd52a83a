"""Scenes with any force law, from Python and from the command line."""

import numpy as np
import pytest
from click.testing import CliRunner

from warp_pd.__main__ import build_scene, main

SCENES = {
    # The nodal law finds no static equilibrium under a follower pressure: its corners crumple without resistance.
    "pressure_static": {"force": "closed_form", "points": 9, "tolerance": 1e-2},
    "pressure_dynamic": {"force": "nodal", "points": 9, "duration": 0.02, "frames": 2},
    "out_of_plane": {"force": "neural_fused", "points": 15, "duration": 0.02, "frames": 2},
    # Without an energy there is no column of that of rupture.
    "precut_tear": {"force": "neural_fused", "critical_stretch": 1.3, "points": 15, "duration": 0.02, "frames": 2},
    "ball_penetration": {"force": "neural", "critical_stretch": 1.3, "points": 11, "duration": 0.02, "frames": 2},
}


@pytest.mark.parametrize("name", SCENES)
def test_scenes_take_any_law(name):
    result = build_scene(name, SCENES[name] | {"horizon": 2.015}).run(device="cpu")
    assert result.status == "finished"
    assert np.abs(result.frame.displacement).max() > 0.0
    assert not [n for n in result.summary["notes"] if n.startswith("solver: Relaxation")]


def test_a_scene_says_why_it_does_not_take_newton():
    said = build_scene("pressure_static", {"force": "nodal", "points": 9, "horizon": 2.015}).notes
    assert said == ["solver: Relaxation, as nodal has no tangent for Newton"]


def test_the_command_line_takes_the_law(tmp_path):
    small = ["run", "pressure_static", "--points", "9", "--device", "cpu", "--set", "tolerance=1e-2", "--no-usd"]
    done = CliRunner().invoke(main, [*small, "--force", "neural", "--out", str(tmp_path / "a"), "--no-pictures"])
    assert done.exit_code == 0, done.output
    assert "no potential" in done.output
    for wrong, said in (
        (["--force", "neurla"], "did you mean 'neural'"),
        (["--force", "none.npz"], "does not exist"),
        (["--force", "nodal", "--weights", "plain"], "weights = 'plain'"),
        (["--force", "nodal", "--solver", "newton"], "which have a tangent; or use the solver Explicit or Relaxation"),
    ):
        done = CliRunner().invoke(main, [*small, *wrong, "--out", str(tmp_path / "b")])
        assert done.exit_code == 2 and said in done.output and "Traceback" not in done.output
        assert len(done.output.strip().splitlines()) == 1
