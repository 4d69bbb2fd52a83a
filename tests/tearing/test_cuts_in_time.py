"""Cuts that open in time, against sheets that are cut from the start, and against waves of release."""

import numpy as np
import pytest
from curved_sheets import small_tube
from helpers import MU, NEO, jittered, refused, square, uniform
from resumed_runs import require_same_when_stopped

from warp_pd import (
    ArcLength,
    BondAssociated,
    CriticalStretch,
    CutsInTime,
    Explicit,
    Fixed,
    Measure,
    Motion,
    NeoHookean,
    Newton,
    Pressure,
    Punch,
    Relaxation,
    Seam,
    Sheet,
    Simulation,
    Slit,
    TearingEnergy,
)
from warp_pd.device.checks import InputError
from warp_pd.device.launches import Launch

LAW = BondAssociated(NEO, horizon=2.015, weights="plain")
PATH = [(0.02, 0.052), (0.07, 0.052)]
INTACT = CriticalStretch(1e3)


def opening(built, frame):
    """How far the points above and below the middle of PATH have moved apart [m]."""
    sheet = built.context.sheet
    above, below = (sheet.nearest(0.045, y) for y in (0.06, 0.045))
    return frame.displacement[above, 1] - frame.displacement[below, 1]


OPENING = Measure("opening", "m", opening)


def pulled(sheet, solver, damage, stretch=0.2, **more):
    move = Motion(sheet.edges("top"), [0.0, solver.duration], x=0.0, y=[0.0, stretch * 0.1], z=0.0)
    flat = Fixed(sheet.where(lambda x, y: (y > 0.0) & (y < 0.1)), "z")
    loads = [Fixed(sheet.edges("bottom")), move, flat]
    return Simulation(sheet, LAW, solver, loads=loads, damage=damage, **more)


def run(simulation, precision=64, **more):
    result = simulation.run(device="cpu", precision=precision, **more)
    assert result.status == "finished", result.summary["message"]
    return result


@pytest.mark.parametrize("solver", [Relaxation(tolerance=1e-8, load_steps=4), Newton(load_steps=4, tolerance=1e-8)])
@pytest.mark.parametrize("layout", [square, jittered])
def test_when_a_slit_opens_makes_no_difference_to_the_equilibrium(layout, solver):
    """Before it opens, the equilibrium is that of the whole sheet; after it, that of one that opened at once."""
    sheet = layout(13)
    later, once, whole = (
        run(pulled(sheet, solver, damage, measures=[OPENING]))
        for damage in (CutsInTime(Slit(PATH, at=0.6 * solver.duration)), CutsInTime(Slit(PATH, at=0.0)), INTACT)
    )
    openings = [[row["opening"] for row in result.history] for result in (later, once, whole)]
    assert openings[0][1:3] == pytest.approx(openings[2][1:3], rel=1e-5)
    assert openings[0][3:] == pytest.approx(openings[1][3:], rel=1e-5)
    assert openings[0][3] > 1.5 * openings[2][3]
    difference = np.abs(later.frame.displacement - once.frame.displacement).max()
    assert difference < 1e-6 * np.abs(once.frame.displacement).max()


def test_a_slit_opens_as_far_as_a_crack_of_griffith():
    """In plane stress a crack of length 2 a in a strain e opens by 4 e a; less than 2 % are due to the finite sheet."""
    strain, half, sheet = 1e-3, 0.01, square(61)
    middle = sheet.points[sheet.nearest(0.05, 0.05), 1] + 0.5 * sheet.spacing
    path = [(0.05 - half, middle), (0.05 + half, middle)]
    law = BondAssociated(NeoHookean(mu=MU, bulk=1e3 * MU), horizon=2.015, weights="corrected")
    between = Fixed(sheet.where(lambda x, y: (y > 0.0) & (y < 0.1)), "z")
    pull = Motion(sheet.edges("top"), [0.0, 1.0], y=[0.0, strain * 0.1], z=0.0)
    loads = [Fixed(sheet.edges("bottom"), "yz"), Fixed(sheet.nearest(0.05, 0.0), "x"), pull, between]
    result = run(Simulation(sheet, law, Newton(), loads=loads, damage=CutsInTime(Slit(path, at=1.0))))
    above, below = (sheet.nearest(0.05, middle + side * 0.5 * sheet.spacing) for side in (1.0, -1.0))
    opening = result.frame.displacement[above, 1] - result.frame.displacement[below, 1]
    assert opening == pytest.approx(4.0 * strain * half, rel=0.03)


