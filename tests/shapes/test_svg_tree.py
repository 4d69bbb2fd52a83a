"""Where an SVG file draws its shapes, and what of it shows: each case by hand from SVG 2."""

import numpy as np
import pytest

from warp_pd import InputError
from warp_pd.shapes.svg import read_outline

BOX = 'viewBox="0 0 10 10"'
UNIT = '<rect width="10" height="10"/>'
SYMBOL = f'<defs><symbol id="s" {BOX}>{UNIT}</symbol></defs>'
SQUARE = '<rect x="10" y="20" width="30" height="40"/>'
WHERE = (10, 20, 40, 60)


def read(folder, body, head='viewBox="0 0 100 100"', **options):
    path = folder / "outline.svg"
    links = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    path.write_text(f"<svg {links} {head}>{body}</svg>")
    return read_outline(path, unit=1.0, tolerance=1e-3, **options)


# x and y of the corners, with y downwards.
PLACES = {
    "svg at x, y": (f'<svg x="10" y="10" width="50" height="50" {BOX}>{UNIT}</svg>', (10, 10, 60, 60)),
    "svg of the same size": (f'<svg x="10" y="10" width="10" height="10" {BOX}>{UNIT}</svg>', (10, 10, 20, 20)),
    "svg without a viewBox": (f'<svg x="20" y="20">{UNIT}</svg>', (20, 20, 30, 30)),
    "svg with a size alone": (f'<svg x="20" y="5" width="60" height="60">{SQUARE}</svg>', (30, 25, 60, 65)),
    "svg in a group": (
        f'<g transform="translate(4)"><svg x="1" width="20" height="20" {BOX}>{UNIT}</svg></g>',
        (5, 0, 25, 20),
    ),
    "svg in svg": (
        f'<svg x="10" y="10" width="50" height="50" {BOX}><svg x="2" y="3" width="50%" height="5">'
        '<rect width="100%" height="20%"/></svg></svg>',
        (20, 25, 45, 30),
    ),
    "origin of a viewBox": (
        '<svg x="10" width="50" height="50" viewBox="5 -5 25 25"><rect x="5" y="-5" width="10" height="10"/></svg>',
        (10, 0, 30, 20),
    ),
    "middle": (f'<svg width="80" height="40" {BOX}>{UNIT}</svg>', (20, 0, 60, 40)),
    "max": (f'<svg width="80" height="40" preserveAspectRatio="xMaxYMin meet" {BOX}>{UNIT}</svg>', (40, 0, 80, 40)),
    "none": (f'<svg width="80" height="40" preserveAspectRatio="none" {BOX}>{UNIT}</svg>', (0, 0, 80, 40)),
    "slice": (
        f'<svg width="40" height="80" preserveAspectRatio="xMinYMid slice" overflow="visible" {BOX}>{UNIT}</svg>',
        (0, 0, 80, 80),
    ),
    "symbol": (f'{SYMBOL}<use href="#s" x="20" y="20" width="40" height="40"/>', (20, 20, 60, 60)),
    "symbol, xlink": (f'{SYMBOL}<use xlink:href="#s" x="20" width="40" height="20"/>', (30, 0, 50, 20)),
    "symbol as large as the page": (f'{SYMBOL}<use href="#s"/>', (0, 0, 100, 100)),
    "symbol of its own size": (
        f'<symbol id="s" width="20" height="20" {BOX}>{UNIT}</symbol><use href="#s" x="5"/>',
        (5, 0, 25, 20),
    ),
    "symbol, turned copy": (
        f'{SYMBOL}<use href="#s" x="5" width="10" height="10" transform="rotate(90) scale(2)"/>',
        (-20, 10, 0, 30),
    ),
    "svg copied": (
        f'<defs><svg id="s" x="1" width="5" height="5" {BOX}>{UNIT}</svg></defs>'
        '<use href="#s" x="10" width="50" height="50"/>',
        (11, 0, 61, 50),
    ),
    "group copied": (
        f'<defs><g id="s" transform="scale(2)">{UNIT}</g></defs><use href="#s" x="10" width="90" height="90"/>',
        (10, 0, 30, 20),
    ),
    "percentages": ('<rect x="10%" y="20%" width="30%" height="40%"/>', WHERE),
    "circle in per cent": ('<circle cx="50%" cy="50%" r="10%"/>', (40, 40, 60, 60)),
    "transforms": (
        '<rect width="10" height="10" transform="matrix(1 0 0 2 3-4),translate(5)rotate(90 5 5)"/>',
        (8, -4, 18, 16),
    ),
    "turned about": ('<rect width="10" height="20" transform="rotate(90,10,20)"/>', (10, 10, 30, 20)),
    "style sheet": (
        "<style>/* a */ .m { transform: translate(10px, 20px); fill: red } rect#r { width: 30px }</style>"
        '<rect id="r" class="k m" width="1" height="40" transform="scale(9)"/>',
        WHERE,
    ),
    "style before class before tag": (
        "<style>.m{width:2px} rect{width:3px;height:40px} #r{x:10px}</style>"
        '<rect id="r" class="m" width="1" height="5" y="20" style="width:30px"/>',
        WHERE,
    ),
    "hidden": (
        f'{SQUARE}<g visibility="hidden">{UNIT}</g><g style="display:none">{UNIT}</g><g class="h">{UNIT}</g>'
        "<style>.h{display:none}</style>",
        WHERE,
    ),
    "visible in hidden": (f'<g visibility="hidden">{UNIT}<g visibility="visible">{SQUARE}</g></g>', WHERE),
    "copy of a hidden group's part": (
        '<g display="none"><rect id="r" width="30" height="40"/></g><use href="#r" x="10" y="20"/>',
        WHERE,
    ),
    "switch": (f'<switch><g requiredExtensions="x">{UNIT}</g>{SQUARE}{UNIT}</switch>', WHERE),
    "never drawn": (
        f"{SQUARE}<pattern>{UNIT}</pattern><mask>{UNIT}</mask><marker>{UNIT}</marker><clipPath>{UNIT}</clipPath>"
        f"<symbol>{UNIT}</symbol>"
        '<x:rect xmlns:x="x" width="5" height="5"/><text> </text><title>t</title>',
        WHERE,
    ),
    "no extent": (
        f'{SQUARE}<rect height="5"/><circle/><ellipse rx="3" ry="0"/><path d=""/><svg width="0">{UNIT}</svg>',
        WHERE,
    ),
    "scaled to nothing": (f'{SQUARE}<g transform="scale(0)">{UNIT}</g>', WHERE),
    "clip that does not cut": (
        f'<clipPath id="c"><rect width="100" height="100"/></clipPath><g clip-path="url(#c)">{SQUARE}</g>',
        WHERE,
    ),
    "clip in the units of what it clips": (
        '<clipPath id="c"><use href="#r"/></clipPath><defs><rect id="r" width="30" height="40"/></defs>'
        '<g transform="translate(10 20)"><use href="#r" clip-path="url(#c)"/></g>',
        WHERE,
    ),
}


