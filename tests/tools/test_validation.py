"""The comparisons with others: page, numbers and README agree, and a row runs."""

from dataclasses import replace

import numpy as np
import pytest
from study import load_rows
from validation import __main__, bulges, comparison, crack_paths, cracks, page, printed, relaxation, spread

from warp_pd import BondAssociated, Fixed, Maxwell, Motion, NeoHookean, Newton, Sheet, Simulation
from warp_pd.fitting import nominal_stress
from warp_pd.geometry.couplings import distance_from_segments
from warp_pd.tearing.cut_profiles import damage_of_cuts
from warp_pd.visco.uniform import maxwell_stress


def test_order_is_that_of_a_converging_sequence():
    spacings = [0.4, 0.2, 0.1]
    assert comparison.order([[1.0 + h**2, 2.0 - h**2] for h in spacings], spacings) == pytest.approx(2.0)
    assert comparison.order([[1.0], [1.0], [2.0]], spacings) is None
    assert comparison.order([[1.0 + h] for h in spacings[:2]], spacings[:2]) is None


def test_the_page_and_the_readme_say_what_the_numbers_say():
    found = page.records()
    assert len(found) >= 10
    assert page.summary(found) in page.README.read_text()
    text = page.PAGE.read_text()
    for heading, lines in page.sections(found).items():
        assert "\n".join([heading, "", *lines]).rstrip() in text


def test_the_readme_counts_only_rows_with_a_deviation():
    found = page.records()
    known = page.compared(found)
    bounds = {name for name, row in page.ROWS.items() if not row.counts}
    assert bounds and not bounds & set(known)
    assert page.summary(found).startswith(f"Against {len(known)} published results")
    assert page.compared({name: found[name] for name in bounds}) == {}


def test_every_row_says_what_theirs_is_and_whether_it_was_blind():
    for row in page.ROWS.values():
        assert row.blind == "yes" or row.blind.startswith("no: ")
        assert row.kind.removesuffix(", a bound") in ("test", "computation", "formula", "law")
        assert row.counts != row.kind.endswith(", a bound")


def test_a_run_that_does_not_finish_gives_no_numbers():
    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1000.0, points=5)
    ends = sheet.edges("left"), sheet.edges("right")
    pull = [Fixed(ends[0]), Motion(ends[1], times=[0.0, 1.0], x=[0.0, 0.05], y=0.0, z=0.0)]
    stiff = Simulation(
        sheet, BondAssociated(NeoHookean(1e3, 1e5)), Newton(load_steps=1, most_iterations=1, most_cuts=0), loads=pull
    )
    with pytest.raises(comparison.UnfinishedError, match="a sheet: the run ended 'not converged'"):
        comparison.finished(stiff, "cpu", "a sheet")


def test_force_on_a_strip_is_the_slope_of_its_energy():
    strokes = np.linspace(0.0, 0.012, 7)
    weaker = None
    for notch in (2e-3, 6e-3):
        sheet, length = printed.notched(13, notch)
        assert length == pytest.approx(notch, abs=1.001e-3)
        force, energy = printed.pulled(sheet, strokes, "cpu", "strip", horizon=2.015)
        # Simpson's rule over pairs of steps.
        work = np.sum((force[:-2:2] + 4.0 * force[1:-1:2] + force[2::2]) * strokes[1]) / 3.0
        assert energy[-1] == pytest.approx(work, rel=1e-3)
        assert weaker is None or force[-1] < weaker
        weaker = force[-1]


def test_strips_that_give_constants_are_not_compared():
    rows = {make().name: make() for make in printed.ROWS}
    compared = {length for length, _ in (*printed.JUNE[1:], *printed.MARCH[1:])}
    assert not {printed.JUNE[0][0], printed.MARCH[0][0]} & compared
    assert len(rows["breaking"].at) == len(compared)
    strokes, forces = printed.measured("read", "holed")
    assert rows["holed"].at == pytest.approx(1e3 * strokes) and rows["holed"].theirs == pytest.approx(forces)


