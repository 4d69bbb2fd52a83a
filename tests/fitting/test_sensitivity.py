"""Derivatives at equilibrium against central differences over equilibria."""

import fitting_cases as cases
import pytest
from helpers import refused

from warp_pd import Explicit, Relaxation
from warp_pd.fitting import sensitivity
from warp_pd.fitting.derivatives import with_defaults
from warp_pd.fitting.equilibrium import Equilibrium

STRIP = {"stretch": 1.3, "thickness": 1e-3}
# Build, settings, constants, measures: edges, follower pressure on clamped and free edges, prestretch, enclosed gas,
# dead loads, incompressible materials.
CASES = {
    "strip of Ogden's rubber": (cases.ogden_strip, STRIP, "mu1 a1 mu2 a2 thickness stretch", "force narrowing"),
    "holed strip of Yeoh's rubber": (cases.yeoh_strip, {"hole": True, "points": 15}, "c10 c20 c30", "force narrowing"),
    "clamped sheet under pressure": (cases.blown, {}, "mu lock thickness pressure prestretch", "height pull"),
    "free edges under pressure": (
        cases.blown, {"free": True, "pressure": 3e3}, "mu lock thickness pressure prestretch",
        "height edge_height pull",
    ),
    "dead force on a free edge": (
        cases.blown, {"free": True, "pressure": 1e3, "push": 0.2}, "mu push prestretch", "height edge_height",
    ),
    "enclosed gas": (cases.blown, {"gas": 4e3}, "mu lock gas thickness", "height pull"),
    "incompressible and prestretched": (cases.mooney_disc, {}, "c10 c01 pressure prestretch", "height"),
}  # fmt: skip


def last_row(build, settings):
    result = build(**settings).run(device="cpu")
    assert result.status == "finished"
    return result.history[-1]


@pytest.mark.parametrize("name", CASES)
def test_derivatives_are_those_of_differences_by_both_methods(name):
    build, settings, vary, measures = CASES[name]
    vary, measures = vary.split(), measures.split()
    found = {
        method: sensitivity(build, vary, measures, settings, method=method, device="cpu")
        for method in ("adjoint", "direct")
    }
    given = with_defaults(build, vary, settings)
    for k, constant in enumerate(vary):
        # Fourth order, so that the differences are exact to 1e-8 or so.
        h = 1e-3 * abs(given[constant])
        rows = [last_row(build, {**given, constant: given[constant] + n * h}) for n in (1, -1, 2, -2)]
        for m, measure in enumerate(measures):
            a, b, c, d = (row[measure] for row in rows)
            difference = (8.0 * (a - b) - (c - d)) / (12.0 * h)
            for derivatives in found.values():
                # What does not depend on the constant has the round-off of the value.
                zero = 1e-9 * abs(derivatives.values[m] / given[constant])
                assert derivatives.jacobian[m, k] == pytest.approx(difference, rel=1e-6, abs=zero)


def test_any_measure_has_derivatives_by_the_direct_method():
    found = sensitivity(cases.ogden_strip, ["mu1", "stretch"], ["squared"], STRIP, device="cpu")
    assert found.method == "direct"
    for k, (name, size) in enumerate((("mu1", 0.5e6), ("stretch", 1.3))):
        h = 1e-4 * size
        a, b = (last_row(cases.ogden_strip, {**STRIP, name: size + s * h})["squared"] for s in (1.0, -1.0))
        assert found.jacobian[0, k] == pytest.approx((a - b) / (2.0 * h), rel=1e-5)


def test_the_adjoint_is_taken_where_it_needs_fewer_solves():
    vary = ["mu", "lock", "thickness"]
    assert sensitivity(cases.blown, vary, ["height"], device="cpu").method == "adjoint"
    assert sensitivity(cases.blown, vary[:1], ["height", "pull"], device="cpu").method == "direct"


def test_stiffness_and_pressure_scale_out():
    """Twice the moduli under twice the pressure is the same shape: mu dm/dmu + p dm/dp = 0 with K = 50 mu."""
    jacobian = sensitivity(cases.blown, ["mu", "pressure", "thickness"], ["height"], {"prestretch": 1.0}).jacobian[0]
    assert 0.4e6 * jacobian[0] == pytest.approx(-15e3 * jacobian[1], rel=1e-8)
    assert 1e-3 * jacobian[2] == pytest.approx(0.4e6 * jacobian[0], rel=1e-8)


def test_float32_has_the_derivatives_of_float64():
    settings = {"pressure": 15e3}
    exact = sensitivity(cases.blown, ["mu", "lock", "pressure"], ["height", "pull"], settings, method="direct")

    def single(**given):
        scene = cases.blown(**given)
        scene.solver = type(scene.solver)(precision=32)
        return scene

    rough = sensitivity(single, ["mu", "lock", "pressure"], ["height", "pull"], {
        **settings, "mu": 0.4e6, "lock": 20.0}, method="direct")  # fmt: skip
    assert rough.jacobian == pytest.approx(exact.jacobian, rel=5e-3)


@pytest.mark.parametrize("device", [pytest.param("cuda:0", marks=pytest.mark.gpu)], indirect=True)
def test_a_gpu_has_the_derivatives_of_a_cpu(device):
    vary, measures = ["mu", "lock", "pressure", "prestretch"], ["height", "pull"]
    for method in ("adjoint", "direct"):
        here = sensitivity(cases.blown, vary, measures, method=method, device=device)
        there = sensitivity(cases.blown, vary, measures, method=method, device="cpu")
        assert here.values == pytest.approx(there.values, rel=1e-9)
        assert here.jacobian == pytest.approx(there.jacobian, rel=1e-6)


def test_what_has_no_derivative_is_refused():
    def relaxed(mu=0.4e6):
        scene = cases.blown(mu=mu)
        scene.solver = Relaxation()
        return scene

    def moving(mu=0.4e6):
        scene = cases.blown(mu=mu)
        scene.solver = Explicit(0.1)
        return scene

    for build, name in ((relaxed, "Relaxation"), (moving, "Explicit")):
        with refused(match=f"solver = {name}: expected Newton"):
            sensitivity(build, ["mu"], ["height"])
    with refused(match="vary = 'nu': expected an argument of the scene"):
        sensitivity(cases.blown, ["nu"], ["height"])
    with refused(match="measure = 'width': expected a measure of the scene: height"):
        sensitivity(cases.blown, ["mu"], ["width"])
    with refused(match="free = False: expected a number"):
        sensitivity(cases.blown, ["free"], ["height"])
    with refused(match="method = 'adjoint': expected measures that are"):
        sensitivity(cases.ogden_strip, ["mu1"], ["squared"], method="adjoint")


def test_a_load_too_large_for_one_step_is_reached_in_several(monkeypatch):
    equilibrium = Equilibrium(cases.ogden_strip(**STRIP), "cpu", 64)
    settle, goals = equilibrium.search.equilibrate, []

    def only_near(goal, *rest):
        goals.append(goal)
        assert len(goals) < 10
        return abs(goal - equilibrium.factor) < 0.3 and settle(goal, *rest)

    monkeypatch.setattr(equilibrium.search, "equilibrate", only_near)
    equilibrium.reach(1.0)
    assert goals == [1.0, 0.5, 0.25, 0.5, 0.75, 1.0]
    expected = cases.ogden_strip(**STRIP).run(device="cpu", precision=64).frame.displacement
    assert equilibrium.displacement == pytest.approx(expected, abs=1e-6)