@pytest.mark.parametrize("name", PLACES)
def test_places(tmp_path, name):
    body, expected = PLACES[name]
    rings = read(tmp_path, body)
    points = rings.boundary.points * [1, -1]
    assert rings.holes == ()
    assert np.allclose([*points.min(axis=0), *points.max(axis=0)], expected, atol=2e-3)


def test_rounded_corners(tmp_path):
    """One radius alone is both; at most half of the side."""
    for corner, area in (('rx="2"', 100 - 4 * (4 - np.pi)), ('ry="9"', 25 * np.pi), ('rx="0" ry="3"', 100.0)):
        x, y = read(tmp_path, f'<rect width="10" height="10" {corner}/>').boundary.points.T
        assert 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) == pytest.approx(area, rel=1e-3)


CLIP = '<clipPath id="c"><path d="M0 0 H30 V60 H0"/></clipPath>'
RING = '<clipPath id="c"><path clip-rule="evenodd" d="M0 0H90V90H0ZM20 30h2v2h-2Z"/></clipPath>'
REFUSED = {
    "clip": (f'{CLIP}<g clip-path="url(#c)">{SQUARE}</g>', "clipPath c cuts rect 0: expected shapes as they show"),
    "clip with a hole": (f'{RING}<g clip-path="url(#c)">{SQUARE}</g>', "clipPath c cuts rect 0"),
    "clip of a sheet": (f'{CLIP}<style>rect{{clip-path:url("#c")}}</style>{SQUARE}', "clipPath c cuts rect 0"),
    "clip of a shape": (
        f'<g clip-path="circle(3px)">{SQUARE}</g>',
        "g has clip-path = 'circle(3px)': expected url(#...)",
    ),
    "clip that is missing": (f'<g clip-path="url(#d)">{SQUARE}</g>', "g has clip-path = 'url(#d)': expected url(#...)"),
    "clip in fractions": (
        f'<clipPath id="c" clipPathUnits="objectBoundingBox">{UNIT}</clipPath><g clip-path="url(#c)">{SQUARE}</g>',
        "clipPath c: expected one in user units",
    ),
    "viewport": (f'<svg id="v" width="30" height="90">{SQUARE}</svg>', "the viewport of svg v cuts rect 0"),
    "symbol": (
        f'<symbol id="s" {BOX}>{SQUARE}</symbol><use href="#s"/>',
        "the viewport of symbol s cuts rect 0",
    ),
    "clip of itself": (
        f'<clipPath id="c"><g clip-path="url(#c)">{UNIT}</g></clipPath><g clip-path="url(#c)">{SQUARE}</g>',
        "g is clipped in a clip path",
    ),
    "garbage in a path": ('<path d="M0 0 H9 V9 Z X H1"/>', "path cannot be read: expected a path of numbers"),
    "mask": (f'<g id="m" mask="url(#x)">{SQUARE}</g>', "the mask of g m cuts rect 0: expected shapes as they show"),
    "animation": ('<rect width="5" height="5"><animate/></rect>', "animate in the drawing"),
    "other file": (
        '<use id="u" href="a.svg#b"/>',
        "use u has href = 'a.svg#b': expected # and the id of an element here",
    ),
    "no such copy": ('<use xlink:href="#b"/>', "use has href = '#b'"),
    "language": (f'<switch><g systemLanguage="de">{SQUARE}</g></switch>', "g: systemLanguage"),
    "page turned": (SQUARE, "svg has transform = 'rotate(3)': expected it on a group", 'transform="rotate(3)"'),
    "origin": (
        '<g id="g" transform="scale(2)" transform-origin="5 5"/>',
        "g g has transform-origin = '5 5': expected 0 0",
    ),
    "transform": (
        '<g transform="translate(10mm)"/>',
        "g has transform = 'translate(10mm)': expected matrix, translate,",
    ),
    "rotate of a style": ('<g style="rotate:5deg"/>', "g has rotate = '5deg': expected transform alone"),
    "selector": (
        "<style>g rect{display:none}</style>",
        "the style sheet sets display of 'g rect': expected selectors of",
    ),
    "media": ("<style>@media print{rect{display:none}}</style>", "the style sheet sets display of 'rect': expected"),
    "import": ('<style>@import "a.css";</style>', "style sheets import another file"),
    "link": (
        '<link xmlns="http://www.w3.org/1999/xhtml" rel="stylesheet" href="a.css"/>',
        "style sheets import another file",
    ),
    "sheet in another file": ("<?xml-stylesheet href='a.css'?>", "its style sheet is another file"),
    "too deep": ("<g>" * 3000 + "</g>" * 3000, "the file cannot be read: its elements are nested too deeply"),
    "infinite": ('<rect id="r" x="1e999" width="5" height="5"/>', "rect r: x = '1e999': expected a length"),
    "infinite scale": ('<g transform="scale(1e999)"/>', "g has transform = 'scale(1e999)': expected matrix"),
    "important": ('<rect style="display:none !important"/>', "style display: none !important: expected a plain value"),
    "length": ('<rect id="r" x="2em" width="5" height="5"/>', "rect r: x = '2em': expected a length in px, %, mm,"),
    "per cent of nothing": ('<rect width="5%" height="5"/>', "rect: width = '5%': expected a number; the drawing", ""),
    "negative": ('<circle r="-3"/>', "circle has a size of -3: expected positive numbers"),
    "fit": (f'<svg {BOX} preserveAspectRatio="mid"/>', "svg: preserveAspectRatio = 'mid': expected such as"),
    "viewBox": ('<svg id="a" viewBox="0 0 10"/>', "svg a: viewBox = '0 0 10': expected x, y, width, height"),
    "foreign": ("<foreignObject/>", "foreignObject 0: expected only paths and shapes"),
    "points": ('<polygon points="0,0 4,0 4"/>', "polygon cannot be read: expected a path of numbers"),
    "path of a style": ("<path style=\"d:path('M0 0H5V5Z')\"/>", "path cannot be read: expected a path of numbers"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_read_is_named(tmp_path, name):
    body, text, *head = REFUSED[name]
    with pytest.raises(InputError) as error:
        read(tmp_path, body, *head)
    assert text in str(error.value) and "\n" not in str(error.value), error.value


def test_a_part_is_read_beside_what_is_not(tmp_path):
    """Only the shapes that are asked for must be read as they show."""
    body = f'<g mask="url(#m)">{UNIT}</g><text>hello</text><rect id="k" x="10" y="20" width="30" height="40"/>'
    assert read(tmp_path, body, part="k").boundary.points.max(axis=0).tolist() == [40.0, -20.0]
