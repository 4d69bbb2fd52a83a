"""Sheets from outlines: points on the curves, triangles that fill them, names, and what is refused."""

import numpy as np
import pytest
import shapely
from helpers import refused

from warp_pd import Sheet
from warp_pd.device.checks import InputError
from warp_pd.families import build_families
from warp_pd.geometry.triangulation import boundary_edges, signed_areas
from warp_pd.shapes.curves import Circle, Polygon, Spline

SHEET = {"thickness": 1e-3, "density": 1000.0}
SQUARE = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)]
L_SHAPE = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.05), (0.05, 0.05), (0.05, 0.1), (0.0, 0.1)]
HOLE, CRACK = Circle((0.05, 0.03), 0.015), [(0.02, 0.07), (0.07, 0.075)]
INCLUSION = Circle((0.018, 0.025), 0.01)


def outline(boundary=SQUARE, spacing=0.005, **parts):
    return Sheet.outline(boundary, spacing=spacing, **parts, **SHEET)


def mixed(spacing=0.005, **changes):
    return outline(spacing=spacing, **{"holes": [HOLE], "cracks": [CRACK], **changes})


def graded(x, y):
    return 0.003 + 0.03 * np.hypot(x - 0.05, y - 0.05)


def bonds_of(sheet, horizon=3.15):
    families = build_families(sheet, horizon, "linear", intersections=False)
    members = families.members_of(np.arange(sheet.size))
    tail = np.repeat(np.arange(sheet.size), members.shape[1])
    return np.column_stack([tail, members.ravel()])[members.ravel() >= 0]


CASES = {
    "square": outline,
    "clockwise": lambda: outline(SQUARE[::-1]),
    "L": lambda: outline(L_SHAPE),
    "off the grid": lambda: outline([(0, 0), (0.0987, 0.004), (0.1, 0.1033), (0.003, 0.091)]),
    "acute corner": lambda: outline([(0, 0), (0.1, 0), (0.1, 0.02)]),
    "disc": lambda: outline(Circle((0.05, 0.05), 0.05)),
    "spline": lambda: outline(Spline(SQUARE)),
    "hole and crack": mixed,
    "inclusion": lambda: mixed(inclusions=[INCLUSION]),
    "hole as wide as a cell": lambda: outline(holes=[Circle((0.05, 0.05), 0.005)]),
    "hole narrower than a cell": lambda: outline(holes=[Circle((0.0512, 0.0503), 0.0025)]),
    "hole tangent to the grid": lambda: outline(holes=[Circle((0.05, 0.05), 0.015)]),
    "half a spacing between hole and edge": lambda: outline(holes=[Circle((0.05, 0.0225), 0.02)]),
    "graded": lambda: mixed(spacing=graded),
}


@pytest.mark.parametrize("case", CASES)
def test_triangles_fill_the_outline(case):
    """Counter-clockwise, conforming, none left over; areas sum to the polygon's."""
    sheet = CASES[case]()
    areas = signed_areas(sheet.points, sheet.triangles)
    assert areas.min() > 0.0
    assert sheet.areas.min() > 0.0
    edges = boundary_edges(sheet.triangles)
    # Every point on an edge begins and ends one piece of it: no hanging points.
    assert np.array_equal(np.sort(edges[:, 0]), np.unique(edges))
    assert np.array_equal(np.sort(edges[:, 1]), np.unique(edges))
    assert np.array_equal(np.unique(sheet.triangles), np.arange(sheet.size))
    rim = sheet.points[edges]
    enclosed = 0.5 * np.sum(rim[:, 0, 0] * rim[:, 1, 1] - rim[:, 0, 1] * rim[:, 1, 0])
    assert np.isclose(areas.sum(), enclosed, rtol=1e-12)
    assert np.isclose(sheet.areas.sum(), enclosed, rtol=1e-12)


