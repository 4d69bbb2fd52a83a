"""Outlines from SVG files: curves within their tolerance, transforms, units, holes, and what is wrong in one line."""

from importlib.resources import files

import numpy as np
import pytest
from helpers import refused

from warp_pd import InputError, Sheet
from warp_pd.shapes.svg import read_outline

VIEW = 'viewBox="0 0 100 50"'


def write(folder, body, head=VIEW):
    path = folder / "outline.svg"
    links = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    path.write_text(f"<svg {links} {head}>{body}</svg>")
    return path


def read(folder, body, head=VIEW, *, unit=1.0, tolerance=1e-3, **options):
    return read_outline(write(folder, body, head), unit=unit, tolerance=tolerance, **options)


def area(ring):
    x, y = ring.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def test_boundary_and_holes(tmp_path):
    """Counter-clockwise outside, clockwise inside, whatever the direction of the paths; y turned upwards."""
    for square in ("M0 0 H40 V20 H0 Z", "M0 0 V20 H40 V0 Z"):
        rings = read(tmp_path, f'<path d="{square} M2 2 h4 v6 h-4 z"/><rect x="20" y="5" width="3" height="3"/>')
        assert sorted(map(tuple, rings.boundary.points.tolist())) == [(0, -20), (0, 0), (40, -20), (40, 0)]
        assert area(rings.boundary.points) == pytest.approx(800.0)
        assert [area(hole.points) for hole in rings.holes] == pytest.approx([-24.0, -9.0])
        assert rings.holes[0].points.max(axis=0).tolist() == [6.0, -2.0]


CURVES = {
    # The distance of a point from the curve, and its area.
    "circle": ('<circle cx="5" cy="-7" r="10"/>', lambda x, y: np.hypot(x - 5, y - 7) - 10, 100 * np.pi),
    "sheared": (
        '<g transform="translate(3 4) scale(2)"><circle r="5" transform="skewX(30)"/></g>',
        lambda x, y: np.hypot(x - 3 + (y + 4) * np.tan(np.pi / 6), y + 4) - 10,
        100 * np.pi,
    ),
    "ellipse": (
        '<ellipse rx="8" ry="2" transform="rotate(90)"/>',
        lambda x, y: 2 * (np.hypot(x / 2, y / 8) - 1),
        16 * np.pi,
    ),
    "arcs": ('<path d="M-5 0 A5 5 0 0 1 5 0 A5 5 0 0 1 -5 0"/>', lambda x, y: np.hypot(x, y) - 5, 25 * np.pi),
    "parabola": ('<path d="M0 0 Q5 20 10 0 Z"/>', lambda x, y: np.minimum(-y, y + 0.4 * x * (10 - x)), 200 / 3),
    "cubic": ('<path d="M0 0 C0 20 10 20 10 0 Z"/>', None, 120.0),
    "smooth": ('<path d="M0 0 C0 10 5 10 5 0 S10 -10 10 0 V20 H0 Z"/>', None, 200.0),
}


@pytest.mark.parametrize("tolerance", [1e-1, 1e-3, 1e-5])
@pytest.mark.parametrize("name", CURVES)
def test_curves_are_within_the_tolerance(tmp_path, name, tolerance):
    body, distance, whole = CURVES[name]
    ring = read(tmp_path, body, tolerance=tolerance).boundary.points
    length = np.linalg.norm(ring - np.roll(ring, -1, axis=0), axis=1).sum()
    assert abs(area(ring) - whole) <= tolerance * length
    if distance is not None:
        middle = 0.5 * (ring + np.roll(ring, -1, axis=0))
        assert np.abs(distance(*ring.T)).max() < 1e-9
        assert np.abs(distance(*middle.T)).max() < 1.2 * tolerance
    # A circle of radius 10 needs this many.
    assert len(ring) < 3 * 2 * np.pi * np.sqrt(10.0 / (8.0 * tolerance)) + 8


UNITS = [
    ("mm", VIEW, 1e-3),
    ("in", f'{VIEW} width="200mm" height="100mm"', 0.0254),
    (2.5, "", 2.5),
    ("document", f'{VIEW} width="200mm" height="100mm"', 2e-3),
    ("document", f'{VIEW} width="5in" height="2.5in"', 0.05 * 0.0254),
    ("document", 'viewBox="-10 -10 72 72" width="72pt" height="72pt"', 0.0254 / 72),
    ("document", 'width="10cm" height="5cm"', 0.0254 / 96),
]


