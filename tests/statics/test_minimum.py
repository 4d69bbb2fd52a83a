"""Notes on equilibria that are no minimum of the energy, against Euler's load, paths by arc length and eigenvalues."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import square
from small_runs import run, simulate

from warp_pd import (
    ArcLength,
    Fixed,
    Frames,
    Motion,
    NeoHookean,
    Newton,
    Plate,
    Pressure,
    Relaxation,
    Sheet,
    TensionField,
    Yeoh,
)
from warp_pd.statics.minimum import least_quotient

# Poisson's ratio zero: a strip then bends like a beam.
BEAM = NeoHookean(mu=1e5, bulk=2e5 / 3.0)


def notes(result):
    assert result.status == "finished", result.summary["message"]
    return [note for note in result.summary["notes"] if "is not stable" in note]


def pulled(sheet, by, *also):
    """Loads that move the right edge by a distance [m], with the left one held."""
    return [Fixed(sheet.edges("left")), Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, by], y=0.0, z=0.0), *also]


def test_a_strip_is_stable_up_to_eulers_load_and_when_it_has_buckled():
    length, thickness = 0.1, 1e-3
    strip = Sheet.rectangle(length, 0.01, thickness=thickness, density=1000.0, points=(21, 3))
    euler = np.pi**2 / 12.0 * (thickness / length) ** 2
    bump = np.zeros((strip.size, 3))
    bump[:, 2] = 1e-4 * np.sin(np.pi * strip.points[:, 0] / length)
    for share, start, found in ((0.9, None, 0), (1.1, None, 1), (1.1, bump, 0)):
        loads = pulled(strip, -share * euler * length, Plate())
        result = run(strip, Newton(), material=BEAM, loads=loads, initial_displacement=start)
        assert len(notes(result)) == found, (share, start is None)
    assert np.abs(result.frame.displacement[:, 2]).max() > 5e-5


@pytest.mark.parametrize("kind", ["multigrid", "direct"])
def test_a_flat_sheet_that_is_pushed_together(kind):
    sheet = square(21)
    flat = Fixed(np.setdiff1d(np.arange(sheet.size), sheet.edges("left", "right")), "z")
    solver = Newton(preconditioner=kind)
    (note,) = notes(run(sheet, solver, loads=pulled(sheet, -1e-3)))
    assert "along z" in note and "hold z" in note
    assert not notes(run(sheet, solver, loads=pulled(sheet, -1e-3, flat)))
    assert not notes(run(sheet, solver, loads=pulled(sheet, 1e-2)))
    slack = run(
        sheet, Newton(), material=TensionField(NeoHookean(1e3, 1e5), slack_stiffness=1.0), loads=pulled(sheet, -1e-3)
    )
    assert not notes(slack)


def test_the_note_comes_where_a_path_counts_a_negative_eigenvalue(tmp_path):
    """A membrane under follower pressure, between the maximum and the minimum of the pressure and beside them."""
    sheet = square(9)
    loads = [Fixed(sheet.edges("all")), Pressure(5e3)]
    parts = {"material": Yeoh(c10=5e4, c30=5.0), "weights": "corrected"}
    path = simulate(sheet, ArcLength(), loads=loads, **parts).run(device="cpu", out=tmp_path, usd=False, pictures=False)
    unstable = np.array([row["unstable"] for row in path.history])
    middle, last = np.flatnonzero(unstable)[len(np.flatnonzero(unstable)) // 2], len(unstable) - 1
    for index in (3, middle, last):
        load = replace(loads[1], value=5e3 * path.history[index]["load_factor"])
        start = Frames(tmp_path)[index].displacement
        result = run(sheet, Newton(), loads=[loads[0], load], initial_displacement=start, **parts)
        assert np.abs(result.frame.displacement - start).max() < 1e-6
        assert len(notes(result)) == unstable[index]


def test_relaxation_sees_short_waves():
    sheet = square(13)
    (note,) = notes(run(sheet, Relaxation(), loads=pulled(sheet, -1e-3)))
    assert note.startswith("Relaxation: ") and "along z" in note
    for by in (1e-2, 0.0):
        assert not notes(run(sheet, Relaxation(), loads=pulled(sheet, by)))
    # Published weights have no energy.
    assert not notes(run(sheet, Relaxation(), loads=pulled(sheet, -1e-3), weights="published"))


def test_a_finished_run_that_is_resumed_says_it_again(tmp_path):
    sheet = square(9)
    scene = simulate(sheet, Newton(load_steps=2), loads=pulled(sheet, -1e-3))
    options = {"device": "cpu", "out": tmp_path, "usd": False, "pictures": False}
    said = notes(scene.run(**options))
    assert len(said) == 1 and notes(scene.run(**options, resume=True)) == said


@pytest.mark.parametrize("lowest", [-0.1, 0.2])
def test_the_least_quotient_is_the_lowest_eigenvalue(lowest):
    rng = np.random.default_rng(1)
    modes, _ = np.linalg.qr(rng.normal(size=(40, 40)))
    stiffness = modes * np.array([lowest, *np.geomspace(1.0, 100.0, 39)]) @ modes.T
    product, jacobi = (lambda x: stiffness @ x), (lambda r: r / np.diag(stiffness))
    x, value = least_quotient(product, jacobi, rng.normal(size=40), 400, -np.inf)
    # A positive one is of no interest.
    assert value == pytest.approx(lowest, rel=1e-6 if lowest < 0.0 else 0.3)
    assert x @ stiffness @ x == pytest.approx(value, abs=1e-9)
    assert np.linalg.norm(x) == pytest.approx(1.0)
    _, early = least_quotient(product, lambda r: np.linalg.solve(stiffness, r), rng.normal(size=40), 10, 0.0)
    assert (early < 0.0) == (lowest < 0.0)