def test_a_cut_strip_flies_apart_at_the_speed_of_its_release():
    """A uniformly strained strip, cut across: its ends move at strain times wave speed, and it rests elsewhere."""
    strain, young, density = 1e-3, 4.0 * MU, 1000.0
    sheet = Sheet.rectangle(0.2, 0.02, thickness=1e-3, density=density, points=(101, 11))
    law = BondAssociated(NeoHookean(mu=MU, bulk=1e3 * MU), horizon=2.015, weights="corrected")
    speed = np.sqrt(young / density)
    start = uniform(sheet, np.diag([1.0 + strain, 1.0, 1.0])[:, :2])
    time = 0.03 / speed
    simulation = Simulation(
        sheet, law, Explicit(time, frames=2), initial_displacement=start,
        loads=[Fixed(sheet.edges("left", "right")), Fixed(range(sheet.size), "yz")],
        damage=CutsInTime(Slit([(0.101, -0.01), (0.101, 0.03)], at=0.0)),
    )  # fmt: skip
    result = run(simulation)
    x, velocity = sheet.points[:, 0], result.frame.velocity[:, 0]
    behind = (x > 0.101 - 0.02) & (x < 0.101 - 0.004)
    assert velocity[behind].mean() == pytest.approx(-strain * speed, rel=0.02)
    assert np.abs(velocity[(x > 0.01) & (x < 0.101 - 0.045)]).max() < 0.02 * strain * speed
    assert max(abs(row["balance_error"]) for row in result.history) < 0.01
    assert result.history[-1]["rupture"] > 0.0


def broken_columns(built, sheet):
    """Largest x of the points with damage."""
    return sheet.points[built.to_numpy(built.rupture.damage) > 0.0, 0].max(initial=0.0)


def test_a_slit_opens_along_its_path_by_its_schedule():
    sheet, duration = square(21), 1e-3
    for share in (0.25, 0.75):
        damage = CutsInTime(Slit([(-0.01, 0.0513), (0.05, 0.0513), (0.11, 0.0513)], at=(0.0, duration)))
        solver = Explicit(share * duration, frames=1)
        built = run(pulled(sheet, solver, damage, stretch=0.0)).built
        reached = -0.01 + 0.12 * share
        assert broken_columns(built, sheet) == pytest.approx(reached, abs=2.1 * sheet.spacing)


def test_a_seam_opens_as_a_zip():
    """Each point of one side has its time; what is not due stays."""
    sheet = jittered(13)
    left = sheet.points[:, 0] < 0.05
    zip_times = sheet.points[left, 1] / 0.1
    damage = CutsInTime(Seam(left, ~left, at=zip_times))
    built = run(pulled(sheet, Relaxation(load_steps=2, tolerance=1e-4), damage, stretch=0.0)).built
    assert (built.to_numpy(built.rupture.damage) > 0.0).any()
    half = CutsInTime(Seam(left, ~left, at=np.where(zip_times < 0.5, 0.5, np.inf)))
    built = run(pulled(sheet, Relaxation(load_steps=2, tolerance=1e-4), half, stretch=0.0)).built
    torn = built.to_numpy(built.rupture.damage) > 0.0
    assert sheet.points[torn, 1].max() < 0.5 * 0.1 + 2.1 * sheet.spacing


