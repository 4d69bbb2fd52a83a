"""Names of edges survive every edit of every sheet."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import jittered, refused, square

from warp_pd import Circle, Place, Sheet, glued, together
from warp_pd.geometry.sheet import SIDES
from warp_pd.geometry.triangulation import boundary_edges

SOLID = {"thickness": 1e-3, "density": 1000.0}
CORNERS = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)]
HOLE = {"bore": Circle((0.03, 0.03), 0.016)}
CLOUD = Sheet.outline(CORNERS, holes=HOLE, spacing=0.01, **SOLID)


def from_file(folder, z=0.0):
    """A square with a hole, read from a mesh whose names of groups are like those of edges; curved if z is not 0."""
    import meshio

    points = np.column_stack([CLOUD.points, z * CLOUD.points[:, 0] ** 2])
    sets = {"hole to fill": np.arange(20), "outline of a badge": np.arange(30)}
    meshio.Mesh(points, [("triangle", CLOUD.triangles)], point_sets=sets).write(folder / "mesh.inp")
    return Sheet.from_file(folder / "mesh.inp", unit="m", **SOLID)


FLAT = {
    "rectangle": lambda folder: square(11),
    "oblong": lambda folder: square(points=(41, 5)),
    "centred": lambda folder: square(11, centred=True),
    "layers": lambda folder: square(11, layers=(1, 2)),
    "filled": lambda folder: Sheet.filled(0.1, 0.1, points=11, turn=20.0, **SOLID),
    "jittered": lambda folder: jittered(11),
    "outline": lambda folder: CLOUD,
    "disc": lambda folder: Sheet.outline(Circle((0.05, 0.05), 0.05), spacing=0.01, **SOLID),
    "cracked": lambda folder: Sheet.outline(CORNERS, cracks=[[(0, 0.08), (0.06, 0.08)]], spacing=0.01, **SOLID),
    "graded": lambda folder: Sheet.outline(CORNERS, spacing=lambda x, y: 0.008 + 0.05 * x, **SOLID),
    "from_points": lambda folder: Sheet.from_points(CLOUD.points, outline=CORNERS, holes=HOLE, graded=True, **SOLID),
    "from_file": from_file,
    "cut": lambda folder: CLOUD.cut((0.0, 0.0812), (0.06, 0.0812)),
    "hole": lambda folder: square(11).hole((0.03, 0.03), 0.012),
    "prestretched": lambda folder: square(11).prestretched(1.3, 1.1),
    "glued": lambda folder: glued(square(11), "right", square(11), "left", Place((0.1, 0.0, 0.0))),
}
TUBE = Sheet.tube(0.02, 0.06, points=24, **SOLID)
CURVED = {
    "tube": lambda folder: TUBE,
    "sphere": lambda folder: Sheet.sphere(0.02, points=5, **SOLID),
    "slit": lambda folder: TUBE.slit((0.02, 0.0, 0.0), (0.02, 0.0, 0.03)),
    "file": lambda folder: from_file(folder, 3.0),
    "glued": lambda folder: glued(TUBE, "top", TUBE, "bottom", Place((0.0, 0.0, 0.06))),
}


ANY_SHEET = {
    "as_cloud": lambda sheet: sheet.as_cloud(),
    "stiffened": lambda sheet: sheet.stiffened([0, 1], 2.0),
    "rigid": lambda sheet: sheet.rigid(sheet.triangles[0]),
    "prestretched": lambda sheet: sheet.prestretched(1.2),
    "unstretched": lambda sheet: sheet.prestretched(1.2).unstretched(),
}
FLAT_SHEET = {
    "turned": lambda sheet: sheet.turned(30.0),
    "turned 1": lambda sheet: sheet.turned(1.0),
    "turned 90": lambda sheet: sheet.turned(90.0),
    "turned twice": lambda sheet: sheet.turned(30.0).prestretched(1.3, 1.0).turned(-50.0).unstretched(),
    "cut": lambda sheet: sheet.cut((0.0712, -0.1), (0.0712, 0.0512)),
    "cut and turned": lambda sheet: sheet.cut((0.0712, -0.1), (0.0712, 0.0512)).turned(30.0).as_cloud(),
}


def names_of(sheet):
    """Points of each name of a sheet, and of its sides if it is flat."""
    return {name: sheet.edges(name) for name in (*sheet.parts, *(SIDES if sheet.frames is None else ()), "all")}


@pytest.mark.parametrize(
    ("makers", "edits"), [(FLAT, ANY_SHEET | FLAT_SHEET), (CURVED, ANY_SHEET)], ids=["flat", "curved"]
)
def test_names_survive_every_edit(makers, edits, tmp_path):
    """Turned, cut and stretched sheets have the points they had under each name."""
    for maker, make in makers.items():
        before = make(tmp_path)
        for edit, change in edits.items():
            after = change(before)
            for name, points in names_of(before).items():
                np.testing.assert_array_equal(after.edges(name), points, f"{name!r} of {maker}, {edit}")


@pytest.mark.parametrize("turn", [0.0, 30.0])
def test_a_hole_leaves_names_and_adds_its_rim(turn, tmp_path):
    """The rim is that of the triangles, also of a hole on a cut and of one that takes a side away."""
    for maker, make in FLAT.items():
        sheet = make(tmp_path)
        before = replace(sheet.turned(turn) if turn else sheet, thickness=1.0 + np.arange(sheet.size))
        for place, radius in ((sheet.nearest(0.07, 0.055), 0.018), (sheet.edges("left")[0], 0.03)):
            after = before.hole(tuple(before.points[place]), radius)
            kept = after.thickness.astype(int) - 1
            for name, points in names_of(sheet).items():
                expected = points[np.isin(points, kept)]
                if name == "all":
                    rim = next(f"hole {k}" for k in (1, 2, 3) if f"hole {k}" not in sheet.parts)
                    expected = np.union1d(expected, kept[after.edges(rim)])
                np.testing.assert_array_equal(kept[after.edges(name)], expected, f"{name!r} of {maker}")
            if maker not in ("cut", "cracked"):
                rim = np.unique(boundary_edges(after.triangles))
                np.testing.assert_array_equal(after.edges("all"), rim, maker)


def test_all_is_the_rim_of_the_triangles(tmp_path):
    """Named holes belong to it; groups of files, pieces and slits do not."""
    for maker, make in (FLAT | CURVED).items():
        sheet = make(tmp_path)
        if maker not in ("cut", "cracked", "slit"):
            np.testing.assert_array_equal(sheet.edges("all"), np.unique(boundary_edges(sheet.triangles)), maker)
        if sheet.frames is None:
            assert np.isin(sheet.edges(*SIDES), sheet.edges("all")).all() or maker == "disc", maker
    slit = CURVED["slit"](tmp_path)
    assert len(slit.edges("all")) == len(TUBE.edges("all")) + 1
    holed = TUBE.hole((-0.02, 0.0, 0.03), 0.01)
    np.testing.assert_array_equal(holed.edges("all"), np.unique(boundary_edges(holed.triangles)))


def test_pieces_have_the_names_of_their_sheets(tmp_path):
    for makers in (FLAT, CURVED):
        sheets = [make(tmp_path) for make in makers.values()]
        sheets = [sheet for sheet in sheets if sheet.stretch is None]
        both, first = together(*sheets), 0
        rim = []
        for number, sheet in enumerate(sheets, start=1):
            for name, points in names_of(sheet).items():
                np.testing.assert_array_equal(both.edges(f"sheet {number} {name}"), points + first)
            rim.append(sheet.edges("all") + first)
            first += sheet.size
        np.testing.assert_array_equal(both.edges("all"), np.concatenate(rim))
    pair = together(square(5), square(5))
    with refused("edge = 'left': expected one of 'sheet 1', 'sheet 1 left'"):
        pair.edges("left")
    assert len(pair.hole((0.05, 0.05), 0.01).edges("sheet 2 left")) == 5


def test_a_glued_sheet_has_the_names_of_both():
    left = square(11).turned(180.0)
    sheet = glued(left, "left", square(11), "left", Place((0.1, 0.0, 0.0)))
    np.testing.assert_array_equal(sheet.edges("sheet 1 left"), left.edges("left"))
    np.testing.assert_array_equal(sheet.edges("seam"), sheet.edges("sheet 2 left"))
