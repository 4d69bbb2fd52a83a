"""BoundaryForce: the points that carry it, the arrays and launches that it needs, what it refuses."""

from types import SimpleNamespace

import numpy as np
import pytest
from boundary_forces import built_on, families_of
from helpers import refused, square

from warp_pd import BondAssociated, BoundaryForce, Explicit, NeoHookean, Simulation
from warp_pd.papers.boundary_force import near_edges


@pytest.mark.parametrize("horizon", [2.015, 3.0, 3.15])
def test_carriers_are_the_points_less_than_a_horizon_from_an_edge(horizon):
    sheet = square(13)
    x, y = sheet.points.T
    gap = np.minimum.reduce([x, y, 0.1 - x, 0.1 - y])
    expected = np.flatnonzero(gap < horizon * sheet.spacing * (1.0 - 1e-6))
    assert (near_edges(sheet, horizon * sheet.spacing) == expected).all()
    assert 0 < len(expected) < sheet.size
    # Every point whose family lacks members is among them.
    members = families_of(sheet, horizon).members_of(np.arange(sheet.size))
    cut_short = np.flatnonzero((members < 0).any(axis=1))
    assert len(cut_short) > 0 and np.isin(cut_short, expected).all()


def test_cuts_and_holes_are_edges():
    sheet = square(25)
    reach = 2.015 * sheet.spacing
    middle = np.linalg.norm(sheet.points - 0.05, axis=1)
    slit = sheet.cut((0.04, 0.0512), (0.06, 0.0512))
    hole = sheet.hole((0.05, 0.05), 0.015)
    assert not np.isin(np.flatnonzero(middle < 0.02), near_edges(sheet, reach)).any()
    assert np.isin(slit.nearest(0.05, 0.05), near_edges(slit, reach))
    assert np.isin(slit.nearest(0.05, 0.055), near_edges(slit, reach))
    assert not np.isin(slit.nearest(0.05, 0.07), near_edges(slit, reach))
    around = np.linalg.norm(hole.points - 0.05, axis=1)
    marked = np.isin(np.arange(hole.size), near_edges(hole, reach))
    rim, outside = around < 0.018, (around > 0.03) & (around < 0.04)
    assert rim.any() and marked[rim].all()
    assert outside.any() and not marked[outside].any()


def test_beyond_the_end_of_a_side_its_end_is_nearest():
    """One triangle, and points past its corner along a side."""
    corners, past = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], [(1.1, -0.17), (1.1, -0.19), (-0.1, -0.17), (-0.1, -0.19)]
    sheet = SimpleNamespace(points=np.array(corners + past), triangles=np.array([[0, 1, 2]]))
    assert near_edges(sheet, 0.2).tolist() == [0, 1, 2, 3, 5]


def names_of(built):
    return {field.name for field in built.context.fields} | {
        name for launches in built.context.stages.values() for launch in launches for name in launch.parts
    }


def test_the_plan_has_it_only_where_a_scene_asks():
    ours = {"edge_normals", "add_boundary_force", "external", "begin_loads"}
    law = BondAssociated(NeoHookean(1e3, 1e5), weights="plain")
    bare = Simulation(square(9), law, Explicit(1.0)).build("cpu")
    assert not names_of(bare) & (ours | {"edge_points", "edge_reach", "edge_mask"})
    assert names_of(built_on()) >= ours | {"edge_points", "edge_reach"} and "edge_mask" not in names_of(built_on())
    breakable = names_of(built_on("lattice", points=(0,), breakable=True))
    assert breakable >= ours | {"edge_mask"} and not breakable & {"edge_points", "edge_reach"}
    # Where nothing breaks, the launches leave the inside of the sheet alone.
    built = built_on()
    launches = {launch.name: launch.threads for launch in built.context.stages["step"]}
    assert launches["edge_normals"] == len(near_edges(built.simulation.sheet, built.law.families.horizon))
    assert launches["edge_normals"] <= launches["add_boundary_force"] <= built.simulation.sheet.size


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"value": -1.0}, "BoundaryForce.value = -1.0: expected 0 or"),
        ({"value": float("nan")}, "BoundaryForce.value = nan: expected a finite"),
        ({"value": "much"}, "BoundaryForce.value = 'much': expected a number"),
        ({"value": 1.0, "form": "norml"}, "did you mean 'normal'"),
    ],
)
def test_wrong_input_is_one_line(arguments, message):
    with refused(message):
        BoundaryForce(**arguments)


@pytest.mark.parametrize(
    ("loads", "message"),
    [
        ([BoundaryForce(1.0, points=[81])], "BoundaryForce.points contains point 81: expected 0 to 80"),
        ([BoundaryForce(1.0, points=[])], "BoundaryForce.points = []: expected at least one point"),
        ([BoundaryForce(1.0), BoundaryForce(2.0)], "loads: two or more BoundaryForce: expected one"),
    ],
)
def test_wrong_points_are_one_line(loads, message):
    with refused(message):
        Simulation(square(9), BondAssociated(NeoHookean(1e3, 1e5)), Explicit(1.0), loads=loads).build("cpu")
