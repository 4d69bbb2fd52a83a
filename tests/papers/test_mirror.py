"""Layers outside a sheet that mirror its displacement."""

import numpy as np
import pytest
from helpers import refused, square
from resumed_runs import require_same_when_stopped

from warp_pd import Bimodular, BondBased, Explicit, Fixed, Mirror, Newton, Relaxation, Simulation
from warp_pd.__main__ import build_scene


def stretched(**settings):
    settings = {"points": 14, "force": "bond_based_refitted", "stretch": 1.5, "tolerance": 1e-6, **settings}
    result = build_scene("stretch", settings).run(device="cpu", precision=64)
    assert result.status == "finished"
    return result


def test_a_uniform_sheet_is_nearly_that_with_layers_that_move_uniformly():
    """The bond law stretches a lattice evenly within a percent: its outer points have other corrections."""
    mirrored, uniform = (stretched(layers=layers) for layers in ("mirror", "uniform"))
    assert mirrored.history[-1]["edge_force"] == pytest.approx(uniform.history[-1]["edge_force"], rel=1e-2)
    apart = np.abs(mirrored.frame.displacement - uniform.frame.displacement).max()
    assert apart < 1e-2 * np.abs(uniform.frame.displacement).max()


@pytest.mark.parametrize("grip", ["roller", "clamp"])
def test_layers_outside_are_the_mirror_image_of_a_sheet_with_a_hole(grip):
    result = stretched(defect="hole", mode="planar", grip=grip, layers="mirror")
    sheet, u = result.built.simulation.sheet, result.frame.displacement
    half = 0.25
    for i in np.flatnonzero((sheet.points[:, 0] > half) & (np.abs(sheet.points[:, 1]) < half)):
        x, y = sheet.points[i]
        image = u[sheet.nearest(2.0 * half - x, y)]
        assert u[i, 0] == pytest.approx(2.0 * 0.5 * half - image[0], abs=1e-5 * half)
        assert u[i, 1] == pytest.approx(image[1] if grip == "roller" else -image[1], abs=1e-5 * half)
    assert np.abs(u[:, 1]).max() > 1e-3 * half


def test_what_is_no_mirror_image_is_refused():
    sheet = square(9)
    right = sheet.edges("right")
    inner, zeros, ones = right - 2, np.zeros((9, 2)), np.ones((9, 2), bool)
    loads = [Fixed(range(sheet.size), "z"), Fixed(sheet.edges("left"), "xy")]
    for part, said in (
        (Mirror(right, right, zeros, ones), "Mirror.images: expected points of the sheet"),
        (Mirror(right, inner[:3], zeros, ones), "Mirror.images: expected one for each of 9"),
        (Mirror(right, inner, zeros[:, :1], ones), "Mirror.edge: expected shape"),
        (Mirror(right, inner, zeros, ones[:4]), "Mirror.mirrored: expected shape"),
        (Mirror(right, inner, zeros + np.nan, ones), "Mirror.edge"),
        (Mirror(right, inner, zeros, ones), "Newton"),
    ):
        with refused(said):
            Simulation(sheet, BondBased(Bimodular(1e4)), Newton(), loads=[*loads, part]).build("cpu")


@pytest.mark.parametrize("solver", [Explicit(0.02, frames=4), Relaxation(load_steps=3, ramp_steps=50)])
def test_a_run_goes_on_bit_for_bit(solver, tmp_path):
    """A step ends with the force where the points outside were, not where those in the sheet now place them."""

    def simulation():
        sheet = square(7)
        left, right = sheet.edges("left"), sheet.edges("right")
        mirror = Mirror(right, right - 2, np.full((7, 2), 1e-3), np.ones((7, 2), bool), [(0.0, 0.0), (0.02, 1.0)])
        return Simulation(sheet, BondBased(Bimodular(1e4)), solver, loads=[Fixed(left), Fixed(right, "z"), mirror])

    require_same_when_stopped(simulation, tmp_path, [3], 64)
