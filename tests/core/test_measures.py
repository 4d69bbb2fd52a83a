import math

import numpy as np
import pytest
from helpers import NEO, build, exact_stress, internal_force, refused, square, uniform

from warp_pd import Sheet
from warp_pd.geometry.triangulation import crosses
from warp_pd.measures import (
    TearLine,
    at_peak,
    at_time,
    growth_rate,
    largest,
    row_at,
    time_above,
    time_below,
    virial_stress,
    when_above,
    worst_balance,
)


def sheet_of(turn, jitter, points=61):
    return Sheet.filled(1.0, 1.0, thickness=0.01, density=1.0, points=points, turn=turn, jitter=jitter)


def torn_by(sheet, segment):
    """Intact faces: all but those that a straight segment crosses."""
    intact = np.ones(len(sheet.triangles), bool)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        tail, head = sheet.points[sheet.triangles[:, a]], sheet.points[sheet.triangles[:, b]]
        intact &= ~crosses(tail, head, segment)
    return intact


@pytest.mark.parametrize(("turn", "jitter"), [(0.0, 0.0), (30.0, 0.0), (0.0, 0.25)])
@pytest.mark.parametrize("angle", [0.0, 22.5, 70.0, -40.0])
def test_a_straight_crack_has_its_length_and_direction_on_any_grid(turn, jitter, angle):
    sheet = sheet_of(turn, jitter)
    line = TearLine(sheet)
    along = np.array([math.cos(math.radians(angle)), math.sin(math.radians(angle))])
    middle = np.array([0.503, 0.497])
    segment = (tuple(middle - 0.3 * along), tuple(middle + 0.3 * along))
    intact = torn_by(sheet, segment)
    assert line.length(intact) == pytest.approx(0.6, rel=0.03)
    assert line.direction(intact) == pytest.approx(angle, abs=0.6)
    assert line.deviation(intact, *segment) < 0.6 / 60
    assert line.reach(intact, tuple(middle), segment[1]) == pytest.approx(0.3, abs=1.0 / 60)
    assert line.pieces(intact) == 1


def test_two_cracks_count_twice_and_a_shattered_band_once():
    sheet = sheet_of(0.0, 0.0)
    line = TearLine(sheet)
    first, second = (torn_by(sheet, ((0.2, y), (0.8, y))) for y in (0.304, 0.704))
    assert line.length(first & second) == pytest.approx(line.length(first) + line.length(second), rel=1e-12)
    y, x = line.centres[:, 1], line.centres[:, 0]
    band = ~((abs(y - 0.5) < 0.026) & (abs(x - 0.5) < 0.3))
    assert line.length(band) == pytest.approx(0.6, abs=0.06)
    shreds = band | ((abs(y - 0.5) < 0.01) & (abs(x - 0.5) < 0.25) & (np.sin(60.0 * x) > 0.3))
    assert shreds.sum() > band.sum() + 20
    assert line.length(shreds) == pytest.approx(line.length(band), rel=0.05)


def test_single_broken_faces_all_over_the_sheet_are_no_crack():
    sheet = sheet_of(0.0, 0.0)
    line = TearLine(sheet)
    crack = torn_by(sheet, ((0.2, 0.504), (0.8, 0.504)))
    stray = crack.copy()
    stray[np.random.default_rng(0).choice(len(crack), 150, replace=False)] = False
    stray |= abs(line.centres[:, 1] - 0.5) < 0.1
    stray &= crack
    assert (~stray).sum() > (~crack).sum() + 80
    assert line.length(stray) == line.length(crack)
    assert line.direction(stray) == line.direction(crack)


def test_a_crack_through_the_sheet_makes_two_pieces_and_cuts_do_not_count():
    sheet = sheet_of(0.0, 0.0)
    line = TearLine(sheet)
    through = torn_by(sheet, ((-0.1, 0.404), (1.1, 0.404)))
    assert line.pieces(through) == 2
    above = sheet.points[sheet.triangles, 1] > 0.404
    at_one_point = through.copy()
    at_one_point[np.flatnonzero(~through & (above.sum(axis=1) == 1))[30]] = True
    assert line.pieces(at_one_point) == 1
    assert line.length(through) == pytest.approx(1.0, abs=0.03)
    cut = sheet.cut((0.2, 0.404), (0.8, 0.404))
    assert TearLine(cut).length(np.ones(len(cut.triangles), bool)) == 0.0
    assert math.isnan(line.direction(np.ones(len(sheet.triangles), bool)))


