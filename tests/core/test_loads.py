"""Loads: body force, point force, dead and follower pressure, each against mechanics."""

import re

import numpy as np
import pytest
from curved_sheets import small_sphere, small_tube, tear
from helpers import build, jittered, refused, sever, soften, square, uniform, without_triangles
from small_runs import run, simulate

from warp_pd import (
    BodyForce,
    BondAssociated,
    CriticalStretch,
    Explicit,
    Fixed,
    NeoHookean,
    Newton,
    Place,
    PointForce,
    Pressure,
    Sheet,
    Simulation,
    TearingEnergy,
    Yeoh,
    placed,
    together,
)
from warp_pd.geometry.surface import cells_of, other_diagonals, pressed_weights
from warp_pd.geometry.triangulation import boundary_edges, doubled_normals
from warp_pd.measures import support_force


@pytest.mark.parametrize("ramp", [None, [(0.0, 0.0), (0.1, 1.0)]])
def test_body_force_makes_the_sheet_fall(ramp):
    result = run(
        square(5), solver=Explicit(0.1, frames=4, safety=0.05), loads=[BodyForce((0.0, 0.0, -9810.0), ramp=ramp)]
    )
    fall = 0.5 * 9.81 * 0.1**2 if ramp is None else 9.81 * 0.1**2 / 6.0
    assert result.frame.displacement[:, 2] == pytest.approx(-fall, rel=2e-2)
    assert abs(result.history[-1]["balance_error"]) < 1e-2


def test_loads_on_a_sheet_of_any_thickness_accelerate_as_they_should():
    """Gravity all points alike, whatever their mass; a force on points of one thickness these alike, by their areas."""
    sheet = square(9, thickness=lambda x, y: 1e-3 * (1.0 + 5.0 * x + 3.0 * y))
    built = build(sheet, loads=[BodyForce((10.0, 20.0, -9810.0))])
    acceleration = built.to_numpy(built.state.external) / built.to_numpy(built.state.mass)[:, None]
    assert acceleration == pytest.approx(np.tile([0.01, 0.02, -9.81], (sheet.size, 1)), rel=1e-12)
    sheet = square(9)
    right = sheet.edges("right")
    built = build(sheet, loads=[PointForce(right, (1.0, 0.0, 2.0))])
    mass = built.to_numpy(built.state.mass)[right]
    pushed = built.to_numpy(built.state.external)[right]
    assert np.ptp(mass) > 0.0
    assert pushed == pytest.approx(np.outer(mass / mass.sum(), [1.0, 0.0, 2.0]), rel=1e-12)


@pytest.mark.parametrize(
    ("make", "on"),
    [
        (square, "points"),
        (square, "triangles"),
        (jittered, "triangles"),
        (lambda n: square(n).hole((0.05, 0.05), 0.02), "triangles"),
        (small_sphere, "triangles"),
    ],
)
def test_the_matrix_of_a_follower_pressure_in_time_is_the_derivative_of_its_force(make, on):
    sheet = make(7)
    start = 0.2 * sheet.spacing * np.random.default_rng(1).normal(size=(sheet.size, 3))
    here = start if sheet.frames is not None else uniform(sheet, [[1.3, 0.2], [0.1, 0.8], [0.4, -0.3]]) + start
    built = build(sheet, loads=[Pressure(5.0, ramp=[(0.0, 0.3), (1.0, 0.3)], on=on)], initial_displacement=here)
    (load,) = [part for part in built.parts if part.label == "loads: Pressure"]
    along = np.random.default_rng(0).normal(size=here.shape)

    def force(displacement):
        built.state.displacement.assign(displacement)
        built.context.run("setup")
        return built.to_numpy(built.state.external)

    step = 1e-6 * sheet.spacing
    slope = (force(here + step * along) - force(here - step * along)) / (2.0 * step)
    found = (load.tangent_matrix(here) @ along.ravel()).reshape(-1, 3)
    assert found == pytest.approx(slope, abs=1e-6 * np.abs(slope).max())


