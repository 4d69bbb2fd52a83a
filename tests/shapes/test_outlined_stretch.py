"""Sheets with a hole, a crack and an inclusion meet the finite elements of tools/references."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from warp_pd.__main__ import build_scene, load_scene

STORED = json.loads((Path(__file__).parents[1] / "references" / "stretch.json").read_text())


@cache
def error(defect, mode, points):
    """Relative error of the force on the right edge at a stretch of 1.5, reached in one load step."""
    settings = {"points": points, "mode": mode, "defect": defect, "stretch": 1.5}
    settings |= {"force": "bond_associated", "tolerance": 1e-5}
    result = build_scene("stretch", settings).run(device="cpu")
    assert result.status == "finished"
    expected = STORED[defect][mode]["1.5"]["force_x"]["value"]
    return result.history[-1]["edge_force"] / expected - 1.0


@pytest.mark.parametrize(
    ("defect", "mode", "bound"),
    [
        ("hole", "equibiaxial", 1e-3), ("hole", "planar", 1e-3), ("inclusion", "equibiaxial", 1.5e-3),
        ("crack", "planar", 3e-3),
    ],
)  # fmt: skip
def test_the_edge_force_is_that_of_the_finite_elements(defect, mode, bound):
    assert abs(error(defect, mode, 41)) < bound


@pytest.mark.parametrize("defect", ["hole", "inclusion"])
def test_the_error_falls_with_the_square_of_the_spacing(defect):
    coarse, fine = (abs(error(defect, "equibiaxial", points)) for points in (21, 41))
    assert np.log2(coarse / fine) >= 1.8


def test_the_scene_compares_with_the_stored_forces():
    for defect in ("hole", "crack", "inclusion"):
        for mode, by_stretch in STORED[defect].items():
            for stretch, known in by_stretch.items():
                told = load_scene("stretch").reference(mode, defect, "roller", float(stretch))[0]
                assert told == pytest.approx(known["force_x"]["value"], rel=1e-5)
