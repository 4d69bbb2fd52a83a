"""Fits find what made the data, say how sure they are, and what the data cannot tell."""

from pathlib import Path

import fitting_cases as cases
import numpy as np
import pytest
from helpers import refused
from scipy.optimize import brentq

from warp_pd import Explicit, Gent, MooneyRivlin, NeoHookean, Ogden, Yeoh
from warp_pd.fitting import (
    Curve,
    FieldData,
    PointField,
    SceneTests,
    TearingFit,
    UniformTests,
    fit,
    nominal_stress,
    read_table,
)
from warp_pd.fitting.equilibrium import Equilibrium

TRUTH = {"mu": 0.4e6, "lock": 20.0}
PRESSURES = np.linspace(6e3, 36e3, 6)


def simulated(build, control, at, measure, settings):
    """What a scene shows at values of an argument, each from a run of its own."""
    rows = [build(**{**settings, control: float(value)}).run(device="cpu").history[-1] for value in at]
    return np.array([row[measure] for row in rows])


@pytest.fixture(scope="module")
def heights():
    return simulated(cases.blown, "pressure", PRESSURES, "height", {**TRUTH, "prestretch": 1.05, "points": 7})


def bulge(values, **settings):
    return SceneTests(
        cases.blown,
        [Curve("pressure", PRESSURES, "height", values, name="bulge")],
        {"prestretch": 1.05, "points": 7, **settings},
    )


def test_exact_data_give_the_constants_that_made_them(heights):
    found = fit(bulge(heights), ["mu", "lock"], start={"mu": 0.6e6, "lock": 12.0}, device="cpu")
    assert found.estimates == pytest.approx(TRUTH, rel=1e-5)
    assert found.converged
    assert found.judgement.deviation < 1e-6
    row = found.simulation(pressure=float(PRESSURES[-1])).run(device="cpu").history[-1]
    assert row["height"] == pytest.approx(heights[-1], rel=1e-5)


def test_standard_errors_are_those_of_the_linear_theory(heights):
    rng = np.random.default_rng(3)
    noisy = heights + 0.01 * heights.max() * rng.normal(size=heights.shape)
    found = fit(bulge(noisy), ["mu", "lock"], start=TRUTH, device="cpu")
    errors = found.judgement.errors
    assert (np.abs(found.values - list(TRUTH.values())) < 3.0 * errors).all()
    # The cost rises by one variance where one constant leaves by its error and the other follows it best.
    shifted = fit(bulge(noisy, lock=found.estimates["lock"] + errors[1]), ["mu"], start=TRUTH, device="cpu")
    costs = [sum((r**2).sum() for r in f.residuals) for f in (found, shifted)]
    assert costs[1] - costs[0] == pytest.approx(found.judgement.deviation**2, rel=0.2)


def test_constants_that_only_scale_each_other_are_named(heights):
    start = {"mu": 0.5e6, "thickness": 1.05e-3}
    found = fit(bulge(heights, lock=20.0), ["mu", "thickness"], start=start, device="cpu")
    # What the data tell is the product; the rest stays where it began.
    assert found.values.prod() == pytest.approx(0.4e6 * 1e-3, rel=1e-4)
    assert not np.isfinite(found.judgement.errors).any()
    assert any("cannot tell mu from thickness" in line for line in found.judgement.words)
    assert "cannot tell mu from thickness" in found.table()


def test_outliers_are_named_and_do_not_move_a_robust_fit():
    rng = np.random.default_rng(5)
    stretch, truth = np.linspace(1.1, 3.0, 20), np.array([0.2e6, 0.03e6])
    stress = nominal_stress(MooneyRivlin(*truth), "uniaxial", stretch)
    spoiled = stress + 2e-3 * stress.max() * rng.normal(size=stress.shape)
    spoiled[[3, 12]] *= (1.5, 0.7)
    tests = UniformTests(MooneyRivlin, [Curve("uniaxial", stretch, "stress", spoiled, name="pulled")])
    start = {"c10": 0.1e6, "c01": 0.05e6}
    plain, robust = (fit(tests, ["c10", "c01"], start=start, loss=kind) for kind in ("linear", "soft_l1"))
    off = [np.abs(found.values / truth - 1.0).max() for found in (plain, robust)]
    assert off[1] < 0.1 * off[0]
    assert (np.abs(robust.values - truth) < 3.0 * robust.judgement.errors).all()
    assert [line.split(":")[0] for line in robust.outliers()] == ["pulled, row 4", "pulled, row 13"]
    assert "an outlier?" in robust.table()


