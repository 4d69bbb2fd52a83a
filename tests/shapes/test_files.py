"""Sheets from meshes: every format, units, parts, and what is wrong with a mesh in one line."""

import meshio
import numpy as np
import pytest
from helpers import refused
from pxr import Gf, Usd, UsdGeom

from warp_pd import InputError, Sheet, TriangleMesh
from warp_pd.families.visibility import severed
from warp_pd.geometry.triangulation import boundary_edges, cell_triangles, signed_areas
from warp_pd.shapes.files import read_mesh

FLAT = {"thickness": 1e-3, "density": 1000.0}
# A rectangle of 3 x 2 in four triangles around (1, 1); point 5 belongs to none.
CORNERS = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0], [1.0, 1.0], [9.0, 9.0]])
FAN = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])


def spatial(points, z=0.0):
    return np.column_stack([points, np.full(len(points), z)])


def write(path, points=None, cells=None, **data):
    points = spatial(CORNERS) if points is None else np.asarray(points, float)
    meshio.Mesh(points, cells or [("triangle", FAN)], **data).write(path)
    return path


def write_usd(path, points, faces, *, meters=None, name="Sheet", stage=None, orientation=None, holes=(), turn=None):
    stage = stage or Usd.Stage.CreateNew(str(path))
    if meters is not None:
        UsdGeom.SetStageMetersPerUnit(stage, meters)
    mesh = UsdGeom.Mesh.Define(stage, f"/World/{name}")
    mesh.CreatePointsAttr([Gf.Vec3f(*map(float, p)) for p in points])
    mesh.CreateFaceVertexCountsAttr([len(face) for face in faces])
    mesh.CreateFaceVertexIndicesAttr([int(i) for face in faces for i in face])
    if orientation:
        mesh.CreateOrientationAttr(orientation)
    if len(holes):
        mesh.CreateHoleIndicesAttr(list(holes))
    if turn is not None:
        UsdGeom.Xform.Define(stage, "/World").AddTransformOp().Set(Gf.Matrix4d(*turn))
    stage.GetRootLayer().Save()
    return path


def cube():
    """A unit cube of twelve triangles that face outwards."""
    points = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return points, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def volume(mesh):
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    return float((np.cross(a, b) * c).sum() / 6.0)


@pytest.mark.parametrize("kind", ["gmsh22", "gmsh", "ansys"])
def test_all_kinds_of_msh(tmp_path, kind):
    meshio.Mesh(spatial(CORNERS), [("triangle", FAN)]).write(tmp_path / "a.msh", file_format=kind)
    assert Sheet.from_file(tmp_path / "a.msh", unit="cm", **FLAT).areas.sum() == pytest.approx(6e-4)


@pytest.mark.parametrize("suffix", ["msh", "stl", "obj", "ply", "vtu", "vtk", "off", "xdmf", "OBJ"])
def test_every_format_gives_the_same_sheet(tmp_path, suffix):
    path = tmp_path / f"sheet.{suffix}"
    write(tmp_path / f"sheet.{suffix.lower()}").rename(path)
    sheet = Sheet.from_file(path, unit="cm", **FLAT)
    assert sheet.size == 5 and sheet.points.shape == (5, 2)
    assert sheet.areas.sum() == pytest.approx(6e-4)
    assert np.allclose(sheet.points.max(axis=0), (0.03, 0.02))
    assert (signed_areas(sheet.points, sheet.triangles) > 0.0).all()


@pytest.mark.parametrize("suffix", ["usd", "usda", "usdc"])
def test_usd_says_its_unit(tmp_path, suffix):
    path = write_usd(tmp_path / f"sheet.{suffix}", spatial(CORNERS), FAN, meters=0.01)
    assert Sheet.from_file(path, **FLAT).areas.sum() == pytest.approx(6e-4)
    assert Sheet.from_file(path, unit="mm", **FLAT).areas.sum() == pytest.approx(6e-6)


def test_usd_without_a_unit_is_asked_for_one(tmp_path):
    path = write_usd(tmp_path / "sheet.usda", spatial(CORNERS), FAN)
    with refused(match="unit = None: expected 'm', 'mm', 'cm', 'in' or a number of meters"):
        read_mesh(path)
    assert read_mesh(path, unit=2.0).vertices[:, 0].max() == 6.0


@pytest.mark.parametrize(("unit", "meters"), [("m", 1.0), ("mm", 1e-3), ("cm", 1e-2), ("in", 0.0254), (0.3048, 0.3048)])
def test_units(tmp_path, unit, meters):
    assert np.allclose(
        np.ptp(read_mesh(write(tmp_path / "a.obj"), unit=unit).vertices, axis=0), [3 * meters, 2 * meters, 0]
    )


@pytest.mark.parametrize(
    ("unit", "text"),
    [
        (None, "unit = None: expected 'm', 'mm', 'cm', 'in' or a number of meters; the file does not say its unit"),
        ("mmm", "unit = 'mmm': expected one of 'm', 'mm', 'cm', 'in' (did you mean 'mm'?)"),
        (0.0, "unit = 0.0: expected a positive number"),
        ([1], "unit = [1]: expected a number"),
    ],
)
def test_wrong_units(tmp_path, unit, text):
    with pytest.raises(InputError) as error:
        read_mesh(write(tmp_path / "a.obj"), unit=unit)
    assert str(error.value) == text