@pytest.mark.parametrize(("unit", "head", "meters"), UNITS)
def test_units(tmp_path, unit, head, meters):
    """User units are those of the viewBox, with its origin; or the document says how large it is."""
    ring = read(tmp_path, '<rect x="1" y="2" width="40" height="10"/>', head, unit=unit).boundary.points
    assert np.allclose(ring.min(axis=0), (meters, -12 * meters), rtol=1e-13)
    assert np.allclose(np.ptp(ring, axis=0), (40 * meters, 10 * meters), rtol=1e-13)


def test_elements_that_are_drawn(tmp_path):
    """Uses of a definition are drawn; definitions, clip paths and hidden elements are not."""
    body = (
        '<defs><rect id="a" width="4" height="4"/><clipPath id="c"><circle r="3"/></clipPath></defs>'
        '<use xlink:href="#a" x="5" y="-9"/><rect style="display:none" width="30" height="40"/>'
    )
    assert read(tmp_path, body).boundary.points.min(axis=0).tolist() == [5.0, 5.0]
    assert area(read(tmp_path, '<polygon points="0,0 4,0 4,4"/>').boundary.points) == 8.0
    # A polyline that comes back to its start is closed.
    assert area(read(tmp_path, '<polyline points="0,0 4,0 4,4 0,0"/>').boundary.points) == 8.0


def test_part(tmp_path):
    body = '<rect id="left" width="4" height="4"/><g transform="scale(2)"><circle id="right" cx="20" r="1"/></g>'
    assert read(tmp_path, body, part="left").boundary.points.max() == 4.0
    assert read(tmp_path, body, part="right", tolerance=1e-6).boundary.points[:, 0].max() == pytest.approx(42.0)
    with refused(match="part = 'rihgt': expected one of 'left', 'right'"):
        read(tmp_path, body, part="rihgt")


WRONG = {
    "open": ('<path id="cuff" d="M0 0 H10 V10 H0"/>', "path cuff is open, from [0., 0.] to [  0., -10.] m"),
    "line": ('<line x2="3" y2="4"/>', "line 0 is open"),
    "second part open": ('<path d="M0 0 H10 V10 H0 Z M1 1 h1 v1"/>', "path 0 is open, from [ 1., -1.]"),
    "empty": ("", "no closed path: expected one or more"),
    "text": ("<text>hello</text>", "text 0: expected only paths and shapes; convert text to paths and remove images"),
    "bow tie": ('<path d="M0 0 L10 10 L10 0 L0 10 Z"/>', "self-intersection at (5, -5) m: expected paths that do not"),
    "crossing": (
        '<rect width="10" height="10"/><rect x="5" y="-5" width="10" height="10"/>',
        "two paths meet at (5, 0) m: expected separate paths",
    ),
    "twice": ('<rect width="10" height="10"/><rect width="10" height="10"/>', "two paths meet at"),
    "two": (
        '<rect width="10" height="10"/><rect x="20" width="10" height="10"/>',
        "2 boundaries, with lower left corners at (0, -10), (20, -10) m: expected one; choose with part=",
    ),
    "island": (
        '<rect width="10" height="10"/><circle cx="5" cy="5" r="4"/><rect x="4" y="4" width="2" height="2"/>',
        "an island in a hole, at (4, -6) m: expected one piece",
    ),
    "no area": ('<path d="M0 0 H10 Z"/>', "path 0 has 2 corners: expected three or more"),
    "a dot": ('<path d="M1 1 L1 1 Z"/>', "path 0 has no extent"),
    "nan": ('<path d="M0 0 H nan V10 H0 Z"/>', "path cannot be read: expected a path of numbers"),
    "broken": ("<rect>", "the file cannot be read: line 1, column "),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_outlines_are_named(tmp_path, name):
    body, text = WRONG[name]
    path = write(tmp_path, body)
    with pytest.raises(InputError) as error:
        read_outline(path, unit="m", tolerance=1e-3)
    said = " ".join(str(error.value).split())
    assert said.startswith(f"path = '{path}': {' '.join(text.split())}"), said


def test_wrong_arguments(tmp_path):
    square = '<rect width="10" height="10"/>'
    for unit in (None, "px"):
        with refused(match=rf"unit = {unit!r}: expected 'm', 'mm', 'cm', 'in' or a number of meters"):
            read(tmp_path, square, unit=unit)
    for head in (VIEW, f'{VIEW} width="100%" height="50px"'):
        with refused(match=r"unit = 'document': .* expected lengths in mm, cm, in"):
            read(tmp_path, square, head, unit="document")
    with refused(match="expected the ratio of the viewBox"):
        read(tmp_path, square, f'{VIEW} width="100mm" height="100mm"', unit="document")
    with refused(match=r"tolerance = 0\.0: expected a positive number"):
        read(tmp_path, square, tolerance=0.0)
    with refused(match="the file does not exist"):
        read_outline(tmp_path / "none.svg", unit="m", tolerance=1e-3)


ROUNDED = '<path d="M2 0 H10 V10 H2 A2 2 0 0 1 0 8 V2 A2 2 0 0 1 2 0 Z"/>'


def test_corners_are_points_and_curves_follow_the_spacing(tmp_path):
    """Two corners are sharp; where lines run into arcs the curve is smooth, however coarsely the arcs are drawn."""
    for tolerance in (0.2, 1e-4):
        curve = read(tmp_path, ROUNDED, tolerance=tolerance).boundary
        assert sorted(curve.points[curve.corners].tolist()) == [[10.0, -10.0], [10.0, 0.0]]
        for turned in (curve, curve.reversed()):
            points, side = turned.sampled(lambda at: np.full(len(at), 0.5))
            assert {(10.0, 0.0), (10.0, -10.0)} <= set(map(tuple, points.tolist()))
            gap = np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1)
            assert 0.45 < gap.min() and gap.max() < 0.55
            assert sorted(np.bincount(side)) == [20, len(points) - 20]
        assert area(curve.points) == pytest.approx(-area(curve.reversed().points)) and area(curve.points) > 90.0