def test_areas_of_polygons_are_exact():
    assert np.isclose(outline(L_SHAPE).areas.sum(), 0.0075, rtol=1e-12)
    corners = [(0, 0), (0.0987, 0.004), (0.1, 0.1033), (0.003, 0.091)]
    assert np.isclose(outline(corners).areas.sum(), shapely.Polygon(corners).area, rtol=1e-12)


def test_points_are_on_the_curves():
    sheet = mixed(holes={"bore": HOLE, "slot": Polygon([(0.08, 0.08), (0.09, 0.08), (0.09, 0.092)])})
    bore = sheet.points[sheet.parts["bore"]] - HOLE.centre
    assert np.abs(np.hypot(*bore.T) - HOLE.radius).max() < 1e-15
    for corner in [*SQUARE, (0.08, 0.08), (0.09, 0.08), (0.09, 0.092), *CRACK]:
        assert np.linalg.norm(sheet.points - corner, axis=1).min() == 0.0
    side = sheet.points[sheet.parts["outline side 2"]]
    assert (side[:, 0] == 0.1).all()
    assert np.allclose(np.diff(np.sort(side[:, 1])), 0.005)
    on = shapely.distance(shapely.LineString(CRACK), shapely.points(sheet.points[sheet.parts["crack 1"]]))
    assert on.max() < 1e-15


def test_the_grid_is_in_order_and_on_the_pitch():
    sheet = mixed()
    on = (sheet.grid >= 0).all(axis=1)
    assert on.mean() > 0.4
    # Points on the grid come first, row by row.
    assert not on[np.argmin(on) :].any()
    assert (np.diff(sheet.grid[on, 1] * 1000 + sheet.grid[on, 0]) > 0).all()
    origin = sheet.points[on] - sheet.spacing * sheet.grid[on]
    assert np.ptp(origin, axis=0).max() < 1e-12


def test_points_off_the_grid_keep_their_distance():
    sheet = mixed(inclusions=[INCLUSION])
    edges = np.concatenate([sheet.triangles[:, [0, 1]], sheet.triangles[:, [1, 2]], sheet.triangles[:, [2, 0]]])
    length = np.linalg.norm(np.diff(sheet.points[edges], axis=1), axis=-1) / sheet.spacing
    assert 0.5 < length.min() and length.max() < 1.8


@pytest.mark.parametrize("spacing", [0.005, graded], ids=["even", "graded"])
def test_every_part_of_the_boundary_has_a_name(spacing):
    sheet = mixed(spacing)
    rim = np.unique(boundary_edges(sheet.triangles))
    faces = np.concatenate([sheet.parts["crack 1 left"], sheet.parts["crack 1 right"]])
    tips = sheet.parts["crack 1 tips"]
    assert np.array_equal(sheet.edges("all"), np.union1d(sheet.parts["outline"], sheet.parts["hole 1"]))
    assert np.array_equal(rim, np.union1d(sheet.edges("all"), faces))
    sides = [f"outline side {k}" for k in (1, 2, 3, 4)]
    assert np.array_equal(sheet.edges(*sides), sheet.parts["outline"])
    assert np.array_equal(sheet.edges("outline side 1"), sheet.edges("bottom"))
    assert len(tips) == 2 and np.isin(tips, sheet.parts["crack 1"]).all()


def test_a_punched_hole_has_a_name():
    sheet = mixed().hole((0.08, 0.03), 0.008)
    rim = np.hypot(*(sheet.points[sheet.parts["hole 2"]] - (0.08, 0.03)).T)
    assert len(rim) > 8
    assert rim.min() >= 0.008 * (1.0 - 1e-9)
    assert rim.max() < 0.008 + 1.5 * sheet.spacing
    assert np.isin(sheet.parts["hole 2"], sheet.edges("all")).all()


def test_a_punched_hole_is_a_barrier():
    sheet = mixed().hole((0.08, 0.03), 0.011)
    pairs = bonds_of(sheet)
    a, b = sheet.points[pairs[:, 0]], sheet.points[pairs[:, 1]]
    middle = np.hypot(*(0.5 * (a + b) - (0.08, 0.03)).T)
    assert middle.min() > 0.5 * 0.011
    assert np.isin(sheet.parts["hole 2"], sheet.barriers).all()


