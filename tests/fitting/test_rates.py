"""Constants of Prony terms and Maxwell elements from uniform tests at several rates."""

from pathlib import Path

import numpy as np
import pytest

from warp_pd import InputError, Maxwell, NeoHookean, Prony, Visco, Yeoh
from warp_pd.command.scene_files import build_scene, load_scene
from warp_pd.fitting import Curve, RateTests, fit, nominal_stress, rate_stress, read_table
from warp_pd.fitting.command import fit_scene
from warp_pd.fitting.rates import law_tests, read_ramps

DATA = Path(__file__).parents[1] / "references" / "vhb.csv"
# VE table 1 and the rates of its figure 2.
PRINTED = {"c10": 0.1438e6, "c20": 0.1438e6, "v10": 0.0587e6, "v20": 0.0562e6, "time": 0.8673, "exponent": 0.1}
RATES = (0.0, 0.24, 0.88)
STRETCH = np.linspace(0.95, 0.4, 12)
SECTION = 1e-5


def prony(c10, c20, v10, v20, time, exponent):
    return Visco(Yeoh(c10, c20), prony=[Prony(v10, v20, time, exponent)])


def maxwell(mu, m1, m2, m3):
    branches = [Maxwell(m, time) for m, time in zip((m1, m2, m3), (1.0, 10.0, 100.0), strict=True)]
    return Visco(NeoHookean(mu, 1e3 * mu), branches=branches)


def test_printed_constants_are_found_again_from_curves_at_their_rates():
    tests = [Curve("uniaxial", STRETCH, "stress", rate_stress(prony(**PRINTED), "uniaxial", r, STRETCH)) for r in RATES]
    start = {"c10": 1e5, "c20": 1e5, "v10": 1e5, "v20": 1e4, "time": 1.0, "exponent": 0.3}
    found = fit(RateTests(prony, tests, rates=RATES), list(PRINTED), start=start)
    assert found.estimates == pytest.approx(PRINTED, rel=1e-6)


@pytest.mark.parametrize("loading", ["uniaxial", "equibiaxial", "planar"])
def test_a_fast_branch_is_a_spring_and_a_slow_one_nothing(loading):
    law = Visco(NeoHookean(1e5, 1e9), branches=[Maxwell(5e4, 2.0)])
    stretch = np.linspace(1.1, 2.0, 5)
    network = nominal_stress(law.material, loading, stretch)
    assert rate_stress(law, loading, 1e6, stretch) == pytest.approx(1.5 * network, rel=1e-3)
    assert rate_stress(law, loading, 1e-6, stretch) == pytest.approx(network, rel=1e-3)
    assert rate_stress(law, loading, 0.0, stretch) == pytest.approx(network)


def test_moduli_from_two_rates_foretell_a_third():
    """Strips of an acrylic; two runs of one test differ by 3 to 7 %."""
    columns = read_table(DATA).columns
    stretch = columns["stretch"][np.isfinite(columns["stretch"])]
    curves = {
        name: Curve("uniaxial", stretch, "stress", columns[name][: len(stretch)] / SECTION)
        for name in ("slow", "middle", "fast")
    }
    tests = RateTests(maxwell, [curves["slow"], curves["fast"]], rates=(0.01, 0.05))
    moduli = ["mu", "m1", "m2", "m3"]
    found = fit(tests, moduli, start=dict.fromkeys(moduli, 2e4), bounds=dict.fromkeys(moduli, (1.0, np.inf)))
    foretold = rate_stress(maxwell(**found.estimates), "uniaxial", 0.03, stretch)
    assert np.median(np.abs(foretold / curves["middle"].values - 1.0)) < 0.05


def test_wrong_rates_and_ramps_are_refused():
    curve = Curve("uniaxial", STRETCH, "stress", STRETCH)
    with pytest.raises(InputError, match="rates: expected one for each of 1 tests, got 0"):
        RateTests(prony, [curve])
    with pytest.raises(InputError, match="rates = -1"):
        RateTests(prony, [curve], rates=(-1,))
    with pytest.raises(InputError, match="all above 1 or all below 1"):
        rate_stress(prony(**PRINTED), "uniaxial", 1.0, np.array([0.9, 1.1]))


def written(folder, name, text):
    (folder / name).write_text(text)
    return folder / name


def test_the_command_finds_the_constants_of_a_scene_from_curves_at_two_rates(tmp_path, monkeypatch):
    """True stress in one file with both rates, nominal stress of the relaxed rubber in another."""
    monkeypatch.chdir(tmp_path)
    true = {"c10": 2e5, "c20": 0.0, "maxwell_1": 1e5, "time_1": 2.0}
    law, stretch = build_scene("rate_test", {"stretch": 2.0, **true}).force, np.linspace(1.1, 2.0, 7)
    relaxed = "".join(f"{s}, {p}\n" for s, p in zip(stretch, rate_stress(law, "uniaxial", 0.0, stretch), strict=True))
    rows = [
        f"{r}, {s}, {s * p / 1e3}\n"
        for r in (0.1, 1.0)
        for s, p in zip(stretch, rate_stress(law, "uniaxial", r, stretch), strict=True)
    ]
    files = [
        written(tmp_path, "relaxed.csv", f"uniaxial [1], stress [Pa]\n{relaxed}"),
        written(tmp_path, "rates.csv", f"rate [1/s], uniaxial [-], true stress [kPa]\n{''.join(rows)}"),
    ]
    lines = list(fit_scene(
        "rate_test", files, {"c10": "1e5", "c20": "0", "maxwell_1": "5e4", "time_1": "1"}, vary="c10,maxwell_1,time_1",
        measure=None, bounds=(), loss="linear", device="cpu", precision=None, out="fitted",
    ))  # fmt: skip
    assert lines[0] == "relaxed.csv: no column rate [1/s]: taken as a test in which everything has relaxed"
    found = dict(part.split("=") for part in lines[-1].split(" --set ")[1:])
    assert {name: float(found[name]) for name in ("c10", "maxwell_1", "time_1")} == pytest.approx(
        {name: true[name] for name in ("c10", "maxwell_1", "time_1")}, rel=1e-5
    )