def test_a_filled_sheet_covers_the_rectangle_with_about_the_same_points():
    square = sheet_of(0.0, 0.0)
    for turn, jitter in ((15.0, 0.0), (45.0, 0.0), (0.0, 0.3)):
        sheet = Sheet.filled(1.0, 1.0, thickness=0.01, density=1.0, points=61, turn=turn, jitter=jitter)
        assert sheet.lattice is None
        assert sheet.areas.sum() == pytest.approx(1.0, rel=1e-12)
        assert sheet.size == pytest.approx(square.size, rel=0.03)
        assert len(sheet.edges("left")) == len(square.edges("left"))
    assert square.lattice is not None
    assert Sheet.filled(1.0, 1.0, thickness=0.01, density=1.0, points=61, turn=90.0).lattice is not None


@pytest.mark.parametrize("jitter", [-0.1, 0.5, float("nan")])
def test_filled_refuses_a_jitter_that_lets_points_meet(jitter):
    with refused(match="jitter = "):
        Sheet.filled(1.0, 1.0, thickness=0.01, density=1.0, points=11, jitter=jitter)


def test_numbers_of_a_history():
    history = [{"time": t, "a": t * t, "balance_error": 0.1 - t} for t in (0.0, 1.0, 2.0)]
    assert at_time("a", 0.5)(history) == pytest.approx(0.5)
    assert at_time("a", 3.0)(history) is None
    assert largest("a")(history) == 4.0
    assert time_above("a", 0.5)(history) == 1.0
    assert time_above("a", 9.0)(history) is None
    assert when_above("time", "a", 1.5)(history) == 2.0
    assert when_above("time", "a", 9.0)(history) is None
    assert worst_balance(history) == pytest.approx(1.9)
    assert worst_balance([{"time": 0.0}]) is None
    assert time_below("balance_error", -1.0)(history) == 2.0
    assert time_below("balance_error", -9.0)(history) is None
    assert growth_rate(history, "a")[1] == pytest.approx(2.0)


def test_a_measured_length_that_falls_is_no_negative_speed():
    history = [{"time": t, "a": a} for t, a in enumerate((0.0, 2.0, 1.0, 1.5, 4.0))]
    assert growth_rate(history, "a") == pytest.approx([2.0, 1.0, 0.0, 1.0, 2.0])


def test_what_hangs_at_points_that_tear_out():
    sheet = sheet_of(0.0, 0.0)
    line = TearLine(sheet)
    held = sheet.within((1.0, 0.5), 0.04)
    intact = np.ones(len(sheet.triangles), bool)
    assert line.attached_fraction(intact, held) == pytest.approx(1.0)
    through = torn_by(sheet, ((0.703, -0.1), (0.703, 1.1)))
    assert line.attached_fraction(through, held) == pytest.approx(0.3, abs=0.02)
    # A tear that takes area with it leaves less of the whole.
    gone = abs(line.centres[:, 0] - 0.5) > 0.2
    middle = sheet.within((0.5, 0.5), 0.04)
    assert line.attached_fraction(gone, held) == pytest.approx(line.areas[line.centres[:, 0] > 0.7].sum(), abs=1e-9)
    assert line.attached_fraction(gone, middle) == 0.0
    distance = np.hypot(line.centres[:, 0] - 1.0, line.centres[:, 1] - 0.5)
    assert line.attached_fraction(abs(distance - 0.08) > 0.02, held) < 0.01