def test_the_deviation_of_a_robust_fit_has_the_weights_that_balance_its_residuals():
    """At the best value the derivative of the loss vanishes; that of soft_l1 by z^2 is (1 + z^2)^(-1/2)."""
    stretch = np.linspace(1.1, 3.0, 20)
    stress = nominal_stress(MooneyRivlin(0.2e6), "uniaxial", stretch)
    spoiled = stress * (1.0 + 0.01 * np.random.default_rng(5).normal(size=stress.shape))
    spoiled[[3, 12, 18]] *= (1.5, 1.4, 1.3)
    tests = UniformTests(MooneyRivlin, [Curve("uniaxial", stretch, "stress", spoiled)], {"c01": 0.0})
    found = fit(tests, ["c10"], start={"c10": 0.1e6}, loss="soft_l1")
    (residuals,), (model,) = found.residuals, found.model

    def weights(margin):
        return 1.0 / np.sqrt(1.0 + (residuals / margin) ** 2)

    size = np.abs(residuals).max()
    margin = brentq(lambda m: (weights(m) * residuals * model).sum(), 1e-4 * size, 10.0 * size)
    w = weights(margin)
    assert w.min() < 0.2 and w.max() > 0.9
    deviation = np.sqrt((w * residuals**2).sum() / (w.sum() - 1.0))
    assert found.judgement.deviation == pytest.approx(deviation, rel=1e-3)


def test_states_share_a_scene_where_the_control_is_proportional_to_its_loads():
    pressed = SceneTests(cases.blown, [Curve("pressure", [1e3, 2e3, 4e3], "height", np.ones(3))], {"points": 7})
    pulled = SceneTests(strip, [Curve("stretch", [1.1, 1.4], "force", np.ones(2))])
    gas = SceneTests(cases.blown, [Curve("gas", [1e3, 4e3], "height", np.ones(2))], {"points": 7})
    timed = SceneTests(cases.blown, [Curve("time", [0.5, 2.0], "height", np.ones(2))], {"points": 7, "duration": 2.0})
    expected = {
        pressed: ([{"pressure": 4e3}] * 3, [0.25, 0.5, 1.0]),
        pulled: ([{"stretch": 1.4}] * 2, [0.25, 1.0]),
        gas: ([{"gas": 1e3}, {"gas": 4e3}], [1.0, 1.0]),
        timed: ([{}, {}], [0.25, 1.0]),
    }
    for tests, (settings, factors) in expected.items():
        name = "mu1" if tests is pulled else "mu"
        places = tests.model([name], np.array([0.4e6]), "cpu", None).places
        assert [place.settings for place in places] == settings
        assert [place.factor for place in places] == pytest.approx(factors)


def test_trials_that_the_material_refuses_are_left_out_and_named():
    """The stress falls with c10, and the first step of the search goes below zero."""
    stretch = np.linspace(1.2, 3.0, 8)
    stress = nominal_stress(MooneyRivlin(1e3), "uniaxial", stretch)

    def exponential(size=4.0):
        return MooneyRivlin(1e6 * np.log(max(size, 1e-3)))

    tests = UniformTests(exponential, [Curve("uniaxial", stretch, "stress", stress)])
    found = fit(tests, ["size"], start={"size": 4.0}, device="cpu")
    assert found.estimates["size"] == pytest.approx(np.exp(1e-3), rel=1e-4)
    assert any("trials without a result" in note and "c10" in note for note in found.notes)


def test_three_terms_of_ogden_are_fitted_by_their_moduli_and_exponents():
    stretch = np.linspace(1.1, 7.0, 30)
    rubber = Ogden((0.63e6, 0.0012e6, -0.01e6), (1.3, 5.0, -2.0))
    curves = [
        Curve(loading, stretch, "stress", nominal_stress(rubber, loading, stretch), name=loading)
        for loading in ("uniaxial", "planar", "equibiaxial")
    ]
    start = {"mu_1": 0.5e6, "alpha_1": 1.6, "mu_2": 2e3, "alpha_2": 4.6, "mu_3": -2e4, "alpha_3": -1.6}
    found = fit(UniformTests(Ogden.of, curves), list(start), start=start, max_evaluations=200)
    truth = (0.63e6, 1.3, 0.0012e6, 5.0, -0.01e6, -2.0)
    assert list(found.values) == pytest.approx(truth, rel=1e-3)


