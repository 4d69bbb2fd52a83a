"""Paths of equilibria: limit points, snap-back, bifurcation, against closed forms."""

from itertools import pairwise

import h5py
import numpy as np
import pytest
from helpers import refused, square
from scipy.optimize import brentq
from small_runs import run, simulate

from warp_pd import (
    ArcLength,
    BodyPath,
    EnclosedGas,
    EnclosedVolume,
    Fixed,
    Frames,
    MooneyRivlin,
    Motion,
    NeoHookean,
    Newton,
    Pressure,
    Reaction,
    RigidBody,
    Sphere,
    Yeoh,
)
from warp_pd.scenes import balloon_paths
from warp_pd.scenes.balloon import exact_pressure
from warp_pd.statics.corrector import Origin, Point, changes, norm
from warp_pd.statics.stability import extreme


def snapping(solver, pressure=5e3, contact=None, **options):
    sheet = square(9)
    loads = [Fixed(sheet.edges("all")), Pressure(pressure)]
    simulation = simulate(
        sheet, solver, material=Yeoh(c10=5e4, c30=5.0), weights="corrected", loads=loads, contact=contact
    )
    return simulation.run(device="cpu", **options)


def kinds(result):
    return [found["kind"] for found in result.summary["solve"]["found"]]


def test_the_corrector_turns_no_family_inside_out():
    """From rough predictions of a sheet pushed together it comes back to the path, as from a smooth one.

    Whole steps throw families inside out, where most of these searches diverge.
    """
    sheet = square(9)
    push = Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, -0.03], y=0.0)
    loads = [Fixed(np.arange(sheet.size), "z"), Fixed(sheet.edges("left")), push]
    result = run(sheet, ArcLength(increment=0.2, modes=0), horizon=1.5, loads=loads)
    solver, level = result.built.solver, result.built.solver.levels[0]
    start = solver.position()
    back = -solver.tangent_at(1.0, 1.0)
    rate, length = -1.0 / norm(back), 0.4 * sheet.spacing
    random, found = np.random.default_rng(1), []
    for roughness in (0.0, *[0.6] * 6):
        rough = np.where(level.held, 0.0, random.normal(size=start.shape))
        direction = back / norm(back) + roughness * rough / norm(rough)
        factor, entry = solver.correct(Origin(start, direction / norm(direction), 1.0, rate), length, Quiet())
        assert entry["converged"], entry["residuals"]
        assert len(entry["shares"]) == len(entry["residuals"]) - 1
        found.append(corners(sheet, solver.position()).min())
        assert 0.0 < factor < 1.0
    assert min(found) > 0.9 * found[0] > 0.6


class Quiet:
    """A sink that takes no progress."""

    def progress(self, *arguments):
        """Show nothing."""


def corners(sheet, displacement):
    """Areas of the triangles over those at rest, negative where one is inside out."""
    a, b, c = (np.stack([sheet.points, sheet.points + displacement[:, :2]])[:, sheet.triangles[:, k]] for k in range(3))
    rest, now = np.linalg.det(np.stack([b - a, c - a], axis=-1))
    return now / rest


def test_a_path_passes_both_limit_points_and_ends_where_newtons_method_does(tmp_path):
    result = snapping(ArcLength(), out=tmp_path, view=True)
    factors = np.array([row["load_factor"] for row in result.history])
    assert result.status == "finished" and kinds(result) == ["maximum", "minimum"]
    falls = np.flatnonzero(np.diff(factors) < 0.0)
    assert (np.diff(falls) == 1).all() and factors[-1] == 1.0
    # Unstable between the limit points and nowhere else; frames tell the load factor as their time.
    for row in result.history[1:]:
        assert row["time"] == row["load_factor"]
    (first, second) = [found["step"] for found in result.summary["solve"]["found"]]
    unstable = [row["unstable"] for row in result.history]
    assert unstable == [float(first <= k < second) for k in range(len(unstable))]
    # Limit points are frames: the load is larger, or smaller, than before and after.
    assert falls.tolist() == list(range(first, second))
    notes = [note for note in result.summary["notes"] if note.startswith("ArcLength: a limit point at load factor 0.")]
    assert "a maximum of the load" in notes[0] and "a minimum of the load" in notes[1]
    frames = Frames(tmp_path)
    assert frames.times.tolist() == factors.tolist()
    with h5py.File(tmp_path / "frames.vtkhdf") as stored:
        assert stored["VTKHDF/Steps/Values"][:].tolist() == list(range(len(factors)))
    assert (tmp_path / "view.html").is_file()
    jumped = snapping(Newton(load_steps=15))
    assert result.frame.displacement == pytest.approx(jumped.frame.displacement, abs=1e-6)
    (note,) = [note for note in jumped.summary["notes"] if "limit point" in note]
    assert "ArcLength" in note


