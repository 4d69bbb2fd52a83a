"""Error against run time: fronts, orders, errors against finite elements, and a fast version of all of it."""

import json

import numpy as np
from error_vs_time import references
from error_vs_time.cli import main, parsed
from error_vs_time.page import page
from error_vs_time.results import Row, load, save
from error_vs_time.studies import STUDIES, Configuration, simulation_of
from error_vs_time.sweep import measure
from error_vs_time.tables import field_of, front, orders, published_text
from study import REFERENCES


def row(points, seconds, field, scalar=0.01, **case):
    run = Configuration(
        **{"scene": "pressure", "law": "plain", "horizon": 2.015, "precision": 64, "solver": "newton", **case},
        points=points,
    )
    status = "finished" if field is not None else "not converged"
    return Row(run, status, scalar, field, seconds, 0.0, 0.0, 0.0, 1e6 * seconds, "CPU", "today")


def test_the_front_of_error_over_time_holds_what_nothing_beats():
    rows = [row(11, 1.0, 0.1), row(21, 2.0, 0.2), row(31, 3.0, 0.02), row(41, 4.0, None), row(51, 2.5, 0.02)]
    assert [r.case.points for r in front(rows, field_of, lambda r: r.seconds)] == [11, 51]


def test_observed_orders_come_from_the_spacings():
    table = orders([row(11, 1.0, 0.16), row(21, 2.0, 0.04), row(41, 2.0, 0.01)])
    assert table[-1].endswith("| 2.0, 2.0 |")
    assert orders([row(11, 1.0, 0.16), row(11, 1.0, 0.2, law="corrected")]) == []


def test_a_page_has_no_empty_tables_and_no_orders_of_a_tear(tmp_path):
    torn = [row(n, 1.0, 1.0 / n, scene="double_notch", solver="explicit", precision=32) for n in (30, 60)]
    text = page([row(11, 1.0, 0.16), *torn], tmp_path)
    assert "## double_notch" in text and "Observed orders" not in text
    assert "Observed orders" in page([row(11, 1.0, 0.16), row(21, 2.0, 0.04)], tmp_path)


def test_what_the_published_settings_lose():
    published = row(101, 2.0, 0.05, law="published", horizon=3.15, solver="relaxation")
    text = published_text([published, row(51, 1.0, 0.05), row(101, 1.9, 0.001)])
    assert "50 times less" in text
    assert text.endswith("2 times less.")


def test_the_fast_version_of_error_over_time(tmp_path, capsys):
    main(["--fast", "--device", "cpu", "--laws", "corrected", "--numbers", str(tmp_path)])
    rows = load(tmp_path)
    assert len(rows) == 8
    assert all(r.status == "finished" for r in rows)
    coarse, fine = (min(field_of(r) for r in rows if r.case.points == n) for n in (11, 21))
    assert fine < 0.4 * coarse
    text = page(rows, tmp_path)
    assert "What to choose" in text
    assert (tmp_path / "error-vs-time" / "pressure-cpu.png").is_file()
    assert "corrected, 2.015, 21 points" in capsys.readouterr().out
    main(["--fast", "--device", "cpu", "--laws", "corrected", "--numbers", str(tmp_path), "--missing"])
    assert len(load(tmp_path)) == 8
    assert "corrected 2.015" not in capsys.readouterr().out, "nothing was left to run"


def test_numbers_of_older_versions_are_read(tmp_path):
    """They name the commit "stand"."""
    save(tmp_path, [row(11, 1.0, 0.1)])
    (file,) = tmp_path.glob("*.json")
    (item,) = json.loads(file.read_text())
    item["stand"] = item.pop("made")
    file.write_text(json.dumps([item]))
    assert load(tmp_path) == [row(11, 1.0, 0.1)]


def test_errors_against_finite_elements_vanish_for_their_own_field():
    """Their field, and what a sheet of 21 points finds: known from the runs of the solvers' tests."""
    options = parsed(["--fast"])
    study = STUDIES[0]
    case = Configuration("pressure", "corrected", 2.015, 21, 64, "newton")
    found = measure(study, case, "cpu", 1, options.enough, "here", [])
    assert 0.0 < found.scalar < 0.01
    assert 0.0 < found.field < 0.015
    sheet = simulation_of(study, case).sheet
    data = np.load(REFERENCES / "pressure.npz")
    moved = data["x"] - np.column_stack([data["X"], np.zeros(len(data["X"]))])
    field = references.quarter_field(data["X"], moved, sheet.points, (0.05, 0.05))
    corner = references.quarter_field(data["X"], moved, 0.1 - sheet.points, (0.05, 0.05))
    assert references.field_error(sheet, field, field) == 0.0
    # Turned by half a turn about the centre, the sheet deflects alike and moves in its plane the other way; on the
    # lines of symmetry the cubics leave a motion across them.
    assert references.field_error(sheet, field * [-1.0, -1.0, 1.0], corner) < 1e-5
