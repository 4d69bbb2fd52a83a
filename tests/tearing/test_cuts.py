"""A cut acts as long as it is drawn, also where its ends lie on columns of points."""

import numpy as np
import pytest

from warp_pd import BondAssociated, Circle, Fixed, Measure, MooneyRivlin, Motion, NeoHookean, Newton, Sheet, Simulation
from warp_pd.families import build_families
from warp_pd.measures import support_force

SOLID = {"thickness": 1e-3, "density": 1000.0}
STEP, ROWS = 0.005, 19


def edge_crack(tip, finer, cloud=False):
    """Force [N] of a sheet of 20 x 19 spacings, stretched across a cut from its left edge, `tip` spacings long."""
    height = ROWS * STEP
    sheet = Sheet.rectangle(20 * STEP, height, points=(20 * finer + 1, ROWS * finer + 1), **SOLID)
    sheet = (sheet.as_cloud() if cloud else sheet).cut((-STEP, 0.5 * height), (tip * STEP, 0.5 * height))
    top = sheet.edges("top")
    run = Simulation(
        sheet, BondAssociated(MooneyRivlin(c10=2e5), horizon=2.015), Newton(load_steps=1),
        loads=[
            Fixed(range(sheet.size), "z"), Fixed(sheet.edges("bottom"), "xy"),
            Motion(top, [0.0, 1.0], x=0.0, y=[0.0, 0.05 * height]),
        ],
        measures=[Measure("pull", "N", lambda built, frame: support_force(built, top)[1])],
    ).run(device="cpu")  # fmt: skip
    return run.history[-1]["pull"]


@pytest.mark.parametrize(("tip", "cloud"), [(10.0, False), (10.0, True), (9.5, False)])
def test_a_cut_to_a_column_is_as_long_as_in_a_finer_sheet(tip, cloud):
    assert edge_crack(tip, 1, cloud) == pytest.approx(edge_crack(tip, 3), rel=4e-3)


def crossing(sheet, place, axis=1):
    """Number of bonds that cross the line from (place[0], 0) to the top, at the height place[1]."""
    families = build_families(sheet, 2.015, "inverse")
    members = families.members_of(np.arange(sheet.size))
    tail, slot = np.nonzero(members >= 0)
    a, b = sheet.points[tail], sheet.points[members[tail, slot]]
    across = (a[:, axis] - place[axis]) * (b[:, axis] - place[axis]) < 0.0
    share = (place[axis] - a[across, axis]) / (b[across, axis] - a[across, axis])
    at = a[across] + share[:, None] * (b[across] - a[across])
    return int((np.abs(at - place).max(axis=1) < 1e-6 * sheet.spacing).sum())


@pytest.mark.parametrize("cloud", [False, True])
def test_ends_that_meet_leave_no_bond(cloud):
    """At the edge of the sheet, and where a cut goes on from another one, no bond passes through the end."""
    plain = Sheet.rectangle(20 * STEP, ROWS * STEP, points=(21, ROWS + 1), **SOLID)
    plain = plain.as_cloud() if cloud else plain
    y = 0.5 * ROWS * STEP
    one = plain.cut((0.0, y), (10 * STEP, y))
    assert crossing(plain, (0.0, y)) and not crossing(one, (0.0, y))
    assert crossing(one, (10 * STEP, y)) == crossing(plain, (10 * STEP, y))
    two = one.cut((10 * STEP, y), (15 * STEP, y))
    assert not crossing(two, (10 * STEP, y)) and crossing(two, (15 * STEP, y))
    turned = one.cut((10 * STEP, y), (10.5 * STEP, 16 * STEP))
    assert not crossing(turned, (10 * STEP, y))
    whole = plain.cut((0.0, y), (20 * STEP, y))
    assert not any(crossing(whole, (k * STEP, y)) for k in range(21))


def test_a_cut_from_a_hole_begins_at_its_edge():
    """Bonds beside the hole do not pass through the end of the cut on its edge."""
    sheet = Sheet.rectangle(0.1, 0.1, points=21, **SOLID).hole((0.05, 0.05), 0.012)
    edge = sheet.points[np.abs(sheet.points[:, 1] - 0.05) < 1e-9]
    start = edge[edge[:, 0] > 0.05][0, 0]
    cut = sheet.cut((start, 0.0525), (0.09, 0.0525))
    assert crossing(sheet, (start, 0.0525)) and not crossing(cut, (start, 0.0525))


def test_a_hole_with_points_on_its_rim_has_converged_where_one_of_steps_has_not():
    """The pull of the guide's scene hole.py, beside 0.080379 N, its value at 81 points with points on the circle."""
    square, bore = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)], Circle((0.05, 0.05), 0.02)
    drawn = Sheet.outline(square, holes=[bore], spacing=0.005, **SOLID)
    stepped = Sheet.rectangle(0.1, 0.1, points=21, **SOLID).hole((0.05, 0.05), 0.02)
    assert drawn.notes == () and "encloses 1.19 times its circle" in stepped.notes[0]
    pulls = []
    for sheet in (drawn, stepped):
        right = sheet.edges("right")
        run = Simulation(
            sheet, BondAssociated(NeoHookean(mu=1e3, bulk=100e3), horizon=2.015), Newton(load_steps=2),
            loads=[
                Fixed(range(sheet.size), "z"), Fixed(sheet.edges("left"), "xy"),
                Motion(right, [0.0, 1.0], x=[0.0, 0.05], y=0.0),
            ],
            measures=[Measure("pull", "N", lambda built, frame, right=right: support_force(built, right)[0])],
        ).run(device="cpu")  # fmt: skip
        pulls.append(run.history[-1]["pull"])
        assert sheet is drawn or any("encloses 1.19 times its circle" in note for note in run.summary["notes"])
    assert pulls == pytest.approx([0.080379 * 1.0024, 0.080379 * 0.938], rel=5e-4)