def test_a_wrong_unit_is_noticed(heights):
    found = fit(bulge(1e3 * heights), ["mu"], device="cpu", max_evaluations=2)
    assert any("check the unit" in note for note in found.notes)


def test_stresses_in_megapascals_are_noticed_where_the_start_is_too():
    stretch = np.linspace(1.1, 3.0, 9)
    megapascals = Curve("uniaxial", stretch, "stress", nominal_stress(MooneyRivlin(0.2, 0.0), "uniaxial", stretch))
    found = fit(UniformTests(MooneyRivlin, [megapascals]), ["c10"], start={"c10": 0.1})
    assert any("stresses up to 1.16 Pa: check the unit, expected pascals" in note for note in found.notes), found.notes


def test_wrong_arguments_are_refused(heights):
    for vary, more, said in (
        (["nu"], {}, "vary = 'nu'"),
        (["pressure"], {}, "the test 'bulge' controls it"),
        (["mu", "mu"], {}, "each once"),
        (["mu"], {"bounds": {"lock": (1.0, 2.0)}}, "bounds of 'lock'"),
        (["mu"], {"bounds": {"mu": (1.0, 2.0)}}, "expected an initial value inside its bounds"),
        (["mu"], {"loss": "huber"}, "loss = 'huber'"),
    ):
        with refused(match=said):
            fit(bulge(heights), vary, device="cpu", **more)
    few = SceneTests(cases.blown, [Curve("pressure", PRESSURES[:1], "height", heights[:1])])
    with refused(match="expected more numbers than the 2 constants"):
        fit(few, ["mu", "lock"], device="cpu")


def strip(mu1=0.5e6, a1=1.6, stretch=1.4):
    return cases.ogden_strip(mu1=mu1, a1=a1, mu2=1e3, stretch=stretch)


def test_a_picture_and_a_force_tell_both_constants():
    state = Equilibrium(strip(), "cpu")
    state.reach(1.0)
    rng = np.random.default_rng(0)
    places = rng.uniform([0.0, 0.0], [0.1, 0.05], size=(60, 2))
    shown = PointField.at(state.built.context.sheet, places).values(state.frame())
    shown[:, 2] = np.nan
    force = simulated(strip, "stretch", [1.2, 1.4], "force", {})
    picture = FieldData(places, shown, "stretch", 1.4, name="picture")
    pull = Curve("stretch", np.array([1.2, 1.4]), "force", force, name="pull")
    start = {"mu1": 0.4e6, "a1": 2.2}
    found = fit(SceneTests(strip, [picture, pull]), ["mu1", "a1"], start=start, device="cpu")
    assert found.estimates == pytest.approx({"mu1": 0.5e6, "a1": 1.6}, rel=1e-4)
    assert found.model[0] == pytest.approx(np.where(np.isnan(shown), 0.0, shown), abs=1e-7)


def test_places_of_a_field_are_exact_for_linear_displacements():
    state = Equilibrium(strip(), "cpu")
    frame = state.frame()
    sheet = state.built.context.sheet
    places = np.array([[0.013, 0.021], [0.1, 0.05], [0.0, 0.033]])
    linear = sheet.positions @ np.array([[0.1, 0.0, 0.2], [0.3, -0.1, 0.0], [0.0, 0.0, 0.0]])
    moved = type(frame)(1, 1.0, linear, frame.velocity)
    shown = PointField.at(sheet, places).values(moved)
    assert shown == pytest.approx(places @ np.array([[0.1, 0.0, 0.2], [0.3, -0.1, 0.0]]), abs=1e-15)
    with refused(match="places: none of .* is on the sheet"):
        PointField.at(sheet, np.array([[1.0, 1.0]]))


def test_uniform_stress_is_that_of_the_closed_forms():
    stretch = np.array([1.05, 1.5, 3.0])
    c10, c01 = 0.2e6, 0.05e6
    third = {"uniaxial": stretch**-0.5, "planar": np.ones(3), "equibiaxial": stretch}
    powers = {"uniaxial": (-2.0, -3.0), "planar": (-3.0, -3.0), "equibiaxial": (-5.0, -5.0)}
    for loading, width in third.items():
        a, _ = powers[loading]
        closed = 2.0 * (stretch - stretch**a) * (c10 + c01 * (width**2 if loading != "uniaxial" else 1.0 / stretch))
        assert nominal_stress(MooneyRivlin(c10, c01), loading, stretch) == pytest.approx(closed, rel=1e-8)
    for material in (NeoHookean(1e5, 1e9), Gent(1e5, 1e9, 1e9)):
        stress = nominal_stress(material, "uniaxial", stretch)
        assert stress == pytest.approx(1e5 * (stretch - stretch**-2.0), rel=2e-3)