def test_smooth_curves_follow_a_graded_spacing(tmp_path):
    curve = read(tmp_path, '<circle r="10"/>', tolerance=1e-6).boundary
    assert len(curve.corners) == 0
    points, side = curve.sampled(lambda at: 0.5 + 0.03 * (at[:, 0] + 10.0))
    assert (side == 0).all() and np.abs(np.hypot(*points.T) - 10.0).max() < 1e-5
    gap = np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1)
    middle = 0.5 * (points + np.roll(points, -1, axis=0))
    assert np.allclose(gap, 0.5 + 0.03 * (middle[:, 0] + 10.0), rtol=0.02)


def test_an_outline_becomes_a_sheet(tmp_path):
    """The area of the sheet is that of the drawing, and its sides have names."""
    rings = read(tmp_path, ROUNDED + '<circle cx="5" cy="5" r="2"/>', tolerance=1e-5)
    sheet = Sheet.outline(rings.boundary, holes=rings.holes, spacing=0.25, thickness=1.0, density=1.0)
    assert sheet.areas.sum() == pytest.approx(100.0 - 2 * (4 - np.pi) - 4 * np.pi, rel=2e-3)
    assert len(sheet.parts["hole 1"]) == pytest.approx(4 * np.pi / 0.25, abs=2)
    right = next(p for p in sheet.parts.values() if (sheet.points[p, 0] == 10.0).all())
    assert len(right) == 41


def test_glove():
    """The file that comes with the scenes: a hand without holes, as large as it says."""
    rings = read_outline(str(files("warp_pd.scenes") / "glove.svg"), unit="document", tolerance=5e-5)
    assert rings.holes == ()
    assert np.allclose(rings.boundary.points.min(axis=0), (-0.0869, 0.0), atol=1e-4)
    assert np.allclose(rings.boundary.points.max(axis=0), (0.0660, 0.1850), atol=1e-4)
    assert 0.012 < area(rings.boundary.points) < 0.016


@pytest.mark.parametrize(
    ("head", "side"), [('width="10cm" height="5cm"', "1in"), ('width="10cm" height="5cm"', "25.4mm"), (VIEW, "96")]
)
def test_lengths_with_a_unit_are_those_of_css(tmp_path, head, side):
    """An inch is 96 pixels, and 2.54 cm."""
    unit = "document" if head != VIEW else 0.0254 / 96.0
    rings = read(tmp_path, f'<rect width="{side}" height="{side}"/>', head, unit=unit, tolerance=1e-6)
    assert np.ptp(rings.boundary.points, axis=0) == pytest.approx([0.0254, 0.0254], rel=1e-6)
