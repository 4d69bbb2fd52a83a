"""Stretched membranes: natural frequencies of drums against exact ones, and vibrations of large amplitude."""

import numpy as np
import pytest
from axisymmetric_membrane import first_zero, vibrating_disc
from helpers import build, jittered, refused, square
from scipy.special import j0, jn_zeros

from warp_pd import BodyForce, Fixed, MooneyRivlin, Newton, Pressure
from warp_pd.__main__ import build_scene
from warp_pd.command.modes import natural_modes

RUBBER = MooneyRivlin(500.0)


def speeds(a, b):
    """Speeds of transverse waves along x and y [m/s] in RUBBER of 1000 kg/m^3: c^2 = Cauchy stress / density."""
    return np.sqrt(np.array([a**2 - (a * b) ** -2, b**2 - (a * b) ** -2]))


def square_drum(points, a, b, make=square):
    """Errors of the first six frequencies of a square drum of 0.1 m."""
    sheet = make(points).prestretched(a, b)
    built = build(
        sheet, material=RUBBER, solver=Newton(), loads=[Fixed(sheet.edges("all"))], weights="corrected", horizon=2.015
    )
    built.context.run("setup")
    m = np.arange(1, 9)
    cx, cy = speeds(a, b)
    exact = np.sort(np.hypot(cx * m[:, None], cy * m).ravel())[:6] / 0.2
    return natural_modes(built, 6, "z").frequencies / exact - 1.0


@pytest.mark.parametrize(("a", "b"), [(1.5, 1.5), (1.5, 1.2)])
def test_square_drums_have_the_exact_frequencies(a, b):
    """Of second order, on a lattice; stretches that differ make the slower axis the one of less tension."""
    coarse, fine = (np.abs(square_drum(points, a, b)).max() for points in (17, 33))
    assert fine < 0.015
    assert np.log2(coarse / fine) > 1.8


def test_round_drums_have_bessels_frequencies():
    errors = {}
    for points in (21, 41):
        measures = build_scene("drum", {"points": points}).run(device="cpu").summary["measures"]
        errors[points] = np.array([abs(m["error"]) for m in measures.values()])
        assert len(errors[points]) == 6
    assert errors[41].max() < 0.01 and errors[41][0] < 0.0022
    assert np.log2(errors[21] / errors[41]).min() > 1.7


@pytest.mark.parametrize("amplitude", [1e-3, 0.1])
def test_the_further_a_drum_is_lifted_the_faster_it_falls(amplitude):
    """The time to the first zero of the centre; a quarter of Bessel's period if the amplitude is small."""
    scene = build_scene("drum", {"points": 41, "amplitude": amplitude, "duration": 1.6e-3, "frames": 40})
    result = scene.run(device="cpu", precision=64)
    root = jn_zeros(0, 1)[0]
    found = result.summary["measures"]["first_zero"]["value"]
    times, centre = vibrating_disc(lambda r: amplitude * j0(root * r / 0.1), 1.5, 5e5, 1.6e-3, elements=100)
    quarter = 0.5 * np.pi * 0.1 / (root * np.sqrt(1e3 * (1.5**2 - 1.5**-4)))
    assert found == pytest.approx(first_zero(times, centre), rel=3e-3)
    assert (found == pytest.approx(quarter, rel=3e-3)) == (amplitude < 0.01)
    assert abs(result.history[-1]["balance_error"]) < 1e-3


def test_modes_are_of_unit_mass_and_orthogonal_and_rigid_motions_are_free():
    sheet = jittered(9)
    built = build(sheet, material=RUBBER, weights="corrected")
    built.context.run("setup")
    modes = natural_modes(built, 8)
    mass = built.to_numpy(built.state.mass)
    products = np.einsum("inc,jnc,n->ij", modes.shapes, modes.shapes, mass)
    assert products == pytest.approx(np.eye(8), abs=1e-8)
    # A flat sheet without stress: three rigid motions in its plane, and nothing resists to the first order out of it.
    plane = natural_modes(built, 5, "xy")
    assert plane.frequencies[:3] == pytest.approx(0.0, abs=1e-3 * plane.frequencies[3])


def test_modes_that_cannot_be_found_are_refused():
    sheet = square(5)
    clamp = Fixed(sheet.edges("all"))
    for parts, text in (
        ({"loads": [clamp, Pressure(1.0)]}, "depends on the displacement"),
        ({"loads": [clamp, BodyForce((0.0, 0.0, 1.0))], "number": 99}, "number = 99"),
        ({"loads": [clamp], "components": "xw"}, "components = 'xw'"),
        ({"loads": [clamp], "components": 3}, "components = 3"),
        ({"loads": [clamp], "number": "many"}, "number = 'many'"),
        ({"loads": [clamp], "weights": "published"}, "weights"),
    ):
        asked = {name: parts.pop(name) for name in ("number", "components") if name in parts}
        with refused(match=text):
            natural_modes(build(sheet, **parts), **asked)
    with refused(match="built = 3: expected a Built"):
        natural_modes(3)
