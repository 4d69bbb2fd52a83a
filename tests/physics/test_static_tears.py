"""A tearing energy in static equilibrium: alternate minimisation of the energy by displacement and damage."""

import numpy as np
import pytest
from helpers import square, strain_energy
from resumed_runs import require_same_when_stopped
from small_runs import run, simulate

from warp_pd import CriticalStretch, Fixed, Motion, Newton, Relaxation, TearingEnergy
from warp_pd.parts.tearing_energy import SETTLED
from warp_pd.solvers import static_rupture

SHEET = square(17).cut((-0.01, 0.053), (0.035, 0.053))
GRIPS = SHEET.edges("bottom", "top")


def pulled(heights):
    """The notched square in plane, its top moved to some heights [m], one a load step."""
    top, bottom = SHEET.edges("top"), SHEET.edges("bottom")
    times = np.linspace(0.0, 1.0, len(heights) + 1)
    return [
        Motion(top, times, x=0.0, y=[0.0, *heights]), Fixed(bottom, "xy"), Fixed(np.arange(SHEET.size), "z")
    ]  # fmt: skip


def tearing(energy, **values):
    return TearingEnergy(energy, spared=GRIPS, **values)


def torn(heights, energy, solver=None, **values):
    solver = solver or Newton(load_steps=len(heights))
    return run(SHEET, solver, loads=pulled(heights), damage=tearing(energy, **values), weights="corrected")


def total_energy(built, displacement):
    """Energy of sheet and field [J]."""
    return strain_energy(built, displacement) + float(built.rupture.fracture.numpy().sum())


def test_the_energy_is_stationary_in_displacement_and_damage():
    """Free points, and points whose damage grew; where there is none yet, damage would cost energy."""
    result = torn([0.03], 12.0, cut_profile=False)
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


def test_relaxation_finds_the_tear_of_newtons_method():
    heights, solver = [0.02, 0.026], Relaxation(load_steps=2, ramp_steps=100)
    newton, relaxation = torn(heights, 8.0), torn(heights, 8.0, solver)
    for result in (newton, relaxation):
        assert result.status == "finished" and result.summary["solve"]["rounds"] > 2
    fields = [result.built.rupture.field.numpy() for result in (newton, relaxation)]
    assert np.abs(fields[0] - fields[1]).max() < 0.02
    assert newton.history[-1]["strain"] == pytest.approx(relaxation.history[-1]["strain"], rel=5e-3)


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
    monkeypatch.setattr(static_rupture, "MAX_ROUNDS", 2)
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