def test_point_force_and_dead_pressure_push_with_what_they_say():
    sheet = square(5)
    built = build(sheet, loads=[PointForce([3, 4], (1.0, 2.0, 3.0)), Pressure(7.0, follower=False)])
    external = built.to_numpy(built.state.external)
    assert external.sum(axis=0) == pytest.approx([1.0, 2.0, 3.0 + 7.0 * 0.01])


@pytest.mark.parametrize("on", ["points", "triangles"])
@pytest.mark.parametrize("make", [square, lambda n: square(n).as_cloud()])
def test_follower_pressure_is_nansons(make, on):
    """p J F^-T N of a uniform deformation, whatever it is."""
    sheet = make(9)
    F = np.array([[1.3, 0.2], [0.1, 0.8], [0.4, -0.3]])
    built = build(sheet, loads=[Pressure(5.0, on=on)], initial_displacement=uniform(sheet, F))
    built.context.run("setup")
    expected = 5.0 * np.outer(sheet.areas, np.cross(F[:, 0], F[:, 1]))
    assert built.to_numpy(built.state.external) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("on", ["points", "triangles"])
def test_damage_reduces_follower_pressure_as_it_reduces_stiffness(on):
    sheet = square(9)
    F = np.array([[1.3, 0.2], [0.1, 0.8], [0.4, -0.3]])
    parts = {"loads": [Pressure(5.0, on=on)], "initial_displacement": uniform(sheet, F)}
    sound, torn = build(sheet, **parts), build(sheet, **parts, damage=TearingEnergy(1e3))
    damage = soften(torn)
    for built in (sound, torn):
        built.context.run("setup")
    expected = (1.0 - damage[:, None]) ** 2 * sound.to_numpy(sound.state.external)
    assert torn.to_numpy(torn.state.external) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("pressure", [3e3, 3e4])
def test_a_rim_carries_pressure_times_its_area_however_the_sheet_bulges(pressure):
    """Also where the bulge hangs over its rim within a few spacings."""
    sheet = square(9)
    scene = simulate(
        sheet,
        Newton(load_steps=4),
        material=Yeoh(2e5, 0.0, 100.0),
        loads=[Fixed(sheet.edges()), Pressure(pressure, on="triangles")],
    )
    result = scene.run(device="cpu")
    assert support_force(result.built, sheet.edges()) == pytest.approx(
        [0.0, 0.0, -pressure * 0.1**2], abs=1e-8 * pressure
    )


def pressed(sheet, displacement, pressure, **parts):
    """Force on the points [N] of a pressure [Pa] at a displacement [m]."""
    built = build(sheet, loads=[Pressure(pressure, on="triangles")], initial_displacement=displacement, **parts)
    built.context.run("setup")
    return built.to_numpy(built.state.external).astype(float)


@pytest.mark.parametrize(("bits", "bound"), [(64, 1e-14), (32, 1e-6)])
def test_a_pressure_in_a_closed_surface_has_no_resultant_and_no_torque(bits, bound):
    """However irregular its triangles, and however it is deformed."""
    rng = np.random.default_rng(0)
    sphere = Sheet.sphere(1.0, thickness=1e-2, density=1e3, points=8)
    uneven = sphere.points + 0.02 * rng.normal(size=sphere.points.shape)
    uneven /= np.linalg.norm(uneven, axis=1)[:, None] / (1.0, 1.5, 0.7)
    mesh = Sheet.from_surface(uneven, sphere.triangles, thickness=1e-2, density=1e3)
    for sheet in (sphere, mesh):
        u = 0.5 * sheet.points + 0.05 * rng.normal(size=sheet.points.shape)
        force = pressed(sheet, u, 5.0, precision=bits)
        size = np.abs(force).sum()
        assert np.abs(force.sum(axis=0)).max() < bound * size
        assert np.abs(np.cross(sheet.positions + u, force).sum(axis=0)).max() < bound * size