def test_a_hole_gets_a_free_name():
    sheet = outline(holes={"hole 2": HOLE}).hole((0.08, 0.08), 0.008).hole((0.02, 0.08), 0.008)
    assert {"hole 1", "hole 2", "hole 3"} <= set(sheet.parts)


def test_two_strips_apart_share_no_bond():
    """A slot two spacings wide divides a sheet but for a bridge at its end."""
    slot = [(0.0475, -1), (0.0575, -1), (0.0575, 0.08), (0.0475, 0.08)]
    sheet = outline(list(shapely.Polygon(SQUARE).difference(shapely.Polygon(slot)).exterior.coords)[:-1])
    pairs = bonds_of(sheet)
    x, y = sheet.points[pairs].transpose(2, 0, 1)
    across = ((x[:, 0] < 0.05) & (x[:, 1] > 0.055)) | ((x[:, 1] < 0.05) & (x[:, 0] > 0.055))
    assert not (across & (y.max(axis=1) < 0.07)).any()
    assert (across & (y.min(axis=1) > 0.081)).any()


def test_a_notch_has_no_bond_and_no_triangle():
    sheet = outline(L_SHAPE)
    room = shapely.Polygon(L_SHAPE).buffer(1e-9)
    assert shapely.covers(room, shapely.polygons(sheet.points[sheet.triangles])).all()
    ways = shapely.linestrings(sheet.points[bonds_of(sheet)])
    outside = ~shapely.covers(room, ways)
    # Only around the corner, where the way inside is hardly longer.
    assert shapely.distance(ways[outside], shapely.Point(0.05, 0.05)).max(initial=0.0) < 0.005


def test_no_bond_joins_the_inside_of_an_inclusion_with_the_sheet():
    sheet = outline(inclusions={"disc": INCLUSION})
    away = np.hypot(*(sheet.points - INCLUSION.centre).T) - INCLUSION.radius
    pairs = bonds_of(sheet)
    inside, outside = away < -1e-9, away > 1e-9
    assert inside.sum() > 3
    assert not (inside[pairs[:, 0]] & ~inside[pairs[:, 1]]).any()
    members = sheet.inclusions[0]
    assert np.array_equal(members, np.flatnonzero(~outside))
    # The body has all of its area, the points on its edge only what is outside.
    polygon = shapely.Polygon(ordered(sheet.points[sheet.parts["disc"]]))
    assert np.isclose(sheet.areas[inside].sum(), polygon.area, rtol=1e-12)
    assert np.isclose(sheet.areas.sum(), 0.01, rtol=1e-12)


def ordered(points):
    offset = points - points.mean(axis=0)
    return points[np.argsort(np.arctan2(offset[:, 1], offset[:, 0]))]


def slotted(*lines):
    return {"cracks": list(lines)}


