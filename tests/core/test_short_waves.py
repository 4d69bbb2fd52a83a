"""Waves of a few spacings, which families average: a tube with free ends under pressure has them, and is noted."""

import numpy as np
import pytest
from helpers import square
from small_runs import simulate

from warp_pd import BondAssociated, Explicit, Fixed, Measure, MooneyRivlin, Newton, Pressure, Sheet, Simulation

C10, RADIUS, LENGTH, THICKNESS = 1e5, 0.02, 0.03, 5e-4


def tube(points, stretch, held=""):
    """A tube under the pressure that stretches it around; free along unless `held` is "z"."""
    shorter = stretch**-0.5
    stress = 2.0 * C10 * (stretch - stretch**-3 * shorter**-2)
    pressure = THICKNESS * stress / (RADIUS * stretch * shorter)
    sheet = Sheet.tube(RADIUS, LENGTH, thickness=THICKNESS, density=1000.0, points=points)
    on_x = sheet.where(lambda x, y, z: abs(y) < 1e-9)
    on_y = sheet.where(lambda x, y, z: abs(x) < 1e-9)
    ends = sheet.edges("bottom", "top") if held else sheet.edges("bottom")
    result = Simulation(
        sheet, BondAssociated(MooneyRivlin(C10), horizon=2.015), Newton(load_steps=2),
        loads=[Fixed(ends, "z"), Fixed(on_x, "y"), Fixed(on_y, "x"), Pressure(pressure)],
    ).run(device="cpu")  # fmt: skip
    top = (sheet.positions + result.frame.displacement)[sheet.edges("top"), 2].mean()
    return top / (LENGTH * shorter), result.summary["notes"]


@pytest.mark.parametrize("stretch", [1.05, 1.1])
def test_waves_of_a_free_tube_are_noted(stretch):
    length, notes = tube(32, stretch)
    assert length < 0.99
    assert len(notes) == 1 and notes[0].startswith("short waves: ")


def test_tubes_that_have_no_short_waves_have_no_note():
    length, notes = tube(48, 1.1)
    assert length == pytest.approx(1.0, abs=0.01) and not notes
    assert not tube(32, 1.1, held="z")[1]


@pytest.mark.parametrize("points", [9, 15])
def test_dome_is_no_short_wave(points):
    sheet = square(points)
    result = Simulation(
        sheet, BondAssociated(MooneyRivlin(C10)), Newton(), loads=[Fixed(sheet.edges("all")), Pressure(1500.0)]
    ).run(device="cpu")
    assert np.abs(result.frame.displacement[:, 2]).max() > 0.01
    assert not result.summary["notes"]


def test_an_interrupted_run_does_not_look_for_waves(monkeypatch):
    """The look at a large sheet takes longer than an interrupted run has."""

    def look(*_):
        raise AssertionError

    monkeypatch.setattr("warp_pd.run.checks._waves", look)

    def stop(built, frame):
        if frame.index == 1:
            raise KeyboardInterrupt
        return 0.0

    scene = simulate(square(7), Explicit(1e-3, frames=2), measures=[Measure("stop", "1", stop)])
    assert scene.run(device="cpu").status == "interrupted"