def test_faces_of_usd(tmp_path):
    """A pentagon with a notch, a quadrilateral and a hole, left-handed and mirrored: the area is that of the shape."""
    points = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (1, 0.5, 0), (0, 2, 0), (3, 0, 0), (3, 2, 0), (4, 0, 0)]
    faces = [(0, 1, 2, 3, 4), (1, 5, 6, 2), (5, 7, 6)]
    mirror = ((-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (10, 0, 0.5, 1))
    plain = read_mesh(write_usd(tmp_path / "a.usda", points, faces, holes=[2]), unit="m")
    assert len(plain.triangles) == 5 and plain.flat and plain.pieces == 1
    turned = read_mesh(
        write_usd(tmp_path / "b.usda", points, [f[::-1] for f in faces], orientation="leftHanded", holes=[2]), unit="m"
    )
    mirrored = read_mesh(write_usd(tmp_path / "c.usda", points, faces, holes=[2], turn=mirror), unit="m")
    for mesh in (plain, turned, mirrored):
        a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
        # The notch takes 1.5 out of the square of 4.
        assert 0.5 * np.cross(b - a, c - a)[:, 2] == pytest.approx(np.abs(0.5 * np.cross(b - a, c - a)[:, 2]))
        assert 0.5 * np.cross(b - a, c - a)[:, 2].sum() == pytest.approx(2.5 + 2.0)
    assert mirrored.vertices[:, 0].min() == 7.0 and mirrored.vertices[0, 2] == 0.5


def test_parts_of_usd(tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "two.usda"))
    write_usd(None, spatial(CORNERS), FAN, stage=stage, meters=1.0)
    path = write_usd(None, *cube(), stage=stage, name="Cube") or tmp_path / "two.usda"
    assert len(read_mesh(path, part="Cube").triangles) == 12
    assert len(read_mesh(path, part="/World/Sheet").triangles) == 4
    for part in (None, "Ball"):
        with refused(match=rf"part = {part!r}: .*expected one of /World/Sheet, /World/Cube"):
            read_mesh(path, part=part)


def test_own_animation_is_a_mesh(ball):
    """The first frame of a run's animation.usd is the sheet of that run: 21 points and clamps of 3 on both sides."""
    mesh = read_mesh(ball / "animation.usd", part="Sheet")
    assert mesh.flat and len(mesh.vertices) == 21 * 21


def test_groups_of_gmsh(tmp_path):
    """Named groups of lines and points become parts; a group of faces is chosen by its name."""
    left, wall = np.array([[3, 0]]), np.array([[0, 1], [1, 2]])
    path = tmp_path / "named.msh"
    tags = {"gmsh:physical": [np.array([7]), np.array([8, 8]), np.array([9, 9, 9, 10])]}
    tags["gmsh:geometrical"] = tags["gmsh:physical"]
    names = {"left": np.array([7, 1]), "wall": np.array([8, 1]), "main": np.array([9, 2]), "rest": np.array([10, 2])}
    cells = [("line", left), ("line", wall), ("triangle", FAN)]
    meshio.Mesh(spatial(CORNERS), cells, cell_data=tags, field_data=names).write(
        path, file_format="gmsh22", binary=False
    )
    sheet = Sheet.from_file(path, unit="m", **FLAT)
    parts = {"outline": [0, 1, 2, 3], "left": [0, 3], "wall": [0, 1, 2], "main": [0, 1, 2, 3, 4], "rest": [0, 3, 4]}
    assert {name: part.tolist() for name, part in sheet.parts.items()} == parts
    assert len(read_mesh(path, unit="m", part="main").triangles) == 3
    with refused(match="part = 'mian': expected one of 'main', 'rest'"):
        read_mesh(path, unit="m", part="mian")
    with refused(match=r"part = 'main': a\.stl has no named groups of faces: expected None"):
        read_mesh(write(tmp_path / "a.stl"), unit="m", part="main")


def test_second_order_elements_are_those_of_their_corners(tmp_path):
    middle = 0.5 * (SQUARE + np.roll(SQUARE, -1, axis=0))
    points = np.vstack([SQUARE, middle, [[0.5, 0.5, 0.0]]])
    six = read_mesh(
        write(tmp_path / "six.vtu", points, [("triangle6", np.array([[0, 1, 2, 4, 5, 8], [0, 2, 3, 8, 6, 7]]))]),
        unit="m",
    )
    eight = read_mesh(write(tmp_path / "eight.vtu", points, [("quad8", np.arange(8)[None])]), unit="m")
    for mesh in (six, eight):
        assert mesh.vertices.tolist() == SQUARE.tolist() and len(mesh.triangles) == 2


def test_quadrilaterals_are_divided_inside(tmp_path):
    """A dart has one diagonal inside; a kite takes the shorter one."""
    dart = [[0, 0, 0], [2, 1, 0], [0, 2, 0], [0.5, 1, 0]]
    kite = [[0, 0, 0], [1, -1, 0], [5, 0, 0], [1, 1, 0]]
    for points, shared, area in ((dart, {1, 3}, 1.5), (kite, {1, 3}, 5.0)):
        mesh = read_mesh(write(tmp_path / "quad.vtu", points, [("quad", np.arange(4)[None])]), unit="m")
        assert set(mesh.triangles[0]) & set(mesh.triangles[1]) == shared
        a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
        assert 0.5 * np.cross(b - a, c - a)[:, 2].sum() == pytest.approx(area)


@pytest.mark.parametrize("n", [5, 6, 9, 12])
def test_polygons_in_any_plane(tmp_path, n):
    """A star with n corners, tilted: its triangles have its area, and no more."""
    angle = np.arange(n) * 2.0 * np.pi / n
    radius = np.where(np.arange(n) % 2 == 0, 1.0, 0.4)
    flat = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(n)])
    area = 0.5 * float(np.cross(flat, np.roll(flat, -1, axis=0))[:, 2].sum())
    for tilt in (np.eye(3), np.eye(3)[[1, 2, 0]], np.eye(3)[[2, 0, 1]], np.diag([1.0, -1.0, -1.0])):
        mesh = read_mesh(
            write_usd(tmp_path / f"{tilt.argmax()}{tilt[1, 1]}.usda", flat @ tilt, [tuple(range(n))]), unit="m"
        )
        a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
        normals = 0.5 * np.cross(b - a, c - a)
        assert np.allclose(normals.sum(axis=0), np.array([0.0, 0.0, area]) @ tilt, atol=1e-6)
        assert np.linalg.norm(normals, axis=1).sum() == pytest.approx(area, rel=1e-5)


