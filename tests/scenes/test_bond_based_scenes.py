"""Scenes of the bond-based law: exact solution of the bar, bending of the beam, wrinkling of the square."""

import json

import pytest
from click.testing import CliRunner

from warp_pd.cli import build_scene, main


def test_the_bar_meets_the_exact_solution_and_its_error_halves_with_the_spacing():
    for ratio, bound in ((1.0, 4e-3), (5.0, 5e-3), (10.0, 7e-3)):
        errors = []
        for points in (100, 200):
            result = build_scene("bimodular_bar", {"points": points, "ratio": ratio}).run(device="cpu")
            assert result.status == "finished" and result.summary["solve"]["iterations"] <= 5
            errors.append(result.summary["measures"]["displacement_error"]["value"])
        assert errors[1] < bound and errors[1] < 0.6 * errors[0]


def test_a_softer_compressed_side_bends_more():
    small = {"points": 60, "tolerance": 1e-6}
    down = [
        -build_scene("cantilever", {**small, "ratio": ratio}).run(device="cpu").summary["measures"]["end_down"]["value"]
        for ratio in (1.0, 5.0, 20.0)
    ]
    assert down[0] < down[1] < down[2]
    assert down[0] == pytest.approx(0.7690, rel=0.2)


def test_one_spacing_of_horizon_leaves_nothing_wrinkled():
    """The paper prints this horizon for its square: the bonds form a net, which turns instead of wrinkling."""
    shares = []
    for horizon in (1.0, 3.0):
        result = build_scene("square_wrinkles", {"points": 20, "horizon": horizon}).run(device="cpu")
        assert result.status == "finished"
        shares.append(result.summary["measures"]["mean_wrinkle_level"]["value"])
    assert shares[0] < 0.02
    assert shares[1] > 0.2


def test_no_convergence_keeps_the_last_good_load_step_and_ends_with_code_3(tmp_path):
    command = [
        "run", "cantilever", "--points", "40", "--set", "ratio=20", "--set", "stiffness=constant", "--set",
        "most_cuts=0", "--device", "cpu", "--quiet", "--no-usd", "--no-pictures", "--out", str(tmp_path),
    ]  # fmt: skip
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 3 and "last good load step" in done.output
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["status"] == "not converged" and 0.0 < summary["solve"]["reached"] < 1.0
