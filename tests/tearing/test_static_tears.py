"""A tearing energy in static equilibrium: alternate minimisation of the energy by displacement and damage."""

import numpy as np
import pytest
from helpers import refused, square, strain_energy
from resumed_runs import require_same_when_stopped
from small_runs import run, simulate

from warp_pd import (
    ArcLength,
    CriticalStretch,
    Fixed,
    Measure,
    Motion,
    NeoHookean,
    Newton,
    PointForce,
    Relaxation,
    Sheet,
    TearingEnergy,
    TensionField,
)
from warp_pd.measures import support_force
from warp_pd.output.progress import Progress
from warp_pd.statics import relaxation, static_rounds
from warp_pd.statics.tear_steps import TearSteps
from warp_pd.tearing.damage_field import SETTLED

SHEET = square(17).cut((-0.01, 0.053), (0.035, 0.053))
GRIPS = SHEET.edges("bottom", "top")
HILLY = square(17, thickness=lambda x, y: 1e-3 * (1.0 + 0.5 * np.sin(40.0 * x) * np.cos(25.0 * y)))
VARYING = HILLY.cut((-0.01, 0.053), (0.035, 0.053)), lambda x, y: 12.0 + 40.0 * x


def pulled(heights):
    """The notched square in plane, its top moved to some heights [m], one a load step."""
    top, bottom = SHEET.edges("top"), SHEET.edges("bottom")
    times = np.linspace(0.0, 1.0, len(heights) + 1)
    return [
        Motion(top, times, x=0.0, y=[0.0, *heights]), Fixed(bottom, "xy"), Fixed(np.arange(SHEET.size), "z")
    ]  # fmt: skip


def tearing(energy, **values):
    return TearingEnergy(energy, spared=GRIPS, **values)


def torn(heights, energy, solver=None, sheet=SHEET, **values):
    solver = solver or Newton(load_steps=len(heights))
    return run(sheet, solver, loads=pulled(heights), damage=tearing(energy, **values), weights="corrected")


def total_energy(built, displacement):
    """Energy of sheet and field [J]."""
    return strain_energy(built, displacement) + float(built.rupture.fracture.numpy().sum())


@pytest.mark.parametrize(("sheet", "energy"), [(SHEET, 12.0), VARYING], ids=["even", "thickness and energy vary"])
def test_the_energy_is_stationary_in_displacement_and_damage(sheet, energy):
    """Free points, and points whose damage grew; where there is none yet, damage would cost energy."""
    result = torn([0.03], energy, sheet=sheet, cut_profile=False)
    built = result.built
    u = built.to_numpy(built.state.displacement)
    field = built.rupture.field.numpy().copy()
    grown = np.flatnonzero(field > 2e-3)
    assert result.status == "finished" and len(grown) > 10 and 0.1 < field.max() < 0.8
    rng = np.random.default_rng(0)
    for _ in range(3):
        direction = rng.normal(size=u.shape)
        direction[GRIPS], direction[:, 2] = 0.0, 0.0
        ahead, behind = (total_energy(built, u + sign * 1e-6 * SHEET.spacing * direction) for sign in (1.0, -1.0))
        forces = np.abs(built.to_numpy(built.state.force)).max()
        assert abs(ahead - behind) / (2e-6 * SHEET.spacing) < 1e-5 * forces

    def energies(point, size=1e-3):
        """With less damage of a point, as it is, with more."""
        values = []
        for change in (-size, 0.0, size):
            changed = field.copy()
            changed[point] += change
            built.rupture.field.assign(changed)
            values.append(total_energy(built, u))
        return values

    for point in grown:
        less, here, more = energies(point)
        lowest_at = 0.5e-3 * (less - more) / (less + more - 2.0 * here)
        assert abs(lowest_at) < SETTLED
    for point in np.setdiff1d(np.flatnonzero(field == 0.0), GRIPS)[::9]:
        _, here, more = energies(point)
        assert more > here


def wedged(heights):
    """The notched square in plane, its top opened as by a wedge, so that the tear is stable: no bond decides alone."""
    times, loads = np.linspace(0.0, 1.0, len(heights) + 1), [Fixed(SHEET.edges("bottom"), "xy")]
    for point in SHEET.edges("top"):
        opening = 1.0 - SHEET.points[point, 0] / 0.1
        loads.append(Motion([point], times, x=0.0, y=[0.0, *(opening * height for height in heights)]))
    return [*loads, Fixed(np.arange(SHEET.size), "z")]


