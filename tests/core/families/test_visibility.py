"""Bonds stay in the sheet: against an independent check by shapely, on random outlines with holes and cracks."""

import itertools

import numpy as np
import shapely
from helpers import refused
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from warp_pd import Sheet
from warp_pd.device.checks import InputError
from warp_pd.families import build_families
from warp_pd.families.visibility import DETOUR
from warp_pd.shapes.curves import Circle

SHEET = {"thickness": 1e-3, "density": 1000.0}
# In spacings: shift of the faces of cracks apart, growth of the sheet, what cracks lose at tips and gain at mouths.
NUDGE, GROWTH, TIP = 1e-6, 1e-5, 1e-4
L_SHAPE = np.array([(0, 0), (1, 0), (1, 0.5), (0.5, 0.5), (0.5, 1), (0, 1)])


def outline(boundary, spacing, **parts):
    return Sheet.outline(boundary, spacing=spacing, **parts, **SHEET)


def found_bonds(sheet, horizon):
    families = build_families(sheet, horizon, "linear", intersections=False)
    members = families.members_of(np.arange(sheet.size))
    return {(i, int(j)) for i, row in enumerate(members) for j in row if j >= 0}


def expected_bonds(sheet, horizon, holes, cracks):
    """Bonds by definition: the straight way, or two straight bonds, in the sheet without the cracks."""
    h = sheet.spacing
    outer = shapely.Polygon(ring_of(sheet, "outline"), [ring_of(sheet, name) for name in holes])
    room = outer.buffer(GROWTH * h)
    walls = shapely.union_all([shortened(crack, outer, TIP * h) for crack in cracks])
    inward = np.zeros((sheet.size, 2))
    for number, crack in enumerate(cracks, start=1):
        tips = sheet.parts.get(f"crack {number} tips", np.zeros(0, int))
        for face, sign in (("left", 1.0), ("right", -1.0)):
            points = np.setdiff1d(sheet.parts[f"crack {number} {face}"], tips)
            inward[points] = sign * h * normals(crack, sheet.points[points])
    seen_from = sheet.points + NUDGE * inward
    pairs = cKDTree(sheet.points).query_pairs(horizon * h * (1.0 + 1e-9), output_type="ndarray")
    ways = shapely.linestrings(seen_from[pairs])
    shapely.prepare(room)
    straight = shapely.covers(room, ways) & ~shapely.intersects(walls, ways)
    seen = np.zeros((sheet.size, sheet.size), bool)
    seen[tuple(pairs[straight].T)] = True
    seen |= seen.T
    bonds = set(map(tuple, pairs[straight].tolist()))
    for i, j in pairs[~straight].tolist():
        k = np.flatnonzero(seen[i] & seen[j])
        way = np.linalg.norm(sheet.points[k] - sheet.points[i], axis=1)
        way += np.linalg.norm(sheet.points[k] - sheet.points[j], axis=1)
        if (way <= DETOUR * np.linalg.norm(sheet.points[i] - sheet.points[j])).any():
            bonds.add((i, j))
    return bonds | {(j, i) for i, j in bonds}


def normals(crack, points):
    """Unit vectors to the left of a crack at points on it; at a corner the mean of both sides."""
    total = np.zeros(points.shape)
    for start, end in itertools.pairwise(crack):
        along = (end - start) / np.linalg.norm(end - start)
        on = shapely.distance(shapely.LineString([start, end]), shapely.points(points)) < 1e-9
        total[on] += [-along[1], along[0]]
    return total / np.linalg.norm(total, axis=1)[:, None]


def ring_of(sheet, name):
    """The points of a ring in order: holes are star-shaped about their middle here, and outlines about the origin."""
    points = np.unique(sheet.points[sheet.parts[name]], axis=0)
    offset = points - (0.0 if name == "outline" else 0.5 * (points.min(axis=0) + points.max(axis=0)))
    return points[np.argsort(np.arctan2(offset[:, 1], offset[:, 0]))]


def shortened(crack, outer, by):
    """A crack that is shorter at its tips, and longer at its mouths."""
    crack = crack.copy()
    for end, before in ((0, 1), (-1, -2)):
        along = (crack[end] - crack[before]) / np.linalg.norm(crack[end] - crack[before])
        is_mouth = outer.boundary.distance(shapely.Point(crack[end])) < 1e-9
        crack[end] += (by if is_mouth else -by) * along
    return shapely.LineString(crack)


@st.composite
def shapes(draw):
    """A star-shaped polygon with perhaps a hole and a crack of two pieces."""
    corners = draw(st.integers(5, 8))
    radius = np.array(draw(st.lists(st.floats(0.55, 1.0), min_size=corners, max_size=corners)))
    angle = 2.0 * np.pi * (np.arange(corners) + draw(st.floats(0.0, 1.0))) / corners
    boundary = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    middle = [draw(st.floats(-0.3, 0.3)) for _ in range(2)]
    holes = [Circle(middle, draw(st.floats(0.08, 0.2)))] if draw(st.booleans()) else []
    cracks = []
    if draw(st.booleans()):
        turn, bend = draw(st.floats(0.0, 6.28)), draw(st.floats(-1.2, 1.2))
        start = np.array([draw(st.floats(-0.5, 0.5)) for _ in range(2)])
        knee = start + 0.25 * np.array([np.cos(turn), np.sin(turn)])
        cracks = [[start, knee, knee + 0.25 * np.array([np.cos(turn + bend), np.sin(turn + bend)])]]
    return boundary, holes, cracks