def test_curves_of_a_data_sheet_and_a_scene_are_fitted_at_once(heights):
    stretch = np.linspace(1.2, 3.0, 6)
    curve = Curve("uniaxial", stretch, "stress", nominal_stress(Gent(0.4e6, 20e6, 20.0), "uniaxial", stretch))

    def rubber(mu=0.5e6, lock=15.0):
        return Gent(mu, 50.0 * mu, lock)

    sheet = UniformTests(rubber, [curve], {"mu": 0.5e6, "lock": 15.0})
    found = fit([bulge(heights), sheet], ["mu", "lock"], device="cpu")
    assert found.estimates == pytest.approx(TRUTH, rel=1e-5)
    assert len(found.residuals) == 2


def test_a_run_in_time_is_fitted_by_differences_over_runs():
    def shaken(mu=0.4e6):
        scene = cases.blown(mu=mu, pressure=2e3, points=7)
        scene.solver = Explicit(2e-3, frames=20, precision=64)
        return scene

    history = shaken(mu=0.4e6).run(device="cpu").history
    at = np.linspace(2e-4, 1e-3, 8)
    heard = np.interp(at, [row["time"] for row in history], [row["height"] for row in history])
    curve = Curve("time", at, "height", heard, name="shaken")
    found = fit(SceneTests(shaken, [curve]), ["mu"], start={"mu": 0.45e6}, device="cpu")
    assert found.estimates["mu"] == pytest.approx(0.4e6, rel=1e-4)
    with refused(match="expected at most"):
        late = Curve("time", at * 10.0, "height", heard)
        fit(SceneTests(shaken, [late]), ["mu"], device="cpu").table()


def test_results_are_saved(tmp_path, heights):
    found = fit(bulge(heights, lock=20.0), ["mu"], device="cpu")
    folder = found.save(tmp_path / "fit", "warp-pd run own")
    assert sorted(path.name for path in folder.iterdir()) == ["fit.json", "fit.png", "test-1.csv"]
    table = np.loadtxt(folder / "test-1.csv", delimiter=",", skiprows=1)
    assert table[:, 1] == pytest.approx(heights)
    assert table[:, 2] == pytest.approx(heights, rel=1e-5)


def test_a_constant_without_a_default_that_nothing_gives_is_named():
    curve = Curve("uniaxial", np.linspace(1.1, 2.0, 5), "stress", np.ones(5))
    with refused(match=r"^bulk has no default: expected a value in settings"):
        fit(UniformTests(Gent, [curve], {"lock": 20.0}), ["mu"], start={"mu": 1e5})

    def scene(mu, pressure, points=7):
        raise AssertionError("it must not be built")

    with refused(match=r"^pressure has no default: expected a value in settings"):
        fit(SceneTests(scene, [curve]), ["mu"], start={"mu": 1e5})


def test_stretches_that_are_not_positive_are_refused():
    curve = Curve("uniaxial", [-1.1, 2.0], "stress", [1e5, 2e5], name="pulled")
    with refused(match=r"pulled: expected positive stretches, got -1\.1"):
        fit(UniformTests(MooneyRivlin, [curve]), ["c10"], start={"c10": 1e5})


@pytest.mark.parametrize("start", [(1e5, 0.0, 0.0), (1e5, 1.0, -1.0), (0.2, -0.01, 0.001), (1e7, 1e6, 1e6)])
def test_a_linear_fit_finds_its_constants_from_any_start(start):
    """Also from zero, from megapascals, and from values a hundred times as large."""
    stretch, truth = np.linspace(1.1, 4.0, 12), (4e5, -6e4, 8e3)
    stress = nominal_stress(Yeoh(*truth), "uniaxial", stretch)
    names = ["c10", "c20", "c30"]
    tests = UniformTests(Yeoh, [Curve("uniaxial", stretch, "stress", stress)])
    found = fit(tests, names, start=dict(zip(names, start, strict=True)))
    np.testing.assert_allclose(found.values, truth, rtol=1e-7)
    assert found.converged and np.all(found.judgement.errors < 1e-6 * np.abs(truth))