def test_relaxation_finds_the_tear_of_newtons_method():
    """Measured: 1.5e-4 and 6e-5."""
    newton, relaxation = (
        run(SHEET, solver, loads=wedged([0.03, 0.05]), damage=tearing(8.0), weights="corrected")
        for solver in (Newton(load_steps=2), Relaxation(load_steps=2, ramp_steps=100))
    )
    for result in (newton, relaxation):
        assert result.status == "finished" and result.summary["solve"]["rounds"] > 2
    fields = [result.built.rupture.field.numpy() for result in (newton, relaxation)]
    assert np.abs(fields[0] - fields[1]).max() < 1e-3
    assert newton.history[-1]["fracture"] > 1e-4
    assert newton.history[-1]["strain"] == pytest.approx(relaxation.history[-1]["strain"], rel=5e-4)


def test_a_static_solver_has_no_steps_to_find_damage_in():
    with refused("TearingEnergy.every_step = True: expected False with a static solver"):
        torn([0.03], 12.0, every_step=True)


def test_damage_stays_when_the_load_goes():
    result = torn([0.03, 0.0, 0.02], 12.0, cut_profile=False)
    largest = [row["largest_damage"] for row in result.history]
    assert result.status == "finished" and largest[1] > 0.1
    assert largest[1] == largest[2] == largest[3]


@pytest.mark.parametrize(("damage", "loose"), [(tearing(1.0), 10), (CriticalStretch(1.4, GRIPS), 0)])
def test_newton_tears_a_sheet_in_two(damage, loose):
    """Two halves that carry nothing, and points without bonds between them."""
    solver = Newton(load_steps=2)
    result = run(SHEET, solver, loads=pulled([0.002, 0.06]), damage=damage, weights="plain")
    assert result.status == "finished"
    assert result.history[-1]["strain"] < 1e-2 * result.history[-2]["strain"]
    assert (np.bitwise_or.reduce(result.built.law.intact.numpy(), axis=0) == 0).sum() >= loose
    assert np.abs(result.frame.displacement).max() < 0.1


@pytest.mark.parametrize("solver", [Newton(load_steps=2, most_cuts=2), Relaxation(load_steps=2, ramp_steps=100)])
def test_a_load_step_whose_tear_does_not_end_leaves_nothing_behind(monkeypatch, solver):
    monkeypatch.setattr(static_rounds, "MAX_ROUNDS", 2)
    result = torn([0.004, 0.04], 8.0, solver)
    assert result.status == "not converged" and result.summary["solve"]["rounds"] >= 2
    assert any("rupture went on" in note for note in result.summary["notes"])
    result.built.context.run("frame")
    for name in ("damage", "intact_faces"):
        np.testing.assert_array_equal(getattr(result.built.rupture, name).numpy(), getattr(result.frame, name))


def test_a_static_tear_resumes_bit_for_bit(tmp_path):
    loads, damage = pulled([0.02, 0.024, 0.028, 0.032]), tearing(8.0)
    solver = Newton(load_steps=4)
    result = require_same_when_stopped(
        lambda: simulate(SHEET, solver, loads=loads, damage=damage, weights="corrected"), tmp_path, [2, 3]
    )
    assert 0 < (result.frame.damage > 0.8).sum() and result.summary["solve"]["rounds"] > 4


def test_a_path_follows_a_tear_that_snaps_back():
    """A tall strip stores more than its tear takes, so the grips must go back while it runs.

    Newton's method at given loads finds the same until the tear runs, and then a strip torn in two.
    """
    sheet = Sheet.rectangle(0.1, 0.2, thickness=1e-3, density=1000.0, points=17).cut((-0.01, 0.1001), (0.03, 0.1001))
    top, energy, thickness = sheet.edges("top"), 12.0, 1e-3

    def ran(solver, height):
        moved = Motion(top, [0.0, 1.0], x=0.0, y=[0.0, height])
        return run(
            sheet, solver, loads=[moved, Fixed(sheet.edges("bottom"), "xy"), Fixed(np.arange(sheet.size), "z")],
            damage=TearingEnergy(energy, spared=sheet.edges("bottom", "top")), weights="corrected",
            measures=[Measure("pull", "N", lambda built, frame: support_force(built, top)[1])],
        )  # fmt: skip

    path, newton = ran(ArcLength(increment=0.1, most_steps=11), 0.06), ran(Newton(load_steps=7), 0.042)
    factor, strain, fracture, pull = (
        np.array([row[name] for row in path.history]) for name in ("load_factor", "strain", "fracture", "pull")
    )
    (found,) = path.summary["solve"]["found"]
    most = found["step"]
    assert found["kind"] == "maximum" and factor[most] == pytest.approx(0.667, abs=0.003)
    back = slice(most, most + 4)
    assert (np.diff(factor[back]) < 0.0).all() and (np.diff(strain[back]) < 0.0).all()
    # The given amount: a quarter of the energy of a tear as long as the field.
    length = path.built.rupture.length
    assert np.diff(fracture[back]) == pytest.approx(0.25 * energy * length * thickness, rel=2e-3)
    # The work of the grips goes into the sheet and the field, until bonds break: 0.7 % by the trapezoidal rule.
    work = np.cumsum(0.5 * (pull[1:] + pull[:-1]) * np.diff(factor)) * 0.06
    assert np.abs((strain + fracture)[1:] - work)[: most + 1].max() < 0.008 * work.max()
    before = newton.history[6]
    assert [before["strain"], before["fracture"]] == pytest.approx([strain[6], fracture[6]], rel=2e-2)
    assert newton.history[7]["strain"] < 0.1 * before["strain"]
    assert newton.history[7]["fracture"] > 10.0 * before["fracture"]