@pytest.mark.parametrize("degrees", [0.0, 35.0])
def test_a_loose_piece_has_a_length_and_a_width(degrees):
    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1000.0, points=301)
    angle = np.deg2rad(degrees)
    axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    place = np.abs((sheet.points[:, :2] - 0.05) @ axes)
    inside = (place[:, 0] < 0.0301) & (place[:, 1] < 0.0151)
    intact = np.flatnonzero(np.ptp(inside[sheet.triangles].astype(int), axis=1) == 0)
    along_x, own = crack_paths.aspects(sheet, intact)
    assert own == pytest.approx(2.0, rel=0.03)
    box = (2.0 * np.cos(angle) + np.sin(angle)) / (2.0 * np.sin(angle) + np.cos(angle))
    assert along_x == pytest.approx(box, rel=0.03)


def test_a_sheet_in_two_parts_has_no_loose_piece():
    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1000.0, points=11)
    above = sheet.points[:, 1] > 0.055
    intact = np.flatnonzero(np.ptp(above[sheet.triangles].astype(int), axis=1) == 0)
    assert np.isnan(crack_paths.aspects(sheet, intact)).all()


def test_a_crack_is_two_where_intact_faces_part_it():
    x, y = (grid.ravel() for grid in np.meshgrid(np.arange(0.5, 100.0), np.arange(0.5, 40.0)))
    lower, upper = np.abs(y - 20.0 + np.maximum(x - 60.0, 0.0)), np.abs(y - 20.0 - np.maximum(x - 60.0, 0.0))
    wide, fork = np.abs(y - 20.0) < 8.0, np.minimum(lower, upper) < 2.0
    faces = np.column_stack([x, y])
    assert cracks.doubled(faces[wide], 1.0, 4.0) == 0.0
    # Bands of 4 rows along y = 20 +- (x - 60), which leave the sheet at x = 82, are 4 rows apart from x = 64 on.
    reached = x < 80.0
    assert cracks.doubled(faces[fork & reached], 1.0, 4.0) == pytest.approx((80.0 - 64.0) / 80.0, abs=0.02)


def test_largest_tangential_stress_is_where_the_shear_stress_vanishes():
    """K_I sin(x) + K_II (3 cos(x) - 1) = 0 with x < 0; 70.53 degrees if K_I is zero."""
    for angle in crack_paths.ANGLES:
        x = -np.deg2rad(crack_paths.largest_tangential_stress(angle))
        assert np.sin(x) + np.tan(np.deg2rad(angle)) * (3.0 * np.cos(x) - 1.0) == pytest.approx(0.0, abs=1e-12)
    assert crack_paths.largest_tangential_stress(89.999) == pytest.approx(np.rad2deg(np.arccos(1.0 / 3.0)), abs=1e-2)


@pytest.mark.parametrize("angle", crack_paths.ANGLES)
def test_a_kink_is_seen_from_where_the_damage_of_the_cut_ends(angle, monkeypatch):
    """A new crack that leaves the damage of a cut by 50 degrees, straight."""

    def left(sheet, travels, load_steps, length, *_):
        damage, _, cuts = damage_of_cuts(sheet, length)
        begins = cuts.shortened(length, sheet.spacing).reshape(2, 2)
        along = np.subtract(*begins[::-1]) / np.linalg.norm(np.subtract(*begins[::-1]))
        turn = np.array([[np.cos(x := np.deg2rad(50.0)), np.sin(x)], [-np.sin(x), np.cos(x)]])
        new = [[begins[0], begins[0] - 0.01 * turn @ along], [begins[1], begins[1] + 0.01 * turn @ along]]
        apart = distance_from_segments(sheet.points[:, :2], np.array(new), 2.0 * length)
        return np.maximum(damage, np.maximum(1.0 - apart / (2.0 * length), 0.0) ** 2), None

    monkeypatch.setattr(crack_paths, "torn", left)
    from_damage, from_tip = crack_paths.grown.__wrapped__(203, angle, None)
    assert from_damage == pytest.approx(50.0, abs=3.0)
    assert from_tip > 60.0
    monkeypatch.setattr(crack_paths, "torn", lambda sheet, *_: (0.0 * sheet.points[:, 0], None))
    with pytest.raises(comparison.UnfinishedError, match="did not grow"):
        crack_paths.grown.__wrapped__(61, angle, None)


