"""Loads: body force, point force, dead and follower pressure, each against mechanics."""

import numpy as np
import pytest
from helpers import build, soften, square, uniform
from small_runs import run, simulate

from warp_pd import BodyForce, Explicit, Fixed, Newton, PointForce, Pressure, TearingEnergy, Yeoh
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


def test_the_matrix_of_a_follower_pressure_in_time_is_the_derivative_of_its_force():
    sheet = square(7)
    here = uniform(sheet, [[1.3, 0.2], [0.1, 0.8], [0.4, -0.3]])
    built = build(sheet, loads=[Pressure(5.0, ramp=[(0.0, 0.3), (1.0, 0.3)])], initial_displacement=here)
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
    assert force(here).sum(axis=0) == pytest.approx(
        0.3 * 5.0 * 0.01 * np.cross([1.3, 0.1, 0.4], [0.2, 0.8, -0.3]), rel=1e-9
    )


def test_point_force_and_dead_pressure_push_with_what_they_say():
    sheet = square(5)
    built = build(sheet, loads=[PointForce([3, 4], (1.0, 2.0, 3.0)), Pressure(7.0, follower=False)])
    external = built.to_numpy(built.state.external)
    assert external.sum(axis=0) == pytest.approx([1.0, 2.0, 3.0 + 7.0 * 0.01])


@pytest.mark.parametrize("make", [square, lambda n: square(n).as_cloud()])
def test_follower_pressure_is_nansons(make):
    """p J F^-T N of a uniform deformation, whatever it is."""
    sheet = make(9)
    F = np.array([[1.3, 0.2], [0.1, 0.8], [0.4, -0.3]])
    built = build(sheet, loads=[Pressure(5.0)], initial_displacement=uniform(sheet, F))
    built.context.run("setup")
    expected = 5.0 * np.outer(sheet.areas, np.cross(F[:, 0], F[:, 1]))
    assert built.to_numpy(built.state.external) == pytest.approx(expected, abs=1e-12)


def test_damage_reduces_follower_pressure_as_it_reduces_stiffness():
    sheet = square(9)
    F = np.array([[1.3, 0.2], [0.1, 0.8], [0.4, -0.3]])
    parts = {"loads": [Pressure(5.0)], "initial_displacement": uniform(sheet, F)}
    sound, torn = build(sheet, **parts), build(sheet, **parts, damage=TearingEnergy(1e3))
    damage = soften(torn)
    for built in (sound, torn):
        built.context.run("setup")
    expected = (1.0 - damage[:, None]) ** 2 * sound.to_numpy(sound.state.external)
    assert torn.to_numpy(torn.state.external) == pytest.approx(expected, abs=1e-12)


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
    notes = [note for note in result.summary["notes"] if note.startswith("Pressure(")]
    assert (off > 0.05) == said == bool(notes), (off, notes)
    assert all("more points" in note for note in notes)
