"""Tears in implicit steps: beside explicit steps, energy, irreversible damage, precision, restarts, ends."""

import itertools

import numpy as np
import pytest
from helpers import NEO, refused, square
from resumed_runs import require_same_when_stopped
from small_runs import run

from warp_pd import (
    Explicit,
    Fixed,
    Implicit,
    Maxwell,
    MooneyRivlin,
    Motion,
    Plate,
    PointForce,
    Reaction,
    Sheet,
    Simulation,
    TearingEnergy,
    Visco,
)

WIDTH, HEIGHT, MU = 0.04, 0.02, 4e3
CUT = (-0.01, 0.50001 * HEIGHT), (0.012, 0.50001 * HEIGHT)
STRIP, COARSE = (
    Sheet.rectangle(WIDTH, HEIGHT, thickness=1e-3, density=1000.0, points=points).cut(*CUT)
    for points in ((25, 13), (17, 9))
)
NOTCHED = square(17).cut((-0.01, 0.053), (0.035, 0.053))


def strip(solver, speed, tau, pulled=0.3, sheet=STRIP, back=()):
    """A notched strip of viscoelastic rubber between grips that part at a speed [m/s] by a share of its height."""
    duration, bottom, top = pulled * HEIGHT / speed, sheet.edges("bottom"), sheet.edges("top")
    path = [0.0, pulled * HEIGHT, *back]
    times = duration * np.arange(len(path))
    return Simulation(
        sheet,
        Visco(MooneyRivlin(0.5 * MU, 0.0), horizon=2.015, branches=[Maxwell(0.5 * MU, tau)]),
        solver(times[-1]),
        loads=[
            Fixed(bottom, "xy"), Motion(top, times, x=0.0, y=path), Fixed(np.arange(sheet.size), "z"),
            Reaction(top, "pull"),
        ],
        damage=TearingEnergy(8.0, spared=sheet.edges("bottom", "top")),
    )  # fmt: skip


def slow(tau=20.0, sheet=STRIP, **changes):
    """Grips that part at 0.1 mm/s."""
    solver = {"frames": 6, "steps": 60, "inertia": False, **changes}
    return strip(lambda duration: Implicit(duration, **solver), 1e-4, tau, sheet=sheet)


def test_a_slow_tear_beside_explicit_steps_at_100_times_the_speed():
    """Without inertia to speak of, a speed over the relaxation time is all that matters."""
    found = slow(inertia=True).run(device="cpu", precision=64)
    fast = strip(lambda duration: Explicit(duration, frames=6), 1e-2, 0.2).run(device="cpu", precision=64)
    stiff = slow(2000.0, steps=30).run(device="cpu", precision=64)
    pulls, wanted, unrelaxed = (np.array([row["pull_y"] for row in r.history]) for r in (found, fast, stiff))
    np.testing.assert_allclose(pulls, wanted, atol=0.01 * wanted.max())
    assert unrelaxed.max() > 1.15 * wanted.max()
    assert pulls[-1] < 0.5 * pulls.max()
    for name, share in {"fracture": 0.01, "viscous": 0.01, "external": 0.01}.items():
        assert found.history[-1][name] == pytest.approx(fast.history[-1][name], rel=share)
    assert abs(found.history[-1]["balance_error"]) < 1e-3


@pytest.mark.parametrize("precision", [64, 32])
def test_the_energy_that_a_tear_takes(precision):
    """To the end, when the strip is in two pieces: the energy of the field and of bonds is what the grips put in."""
    result = strip(
        lambda duration: Implicit(duration, frames=20, steps=80, inertia=False), 1e-4, 20.0, pulled=0.55
    ).run(device="cpu", precision=precision)  # fmt: skip
    assert result.status == "finished"
    last, most = result.history[-1], max(row["pull_y"] for row in result.history)
    assert abs(last["balance_error"]) < 1e-3
    assert abs(last["pull_y"]) < 1e-3 * most
    assert last["external"] == pytest.approx(last["rupture"] + last["viscous"], rel=0.01)


def test_damage_does_not_heal():
    """Grips that part and come back: the damage stays, and the way back takes less force."""
    scene = strip(
        lambda duration: Implicit(duration, frames=20, steps=40, inertia=False), 1.0, 100.0, 0.3, COARSE,
        back=[0.15 * HEIGHT],
    )  # fmt: skip
    fields = []
    watch = type("Watch", (), {"write": lambda s, f: fields.append(f.damage.copy()),
                               "save": lambda s: None, "close": lambda s: None})  # fmt: skip
    history = scene.run(device="cpu", precision=64, writers=[watch()]).history
    assert min(np.min(after - before) for before, after in itertools.pairwise(fields)) >= 0.0
    energies, pulls = (np.array([row[name] for row in history]) for name in ("fracture", "pull_y"))
    assert np.diff(energies).min() >= 0.0
    assert energies[20] == energies[10] > 0.0
    assert pulls[20] < 0.6 * pulls[5]


def test_steps_are_as_short_as_the_damage_grows():
    """With few steps asked for, those in which the strip tears are shorter, and end alike."""
    coarse, fine = (slow(sheet=COARSE, frames=1, steps=steps).run(device="cpu", precision=64) for steps in (1, 60))
    assert coarse.summary["steps"] > 6
    assert coarse.summary["solve"]["refused"] > 0
    assert coarse.history[-1]["fracture"] == pytest.approx(fine.history[-1]["fracture"], rel=0.02)


@pytest.mark.parametrize(
    "solver", [{"inertia": True, "steps": 12}, {"steps": 12}, {"tolerance": 1e-3, "steps": None}]
)  # fmt: skip
def test_a_tear_continues_from_the_middle_bit_for_bit(solver, tmp_path):
    require_same_when_stopped(lambda: slow(sheet=COARSE, **solver), tmp_path, [4], 64)


def dead_load(**solver):
    top, bottom = NOTCHED.edges("top"), NOTCHED.edges("bottom")
    loads = [
        PointForce(top, (0.0, 0.07, 0.0), ramp=((0.0, 0.0), (1.0, 1.0))), Fixed(bottom, "xy"),
        Fixed(np.arange(NOTCHED.size), "z"), Fixed(top, "x"),
    ]  # fmt: skip
    damage = TearingEnergy(12.0, spared=NOTCHED.edges("bottom", "top"))
    return run(NOTCHED, Implicit(1.0, frames=2, steps=10, **solver), loads=loads, damage=damage)


def test_a_tear_that_does_not_stop_needs_inertia():
    stopped = dead_load(inertia=False)
    assert stopped.status == "diverged"
    assert "tears the sheet in two, which takes inertia = True" in stopped.summary["message"]
    torn = dead_load()
    assert torn.status == "finished"
    assert torn.history[-1]["kinetic"] > torn.history[-1]["fracture"] > 0.0


def test_what_tears_in_implicit_steps_do_not_take():
    solver = Implicit(1.0, steps=10)
    with refused("TearingEnergy.every_step = True: expected False with a static solver or implicit steps"):
        run(NOTCHED, solver, damage=TearingEnergy(12.0, every_step=True))
    with refused("loads = Plate: damage not supported in equilibrium; expected Explicit"):
        run(NOTCHED, solver, damage=TearingEnergy(12.0), loads=[Plate()], material=NEO)