REFUSED = {
    "self-crossing": (
        lambda: outline([(0, 0), (0.1, 0.1), (0.1, 0), (0, 0.1)]),
        "outline: it crosses or touches itself at (0.05, 0.05) m: expected a closed curve",
    ),
    "flat outline": (lambda: outline([(0, 0), (0.1, 0), (0.05, 0)]), "outline: "),
    "two corners": (
        lambda: outline([(0, 0), (0.1, 0)]),
        "outline: corners: expected shape (N, 2) with N >= 3, got (2, 2)",
    ),
    "no outline": (lambda: outline(None), "outline = None: expected a Polygon, Circle or Spline"),
    "class": (lambda: outline(Circle), "outline = the class Circle: expected a Polygon"),
    "nan": (lambda: outline([(0, 0), (0.1, 0), (np.nan, 0.1)]), "outline: corners[2, 0] = nan"),
    "same corner twice": (lambda: outline([*SQUARE, (0.0, 0.1)]), "outline comes as near as 0 spacings to itself"),
    "open function": (lambda: outline(lambda t: np.column_stack([t, t])), "expected a closed curve"),
    "function that raises": (lambda: outline(lambda t: 1 / 0), "outline: the curve raised ZeroDivisionError"),
    "function of another shape": (lambda: outline(lambda t: t), "outline: boundary function returned shape (5,)"),
    "hole as it is": (
        lambda: outline(holes=HOLE),
        "holes = Circle(centre=(0.05, 0.03), radius=0.015): expected",
    ),
    "holes None": (lambda: outline(holes=None), "holes = None: expected a list of curves"),
    "hole as corners": (lambda: outline(holes=[(0.02, 0.02), (0.04, 0.02), (0.03, 0.03)]), "write [curve]"),
    "crack as corners": (lambda: outline(cracks=CRACK), "got one polyline; write [polyline]"),
    "hole None": (lambda: outline(holes=[None]), "hole 1 = None: expected a Polygon"),
    "hole outside": (lambda: outline(holes=[Circle((0.3, 0.05), 0.02)]), "hole 1 spans (0.28, 0.03, 0.32, 0.07) m"),
    "hole at the edge": (lambda: outline(holes=[Circle((0.02, 0.05), 0.02)]), "expected a curve inside outline"),
    "hole near the edge": (lambda: outline(holes=[Circle((0.05, 0.021), 0.02)]), "to hole 1 at"),
    "hole in a hole": (lambda: outline(holes=[HOLE, Circle(HOLE.centre, 0.005)]), "hole 2 meets hole 1"),
    "tiny hole": (
        lambda: outline(holes=[Circle((0.05, 0.05), 2e-4)]),
        "hole 1 comes as near as 0.057 spacings to itself",
    ),
    "inclusion on a hole": (lambda: outline(holes=[HOLE], inclusions=[HOLE]), "inclusion 1 meets hole 1"),
    "crossing cracks": (lambda: mixed(**slotted(CRACK, [(0.05, 0.06), (0.05, 0.09)])), "crack 2 meets crack 1"),
    "crack in an inclusion": (
        lambda: outline(inclusions=[INCLUSION], **slotted([(0.02, 0.025), (0.03, 0.025)])),
        "crack 1 meets inclusion 1: expected cracks outside inclusions",
    ),
    "crack across an inclusion": (
        lambda: outline(inclusions=[INCLUSION], **slotted([(0.005, 0.025), (0.06, 0.025)])),
        "crack 1 meets inclusion 1",
    ),
    "crack outside": (
        lambda: outline(**slotted([(0.2, 0.05), (0.3, 0.05)])),
        "expected a line that enters the sheet only once",
    ),
    "crack across a hole": (
        lambda: mixed(**slotted([(0.02, 0.03), (0.09, 0.03)])),
        "expected a line that enters the sheet only once",
    ),
    "crack on the edge": (lambda: outline(**slotted([(0.02, 0.0), (0.05, 0.0)])), "crack 1 = [[0.02, 0.0]"),
    "crack too short": (lambda: outline(**slotted([(0.05, 0.05), (0.052, 0.05)])), "is as long as 1 spacing"),
    "crack without length": (lambda: outline(**slotted([(0.05, 0.05)] * 2)), "expected two or more distinct points"),
    "crack across itself": (
        lambda: outline(**slotted([(0.02, 0.05), (0.08, 0.05), (0.05, 0.08), (0.05, 0.02)])),
        "crack 1 crosses itself",
    ),
    "closed crack": (
        lambda: outline(**slotted([(0.03, 0.03), (0.07, 0.03), (0.05, 0.07), (0.03, 0.03)])),
        "use a hole",
    ),
    "crack near the edge": (lambda: outline(**slotted([(0.002, 0.05), (0.05, 0.05)])), "less than 0.7 spacings"),
    "crack nan": (lambda: outline(**slotted([(0.02, 0.05), (np.nan, 0.05)])), "crack 1[1, 0] = nan"),
    "name of a side": (lambda: outline(holes={"left": HOLE}), "two parts have the name 'left'"),
    "name all": (lambda: outline(holes={"all": HOLE}), "two parts have the name 'all'"),
    "one name twice": (lambda: outline(holes={"a": HOLE}, cracks={"a": CRACK}), "two parts have the name 'a'"),
    "name that is made": (lambda: outline(holes=[HOLE], cracks={"hole 1": CRACK}), "two parts have the name 'hole 1'"),
    "number as a name": (lambda: outline(holes={1: HOLE}), "holes: the name 1: expected text"),
    "spacing below zero": (lambda: outline(spacing=-1.0), "spacing = -1.0: expected a positive number"),
    "no spacing": (lambda: outline(spacing=None), "spacing = None: expected a number"),
    "spacing too wide": (lambda: outline(spacing=1.0), "spacing is 1 m in a sheet 0.1 m long"),
    "spacing too fine": (lambda: outline(spacing=2e-6), "spacing = 2e-06: expected 1e-05 m or more"),
    "spacing much too fine": (lambda: outline(spacing=1e-12), "expected 10000000 or fewer"),
    "spacing function below zero": (lambda: outline(spacing=lambda x, y: x - 0.05), "spacing(x, y) = -0.0"),
    "spacing function raises": (lambda: outline(spacing=lambda x, y: 1 / 0), "spacing(x, y) raised ZeroDivisionError"),
    "spacing function without a value": (lambda: outline(spacing=lambda x, y: None), "spacing(x, y) = array(None, "),
    "spacing function of text": (lambda: outline(spacing=lambda x, y: "0.01"), "spacing(x, y) = array('0.01', "),
    "boundary function without a value": (lambda: outline(lambda t: None), "outline: boundary function = nan"),
    "boundary function of complex numbers": (lambda: outline(lambda t: np.exp(6.283j * t)), "expected numbers"),
    "spacing function of another shape": (lambda: outline(spacing=lambda x, y: np.ones(3)), "spacing(x, y) raised"),
    "spacing function too fine": (lambda: outline(spacing=lambda x, y: 1e-5 + 0 * x), "expected larger spacings"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_wrong_outlines_are_refused_in_a_line(case):
    make, text = REFUSED[case]
    with pytest.raises(InputError) as error:
        make()
    assert text in str(error.value)


def test_empty_lists_are_fine():
    assert outline(holes=[], cracks={}, inclusions=()).size == outline().size


@pytest.mark.parametrize("shift", [500e3, -4.5e6])
@pytest.mark.parametrize("spacing", [5e-3, lambda x, y: 5e-3 + 0.0 * x], ids=["even", "graded"])
def test_an_outline_at_survey_coordinates_is_that_near_the_origin(shift, spacing):
    """Squares of coordinates of 4500 km keep no digits of 5 mm, and slivers along a slanting side have round-off."""
    corners, shift = np.array([(0.0, 0.0), (0.09, 0.013), (0.08, 0.1), (0.007, 0.097)]), np.array([0.1 * shift, shift])
    near, far = (
        Sheet.outline(corners + by, holes=[Circle(by + 0.05, 0.015)], spacing=spacing, thickness=1e-3, density=1e3)
        for by in (np.zeros(2), shift)
    )
    assert abs(far.size - near.size) <= 2 and len(far.edges("outline")) == len(near.edges("outline"))
    assert len(far.triangles) - 2 * far.size == len(near.triangles) - 2 * near.size
    assert far.areas.sum() == pytest.approx(near.areas.sum(), rel=1e-7)


def test_an_outline_without_digits_is_refused():
    with refused("boundary: coordinates up to 4.5e+08 m have no digits for a spacing of 0.005 m"):
        Sheet.outline(np.array([(0, 0), (0.1, 0), (0, 0.1)]) + 4.5e8, spacing=5e-3, thickness=1e-3, density=1e3)