@pytest.mark.parametrize(("turn", "jitter"), [(0.0, 0.0), (30.0, 0.0), (0.0, 0.25)])
def test_alignment_tells_cracks_along_a_grid_from_cracks_that_ignore_it(turn, jitter):
    sheet = sheet_of(turn, jitter)
    line = TearLine(sheet)

    def crack(angle):
        along = 0.3 * np.array([math.cos(math.radians(angle)), math.sin(math.radians(angle))])
        return torn_by(sheet, (tuple(0.503 - along), tuple(0.503 + along)))

    assert np.mean([line.alignment(crack(turn + a), turn) for a in np.arange(0.0, 180.0, 5.0)]) == pytest.approx(
        0.0, abs=0.12
    )
    if jitter == 0.0:
        assert line.alignment(crack(turn), turn) > 0.85
        assert line.alignment(crack(turn + 22.5), turn) < -0.3
    assert math.isnan(line.alignment(np.ones(len(sheet.triangles), bool)))


def test_the_row_at_a_height_runs_from_left_to_right_in_single_precision_too():
    sheet = Sheet.rectangle(0.2, 0.1, thickness=1e-3, density=1.0, points=21)
    turned = np.random.default_rng(0).permutation(sheet.size)
    points = sheet.points[turned].astype(np.float32)
    row = row_at(points, 0.0522)
    assert len(row) == 21
    assert points[row] == pytest.approx(np.column_stack([np.linspace(0.0, 0.2, 21), np.full(21, 0.05)]), abs=1e-7)
    assert row_at(np.array([[1.0, 0.0], [0.0, 0.0]]), 0.3).tolist() == [1, 0]


def test_virial_stress_is_the_nominal_stress_of_a_uniform_stretch():
    sheet, gradient = square(9), np.array([[1.3, 0.2], [0.1, 0.9], [0.0, 0.0]])
    built = build(sheet, law={"fast": False})
    internal_force(built, uniform(sheet, gradient))
    found = virial_stress(built, sheet.size // 2)
    assert found == pytest.approx(exact_stress(NEO, gradient)[:2], rel=5e-4)


def test_long_and_large_faces_of_cracks_count_by_their_size():
    """A crack of 0.4 m along large triangles and one of 0.16 m, turned by 22.5 degrees, along small ones."""
    coarse = Sheet.rectangle(0.4, 0.4, thickness=1e-3, density=1000.0, points=(9, 9))
    fine = Sheet.rectangle(0.16, 0.12, thickness=1e-3, density=1000.0, points=(17, 13))
    turn = np.exp(1j * np.pi / 8.0) * (fine.points @ [1.0, 1j])
    points = np.concatenate([coarse.points, np.column_stack([turn.real, turn.imag + 10.0])])
    triangles = np.concatenate([coarse.triangles, fine.triangles + coarse.size])
    sheet = Sheet.from_points(points, triangles=triangles, thickness=1e-3, density=1000.0, graded=True)
    middle = [each.points[each.triangles].mean(axis=1)[:, 1] for each in (coarse, fine)]
    torn = np.concatenate([np.abs(middle[0] - 0.175) < 0.025, np.abs(middle[1] - 0.065) < 0.005])
    line = TearLine(sheet)
    assert line.alignment(~torn) == pytest.approx((0.4 - 0.16) / (0.4 + 0.16), rel=1e-6)
    band = 0.4 * 0.05, 0.16 * 0.01
    away = line.deviation(~torn, (0.0, 0.0), (1.0, 0.0))
    assert away == pytest.approx(10.0 * np.sqrt(band[1] / sum(band)), rel=0.03)


def test_a_line_of_no_tear_has_no_deviation():
    sheet = square(9)
    line = TearLine(sheet)
    assert math.isnan(line.deviation(np.ones(len(sheet.triangles), bool), (0.0, 0.0), (1.0, 0.0)))


@pytest.mark.parametrize(("loads", "found"), [
    ((0.0, 3.0, 1.0), 0.2), ((0.0, 1.0, 3.0), None), ((3.0, 1.0, 0.0), None), ((0.0, 0.0, 0.0), None),
    ((math.nan, 0.0, 3.0, math.nan, 2.0), 0.4), ((1.0,), None), ((), None),
])  # fmt: skip
def test_a_peak_has_frames_on_both_sides(loads, found):
    history = [{"depth": 0.2 * k, "load": load} for k, load in enumerate(loads)]
    assert at_peak("depth", "load")(history) == found