def test_a_punched_hole_carries_no_pressure():
    """While a sheet is blown up a hole is punched: its points are free, and the force of the pressure is less by it."""
    sheet = square(21)
    centre = (0.05, 0.05)
    hole = np.linalg.norm(sheet.points - centre, axis=1) < 0.02
    loads = [Fixed(sheet.edges("all")), Pressure(2.0, follower=False)]
    damage = CutsInTime(Punch(centre, 0.02, at=0.01), beside=CriticalStretch(3.0))
    result = run(Simulation(sheet, LAW, Explicit(0.02, frames=2), loads=loads, damage=damage))
    built = result.built
    assert (built.to_numpy(built.rupture.damage)[hole] == 1.0).all()
    assert result.history[1]["largest_damage"] in (0.0, 1.0) and result.history[0]["largest_damage"] == 0.0
    whole = {tuple(t) for t in sheet.triangles[built.to_numpy(built.rupture.intact_faces) != 0].tolist()}
    assert not any(hole[list(t)].any() for t in whole)


def test_beside_a_damage_field_the_tips_of_a_slit_are_damaged():
    """The sheet is below its strength until the slit opens at the last load step; then damage is at its tips."""
    sheet, solver = square(17), Relaxation(tolerance=1e-5, load_steps=2)
    field = TearingEnergy(8.0, length=0.015, spared=sheet.edges("top", "bottom"))
    path = [(0.02, 0.053), (0.08, 0.053)]
    built = run(pulled(sheet, solver, CutsInTime(Slit(path, at=solver.duration), beside=field))).built
    damage = built.to_numpy(built.rupture.field)
    apart = np.min([np.linalg.norm(sheet.points - end, axis=1) for end in path], axis=0)
    assert damage.max() > 0.05
    assert apart[damage.argmax()] < 2.0 * sheet.spacing
    assert damage[apart > 0.03].max() == 0.0


def test_energies_balance_while_cuts_open_beside_a_damage_field():
    sheet, solver = square(21), Explicit(0.1, frames=10, damping=5.0)
    field = TearingEnergy(5.0, length=0.02, spared=sheet.edges("top", "bottom"))
    damage = CutsInTime([Slit(PATH, at=(0.03, 0.06)), Punch((0.05, 0.02), 0.008, at=0.05)], beside=field)
    result = run(pulled(sheet, solver, damage, stretch=0.4))
    assert max(abs(row["balance_error"]) for row in result.history) < 0.01
    assert result.history[-1]["rupture"] > 0.0


def test_a_run_goes_on_from_a_restart_bit_for_bit(tmp_path):
    sheet, solver = square(13), Explicit(0.02, frames=4)
    result = require_same_when_stopped(
        lambda: pulled(sheet, solver, CutsInTime(Slit(PATH, at=(0.004, 0.016)))), tmp_path, [2], precision=64
    )
    assert result.frame.damage.max() > 0.0


def test_a_cut_that_the_run_does_not_reach_has_a_note():
    result = run(pulled(square(9), Explicit(1e-3, frames=1), CutsInTime(Slit(PATH, at=1.0)), stretch=0.0))
    assert any("has not opened" in note for note in result.summary["notes"])
    assert result.built.to_numpy(result.built.rupture.damage).max() == 0.0


