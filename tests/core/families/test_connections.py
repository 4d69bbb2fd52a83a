"""Bonds connect what triangles connect, and corrected weights that cannot balance the sheet are refused."""

import numpy as np
import pytest
from helpers import refused

from warp_pd import BondAssociated, Circle, Fixed, Measure, MooneyRivlin, Motion, Newton, Sheet, Simulation
from warp_pd.families import build_families, notes_on_folds
from warp_pd.laws.weight_tables import notes_on_balance, point_tables, weight_tables
from warp_pd.measures import support_force

SOLID = {"thickness": 1e-3, "density": 1000.0}


def cells(ratio, points=11):
    """A sheet of 0.1 x 0.05 m of cells `ratio` times as long as high, as a cloud."""
    return Sheet.rectangle(0.1, 0.05, points=(points, (points - 1) * ratio // 2 + 1), **SOLID).as_cloud()


@pytest.mark.parametrize("weights", ["plain", "published", "corrected"])
@pytest.mark.parametrize(
    "sheet",
    [cells(4), Sheet.tube(0.05, 0.3, points=(12, 50), **SOLID), Sheet.from_points(cells(4).points, **SOLID)],
    ids=["cloud", "tube", "points"],
)
def test_long_cells_are_refused_with_a_horizon_that_does(sheet, weights):
    words = "pieces of what triangles connect" if weights == "corrected" else "lie on a line"
    with refused(match=f"horizon = 2.015: .*{words}.*expected at least 2\\.[012]"):
        weight_tables(sheet, 2.015, "inverse", weights)
    families, _, found, report = weight_tables(sheet, 2.3, "inverse", weights)
    assert ((found > 0.0) & families.exists).sum(axis=1).min() >= 2
    assert report is None or report["left"] < 0.01


@pytest.mark.parametrize("weights", ["plain", "corrected"])
def test_a_grid_with_gaps_needs_diagonals_as_a_lattice_does(weights):
    sheet = Sheet.rectangle(0.1, 0.1, points=21, **SOLID).hole((0.05, 0.05), 0.02)
    with refused(match=r"horizon = 1\.2: .*expected at least 1\.42"):
        weight_tables(sheet, 1.2, "inverse", weights)
    weight_tables(sheet, 1.42, "inverse", weights)


def test_bonds_of_one_direction_are_refused_for_bond_based_laws_too():
    sheet = Sheet.rectangle(0.1, 0.01, points=(11, 21), **SOLID).as_cloud()
    with refused(match="horizon = 1.2: the bonds of 231 points, as of that at .* lie on a line: expected at least 4.4"):
        build_families(sheet, 1.2, "inverse", intersections=False)


@pytest.mark.parametrize("ratio", [2, 3])
def test_force_of_long_cells_is_exact(ratio):
    sheet = cells(ratio)
    right = sheet.edges("right")
    run = Simulation(
        sheet,
        BondAssociated(MooneyRivlin(c10=2e5), horizon=2.015),
        Newton(load_steps=1),
        loads=[
            Fixed(range(sheet.size), "z"), Fixed(sheet.edges("left"), "x"), Fixed([sheet.edges("left")[0]], "y"),
            Motion(right, [0, 1], x=[0, 0.01]),
        ],
        measures=[Measure("pull", "N", lambda built, frame: support_force(built, right)[0])],
    ).run(device="cpu")  # fmt: skip
    assert run.history[-1]["pull"] == pytest.approx(4e5 * (1.1 - 1.1**-2) * 0.05 * 1e-3, rel=1e-9)


def fine_hole(fine, **grading):
    """A mesh of triangles of 6 mm that become `fine` [m] at a hole."""
    made = Sheet.outline(
        [(0, 0), (0.1, 0), (0.1, 0.1), (0, 0.1)],
        holes=[Circle((0.05, 0.05), 0.005)],
        spacing=lambda x, y: np.minimum(fine + 0.2 * np.maximum(np.hypot(x - 0.05, y - 0.05) - 0.005, 0.0), 0.006),
        **SOLID,
    )
    return Sheet.from_points(made.points, triangles=made.triangles, **grading, **SOLID)


def test_a_mesh_much_finer_in_places_takes_a_horizon_that_follows_it():
    with refused(match=r"horizon = 2\.015, which is .* spacings of the triangles at .* graded = True"):
        weight_tables(fine_hole(0.001), 2.015, "inverse", "corrected")
    sheet = fine_hole(0.001, graded=True)
    assert sheet.spacings.min() < 0.0014 and sheet.spacings.max() > 0.005
    assert weight_tables(sheet, 2.015, "inverse", "corrected")[3]["points_left_unbalanced"] == 0


def test_local_spacings_are_those_of_the_grid():
    sheet = Sheet.rectangle(0.1, 0.1, points=11, **SOLID)
    graded = Sheet.from_points(sheet.points, triangles=sheet.triangles, graded=True, **SOLID)
    np.testing.assert_allclose(graded.spacings, 0.01, rtol=1e-12)
    surface = Sheet.from_surface(sheet.positions, sheet.triangles, graded=True, **SOLID)
    np.testing.assert_allclose(surface.spacings, 0.01, rtol=1e-12)
    with refused(match="graded = True and spacing = 0.01: expected only one of them"):
        Sheet.from_points(sheet.points, spacing=0.01, graded=True, **SOLID)


@pytest.mark.parametrize(
    ("tables", "way", "horizon"),
    [(weight_tables, "corrected", 1.6), (point_tables, True, 1.3)],
    ids=["bonds", "points"],
)
def test_weights_that_cannot_balance_are_refused_with_a_horizon_that_does(tables, way, horizon):
    sheet = Sheet.filled(0.1, 0.1, points=21, jitter=0.25, **SOLID)
    with refused(match=rf"weights = 'corrected' at horizon = {horizon}: .* most at \(.*\) m: expected horizon = 1\.8"):
        tables(sheet, horizon, "linear", way)
    report = tables(sheet, 1.8, "linear", way)[3]
    assert report["left"] < 1e-9 and notes_on_balance(report, sheet, 1.8) == []


def test_a_short_horizon_off_the_lattice_is_refused_once():
    """The horizon that is advised where bonds leave pieces balances the sheet, too."""
    sheet = Sheet.filled(0.1, 0.1, points=21, jitter=0.25, **SOLID)
    with refused(match=r"horizon = 1\.5: bonds leave 3 pieces .* expected at least 1\.8"):
        weight_tables(sheet, 1.5, "linear", "corrected")


def test_graded_example_of_the_pages_is_balanced():
    sheet = Sheet.outline(
        [(0.0, 0.0), (0.1, 0.0), (0.1, 0.06), (0.0, 0.06)],
        cracks=[[(0.0, 0.03), (0.04, 0.03)]],
        spacing=lambda x, y: np.clip(0.12 * np.hypot(x - 0.04, y - 0.03), 0.0012, 0.005),
        **SOLID,
    )
    assert weight_tables(sheet, 2.015, "inverse", "corrected")[3]["points_left_unbalanced"] == 0


def test_little_left_unbalanced_is_a_note():
    sheet = Sheet.filled(0.1, 0.1, points=21, turn=20.0, **SOLID)
    report = weight_tables(sheet, 3.15, "inverse", "corrected")[3]
    assert 1e-3 < report["left"] < 0.1
    (note,) = notes_on_balance(report, sheet, 3.15)
    assert f"at {report['points_left_unbalanced']} points" in note and "most at (" in note
    assert note.endswith("another horizon, such as 2.015, may balance them")


def folded(turn):
    """Two squares that meet at x = 0 along a fold of an angle [degrees]."""
    square, half = Sheet.rectangle(0.1, 0.1, points=6, **SOLID), np.radians(0.5 * turn)
    right = np.column_stack(
        [square.points[:, 0] * np.cos(half), square.points[:, 1], -square.points[:, 0] * np.sin(half)]
    )
    beyond = square.points[:, 0] > 0.0
    number = np.where(beyond, square.size + np.cumsum(beyond) - 1, np.arange(square.size))
    triangles = np.concatenate([square.triangles[:, ::-1], number[square.triangles]])
    points = np.concatenate([right * (-1.0, 1.0, 1.0), right[beyond]])
    return Sheet.from_surface(points, triangles, spacing=0.02, **SOLID)


@pytest.mark.parametrize("turn", [60.0, 90.0, 145.0, 160.0, 175.0])
def test_folds_are_noted_and_refused_by_their_angle(turn):
    sheet = folded(turn)
    if turn > 150.0:
        with refused(match=rf"sheet: it is folded by {turn:.0f} degrees at \(0, .* m, .*: expected at most 150: round"):
            weight_tables(sheet, 2.015, "inverse", "plain")
        return
    weight_tables(sheet, 2.015, "inverse", "plain")
    notes = notes_on_folds(sheet)
    assert len(notes) == (turn > 80.0)
    assert not notes or f"turns by up to {turn:.0f} degrees at 6 points, most at (0, " in notes[0]


def test_smooth_surfaces_have_no_folds():
    assert not notes_on_folds(Sheet.sphere(0.1, points=4, **SOLID)) and not notes_on_folds(Sheet.tube(1, 1, **SOLID))


def test_dense_sums_of_uneven_sheets_are_the_sparse_ones(monkeypatch):
    sheet, found = fine_hole(0.002, graded=True), []
    for uneven in (1.0, np.inf):
        monkeypatch.setattr("warp_pd.families.weights.UNEVEN", uneven)
        found.append(weight_tables(sheet, 2.015, "inverse", "corrected")[2])
    np.testing.assert_allclose(*found, rtol=1e-9, atol=1e-12)
