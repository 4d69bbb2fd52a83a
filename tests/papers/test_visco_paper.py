"""What VE prints and its equations cannot give, and what its torn and holed sheets need instead."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from warp_pd import Prony, Yeoh
from warp_pd.__main__ import build_scene
from warp_pd.papers.analytic_response import published_stress

POLYUREA = Yeoh(c10=0.1996e6, c20=0.0170e6)
TERM = Prony(c10=0.01733e6, c20=0.0015e6, time=0.9466, exponent=1.6665)
YOUNG, POISSON = 1.1976e6, 0.5
ELEMENTS = json.loads((Path(__file__).parents[1] / "references" / "visco.json").read_text())


def elastic_stress(stretch):
    """Virial stress [Pa] of eq. 79 in a uniform sheet, with the factor that `published_stress` has."""
    x, y = np.meshgrid(*[np.arange(-3.0, 4.0)] * 2)
    length = np.hypot(x, y)
    family = (length > 0.0) & (length <= 3.015)
    constant = 12.0 * YOUNG / ((1.0 + POISSON) * math.pi * 3.015**3)
    return constant * (stretch - 1.0) * (x[family] ** 2 / length[family]).sum()


def hyperelastic_stress(stretch):
    """The same of eq. 74."""
    return published_stress(POLYUREA, (), np.array([0.0, 1.0]), np.array([1.0, stretch]))[-1]


def test_the_equations_put_the_elastic_sheet_above_the_hyperelastic_one_at_a_stretch_of_1_5():
    """VE figure 7 has it 0.31 MPa below, and 9.12 MPa below at 4; no common factor of eq. 78 turns a sign."""
    moderate, large = (hyperelastic_stress(s) - elastic_stress(s) for s in (1.5, 4.0))
    assert moderate < -0.5e6
    # With the continuum's plane stress E / (1 - nu) instead of eq. 79 the sign is the same at 1.5.
    assert hyperelastic_stress(1.5) - YOUNG / (1.0 - POISSON) * 0.5 < -0.3e6
    assert large < 0.3 * 9.12e6


@pytest.mark.parametrize(("stretch", "printed", "factor"), [(1.25, 0.24e5, 2.3), (2.5, 1.20e6, 8.1)])
def test_the_viscous_part_of_the_equations_is_too_small_for_figure_19(stretch, printed, factor):
    """Whatever its sign and however fast it relaxes: it is largest where nothing has relaxed yet."""
    path, time = np.linspace(1.0, stretch, 200), np.linspace(0.0, 1e-9, 200)
    unrelaxed = Prony(c10=TERM.c10, c20=TERM.c20, time=1e9)
    viscous = [
        published_stress(POLYUREA, (term,), times, path)[-1] - hyperelastic_stress(stretch)
        for term, times in ((unrelaxed, time), (TERM, np.linspace(0.0, (stretch - 1.0) / 0.15, 200)))
    ]
    assert 0.0 < viscous[1] < viscous[0]
    assert printed > factor * viscous[0]


def test_the_prony_term_carries_nothing_at_the_rates_of_the_running_cracks():
    """It relaxes in 0.2 ms or less, the sheets tear after 20 ms: figures 14 and 24 differ by their rates alone."""
    path = np.linspace(1.0, 5.0, 4000)
    for rate in (159.4, 205.0):
        whole = published_stress(POLYUREA, (TERM,), np.linspace(0.0, 4.0 / rate, 4000), path)[-1]
        assert 0.0 < whole - hyperelastic_stress(5.0) < 1e-3 * whole


def test_the_hole_on_a_circle_grows_as_in_finite_elements():
    result = build_scene("visco_hole", {"points": 31, "horizon": 2.015, "stretch": 2.0, "load_steps": 3}).run(
        device="cpu"
    )
    growth = result.summary["measures"]["hole_growth"]
    exact = 1.0 + ELEMENTS["hole"]["2"]["opening_x"]["value"] / 0.08
    assert growth["reference"] == pytest.approx(exact, rel=1e-5)
    assert abs(growth["error"]) < 5e-3
    assert abs(result.summary["measures"]["squareness"]["value"]) < 2e-3


def test_the_scenes_compare_with_the_stored_elements():
    for stretch, found in ELEMENTS["hole"].items():
        if float(stretch) > 1.0:
            built = build_scene("visco_hole", {"points": 17, "stretch": float(stretch)})
            known = {measure.name: measure.reference for measure in built.measures}
            assert known["hole_growth"] == pytest.approx(1.0 + found["opening_x"]["value"] / 0.08, rel=1e-4)
            assert known["nominal_stress"] == pytest.approx(found["force_x"]["value"] / (0.5 * 0.01), rel=1e-4)
    for stretch, found in ELEMENTS["crack"].items():
        built = build_scene("visco_crack", {"points": 16, "stretch": float(stretch)})
        known = {measure.name: measure.reference for measure in built.measures}
        assert known["crack_opening"] == pytest.approx(2.0 * found["opening_x"]["value"], rel=1e-4)
        assert known["nominal_stress"] == pytest.approx(found["force_x"]["value"] / (0.5 * 0.01), rel=1e-4)


def torn(**settings):
    """The running crack of VE 6.3 by the stress-free law."""
    return build_scene("visco_crack", {"points": 12, "horizon": 2.015, "failure": True, **settings}).run(device="cpu")


def test_a_torn_sheet_that_wrinkles_runs_to_its_end():
    """The compressive branch is what ends runs of the full energy: without it the same steps keep the energy."""
    result = torn(safety=0.05)
    assert result.status == "finished"
    assert max(abs(row["balance_error"]) for row in result.history) < 1e-3
    assert result.history[-1]["crack_length"] > 0.3


def test_a_ramp_relaxes_by_the_rate_of_the_right_cauchy_green_tensor():
    """VE eqs. 31 to 33 and 61: gamma' = stretch' - gamma / theta, with C of an incompressible bar at that stretch."""
    rate, term, times = 0.8, Prony(c10=1e3, time=0.5, exponent=1.6), np.linspace(0.0, 2.0, 4001)
    path = 1.0 + rate * times
    squares = np.stack([path**2, 1.0 / path, 1.0 / path])
    speed = np.linalg.norm(np.diff(squares, axis=1), axis=0) / np.diff(times)
    gamma = 0.0
    for dt, relaxation in zip(np.diff(times), term.time * speed**-term.exponent, strict=True):
        gamma = (gamma * (1.0 - 0.5 * dt / relaxation) + rate * dt) / (1.0 + 0.5 * dt / relaxation)
    viscous = published_stress(POLYUREA, (term,), times, path) - published_stress(POLYUREA, (), times, path)
    assert viscous[-1] == pytest.approx(2.0 * term.c10 * gamma, rel=1e-4)