def test_stl_corners_at_one_place_are_one_vertex(tmp_path):
    points, triangles = cube()
    path = write(
        tmp_path / "cube.stl",
        points,
        [("triangle", triangles)],
    )
    mesh = read_mesh(path, unit="mm", closed=True)
    assert len(mesh.vertices) == 8 and volume(mesh) == pytest.approx(1e-9)
    assert not mesh.flat


def test_pieces(tmp_path):
    two = np.vstack([SQUARE, SQUARE + [3.0, 0.0, 0.0]])
    mesh = read_mesh(write(tmp_path / "two.obj", two, [("quad", np.arange(8).reshape(2, 4))]), unit="m")
    assert mesh.pieces == 2
    assert Sheet.from_file(tmp_path / "two.obj", unit="m", **FLAT).areas.sum() == pytest.approx(2.0)


def grid(n, left_out):
    """A square of n x n cells without those of a mask, shape (n, n)."""
    x, y = (k.ravel() for k in np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0)))
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n))[~left_out]
    return np.column_stack([x, y, 0 * x]), np.column_stack([a, a + 1, a + n + 2, a + n + 1])


def test_boundary_of_a_flat_mesh(tmp_path):
    """Rings have names, the largest first; no bond crosses them; areas are those of Voronoi cells."""
    left_out = np.zeros((12, 12), bool)
    left_out[2:4, 2:4] = left_out[6:9, 5:9] = left_out[10:, 10:] = True
    points, quads = grid(12, left_out)
    path = write(tmp_path / "holes.obj", points, [("quad", quads)])
    sheet = Sheet.from_file(path, unit="cm", **FLAT)
    count = {name: len(part) for name, part in sheet.parts.items()}
    assert count == {"outline": 48, "hole 1": 14, "hole 2": 8}
    assert np.ptp(sheet.points[sheet.parts["hole 1"]], axis=0) == pytest.approx([0.04, 0.03])
    assert sheet.areas.sum() == pytest.approx((144 - 4 - 12 - 4) * 1e-4)
    corner = sheet.nearest(0.0, 0.0)
    assert sheet.areas[corner] == pytest.approx(0.25e-4) and sheet.areas.max() == pytest.approx(1e-4)
    # Across the hole of three cells, and the same bond where there is none.
    across, whole = [[sheet.nearest(x, 0.06), sheet.nearest(x, 0.09)] for x in (0.07, 0.01)]
    assert severed(sheet, np.array([across, whole])).tolist() == [True, False]


def test_flat_mesh_of_either_orientation_off_the_plane(tmp_path):
    """All clockwise, at z = 0.3: a sheet like any other."""
    path = write(tmp_path / "below.vtu", spatial(CORNERS, 0.3), [("triangle", FAN[:, ::-1])])
    sheet = Sheet.from_file(path, unit="m", **FLAT)
    assert sheet.positions[:, 2].tolist() == [0.0] * 5
    assert sheet.notes == ("the mesh at z = 0.3 m became a sheet at z = 0: move bodies of its drawing, too",)
    assert (signed_areas(sheet.points, sheet.triangles) > 0.0).all()


def strip_with_one_side():
    """Moebius' strip of 12 quadrilaterals."""
    angle = np.arange(12) * 2.0 * np.pi / 12
    points = [
        [(1 + w * np.cos(t / 2)) * np.cos(t), (1 + w * np.cos(t / 2)) * np.sin(t), w * np.sin(t / 2)]
        for t in angle
        for w in (-0.3, 0.3)
    ]
    quads = [(2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2) for k in range(11)] + [(22, 23, 0, 1)]
    return np.array(points), np.array(quads)


def bad(points=None, cells=FAN, kind="triangle"):
    return (spatial(CORNERS) if points is None else np.asarray(points, float), [(kind, np.asarray(cells))])


def changed(row, value, column=slice(None)):
    points = spatial(CORNERS)
    points[row, column] = value
    return points