@settings(max_examples=25, deadline=None)
@given(shapes(), st.sampled_from([1.5, 2.015, 3.15]))
def test_bonds_are_those_of_a_brute_force_check(shape, horizon):
    boundary, holes, cracks = shape
    try:
        sheet = outline(boundary, 0.11, holes=holes, cracks=cracks)
        found = found_bonds(sheet, horizon)
    except InputError:
        # A crack on a hole, say.
        return
    names = [name for name in sheet.parts if name.startswith("hole ")]
    room = shapely.Polygon(ring_of(sheet, "outline"), [ring_of(sheet, name) for name in names])
    pieces = [shapely.get_parts(shapely.LineString(crack).intersection(room)) for crack in cracks]
    clipped = [np.array(max(parts, key=shapely.length).coords) for parts in pieces]
    assert found == expected_bonds(sheet, horizon, names, clipped)


def cloud(points, **given):
    return Sheet.from_points(np.asarray(points, float), **given, **SHEET)


def strips(gap):
    """Two strips of points, 0.1 apart, with a gap between them."""
    x, y = np.meshgrid(0.1 * np.arange(12), 0.1 * np.arange(4))
    lower = np.column_stack([x.ravel(), y.ravel()])
    return np.vstack([lower, lower + (0.0, 0.3 + gap)])


def strip_triangles():
    one = cloud(strips(0.3)[:48], spacing=0.1).triangles
    return np.vstack([one, one + 48])


def test_clouds_apart_share_no_bond():
    """Two strips two spacings apart, which a horizon of 3.15 spacings reaches across."""
    sheet = cloud(strips(0.2), spacing=0.1, triangles=strip_triangles())
    lower = sheet.points[:, 1] < 0.35
    assert all(lower[i] == lower[j] for i, j in found_bonds(sheet, 3.15))
    assert {"outline 1", "outline 2"} <= set(sheet.parts)
    assert len(sheet.edges("all")) == 2 * (12 + 12 + 2 + 2)


def test_the_notch_of_a_cloud_is_not_bridged():
    x, y = np.meshgrid(0.05 * np.arange(21), 0.05 * np.arange(21))
    points = np.column_stack([x.ravel(), y.ravel()])
    sheet = cloud(points[~((x > 0.525) & (y > 0.525)).ravel()], spacing=0.05, outline=L_SHAPE)
    room = shapely.Polygon(L_SHAPE).buffer(1e-9)
    assert np.isclose(sheet.areas.sum(), 0.75)
    ways = shapely.linestrings(sheet.points[sorted(found_bonds(sheet, 3.15))])
    outside = ways[~shapely.covers(room, ways)]
    # Around the corner, where the way inside is hardly longer.
    assert shapely.distance(outside, shapely.Point(0.5, 0.5)).max() < 0.05


def test_a_convex_cloud_keeps_all_bonds():
    points = np.random.default_rng(0).uniform(0.0, 1.0, (300, 2))
    points = np.vstack([points, [(0, 0), (1, 0), (1, 1), (0, 1)]])
    hull = shapely.Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    sheet = cloud(points, spacing=0.1, outline=np.array(hull.exterior.coords))
    assert sheet.barriers is None
    near = cKDTree(points).query_pairs(0.2)
    assert build_families(sheet, 2.0, "linear", intersections=False).bond_count == 2 * len(near)


def test_points_outside_their_outline_are_refused():
    with refused(match=r"points\[48\] at .* has no triangle inside the outline"):
        cloud(np.vstack([strips(0.0)[:48], [(3.0, 0.1)]]), outline=[(0, 0), (1.1, 0), (1.1, 0.3), (0, 0.3)])
    with refused(match="expected only one of them"):
        cloud(strips(0.2), outline=L_SHAPE, triangles=strip_triangles())


def test_points_of_an_outline_get_its_bonds_back():
    sheet = outline(Circle((0, 0), 1.0), 0.1, holes=[Circle((0.2, 0.0), 0.3)])
    again = cloud(sheet.points, spacing=0.1, triangles=sheet.triangles)
    assert found_bonds(again, 3.15) == found_bonds(sheet, 3.15)
    for name in ("outline", "hole 1"):
        assert np.array_equal(again.parts[name], sheet.parts[name])
    # An outline without the hole fills it.
    filled = cloud(sheet.points, spacing=0.1, outline=Circle((0, 0), 1.0))
    assert np.isclose(filled.areas.sum(), np.pi, rtol=0.01)
