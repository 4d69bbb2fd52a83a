"""Supports: wrong input, and points that two of them would hold or move, are named."""

from types import SimpleNamespace

import numpy as np
import pytest
from helpers import NEO, refused, square

from warp_pd import BondAssociated, Explicit, Fixed, Motion, Simulation
from warp_pd.parts import stretching_edges


def built_with(*loads):
    return Simulation(square(5), BondAssociated(NEO), Explicit(1.0), loads=loads).build("cpu")


WRONG = [
    (lambda: built_with(Motion([3], [0.0], x=1.0), Fixed([3])), r"Fixed\.points contains point 3 at .* component x"),
    (lambda: built_with(Fixed([3]), Motion([3], [0.0], z=1.0)), r"Motion\.points contains point 3 at .* component z"),
    (lambda: Motion([0], [0.0, 1.0]).constraints(square(5)), "at least one prescribed"),
    (lambda: Motion([0], [1.0, 0.0], x=1.0).paths(), "increasing"),
    (lambda: Motion([0], [0.0, 1.0], x=[1.0, 2.0, 3.0]).paths(), "3 values"),
    (lambda: Motion([0], [0.0, 1.0], x=[0.0, float("nan")]).paths(), r"Motion\.x\[1\] = nan"),
    (lambda: Motion([0], [0.0, 1.0], y="fast").paths(), r"Motion\.y = 'fast'"),
    (lambda: Motion([0], ["soon", 1.0], x=1.0).paths(), r"Motion\.times = "),
    (lambda: Motion([0], [], x=[]).paths(), "expected one or more increasing times"),
    (lambda: Motion([0], [[0.0, 1.0]], x=[0.0, 1.0]).paths(), "increasing"),
    (
        lambda: built_with(Motion([3], [0.0, 1.0], y=[1.0, 0.0])),
        r"Motion\.y is 1 m at t = 0, 1 m from its points",
    ),
    (lambda: Motion([0], [0.0, 1.0], x=np.ones((3, 2))).paths(), r"shape \(3, 2\): expected 1 or 2, one per time, or"),
    (lambda: Motion([0], [0.0], x=np.ones((1, 2)), y=np.ones((1, 3))).paths(), "paths of 2 and 3 points"),
    (
        lambda: Motion([0, 1, 2], [0.0], x=np.ones((1, 2))).constraints(square(5)),
        "expected 2 different points, one for each path, got 3",
    ),
    (
        lambda: Motion([1, 1], [0.0], x=np.ones((1, 2))).constraints(square(5)),
        "expected 2 different points, one for each path, got 1",
    ),
    (lambda: Fixed([0], "xw").constraints(square(5)), "'xw'"),
    (lambda: Motion([0], [0.0], angle=1.0, axis=(0, 0, 0)).turn(), r"Motion\.axis = \(0, 0, 0\): expected a direction"),
    (lambda: Motion([0], [0.0], angle=1.0, about=(0, 0, 0, 0)).turn(), r"Motion\.about"),
    (lambda: Motion([0], [0.0, 1.0], angle=[0.0, 1.0, 2.0]).turn(), "Motion.angle has 3 values"),
    (lambda: Motion([0], [0.0, 1.0], x=lambda t: None).paths(), "Motion.x returned None: expected a function that"),
    (lambda: Motion([0], [0.0, 1.0], angle=lambda t: None).turn(), "Motion.angle returned None: expected a function"),
    (
        lambda: Motion([0], [0.0, 1.0], x=lambda t: np.exp(1j * t)).paths(),
        r"Motion\.x = array\(\[.*j\]\): expected num",
    ),
    (lambda: built_with(Motion([3], [0.0], angle=1.0)), r"Motion\.y is 0 m and angle 1 rad at t = 0"),
    (
        lambda: built_with(Motion([3], [0.0], angle=0.0), Fixed([3], "y")),
        r"Fixed\.points contains point 3 at .* component y",
    ),
]


@pytest.mark.parametrize(("make", "text"), WRONG, ids=[text for _, text in WRONG])
def test_wrong_supports_are_named(make, text):
    with refused(match=text):
        make()


def test_stretching_edges_move_as_an_equal_stretch_of_the_sheet():
    place = square(9, size=2.0).points - 1.0
    sheet = SimpleNamespace(points=place, spacing=0.25)
    moved = np.zeros_like(place)
    for motion in stretching_edges(sheet, 0.75, [0.0, 2.0], [1.0, 1.5]):
        for axis, path in enumerate((motion.x, motion.y)):
            if path is not None:
                assert path[0] == 0.0
                moved[motion.points, axis] += path[1]
    outside = np.abs(place).max(axis=1) > 0.7
    np.testing.assert_allclose(moved, np.where(outside[:, None], 0.5 * place, 0.0), atol=1e-12)