def test_a_body_stops_a_snap():
    """The sheet passes the maximum of the pressure, falls against a ball above it, and takes more pressure again."""
    ball = RigidBody(Sphere(1.0), BodyPath([0.0], [(0.05, 0.05, 0.58)]))
    path, jumped = (snapping(solver, pressure=3.6e3, contact=ball) for solver in (ArcLength(), Newton(load_steps=12)))
    free, force = (np.array([row[name] for row in path.history]) for name in ("load_factor", "body_force_z"))
    assert path.status == "finished" and kinds(path) == ["maximum", "minimum"]
    first, second = (found["step"] for found in path.summary["solve"]["found"])
    assert (force[: first + 1] == 0.0).all() and (force[second:] > 0.0).all() and free[-1] == 1.0
    assert free[first + 1] < free[first] and 1.0 in [row["unstable"] for row in path.history]
    assert path.frame.displacement == pytest.approx(jumped.frame.displacement, abs=1e-6)
    assert path.history[-1]["unstable"] == 0.0


def test_a_piston_behind_a_soft_spring_snaps_back():
    """Stroke and pressure fall together; load factors of the limit points follow from the closed form."""
    scene = balloon_paths.build(points=6, control="piston")
    result = scene.run(device="cpu")
    assert result.status == "finished"
    (volume,) = [load for load in scene.loads if isinstance(load, EnclosedVolume)]
    (_, empty), (_, full) = volume.volume
    stretch = np.linspace(1.001, 6.0, 20001)
    lacking = empty / (4.0 / 3.0 * np.pi * 0.1**3)
    stroke = empty * stretch**3 + exact_pressure(stretch, 0.1) / lacking / volume.stiffness
    factors = (stroke - empty) / (full - empty)
    exact = factors[np.flatnonzero(np.diff(np.sign(np.diff(factors)))) + 1]
    found = result.summary["solve"]["found"]
    assert [entry["kind"] for entry in found] == ["maximum", "minimum"]
    assert [entry["load_factor"] for entry in found] == pytest.approx(exact, rel=5e-3)
    back = [(a, b) for a, b in pairwise(result.history) if b["load_factor"] < a["load_factor"]]
    assert len(back) > 2 and all(b["pressure"] < a["pressure"] and b["volume"] > a["volume"] for a, b in back)


def test_a_bifurcation_is_named_where_the_load_does_not_turn():
    """One free point of a sheet in plane strain rates: it leaves the plane where the stresses S11 + S22 are zero."""
    sheet = square(3)
    x, y = sheet.points[:, 0], sheet.points[:, 1]
    loads = [Fixed(sheet.edges("all"), "z")]
    for k in range(3):
        at = 0.05 * k
        for along, here, rate in (("x", x, 0.5), ("y", y, -0.3)):
            chosen = np.intersect1d(np.flatnonzero(np.isclose(here, at)), np.asarray(sheet.edges("all")))
            loads.append(Motion(chosen, times=[0.0, 1.0], **{along: [0.0, rate * at]}))

    def sum_of_stresses(s):
        a, b = 1.0 + 0.5 * s, 1.0 - 0.3 * s
        return 2.0 - (a**-2 + b**-2) / (a * b) ** 2

    result = run(
        sheet, ArcLength(increment=0.05), material=MooneyRivlin(5e4), weights="plain", horizon=1.5, loads=loads
    )
    assert result.status == "finished" and kinds(result) == ["bifurcation"]
    (found,) = result.summary["solve"]["found"]
    assert found["load_factor"] == pytest.approx(brentq(sum_of_stresses, 0.2, 1.0), rel=2e-3)
    assert [row["unstable"] for row in result.history][:: len(result.history) - 1] == [0.0, 1.0]
    assert any("a bifurcation at load factor" in note for note in result.summary["notes"])


def test_places_between_two_points_of_a_path():
    """Cubics through both points are exact for cubic paths: s^3 / 3 - s of the arc length s."""

    def at(s, step, negative, lowest):
        return Point(step, s**3 / 3.0 - s, s**2 - 1.0, negative, lowest)

    bifurcation, minimum = changes(at(0.5, 3, 0, [0.1, 3.0]), at(2.0, 4, 2, [-1.0, -0.5]), 1.5)
    assert minimum.kind == "minimum" and 0.5 + 1.5 * minimum.place == pytest.approx(1.0, abs=1e-12)
    assert (bifurcation.kind, bifurcation.eigenvalues) == ("bifurcation", 1)
    assert bifurcation.place == pytest.approx(0.1 / 1.1)
    assert changes(at(1.5, 3, None, []), at(2.0, 4, None, []), 0.5) == []