@pytest.mark.parametrize(("text", "said"), [
    ("uniaxial [1], planar [1], stress [Pa]\n2, 2, 1e5", "columns uniaxial, planar: expected one of them"),
    ("uniaxial [1], force [N]\n2, 3", "expected one of stress beside 'uniaxial'"),
    ("uniaxial [mm], stress [Pa]\n2, 1e5", "column 'uniaxial' is a length: expected a ratio"),
    ("uniaxial [1], stress [Pa], rate [mm/s]\n2, 1e5, 1", "column 'rate' is a velocity: expected a rate"),
    ("uniaxial [1], stress [Pa], rate [1/s]\n2, 1e5, -1", "rate = -1.0: expected 0 or a positive number"),
    ("uniaxial [1], stress [Pa], rate [1/s]\n2, 1e5,", "expected rows with both uniaxial and stress"),
    ("uniaxial [1], stress [Pa], rate [1/s]\n0.1, 1e5, 1", "expected positive stretches, got 0.1"),
    ("uniaxial [%], stress [Pa]\n150, 1e5", "in [%] may be strains or stretches: expected 'uniaxial strain' or"),
    ("planar [mm/mm], stress [Pa]\n1.5, 1e5", "in [mm/mm] may be strains or stretches: expected 'planar strain' or"),
    ("planar strain [1], stress [Pa]\n150, 1e5", "write the unit [%] for percents"),
    ("uniaxial [1], stress [Pa], rate [1/s]\n0.9, -1e5, 1\n1.1, 1e5, 1", "expected all above 1 or all below 1"),
    ("uniaxial [1], stress [Pa], rate [1/s]\n1.5, 2e5, 1\n1.2, 1e5, 1", "without unloading"),
])  # fmt: skip
def test_files_of_no_uniform_ramp_are_refused_in_a_line(tmp_path, text, said):
    with pytest.raises(InputError) as refused:
        read_ramps(read_table(written(tmp_path, "test.csv", text + "\n")), None)
    assert said in str(refused.value) and "test.csv" in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(("rates", "constants", "said"), [
    ((0.0, 0.24), PRINTED, "cannot tell how a relaxation time depends on it"),
    ((0.0, 0.24), {"time": 0.8673}, ""),
    ((0.0, 0.0), PRINTED, "nothing tells what relaxes"),
    ((0.0, 0.0), {"c10": 0.1438e6}, ""),
    ((0.24, 0.88), PRINTED, ""),
])  # fmt: skip
def test_too_few_rates_for_the_terms_are_noted(rates, constants, said):
    curves = [Curve("uniaxial", STRETCH, "stress", STRETCH)] * 2
    notes = RateTests(prony, curves, {**PRINTED}, rates=rates)._untold(constants)
    assert [said in note for note in notes] == [True] * bool(said)


def test_an_element_of_no_modulus_may_vary():
    law = build_scene("rate_test", {"maxwell_1": 1e5}).force
    curve = Curve("uniaxial", STRETCH, "stress", rate_stress(law, "uniaxial", 0.1, STRETCH))
    tests = law_tests(load_scene("rate_test").build, [(curve, 0.1)], {"maxwell_1": 1e5})
    assert tests._untold({"maxwell_2": 0.0}) == []
    with pytest.raises(InputError, match="force = ViscoBondBased: expected BondAssociated or Visco"):
        law_tests(load_scene("visco_sheet").build, [(curve, 0.1)], {"law": "published"})._untold({})


def test_more_times_than_rates_are_noted_and_fixed_times_are_not():
    def rubber(mu, m1, t1, m2, t2):
        return Visco(NeoHookean(mu, 1e9), branches=[Maxwell(m1, t1), Maxwell(m2, t2)])

    constants = {"mu": 1e5, "m1": 1e5, "t1": 1.0, "m2": 1e5, "t2": 10.0}
    tests = RateTests(rubber, [Curve("uniaxial", STRETCH, "stress", STRETCH)], constants, rates=(1.0,))
    assert tests._untold(constants) == [
        "rates: 1 above 0 for 2 relaxation times that vary: the shape of curves alone tells them apart; expected as "
        "many rates as times"
    ]
    assert tests._untold({name: constants[name] for name in ("mu", "m1", "m2", "t1")}) == []


@pytest.mark.parametrize(
    ("header", "rows"),
    [
        ("uniaxial [1]", (1.25, 2.5, 3.5)),
        ("uniaxial stretch [m/m]", (1.25, 2.5, 3.5)),
        ("Uniaxial strain [-]", (0.25, 1.5, 2.5)),
        ("uniaxial strain [%]", (25.0, 150.0, 250.0)),
    ],
)
def test_a_column_says_whether_it_has_strains_or_stretches(tmp_path, header, rows):
    text = "".join(f"{row}, {stretch}\n" for row, stretch in zip(rows, (1.25, 2.5, 3.5), strict=True))
    table = read_table(written(tmp_path, "test.csv", f"{header}, true stress [Pa]\n{text}"))
    ((curve, _),), _ = read_ramps(table, None)
    np.testing.assert_allclose(curve.at, (1.25, 2.5, 3.5), rtol=1e-14)
    np.testing.assert_allclose(curve.values, 1.0, rtol=1e-14)