def test_fits_of_the_page_are_those_of_the_laws():
    rows = load_rows(page.SPREAD)
    assert {(row["rubber"], row["law"]) for row in rows} == {
        (rubber, law) for rubber in spread.RUBBERS for law in spread.LAWS
    }
    stored = next(row for row in rows if (row["rubber"], row["law"]) == ("james", "Arruda-Boyce"))
    again = next(row for row in spread.predictions("james", ["Arruda-Boyce"]))
    assert again["equibiaxial"] == pytest.approx(stored["equibiaxial"], rel=1e-3)
    # It agrees with what it knows, and not with what it predicts.
    off = {loading: np.median(np.abs(values)) for loading, values in stored["off"].items()}
    assert off["uniaxial"] < 0.03
    assert off["equibiaxial"] > 0.1


@pytest.mark.parametrize("name", list(page.ROWS))
def test_numbers_are_those_of_the_row(name):
    row, runs = page.ROWS[name], page.records()[name]
    assert row.verdict and row.source and len(runs) == len({run["full"] for run in runs})
    for run in runs:
        assert run["theirs"] == pytest.approx(row.theirs, rel=1e-5) and len(run["ours"]) == len(run["points"])
        if row.counts and None not in run["ours"][-1]:
            assert run["deviation"] == pytest.approx(comparison.median_deviation(run["ours"][-1], row.theirs), abs=1e-5)


def test_constants_do_not_know_what_they_predict():
    free = bulges.rubber("kawabata")
    curves = {curve.control: curve for curve in bulges.tests(bulges.FILES["kawabata"])}
    for loading in ("uniaxial", "planar"):
        off = nominal_stress(free, loading, np.asarray(curves[loading].at)) / curves[loading].values - 1.0
        assert np.median(np.abs(off)) < 0.05
    assert bulges.rubber("kawabata", True).c10 != pytest.approx(free.c10, rel=1e-3)


def test_branches_are_those_of_the_relaxation_test():
    at, force = relaxation.columns("time", "relaxation")
    times = np.union1d(np.linspace(0.0, at[-1], 20001), at)
    held = np.minimum(1.0 + relaxation.RAMP * times, relaxation.HELD)
    network, *branches = relaxation.moduli()
    stress = network * (held - held**-2)
    for modulus, time in zip(branches, relaxation.TIMES, strict=True):
        stress += maxwell_stress(Maxwell(modulus, time), times, held, held**-0.5)
    off = np.interp(at, times, stress) * relaxation.SECTION / force - 1.0
    assert np.sqrt((off**2).mean()) < 0.05


def test_a_row_runs(tmp_path, monkeypatch):
    """The pole of a bulge of 25 points has the stress of its own law within 3 % up to a stretch of 1.7."""
    whole = page.ROWS["meunier"]
    at = tuple(x for x in whole.at if x < 1.7)

    def model(points, device):
        stretch, stress = bulges.bulge(bulges.rubber("meunier"), points, at[-1], device)
        return 1e-6 * np.interp(at, stretch, stress)

    law = 1e-6 * nominal_stress(bulges.rubber("meunier"), "equibiaxial", np.array(at))
    small = replace(whole, at=at, theirs=tuple(law.tolist()), points=(25,), model=model, reasons=None)
    monkeypatch.setitem(page.ROWS, "meunier", small)
    __main__.main(["meunier", "--device", "cpu", "--numbers", str(tmp_path / "numbers.json")])
    ((run,),) = page.records(tmp_path / "numbers.json").values()
    assert abs(run["worst"]) < 0.03
    assert run["spacing"] == [pytest.approx(0.1 / 24, rel=1e-5)]


def test_a_page_of_all_rows_takes_no_row(capsys):
    with pytest.raises(SystemExit):
        __main__.parsed(["notch", "--only-page"])
    assert "--only-page notch: expected no ROW" in capsys.readouterr().err