@pytest.mark.parametrize(("first", "other"), [(0.99, -0.005), (0.01, 1.005), (0.5, -0.4), (0.5, 1.4)])
def test_the_limit_point_is_the_one_between_two_points_of_a_path(first, other):
    """A cubic with two extrema, of which one lies just outside."""
    before, after = (
        Point(step, x**3 / 3.0 - 0.5 * (first + other) * x**2 + first * other * x, (x - first) * (x - other), None, [])
        for step, x in ((1, 0.0), (2, 1.0))
    )
    (found,) = changes(before, after, 1.0)
    assert found.place == pytest.approx(first, abs=1e-12)
    assert found.kind == ("minimum" if first > other else "maximum")


@pytest.mark.parametrize(
    "load",
    [
        Pressure(500.0, follower=False),
        EnclosedGas(chamber=1e-4, amount=[(0.0, 1.0), (1.0, 1.5)]),
        EnclosedVolume(((0.0, 0.0), (1.0, 5e-5)), stiffness=1e9),
    ],
    ids=["pressure", "gas", "volume"],
)
def test_the_support_carries_the_load_of_every_point_of_a_path(load):
    """A held rim carries the pressure times the area that it encloses."""
    sheet = square(9)
    rim, area = sheet.edges("all"), float(np.prod(np.ptp(sheet.points, axis=0)))
    loads = [Fixed(rim), load, Reaction(rim, "rim")]
    result = run(sheet, ArcLength(increment=0.5), material=MooneyRivlin(1e5), weights="corrected", loads=loads)
    assert result.status == "finished" and len(result.history) > 2
    for row in result.history[1:]:
        pressure = row["pressure"] if "pressure" in row else load.value * row["load_factor"]
        assert row["rim_z"] == pytest.approx(-pressure * area, rel=1e-6)


def test_what_no_path_can_follow_is_told():
    sheet = square(5)
    with refused(match="expected a load or a motion that changes with the load factor"):
        run(sheet, ArcLength(), loads=[Fixed(sheet.edges("all")), Pressure(1.0, ramp=[(0.0, 0.0)])])


def test_a_path_that_is_not_over_says_so():
    result = snapping(ArcLength(most_steps=3, switch=1))
    assert result.status == "finished" and len(result.history) == 4
    for words in ("followed for most_steps = 3", "met fewer bifurcations"):
        assert any(words in note for note in result.summary["notes"])


def test_a_path_that_ends_early_says_why():
    result = snapping(ArcLength(most_iterations=1, most_cuts=0, tolerance=1e-12))
    assert result.status == "not converged"
    texts = [result.summary["message"], *result.summary["notes"]]
    assert sum("even the shortest step failed, as Newton's method ended" in text for text in texts) == 2
    result = snapping(ArcLength(increment=0.5, most_cuts=0))
    assert result.status == "ended early" and "lies on another branch" in result.summary["message"]


def test_a_path_may_begin_where_the_start_is_no_equilibrium():
    """A prestretched sheet with two free edges contracts first; that is not the direction of the path."""
    sheet = square(9).prestretched(1.2)
    loads = [
        Fixed(sheet.edges("left")),
        Motion(sheet.edges("right"), times=[0.0, 1.0], x=[0.0, 0.03], y=0.0, z=0.0),
    ]
    result = run(sheet, ArcLength(), material=MooneyRivlin(5e4), weights="corrected", loads=loads)
    newton = run(sheet, Newton(), material=MooneyRivlin(5e4), weights="corrected", loads=loads)
    assert result.status == "finished" and result.history[-1]["load_factor"] == 1.0
    assert result.frame.displacement == pytest.approx(newton.frame.displacement, abs=1e-7)


def test_a_path_beside_a_constant_load_begins_along_the_rising_one():
    sheet = square(9)
    loads = [
        Fixed(sheet.edges("all")),
        Pressure(-10.0, follower=False, ramp=[(0.0, 1.0)]),
        Pressure(20.0),
    ]
    ends = [
        simulate(sheet, solver, material=NeoHookean(mu=1e5, bulk=1e7), loads=loads).run(device="cpu", precision=64)
        for solver in (ArcLength(), Newton())
    ]
    assert [end.status for end in ends] == ["finished", "finished"]
    middle = [end.frame.displacement[40, 2] for end in ends]
    assert middle[0] > 0.0
    assert middle[0] == pytest.approx(middle[1], rel=1e-6)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_extreme_eigenvalues_of_a_matrix_with_few_rows(size):
    """A few free components leave fewer rows than ARPACK takes."""
    expected = np.linspace(-1.0, 3.0, size)
    axes = np.linalg.qr(np.random.default_rng(0).normal(size=(size, size)))[0]
    matrix = axes * expected @ axes.T
    for which, value in (("SR", expected[0]), ("LM", expected[-1])):
        values, vectors = extreme(lambda x: matrix @ x, size, 1, which)
        np.testing.assert_allclose(values, [value], atol=1e-6)
        np.testing.assert_allclose(matrix @ vectors[:, 0], value * vectors[:, 0], atol=1e-6)
