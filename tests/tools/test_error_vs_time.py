"""Error against run time: fronts, orders, errors against finite elements, and a fast version of all of it."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("skfem")

from error_vs_time import errors
from error_vs_time.__main__ import main, parsed
from error_vs_time.elements import SCENES, around_hole
from error_vs_time.studies import ELEMENTS, STUDIES, Configuration, configurations, simulation_of
from error_vs_time.sweep import measure
from error_vs_time.tables import METHODS, costs, draw, error_of, front, orders, sections
from finite_elements import Membrane, incompressible
from study import load_rows


def row(points, seconds, field, **case):
    run = {
        "scene": "pressure", "law": "plain", "horizon": 2.015, "points": points, "precision": 64, "solver": "newton"
    }  # fmt: skip
    status = "finished" if field is not None else "not converged"
    scalar = None if field is None else 0.01
    found = {"status": status, "scalar": scalar, "field": field, "seconds": seconds, "point_steps": 1e6 * seconds}
    return {**run, **found, "device": "CPU, one core", "made": "today", **case}


def test_the_front_of_error_over_time_holds_what_nothing_beats():
    rows = [row(11, 1.0, 0.1), row(21, 2.0, 0.2), row(31, 3.0, 0.02), row(41, 4.0, None), row(51, 2.5, 0.02)]
    assert [r["points"] for r in front(rows)] == [11, 51]


def test_observed_orders_come_from_the_spacings():
    table = orders([row(11, 1.0, 0.16), row(21, 2.0, 0.04), row(41, 2.0, 0.01)])
    assert table[-1].endswith("| 1 % (41), 2.0 |")
    assert orders([row(11, 1.0, 0.16), row(11, 1.0, 0.2, law="corrected")]) == []


def test_finite_elements_are_compared_at_equal_error():
    rows = [
        row(26, 0.1, 2e-3),
        row(51, 0.4, 5e-4),
        row(13, 0.02, 9e-4, law="membrane_q9", horizon=0.0),
    ]
    lines = costs(rows, "CPU, one core")
    assert lines[2].endswith("plain 2.015, 26, newton, float64: 0.1 s | 9 nodes each, 13 along: 0.02 s | 5.0 |")
    assert lines[3].endswith("0.02 s | 20.0 |")
    assert costs([row(26, 0.1, 0.02)], "CPU, one core")[2:] == [
        "| pressure | 2 % | plain 2.015, 26, newton, float64: 0.1 s |"
    ]


def test_a_scene_without_a_field_is_compared_by_its_scalar():
    torn = row(16, 1.0, None, scene="pure_shear_tear", law="corrected", status="finished", scalar=-0.02)
    failed = row(24, 1.0, None, scene="pure_shear_tear", law="corrected")
    assert error_of(torn) == 0.02
    assert front([torn, failed]) == [torn]


def test_every_law_has_a_line_in_the_picture_and_finite_elements_run_on_a_cpu_alone():
    drawn = [law for *_, laws in METHODS for law in laws]
    assert set(drawn) == {law for study in STUDIES for law in study.laws}
    assert len(drawn) == len(set(drawn))
    for study in STUDIES:
        on_gpu = {run.law for run in configurations(study, (), (), elements=False)}
        assert on_gpu == set(study.laws) - set(ELEMENTS)


@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.scene)
def test_every_law_of_a_study_builds_its_scene(study):
    for run in configurations(study, (), (), elements=False):
        simulation_of(study, replace(run, points=26))


def test_published_weights_count_one_area_a_point():
    case = Configuration("pressure", "published", 2.015, 16, 64, "relaxation")
    areas = simulation_of(STUDIES[0], case).sheet.areas
    assert areas.min() == pytest.approx(areas.max())


def test_the_fast_version_of_error_over_time(tmp_path, capsys):
    numbers = tmp_path / "numbers.json"
    options = ["--fast", "--device", "cpu", "--laws", "corrected", "--numbers", str(numbers)]
    main(options)
    rows = load_rows(numbers)
    assert len(rows) == 6
    assert all(r["status"] == "finished" for r in rows)
    coarse, fine = (min(error_of(r) for r in rows if r["points"] == n) for n in (11, 21))
    assert fine < 0.4 * coarse
    found = sections(rows, tmp_path / "page.md")
    assert list(found) == ["## On CPU"]
    draw(rows, tmp_path / "front.png")
    assert (tmp_path / "front.png").is_file()
    assert "corrected 2.015, 21, " in capsys.readouterr().out
    main([*options, "--missing"])
    assert len(load_rows(numbers)) == 6
    assert "pressure corrected 2.015" not in capsys.readouterr().out, "nothing was left to run"


def test_small_cases_are_no_rows_of_the_page():
    options = parsed(["--fast"])
    assert options.out is None and options.numbers.parts[-2:] == ("runs", "error-vs-time.json")


def test_errors_against_finite_elements_vanish_for_their_own_field():
    """Their field, and what a sheet of 21 points finds: known from the runs of the solvers' tests."""
    case = Configuration("pressure", "corrected", 2.015, 21, 64, "newton")
    found = measure(STUDIES[0], case, parsed(["--fast", "--device", "cpu"]))
    assert 0.0 < found["scalar"] < 0.01
    assert 0.0 < found["field"] < 0.015
    sheet = simulation_of(STUDIES[0], case).sheet
    field, corner = errors.pressure_field(sheet.points), errors.pressure_field(0.1 - sheet.points)
    assert errors.of_sheet(sheet, field, field) == 0.0
    # Turned by half a turn about the centre, the sheet deflects alike and moves in its plane the other way; on the
    # lines of symmetry the cubics leave a motion across them.
    assert errors.of_sheet(sheet, field * [-1.0, -1.0, 1.0], corner) < 1e-5


def test_the_mirrored_elements_are_the_whole_sheet_with_its_hole():
    nodes, moved = errors.whole_sheet_with_hole()
    assert np.allclose(np.abs(nodes).max(axis=0), 0.25)
    assert np.hypot(*nodes.T).min() == pytest.approx(0.08, rel=1e-6)
    assert np.allclose(moved[nodes[:, 0] > 0.25 - 1e-9, 0], 0.25)
    assert np.allclose(moved.sum(axis=0), 0.0, atol=1e-9)


def test_the_hole_of_the_elements_is_round():
    sheet = Membrane(around_hole(0.3, 1.0, 4, True), incompressible(1.0), 1.0, 2)
    assert np.hypot(*sheet.nodes.T).min() == pytest.approx(0.3, rel=1e-12)
    assert sheet.weights.sum() == pytest.approx(4.0 - np.pi * 0.09, rel=2e-5)


@pytest.mark.parametrize("scene", ["pressure", "tension", "stretch"])
def test_finer_elements_come_nearer_to_the_reference(scene):
    """Elements of nine nodes, corners and reference in the way of their order three."""
    coarse, fine = (SCENES[scene](points, True).errors()[1] for points in (13, 25))
    assert fine < 0.35 * coarse
    assert fine < 1e-3