BAD = {
    "no faces": (bad(cells=[[0, 1], [1, 2]], kind="line"), "no triangles or quadrilaterals: expected at least one"),
    "volume": (bad(np.eye(4)[:, :3], [[0, 1, 2, 3]], "tetra"), "1 elements 'tetra': expected a surface"),
    "missing": (
        bad(cells=[[0, 1, 4], [1, 2, 40], [2, 3, -1]]),
        "faces 1, 2 with points that are missing: expected 0 to 5",
    ),
    "nan": (bad(changed(2, np.nan, 1)), "point 2 with coordinates that are NaN or infinite"),
    "no area": (bad(changed(4, [3.0, 1.0, 0.0])), "face 1 without area: expected more than 1e-12 of the mean"),
    "corner twice": (bad(cells=[*FAN, [0, 1, 1]]), "face 4 without area"),
    "hanging": (
        bad(
            [[0, 0, 0], [1, 0, 0], [1, 2, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0]],
            [[0, 1, 2], [1, 3, 5], [3, 4, 5], [5, 4, 2]],
        ),
        "point 5 at (1, 1) lies in the middle of the edge of another triangle, from point 1 to point 2 (a hanging",
    ),
    "hanging and bent": (
        bad(
            [[0, 0, 1], [1, 0, 0], [1, 2, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0]],
            [[0, 1, 2], [1, 3, 5], [3, 4, 5], [5, 4, 2]],
        ),
        "point 5 at (1, 1, 0) lies in the middle of the edge of another triangle, from point 1 to point 2 (a hanging",
    ),
    "crossing": (
        bad(np.vstack([spatial(CORNERS[:5]), spatial(CORNERS[:5] + [2.5, 0.5])]), [*FAN, *(FAN + 5)]),
        "the edge from point 1 to point 2 crosses another one at (3, 0.5): expected a flat mesh that covers each",
    ),
    "covered": (
        bad(np.vstack([spatial(CORNERS[:5]), spatial(0.1 * CORNERS[:5] + [0.4, 0.3])]), [*FAN, *(FAN + 5)]),
        "two pieces overlap at",
    ),
    "crowded": (
        bad(changed(5, [1.0, 1.0, 1.0]), [*FAN, [0, 4, 5], [2, 5, 4]]),
        "edges (0, 4), (2, 4) with more than two triangles: expected one or two",
    ),
    "flipped": (
        bad(cells=[FAN[0], FAN[1][::-1], *FAN[2:]]),
        "face 1 flipped against the neighbours: expected one orientation",
    ),
    "folded": (
        bad(changed(4, [5.0, 1.0, 0.0])),
        "face 1 folded over the neighbours: expected a flat mesh that covers each place once",
    ),
    "bow tie": (
        bad(SQUARE[[0, 2, 1, 3]], [[0, 1, 2, 3]], "quad"),
        "face 0 with sides that cross or touch: expected simple polygons",
    ),
    "one side": (
        bad(*strip_with_one_side(), "quad"),
        "the surface is not orientable (a Moebius strip): expected an orientable surface",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_meshes_are_named(tmp_path, name):
    (points, cells), text = BAD[name]
    path = write(tmp_path / "bad.vtu", points, cells)
    with pytest.raises(InputError) as error:
        Sheet.from_file(path, unit="m", **FLAT)
    assert str(error.value).startswith(f"path = '{path}': {text}"), error.value


def test_long_lists_are_cut(tmp_path):
    points, triangles = cube()
    triangles[5] = triangles[5][::-1]
    with refused(match="face 5 flipped"):
        read_mesh(write(tmp_path / "a.obj", points, [("triangle", triangles)]), unit="m")
    strip = np.array([[0.1 * k, k % 2, 0.01 * k] for k in range(40)])
    cells = np.array([[k, k + 1, k + 2] if k % 2 == 0 else [k + 1, k, k + 2] for k in range(38)])
    with refused(match=r"edges \(0, 1\), .*, \.\.\. \(40 in all\) with one triangle: expected a closed"):
        read_mesh(write(tmp_path / "b.obj", strip, [("triangle", cells)]), unit="m", closed=True)


def test_holes_in_a_closed_surface_are_named(tmp_path):
    points, triangles = cube()
    path = write(tmp_path / "open.obj", points, [("triangle", triangles[1:])])
    assert len(read_mesh(path, unit="m").triangles) == 11
    with pytest.raises(InputError) as error:
        read_mesh(path, unit="m", closed=True)
    # The missing triangle is 0, 2, 3; its neighbours run the other way.
    assert "edges (3, 0), (2, 3), (0, 2)" in str(error.value) or "edges (0, 3), (3, 2), (2, 0)" in str(error.value)


def test_other_surfaces_are_curved_sheets(tmp_path):
    """A half tube on its own vertices, and its named lines."""
    angle, z = (k.ravel() for k in np.meshgrid(np.linspace(0.0, np.pi, 21), np.linspace(0.0, 2.0, 15)))
    a = (np.arange(14)[:, None] * 21 + np.arange(20)).ravel()
    cells = [("line", np.column_stack([np.arange(20), np.arange(1, 21)])), ("quad", a[:, None] + [0, 1, 22, 21])]
    tags = [np.full(len(block), k) for k, (_, block) in enumerate(cells, start=1)]
    points = np.column_stack([np.cos(angle), np.sin(angle), z])
    data = {"cell_data": {"gmsh:physical": tags, "gmsh:geometrical": tags}, "field_data": {"rim": np.array([1, 1])}}
    meshio.Mesh(points, cells, **data).write(tmp_path / "tube.msh", file_format="gmsh22", binary=False)
    sheet = Sheet.from_file(tmp_path / "tube.msh", unit="cm", **FLAT)
    assert np.allclose(sheet.points, 0.01 * points) and sheet.frames is not None
    assert sheet.areas.sum() == pytest.approx(2e-4 * np.pi, rel=3e-3)
    assert sheet.parts["rim"].tolist() == list(range(21))


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("none.stl", None, "the file does not exist"),
        ("a.step", b"ISO", "expected .msh, .stl, .obj, .ply, .vtu, .vtk, .off, .usd, .usda, .usdc, or another"),
        ("a.svg", b"<svg/>", "outlines are read by read_outline"),
        ("a.vtu", b"<VTKFile", "the file cannot be read: "),
        ("a.ply", b"hello", "the file cannot be read: "),
        ("a.msh", b"", "the file cannot be read: expected a complete .msh file of a common version; write it again"),
        ("a.msh", b"(0 grid written by Fluent)\n(10 (0 1 5 0 3)\n", "the file cannot be read: "),
        ("c.msh", b"(10 (1 1 2 0 3)(\n0 0 0\n1 0 0\n))(((\n", "the file cannot be read: "),
        ("b.msh", b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 4 (", "the file cannot be read: "),
        ("a.stl", b"solid x\n facet\n", "the file cannot be read: "),
        ("a.obj", b"v 0 0\nf 1 2 3 x\n", "the file cannot be read: line 2: 'f 1 2 3 x': expected numbers"),
        ("a.off", b"off", "the file cannot be read: line 1: 'off': expected OFF, and a file of text in 3D"),
        ("b.off", b"OFF BINARY\n", "the file cannot be read: line 1: 'OFF BINARY': expected OFF, and a file of text"),
        ("c.off", b"OFF\n3", "the file cannot be read: line 2: '3': expected the numbers of vertices and faces"),
        ("d.off", b"OFF 1 1\n0 0\n", "the file cannot be read: line 2: '0 0': expected three coordinates"),
        ("e.off", b"OFF 1 1\n0 0 0\n3 0 0\n", "line 3: '3 0 0': expected the number of its corners, and the corners"),
        ("f.off", b"OFF 3 1\n0 0 0\n", "3 vertices and 1 faces, by its header, but has 1 and 0"),
        ("g.off", b"OFF 1 1\n0 0 0\n3 0 0 0\n3 0 0 0\n", "1 vertices and 1 faces, by its header, but has more lines"),
        ("a.usd", b"hello", "the file cannot be read: expected a complete USD file"),
        ("a.usdc", b"PXR-USDC", "the file cannot be read: "),
        ("b.usda", b"#usda 1.0\n", "expected a file with a UsdGeom.Mesh, found none"),
    ],
)
def test_files_that_are_no_meshes(tmp_path, name, content, text):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError) as error:
        read_mesh(path, unit="m")
    assert str(error.value).startswith(f"path = '{path}': ") and text in str(error.value), error.value
    assert "\n" not in str(error.value) and not str(error.value).endswith(":")
    # Words of libraries name their own code.
    assert "be read: " not in text or not any(
        word in str(error.value) for word in ("Error", "Exception", "meshio", "layer", "token")
    )


def test_wrong_paths():
    with refused(match="path = 3: expected the path of a file"):
        read_mesh(3, unit="m")
    with refused(match="path = '/': expected a file, not a folder"):
        read_mesh("/", unit="m")


def test_a_large_mesh_is_read_whole(tmp_path):
    n = 200
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    quads = np.column_stack([a, a + 1, a + n + 2, a + n + 1])
    points = np.column_stack([x.ravel(), y.ravel(), np.sin(3.0 * x.ravel())])
    mesh = read_mesh(write(tmp_path / "large.vtu", points, [("quad", quads)]), unit="m")
    assert len(mesh.triangles) == 2 * n * n and mesh.pieces == 1


def halves(step=0.0, nodes=5):
    """Two squares of 1 that meet at x = 1, but for `step`; each has its own points, `nodes` along every edge."""
    x, y = np.meshgrid(np.linspace(0.0, 1.0, nodes), np.linspace(0.0, 1.0, nodes))
    points = np.column_stack([x.ravel(), y.ravel()])
    cells = cell_triangles(np.ones((nodes - 1, nodes - 1), bool))
    return spatial(np.vstack([points, points + [1.0 + step, 0.0]])), np.vstack([cells, cells + len(points)])


@pytest.mark.parametrize("step", [0.0, 1e-7, 1e-4, -1e-4])
@pytest.mark.parametrize("away", [0.0, 1e3])
def test_patches_that_meet_within_the_digits_of_a_file_are_one_sheet(tmp_path, step, away):
    points, triangles = halves(step)
    points = points.astype(np.float32) + np.float32(away)
    sheet = Sheet.from_file(write(tmp_path / "a.vtu", points, [("triangle", triangles)]), unit="m", **FLAT)
    assert sheet.size == 45 and len(sheet.triangles) == 64 and sheet.areas.sum() == pytest.approx(2.0, rel=2e-4)
    assert len(boundary_edges(sheet.triangles)) == 24 and list(sheet.parts) == ["outline"]
    assert (
        len(sheet.notes) == 1 + (away > 0.0)
        and "5 points at the place" in sheet.notes[0]
        and "1 seam of" in sheet.notes[0]
    )


def test_curved_patches_are_merged_too(tmp_path):
    points, triangles = halves(1e-5)
    points[:, 2] = 0.1 * points[:, 0] ** 2
    sheet = Sheet.from_file(write(tmp_path / "a.vtu", points, [("triangle", triangles)]), unit="m", **FLAT)
    assert sheet.size == 45 and "1 seam of no width" in sheet.notes[0]


@pytest.mark.parametrize("step", [0.01, 0.5])
def test_patches_that_do_not_meet_are_pieces_in_a_note(tmp_path, step):
    points, triangles = halves(step)
    sheet = Sheet.from_file(write(tmp_path / "a.vtu", points, [("triangle", triangles)]), unit="m", **FLAT)
    assert sheet.size == 50 and "2 pieces, which nothing connects" in sheet.notes[0]
    gap = [note for note in sheet.notes if "a gap narrower than 0.1" in note]
    assert len(gap) == (1 if step < 0.1 else 0) and all("at 10 points, 0.01 at (1.01, 0)" in n for n in gap)


def test_triangles_with_corners_of_their_own_are_joined(tmp_path):
    points, triangles = halves()
    own = np.arange(3 * len(triangles)).reshape(-1, 3)
    for name in ("a.obj", "a.vtu", "a.ply"):
        path = write(tmp_path / name, points[triangles.ravel()], [("triangle", own)])
        assert Sheet.from_file(path, unit="m", **FLAT).size == 45
    own = own.astype(np.int32)
    with refused(match=r"points\[\d+\] and points\[\d+\] coincide"):
        Sheet.from_points(points[triangles.ravel(), :2], triangles=own, **FLAT)


def test_faces_listed_twice_are_read_once(tmp_path):
    quads = np.array([[0, 1, 2, 3]])
    points = np.vstack([SQUARE, SQUARE])
    path = write(tmp_path / "a.vtu", points, [("quad", quads), ("quad", np.roll(quads, 1) + 4)])
    mesh = read_mesh(path, unit="m")
    assert len(mesh.triangles) == 2 and len(mesh.vertices) == 4
    assert any("1 faces with the corners of another one were left out" in note for note in mesh.notes)


def test_points_and_triangles_that_do_not_meet_are_refused():
    points = np.array([[0, 0], [1, 0], [1, 2], [2, 0], [2, 1], [1, 1]], float)
    triangles = np.array([[0, 1, 2], [1, 3, 5], [3, 4, 5], [5, 4, 2]])
    with refused(match="triangles: point 5 at .* hanging node"):
        Sheet.from_points(points, triangles=triangles, **FLAT)
    with refused(match="triangles: point 5 at .* hanging node"):
        Sheet.from_surface(spatial(points) + [[0, 0, 1], *5 * [[0, 0, 0]]], triangles, **FLAT)
    with refused(match=r"triangles\[4\] = .* is listed twice"):
        Sheet.from_points(CORNERS[:5], triangles=[*FAN, FAN[0]], **FLAT)


def test_sharp_corners_are_no_gaps(tmp_path):
    """Two triangles that meet in a corner of 3 degrees."""
    points = np.array([[0, 0], [4, 0], [4, -1], [3, 0.15], [4, 1.2]], float)
    cells = np.array([[0, 2, 1], [0, 3, 4]])
    sheet = Sheet.from_file(write(tmp_path / "a.vtu", spatial(points), [("triangle", cells)]), unit="m", **FLAT)
    assert sheet.notes == ()


GMSH_41 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
3
1 3 "clamped"
1 4 "pulled"
2 1 "sheet"
$EndPhysicalNames
$Entities
0 2 1 0
1 0 0 0 1 0 0 3 3 4 7 0
2 1 0 0 1 1 0 0 0
1 0 0 0 1 1 0 1 1 0
$EndEntities
$Nodes
1 4 1 4
2 1 0 4
1
2
3
4
0 0 0
1 0 0
1 1 0
0 1 0
$EndNodes
$Elements
3 4 1 4
1 1 1 1
1 1 2
1 2 1 1
2 2 3
2 1 2 2
3 1 2 3
4 1 3 4
$EndElements
"""


def test_all_groups_of_an_edge_are_parts(tmp_path):
    """Edge 1 is in two named groups and one without a name; edge 2, without a group, is in the file all the same."""
    (tmp_path / "a.msh").write_text(GMSH_41)
    sheet = Sheet.from_file(tmp_path / "a.msh", unit="m", **FLAT)
    parts = {name: part.tolist() for name, part in sheet.parts.items() if name != "outline"}
    assert parts == {"clamped": [0, 1], "pulled": [0, 1], "line 7": [0, 1], "sheet": [0, 1, 2, 3]}
    assert len(read_mesh(tmp_path / "a.msh", unit="m", part="sheet").triangles) == 2


ABAQUS = """*Heading
*Node, nset=all nodes
10, 0., 0.
20, 3., 0.
30, 3., 2.
*Node
40, 0., 2.
50, 1., 1.
*Element, type=M3D3, elset=LOWER
1, 10, 20, 50
2, 20, 30, 50
*Element, type=S3R
3, 30, 40, 50
4, 40, 10, 50
*Element, type=T3D2, elset=RIM
5, 40, 10
*Elset, elset=UPPER, generate
3, 4
*Nset, nset=ENDS
10, 30,
40
*Nset, nset=MORE
ends, 50
*Nset, nset=OF_LOWER, elset=LOWER
** comment
*Boundary
ENDS, 1, 2
"""


def test_sets_of_abaqus_are_parts(tmp_path):
    (tmp_path / "a.inp").write_text(ABAQUS)
    sheet = Sheet.from_file(tmp_path / "a.inp", unit="m", **FLAT)
    assert {name: part.tolist() for name, part in sheet.parts.items()} == {
        "outline": [0, 1, 2, 3], "all nodes": [0, 1, 2], "LOWER": [0, 1, 2, 4], "UPPER": [0, 2, 3, 4], "RIM": [0, 3],
        "ENDS": [0, 2, 3], "MORE": [0, 2, 3, 4], "OF_LOWER": [0, 1, 2, 4],
    }  # fmt: skip
    assert read_mesh(tmp_path / "a.inp", unit="m", part="UPPER").triangles.shape == (2, 3)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("type=M3D3", "type=C3D4", "*ELEMENT, TYPE=C3D4: expected shells, membranes or plane elements"),
        ("1, 10, 20, 50", "1, 10, 20", "7 numbers: expected 4 for each element"),
        ("2, 20, 30, 50", "2, 20, 31, 50", "element 2 has node 31, which is missing"),
        ("10, 30,", "10, 31,", "node set 'ENDS' has node 31, which is missing"),
        ("ends, 50", "end, 50", "set 'MORE' contains 'end': expected a number or a set before it"),
        ("*Boundary", "*Ngen\n1,5,1", "*NGEN is not read: expected all nodes and elements in the file"),
        ("*Boundary", "*Instance, name=a, part=b\n1., 0., 0.", "*INSTANCE moves a part"),
        ("40, 0., 2.", "10, 0., 2.", "node 10 occurs twice"),
        ("*Node\n", "*Node, system=C\n", "*NODE, SYSTEM=C: expected rectangular coordinates, R"),
        ("3, 30, 40, 50", "2, 30, 40, 50", "element 2 occurs twice"),
        ("*Boundary", "*Include, input=all.msh\n*Boundary", "all.msh' does not exist: expected a file"),
        ("*Node\n", "*Node, input=all.msh\n", "*NODE, INPUT=all.msh: "),
        (
            "*Boundary",
            "*Instance, name=a, part=b\n*Instance, name=c, part=B\n*Boundary",
            "*INSTANCE repeats the part 'B'",
        ),
    ],
)
def test_wrong_files_of_abaqus(tmp_path, old, new, text):
    (tmp_path / "a.inp").write_text(ABAQUS.replace(old, new, 1))
    with pytest.raises(InputError, match="path = ") as error:
        read_mesh(tmp_path / "a.inp", unit="m")
    assert text in str(error.value)


def test_abaqus_reads_the_data_of_another_file(tmp_path):
    (tmp_path / "more.txt").write_text("** comment\n40, 0., 2.\n50, 1., 1.\n")
    (tmp_path / "a.inp").write_text(ABAQUS.replace("*Node\n40, 0., 2.\n50, 1., 1.\n", "*Node, input=more.txt\n"))
    assert read_mesh(tmp_path / "a.inp", unit="m").vertices.shape == (5, 3)


@pytest.mark.parametrize(("kind", "what"), [("R3D3", "rigid"), ("CAX3", "axisymmetric"), ("CGAX3", "axisymmetric")])
def test_elements_of_abaqus_that_are_no_sheet_are_noted(tmp_path, kind, what):
    (tmp_path / "a.inp").write_text(ABAQUS.replace("type=S3R", f"type={kind}"))
    mesh = read_mesh(tmp_path / "a.inp", unit="m")
    assert any(f"2 {what} elements ({kind}) became part of the sheet" in note for note in mesh.notes)
    (tmp_path / "a.inp").write_text(ABAQUS)
    assert read_mesh(tmp_path / "a.inp", unit="m").notes == ()


ZONE = "ZONE N=4, E=1, F=FEPOINT, ET=QUADRILATERAL\n{0} 0\n{1} 0\n{1} 1\n{0} 1\n1 2 3 4\n"


def test_several_meshes_in_one_file_are_refused(tmp_path):
    """The reader would keep the first zone of Tecplot, or the last piece of VTK, and drop the rest of the sheet."""
    (tmp_path / "a.dat").write_text('VARIABLES="X","Y"\n' + ZONE.format(0, 1))
    assert len(read_mesh(tmp_path / "a.dat", unit="m").triangles) == 2
    (tmp_path / "a.dat").write_text('VARIABLES="X","Y"\n' + ZONE.format(0, 1) + ZONE.format(1, 2))
    with refused(match="2 zones: expected one"):
        read_mesh(tmp_path / "a.dat", unit="m")
    meshio.write(tmp_path / "a.vtu", meshio.Mesh(np.eye(3), [("triangle", [[0, 1, 2]])]))
    assert len(read_mesh(tmp_path / "a.vtu", unit="m").triangles) == 1
    text = (tmp_path / "a.vtu").read_bytes()
    piece = text[text.index(b"<Piece") : text.index(b"</Piece>") + len(b"</Piece>")]
    (tmp_path / "a.vtu").write_bytes(text.replace(piece, piece + piece))
    with refused(match="2 pieces: expected one"):
        read_mesh(tmp_path / "a.vtu", unit="m")


# Fields of 8 columns, of 16 columns, between commas; continued; an angle after the corners; a number without an E.
NASTRAN = f"""SOL 101
BEGIN BULK
$ comment
GRID           1       0      0.      0.      0.
GRID,2,,3.0,0.0,0.0
{"GRID*":8}{3:16}{"":16}{"3.":>16}{"2.+0":>16}+A
{"*A":8}{"0.":>16}
{"GRID":8}{4:8}{"":8}{"0.":>8}{"20.-1":>8}{"0.":>8}
INCLUDE 'more.bdf'
CTRIA3         1       7       1       2       5     0.0
CTRIA3,2,7,2,3,5,0.0
{"CTRIA3*":8}{3:16}{8:16}{3:16}{4:16}
{"*":8}{5:16}
CTRIA6         4       8       4       1       5
CBAR           5       9       4       1      1.      0.      0.
CONM2          6       1       0      2.
ENDDATA
after the end
"""


def test_cards_of_nastran(tmp_path):
    """Cards in any of the three forms make one mesh; the properties are groups."""
    (tmp_path / "more.bdf").write_text("GRID           5              1.      1.      0.\n")
    (tmp_path / "a.bdf").write_text(NASTRAN)
    sheet = Sheet.from_file(tmp_path / "a.bdf", unit="m", **FLAT)
    assert sheet.points.tolist() == [[0, 0], [3, 0], [3, 2], [0, 2], [1, 1]]
    assert sheet.areas.sum() == pytest.approx(6.0)
    parts = {name: part.tolist() for name, part in sheet.parts.items() if name != "outline"}
    assert parts == {"surface 7": [0, 1, 2, 4], "surface 8": [0, 2, 3, 4], "line 9": [0, 3]}


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("GRID,2,,", "GRID,2,5,", "GRID 2: coordinate system 5: expected the basic one, 0"),
        ("SOL 101\nBEGIN BULK\n", "GRDSET,,5\n", "GRDSET : coordinate system 5"),
        ("GRID,2,,", "GRID,1,,", "GRID 1 occurs twice"),
        ("CTRIA3,2,7,2,3,5", "CTRIA3,2,7,2,3,6", "an element has the point 6, which is missing"),
        ("CTRIA3,2,7,2,3,5", "CTRIAX6,2,7,2,3,5", "CTRIAX6 2: expected a surface"),
        ("CTRIA3,2,7,2,3,5", "CTETRA,2,7,2,3,5,4", "CTETRA 2: expected a surface"),
    ],
)
def test_wrong_files_of_nastran(tmp_path, old, new, text):
    (tmp_path / "more.bdf").write_text("GRID,5,,1.,1.,0.\n")
    (tmp_path / "a.nas").write_text(NASTRAN.replace(old, new, 1))
    with pytest.raises(InputError, match="path = ") as error:
        read_mesh(tmp_path / "a.nas", unit="m")
    assert text in str(error.value)


WAVEFRONT = """# as Blender writes it
o Plane.001
v 0 0 0 1 0.5 0.5
v 1 0 0
v 2 0 0
v 0 1 0
v 1 1 0
v 2 1 0
vn 0 0 1
vt 0 0
g left half
f 1/1/1 2/1/1 5/1/1 4/1/1
g right
f -5/1/1 \\
  -4/1/1 -1/1/1 -2/1/1
"""


def test_obj_as_programs_write_it(tmp_path):
    """One normal, colours, corners counted backwards, continued lines, groups."""
    (tmp_path / "a.obj").write_text(WAVEFRONT)
    sheet = Sheet.from_file(tmp_path / "a.obj", unit="m", **FLAT)
    assert sheet.size == 6 and len(sheet.triangles) == 4 and sheet.areas.sum() == pytest.approx(2.0)
    parts = {name: part.tolist() for name, part in sheet.parts.items() if name != "outline"}
    assert parts == {"left": [0, 1, 3, 4], "half": [0, 1, 3, 4], "right": [1, 2, 4, 5]}
    assert len(read_mesh(tmp_path / "a.obj", unit="m", part="right").triangles) == 2
    (tmp_path / "b.obj").write_text("v 0 0 x\n")
    with refused(match="line 1: 'v 0 0 x': expected numbers"):
        read_mesh(tmp_path / "b.obj", unit="m")


def test_groups_that_name_no_point_or_an_edge_are_noted(tmp_path):
    text = GMSH_41.replace('"clamped"', '"all"').replace("1 4 1 4\n2 1 0 4", "1 5 1 5\n2 1 0 5")
    text = text.replace("4\n0 0 0", "4\n5\n0 0 0").replace("0 1 0\n$End", "0 1 0\n5 5 0\n$End")
    (tmp_path / "a.msh").write_text(
        text.replace("2 2 3\n", "2 5 5\n").replace("2 1 0 0 1 1 0 0 0", "2 1 0 0 1 1 0 1 9 0")
    )
    sheet = Sheet.from_file(tmp_path / "a.msh", unit="m", **FLAT)
    assert any("group 'line 9' has no point of the surface" in note for note in sheet.notes)
    assert any("part 'all' is the group of that name in the file, not the edge" in note for note in sheet.notes)


def test_objects_that_touch_are_refused_with_what_was_merged(tmp_path):
    """Three squares on one edge, each with points of its own."""
    points, own = [[0, 0, 0], [1, 0, 0]], [[1, 1, 0], [1, -1, 0], [0, 0, 1]]
    path = write(
        tmp_path / "a.vtu", [p for third in own for p in (*points, third)], [("triangle", np.arange(9).reshape(3, 3))]
    )
    with refused(match="after merging 4 points at the place of another one: edge .* with more than two triangles"):
        read_mesh(path, unit="m")


def test_face_sets_of_usd_are_parts(tmp_path):
    path = write_usd(tmp_path / "a.usda", spatial(CORNERS[:5]), FAN)
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh.Get(stage, "/World/Sheet")
    UsdGeom.Subset.CreateGeomSubset(mesh, "patch", UsdGeom.Tokens.face, [1])
    stage.Save()
    assert Sheet.from_file(path, unit="m", **FLAT).parts["patch"].tolist() == [1, 2, 4]


@pytest.mark.parametrize("face", [-1, 4])
def test_wrong_face_sets_of_usd(tmp_path, face):
    path = write_usd(tmp_path / "a.usda", spatial(CORNERS[:5]), FAN)
    stage = Usd.Stage.Open(str(path))
    UsdGeom.Subset.CreateGeomSubset(UsdGeom.Mesh.Get(stage, "/World/Sheet"), "patch", UsdGeom.Tokens.face, [1, face])
    stage.Save()
    with refused(match=f"/World/Sheet: patch has face {face}: expected 0 to 3"):
        read_mesh(path, unit="m")


def test_a_mesh_of_usd_without_points_is_refused(tmp_path):
    with refused(match="/World/Sheet has no points: expected a mesh"):
        read_mesh(write_usd(tmp_path / "a.usda", [], []), unit="m")


def test_y_up_becomes_z_up(tmp_path):
    """A plane and a cube of one file with y up are a flat sheet and a cube over it; one with z up is as it is."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "up.usda"))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    across = CORNERS[:5] * (1.0, -1.0)
    write_usd(None, np.insert(across, 1, 2.0, axis=1), FAN, stage=stage, meters=1.0)
    write_usd(None, cube()[0] + (5.0, 3.0, 0.0), cube()[1], stage=stage, name="Cube")
    plane, above = (read_mesh(tmp_path / "up.usda", part=part) for part in ("Sheet", "Cube"))
    assert plane.vertices.tolist() == spatial(CORNERS[:5], 2.0).tolist() and above.vertices[:, 2].min() == 3.0
    assert volume(above) == pytest.approx(1.0) and above.vertices[:, 1].tolist() == (-cube()[0][:, 2]).tolist()
    assert "y is up in the file" in plane.notes[0]
    body = TriangleMesh.from_file(tmp_path / "up.usda", part="Cube")
    assert body.vertices.tolist() == above.vertices.tolist() and body.notes == above.notes
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    stage.Save()
    same = read_mesh(tmp_path / "up.usda", part="Cube")
    assert same.vertices[:, 1].min() == 3.0 and not same.notes


def test_a_polygon_that_touches_itself_is_refused(tmp_path):
    points = [(-0.5, 0.5, -0.5), (0.5, 0.5, -0.5), (0.5, -0.5, -0.5), (-0.5, -0.5, -0.5), (0.7, 0.7, 0.7)]
    with refused(match="face 0 with sides that cross or touch"):
        read_mesh(write_usd(tmp_path / "a.usda", points, [range(5)]), unit="m")


OFF = """{} # made by hand

{} 2 0
0 0 0
1 0 0 {}
1 1 0
# the last
0 1 0
5 5 0
4 0 1 2 3  1.0 0.5 0.0 0.75 # red
2 0 2
"""


@pytest.mark.parametrize(("header", "more"), [("OFF", "# odd"), ("COFF", "0.1 0.2 0.3 1"), ("STNOFF", "0 1"), ("", "")])
def test_off_as_programs_write_it(tmp_path, header, more):
    """Comments, polygons, colours, a lone edge and a loose vertex; the first word may be missing."""
    (tmp_path / "a.off").write_text(OFF.format(header, 5, more))
    mesh = read_mesh(tmp_path / "a.off", unit="m")
    assert np.array_equal(mesh.vertices, SQUARE) and len(mesh.triangles) == 2
    assert mesh.notes[0].endswith("1 faces of fewer than three corners were left out")
    (tmp_path / "a.off").write_text(f"{header} 4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n")
    assert np.array_equal(read_mesh(tmp_path / "a.off", unit="m").vertices, SQUARE)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.off", "OFF 4 1\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"),
    ],
)
def test_a_text_may_begin_with_the_mark_of_its_encoding(tmp_path, name, text):
    (tmp_path / name).write_text(text, encoding="utf-8-sig")
    assert np.array_equal(read_mesh(tmp_path / name, unit="m").vertices, SQUARE)