@pytest.mark.parametrize("make", [square, jittered, lambda n: square(n).hole((0.05, 0.05), 0.02), small_tube])
def test_the_resultant_of_a_pressure_is_that_on_any_surface_with_the_same_edge(make):
    """p/2 times the sum over the edges of x_a x x_b, times the smooth area of a tube over that of its chords."""
    sheet = make(12)
    u = 0.2 * sheet.spacing * np.random.default_rng(0).normal(size=(sheet.size, 3))
    places = sheet.positions + u
    a, b = boundary_edges(sheet.triangles).T
    smooth = 1.0 if sheet.frames is None else (np.pi / 12) / np.sin(np.pi / 12) / np.cos(np.pi / 12)
    expected = 2.5 * smooth * np.cross(places[a], places[b]).sum(axis=0)
    assert pressed(sheet, u, 5.0).sum(axis=0) == pytest.approx(expected, abs=1e-12 * np.abs(places[a]).sum())


@pytest.mark.parametrize(
    "sheet",
    [
        square(13).cut((0.02, 0.046), (0.07, 0.046)),
        Sheet.rectangle(0.1, 0.1, points=9, thickness=1e-3, density=1e3, centred=True),
        Sheet.rectangle(0.1, 0.1, points=9, thickness=1e-3, density=1e3, areas="whole"),
    ],
    ids=["cut", "centred", "whole areas"],
)
def test_points_beside_a_cut_and_beyond_the_triangles_carry_their_areas(sheet):
    F = np.array([[1.3, 0.2], [0.1, 0.8], [0.4, -0.3]])
    expected = 5.0 * np.outer(sheet.areas, np.cross(F[:, 0], F[:, 1]))
    assert pressed(sheet, uniform(sheet, F), 5.0) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("make", [square, jittered, small_tube])
def test_triangles_cut_by_a_crack_carry_no_pressure(make):
    """p/6 (x_b - x_a) x (x_c - x_a) of those along whose sides no bond is broken, of rectangles both ways halved."""
    sheet = make(12)
    built = build(sheet, loads=[Pressure(5.0, on="triangles")], damage=CriticalStretch(9.0))
    u = 0.2 * sheet.spacing * np.random.default_rng(0).normal(size=(sheet.size, 3))
    lost = tear(built) if sheet.frames is not None else sever(built, ((0.02, 0.048), (0.07, 0.062)))
    built.state.displacement.assign(u)
    built.context.run("setup")
    point, member = np.nonzero(lost)
    heads = built.law.families.heads(point, member)
    torn = set(zip(point.tolist(), heads.tolist(), strict=True))
    smooth = 1.0 if sheet.frames is None else (np.pi / 12) / np.sin(np.pi / 12) / np.cos(np.pi / 12)
    expected, places, cut = np.zeros((sheet.size, 3)), sheet.positions + u, 0
    for triangles in (sheet.triangles, other_diagonals(sheet.positions, sheet.triangles)):
        for face in triangles:
            a, b, c = face.tolist()
            if torn & {(a, b), (b, c), (c, a)}:
                cut += 1
                continue
            vector = np.cross(places[b] - places[a], places[c] - places[a])
            expected[face] += 5.0 * smooth / 12.0 * vector
    assert cut > 5
    assert built.to_numpy(built.state.external) == pytest.approx(expected, abs=1e-12)


def test_a_pressure_on_triangles_is_refused_where_there_are_none():
    sheet = without_triangles(square(9))
    with refused(match="point 0 has no triangle: expected Pressure"):
        build(sheet, loads=[Pressure(5.0, on="triangles")])
    with refused(match="expected 'points' with follower = False"):
        Pressure(5.0, follower=False, on="triangles")


@pytest.mark.parametrize(("pressure", "said"), [(3e3, False), (3e4, True)])
def test_a_pressure_whose_resultant_on_points_is_not_that_of_its_edge_is_noted(pressure, said):
    """Supports of a bulge that hangs over its rim do not carry p A: families take the mean normal of both its sides."""
    sheet = square(9)
    scene = simulate(
        sheet, Newton(load_steps=4), material=Yeoh(2e5, 0.0, 100.0), loads=[Fixed(sheet.edges()), Pressure(pressure)]
    )
    result = scene.run(device="cpu")
    rim = support_force(result.built, sheet.edges())[2]
    off = abs(rim / (-pressure * 0.1**2) - 1.0)
    assert (off > 0.02) == said == bool(told_error(result)), off
    assert all(percent == pytest.approx(100.0 * off, rel=0.06) for percent in told_error(result))