def test_a_scene_without_cuts_has_nothing_of_them():
    built = pulled(square(9), Explicit(1e-3), INTACT).build("cpu")
    assert not any("cut_" in stored.name for stored in built.context.fields)
    assert not any(
        "cut_bonds" in item.name
        for s in built.context.stages.values()
        for item in s.launches()
        if isinstance(item, Launch)
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Slit([(0.0, 0.0)], at=0.0), "Slit.path: expected two or more positions"),
        (lambda: Slit([(0.0, 0.0), (0.0, 0.0)], at=0.0), "no position twice"),
        (lambda: Slit([(0.0, 0.0), (float("nan"), 0.0)], at=0.0), "Slit.path"),
        (lambda: Slit(PATH, at=-1.0), "Slit.at = -1.0"),
        (lambda: Slit(PATH, at=(2.0, 1.0)), "Slit.at"),
        (lambda: Seam([0], [1], at=float("nan")), "Seam.at"),
        (lambda: Punch((0.0, 0.0), 0.0, at=1.0), "Punch.radius"),
        (lambda: Punch((0.0, 0.0), 1.0, at=-1.0), "Punch.at"),
        (lambda: CutsInTime([]), "CutsInTime.cuts"),
        (lambda: CutsInTime("slit"), "CutsInTime.cuts"),
        (lambda: CutsInTime(None), "CutsInTime.cuts"),
        (lambda: CutsInTime(Slit(PATH, at=0.0), beside=3.0), "CutsInTime.beside"),
        (lambda: CutsInTime(Slit(PATH, at=0.0), beside=CutsInTime(Slit(PATH, at=0.0))), "CutsInTime.beside"),
    ],
)
def test_wrong_cuts_are_refused(make, message):
    with refused(match=message):
        make()


@pytest.mark.parametrize(
    ("sheet", "cut", "message"),
    [
        (square(9), Slit([(1.0, 1.0), (2.0, 1.0)], at=0.0), "cuts no bond"),
        (square(9), Punch((1.0, 1.0), 0.01, at=0.0), "cuts no bond"),
        (square(9), [Slit(PATH, at=0.0), Slit(PATH, at=1.0)], "at=1.0.*: by then other cuts have opened all its bonds"),
        (square(9), [Slit(PATH, at=2.0), Slit(PATH, at=1.0)], "at=2.0.*: by then other cuts have opened all its bonds"),
        (square(9).cut(*PATH), Slit(PATH, at=1.0), "and is not cut before the run"),
        (square(9).inclusion((0.05, 0.05), 0.02), Slit(PATH, at=1.0), "passes through a rigid inclusion at"),
        (square(9), Seam([0, 1], [1, 2], at=0.0), "share points"),
        (square(9), Seam([0, 1], [9, 10], at=[0.0, 1.0, 2.0]), "a time for each of the 2 points"),
        (square(9), Seam([0], [80], at=0.0), "cuts no bond"),
        (square(9), Punch((0.0, 0.0, 0.0), 0.01, at=0.0), "Punch.centre"),
        (small_tube(), Slit(PATH, at=0.0), "expected a flat sheet"),
    ],
)
def test_cuts_that_the_sheet_does_not_have_are_refused(sheet, cut, message):
    with refused(match=message):
        Simulation(sheet, LAW, Explicit(1.0), damage=CutsInTime(cut)).build("cpu")


def test_arc_length_and_several_processes_are_refused():
    sheet = square(9)
    damage = CutsInTime(Slit(PATH, at=0.5), beside=TearingEnergy(5.0))
    with refused(match="expected TearingEnergy with ArcLength"):
        pulled(sheet, ArcLength(), damage).build("cpu")


def test_a_sheet_is_as_without_cuts_until_they_open():
    """The weights "auto" are those of a sheet without rupture: its deflection keeps its bits."""
    sheet, late = square(13), CutsInTime(Punch((0.02, 0.02), 0.01, at=2.0))
    loads, law = [Fixed(sheet.edges("all")), Pressure(5.0)], BondAssociated(NEO, horizon=3.15)
    found = [
        run(Simulation(sheet, law, Newton(preconditioner="direct"), loads=loads, damage=damage)).frame.displacement
        for damage in (None, late)
    ]
    assert found[1] == pytest.approx(found[0], abs=1e-9)


@pytest.mark.parametrize("at", [["a"], [[1.0], [2.0, 3.0]], [], None, [np.nan], [-1.0]])
def test_times_of_seams_are_refused_in_a_line(at):
    with pytest.raises(InputError, match=r"^Seam\.at = .*: expected"):
        Seam([0], [1], at=at)
