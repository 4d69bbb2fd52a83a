"""Distance of points from the plane of their neighbours."""

from types import SimpleNamespace

import numpy as np
import pytest
from boundary_forces import HORIZON, built_on, lifted, rotated, rotation_of
from helpers import NEO, random_gradient, refused, sever, square, uniform

from warp_pd import BondAssociated, Explicit, Simulation
from warp_pd.measures import distance_from_local_plane


def distance(built, displacement, points):
    return distance_from_local_plane(built, SimpleNamespace(displacement=displacement), points)


@pytest.mark.parametrize("sheet", ["lattice", "jittered"])
def test_a_plane_in_space_has_distance_zero(sheet):
    built = built_on(sheet)
    s = built.simulation.sheet
    u = uniform(s, random_gradient(5)) + (3.0, -2.0, 1.0)
    assert distance(built, u, np.arange(s.size)).max() < 1e-14


@pytest.mark.parametrize("sheet", ["lattice", "jittered"])
def test_the_distance_is_the_height_of_a_lifted_point(sheet):
    built = built_on(sheet)
    s = built.simulation.sheet
    rotation = rotation_of(6)
    for point, height in ((0, 0.02), (40, -0.003)):
        u = rotated(s, lifted(s, point, height), rotation)
        # In the order asked for, and not sorted.
        assert distance(built, u, [point, s.size - 1])[0] == pytest.approx(abs(height), rel=1e-10)
        assert distance(built, u, [s.size - 1, point])[1] == pytest.approx(abs(height), rel=1e-10)
        assert distance(built, u, s.size - 1) == pytest.approx([0.0], abs=1e-14)


def test_the_distance_is_second_order_on_a_curved_surface():
    found = []
    for points in (9, 17, 33):
        sheet = square(points)
        law = BondAssociated(NEO, horizon=HORIZON, weights="plain")
        built = Simulation(sheet, law, Explicit(1.0)).build("cpu")
        u = np.zeros((sheet.size, 3))
        u[:, 2] = 2.0 * (sheet.points[:, 0] ** 2 - 0.5 * sheet.points[:, 1] ** 2)
        found.append(distance(built, u, [0, sheet.nearest(0.05, 0.05)]))
    ratios = np.array(found[:-1]) / np.array(found[1:])
    assert (np.array(found) > 0.0).all()
    assert ratios == pytest.approx(4.0, rel=0.1)


def test_the_distance_follows_the_intact_bonds():
    built = built_on("lattice", points=(0,), breakable=True)
    s = built.simulation.sheet
    undamaged = built.law.intact.numpy().copy()
    # Two leaves, one raised: each is a plane of its own once the bonds between them are gone.
    u = np.zeros((s.size, 3))
    u[s.points[:, 1] > 0.0444, 2] = 0.01
    near = s.nearest(0.05, 0.05)
    assert distance(built, u, near)[0] > 1e-3
    try:
        sever(built, ((-0.01, 0.0444), (0.11, 0.0444)))
        assert distance(built, u, near)[0] < 1e-15
        built.law.intact.assign(np.zeros_like(undamaged))
        assert np.isnan(distance(built, u, near)).all()
    finally:
        built.law.intact.assign(undamaged)


def test_points_that_do_not_exist_are_refused():
    built = built_on()
    with refused(match="points contains point 81: expected 0 to 80"):
        distance(built, np.zeros((81, 3)), [81])