def test_a_path_ends_where_neither_load_nor_tear_goes_on(monkeypatch):
    """As before the last ligament, where no smaller step is found: here none is looked for."""
    sheet = Sheet.rectangle(0.1, 0.2, thickness=1e-3, density=1000.0, points=11).cut((-0.01, 0.1001), (0.03, 0.1001))
    monkeypatch.setattr(TearSteps, "alternate", lambda self, there, motion, here, *rest: here)
    loads = [
        Fixed(sheet.edges("bottom")), Fixed(np.arange(sheet.size), "z"),
        Motion(sheet.edges("top"), [0.0, 1.0], x=0.0, y=[0.0, 0.06]),
    ]  # fmt: skip
    damage = TearingEnergy(12.0, spared=sheet.edges("bottom", "top"))
    result = run(sheet, ArcLength(increment=0.1), loads=loads, damage=damage, weights="corrected")
    assert result.status == "ended early" and len(result.history) < 12
    assert any("neither the load nor the tear goes on" in note for note in result.summary["notes"])


def slack_behind(load):
    """A notched strip under a dead load; what lies behind the notch is slack."""
    sheet = Sheet.rectangle(0.1, 0.05, thickness=1e-3, density=1000.0, points=(21, 11)).cut(
        (-0.01, 0.0275), (0.03, 0.0275)
    )
    top, bottom = sheet.edges("top"), sheet.edges("bottom")
    loads = [
        Fixed(bottom), Fixed(np.arange(sheet.size), "z"), Fixed(top, "x"), PointForce(top, (0.0, load / len(top), 0.0))
    ]  # fmt: skip
    return sheet, {"loads": loads, "damage": TearingEnergy(20.0, spared=np.concatenate([top, bottom]))}


def test_a_path_sets_out_from_a_slack_sheet_and_keeps_its_tangents(monkeypatch):
    """A slack sheet takes as many Newton steps at any load, however small; rounds of a tear share tangents."""
    material = TensionField(NeoHookean(mu=1e5, bulk=1e7), slack_stiffness=1e3)
    sheet, parts = slack_behind(14.0)
    tangents = []
    linearise = TearSteps.linearise
    monkeypatch.setattr(TearSteps, "linearise", lambda self, *given: tangents.append(1) or linearise(self, *given))
    solver = ArcLength(increment=0.2, modes=0, most_steps=5, most_iterations=8)
    result = run(sheet, solver, material=material, weights="corrected", **parts)
    solve = result.summary["solve"]
    assert result.status == "finished" and solve["rounds"] > 4
    assert len(solve["load_steps"][0]["lattices"][0]["shares"]) > 8
    assert solve["found"][0]["kind"] == "maximum"
    assert len(tangents) < 0.75 * solve["iterations"]


def test_relaxation_advises_a_path_where_loads_tear_for_long(monkeypatch):
    """In the run, and in its notes; not where the grips move."""
    monkeypatch.setattr(relaxation, "SLOW", 1000)
    material = TensionField(NeoHookean(mu=1e5, bulk=1e7), slack_stiffness=1e3)
    sheet, parts = slack_behind(14.0)
    grips = {**parts, "loads": [*parts["loads"][:3], Motion(sheet.edges("top"), [0.0, 1.0], y=[0.0, 0.05])]}
    for given, advised in ((parts, True), (grips, False)):
        said = []
        monkeypatch.setattr(Progress, "note", lambda self, *lines, said=said: said.extend(lines))
        simulation = simulate(
            sheet, Relaxation(load_steps=4, most_steps=1900), material=material, weights="corrected", **given
        )
        notes = simulation.run(device="cpu", precision=64, reporter=Progress(quiet=True)).summary["notes"]
        for lines in (said, notes):
            assert any("ArcLength follows it past the largest load" in line for line in lines) == advised, lines


def test_sweeps_of_a_static_tear_are_one_launch():
    built = simulate(SHEET, Newton(load_steps=1), loads=pulled([0.02]), damage=tearing(8.0)).build("cpu", 64)
    launches = [launch for launch in built.context.stages["damage"].launches() if launch.name == "sweep"]
    assert built.rupture.sweeps > 50 and len(launches) == 1