def test_errors_of_two_pieces_do_not_cancel():
    """Two bulges on one sheet of two pieces, the second upside down: together their edges carry nothing."""
    both = together(square(9), square(9))
    start = placed(both, Place(), Place(offset=(0.0, 0.1, 0.2), axis=(1.0, 0.0, 0.0), degrees=180.0))
    loads = [Fixed(both.edges("all")), Pressure(3e4)]
    result = simulate(
        both, Newton(load_steps=4), material=Yeoh(2e5, 0.0, 100.0), initial_displacement=start, loads=loads
    ).run(device="cpu")
    up, down = (support_force(result.built, both.edges(f"sheet {number} all"))[2] for number in (1, 2))
    assert up == pytest.approx(-down, rel=1e-6)
    assert told_error(result) == pytest.approx([100.0 * abs(up / (3e4 * 0.1**2) + 1.0)], rel=0.06)


def told_error(result):
    """Errors of a pressure's resultant [%] in the notes."""
    notes = [note for note in result.summary["notes"] if note.startswith("Pressure(")]
    assert all("on='triangles', or more points" in note for note in notes)
    return [float(re.search(r"N, (\S+) % of the", note)[1]) for note in notes]


@pytest.mark.parametrize("make", ["sphere", "tube", "flat", "fine"])
def test_a_note_tells_what_a_rim_carries_too_much(make):
    """Support of the rim over pressure times the vector area that it spans."""
    sheet = {
        "sphere": lambda: Sheet.sphere(1.0, thickness=1e-2, density=1e3, points=6).hole((0.0, 0.0, -1.0), 0.6),
        "tube": lambda: Sheet.tube(0.3, 0.8, thickness=3e-3, density=1e3, points=24).hole((0.3, 0.0, 0.4), 0.15),
        "flat": lambda: Sheet.rectangle(1.0, 0.8, thickness=1e-2, density=1e3, points=(21, 17)),
        "fine": lambda: Sheet.rectangle(1.0, 1.0, thickness=1e-2, density=1e3, points=41),
    }[make]()
    rim = np.unique(boundary_edges(sheet.triangles))
    law = BondAssociated(NeoHookean(mu=1e5, bulk=1e7), horizon=3.15 if make == "flat" else 2.015)
    pressure = 1e3 if sheet.frames is None else 100.0
    for on in ("points", "triangles"):
        result = Simulation(sheet, law, Newton(), loads=[Fixed(rim), Pressure(pressure, on=on)]).run(device="cpu")
        held = sheet.positions + result.frame.displacement
        edge = 0.5 * doubled_normals(held, sheet.triangles).sum(axis=0)
        support = support_force(result.built, rim) / pressure
        if on == "points":
            off = 100.0 * np.linalg.norm(support + edge) / np.linalg.norm(edge)
            assert told_error(result) == (pytest.approx([off], rel=0.06) if make != "fine" else [])
            assert (off > 2.0) == (make != "fine")
        else:
            # The smooth surface has a larger area than its chords.
            smooth = pressed_weights(sheet, cells_of(sheet.positions, sheet.triangles))
            assert told_error(result) == [] and np.ptp(smooth) == 0.0
            assert support == pytest.approx(-smooth[0] * edge, abs=1e-8)


def test_a_pressure_on_points_that_moves_a_closed_surface_is_noted():
    sphere = Sheet.sphere(1.0, thickness=1e-2, density=1e3, points=6)
    uneven = sphere.points + 0.03 * np.random.default_rng(0).normal(size=sphere.points.shape)
    uneven *= (1.0, 1.6, 0.6) / np.linalg.norm(uneven, axis=1)[:, None]
    mesh = Sheet.from_surface(uneven, sphere.triangles, thickness=1e-2, density=1e3)
    for on in ("points", "triangles"):
        notes = run(mesh, Explicit(1e-4, frames=1), loads=[Pressure(1.0, on=on)]).summary["notes"]
        assert any("in the closed surface" in note for note in notes) == (on == "points"), notes