def test_errors_do_not_depend_on_the_start():
    """Noise of 1 % in data of neo-Hookean rubber: c01 is zero within its standard error, and not undetermined."""
    stretch = np.linspace(1.1, 2.4, 10)
    noise = 1.0 + 0.01 * np.random.default_rng(0).normal(size=10)
    stress = nominal_stress(MooneyRivlin(1e5), "equibiaxial", stretch) * noise
    tests = UniformTests(MooneyRivlin, [Curve("equibiaxial", stretch, "stress", stress)])
    one, other = (fit(tests, ["c10", "c01"], start={"c10": c10, "c01": c01}) for c10, c01 in ((5e4, 0.0), (1e6, 3e5)))
    np.testing.assert_allclose(one.values, other.values, rtol=1e-6)
    np.testing.assert_allclose(one.judgement.errors, other.judgement.errors, rtol=1e-4)
    assert abs(one.values[1]) < 3.0 * one.judgement.errors[1] < 1e4


def test_a_constant_that_nothing_depends_on_stays_and_is_named():
    def material(c10, spare):
        return MooneyRivlin(c10)

    stretch = np.linspace(1.1, 2.4, 10)
    stress = nominal_stress(MooneyRivlin(1e5), "planar", stretch)
    tests = UniformTests(material, [Curve("planar", stretch, "stress", stress)])
    found = fit(tests, ["c10", "spare"], start={"c10": 2.0, "spare": 7.0})
    np.testing.assert_allclose(found.values, (1e5, 7.0), rtol=1e-7)
    assert found.judgement.words == ["the data do not determine spare"] and np.isinf(found.judgement.errors[1])


def test_a_scene_that_tears_late_has_a_positive_error():
    assert TearingFit(energy=1e3, load=10.0, check=11.0, released=9e2, runs=2).error == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("at", "sign", "rows"),
    [(-1.0, 1.0, 2), (0.0, -1.0, 5), (0.0, 1.0, 0)],
    ids=["strains", "push counts above 0", "right"],
)
def test_stresses_of_the_wrong_sign_are_noted(at, sign, rows):
    """Large strains pass for stretches, but no rubber pulls when it is compressed."""
    stretch = np.array([1.5, 1.8, 2.2, 2.6, 3.0])
    stress = sign * nominal_stress(MooneyRivlin(2e5), "uniaxial", stretch)
    tests = UniformTests(MooneyRivlin, [Curve("uniaxial", stretch + at, "stress", stress, name="sheet")])
    noted = [note for note in tests.notes({"c10": 2e5}) if note.startswith("sheet: a stress of")]
    assert len(noted) == bool(rows)
    assert all(f"({rows} such rows)" in note and "add 1 to strains" in note for note in noted)


@pytest.mark.parametrize(
    ("at", "noted"),
    [(np.linspace(2.2, 4.0, 6), True), (np.linspace(2.0, 3.0, 6), True), (np.linspace(1.1, 3.0, 6), False)],
    ids=["from a strain of 1.2", "from a strain of 1", "stretches"],
)
def test_strains_above_1_are_noted(at, noted):
    """Their signs are right, but the first rows do not lead back to no stress at 1, or there is a stress at 1."""
    stress = nominal_stress(MooneyRivlin(2e5), "uniaxial", at)
    tests = UniformTests(MooneyRivlin, [Curve("uniaxial", at - noted, "stress", stress, name="sheet")])
    notes = [note for note in tests.notes({"c10": 2e5}) if note.startswith("sheet: ")]
    assert len(notes) == noted
    assert all("add 1 to strains" in note for note in notes)


@pytest.mark.parametrize("name", ["james", "kawabata", "kawamura", "meunier", "treloar"])
def test_published_stretches_are_not_taken_for_strains(name):
    rows = read_table(Path(__file__).parents[1] / "references" / f"{name}.csv")
    curves = []
    for loading in ("uniaxial", "planar", "equibiaxial"):
        names = [f"{loading}_stretch", f"{loading}_stress"]
        if names[0] in rows.columns:
            at, stress = rows.without_gaps(names)[0].values()
            curves.append(Curve(loading, at, "stress", stress))
    assert curves and not UniformTests(MooneyRivlin, curves).wrong_signs()
