"""Meshes with changed bytes and numbers: each is read, or refused in one line, at once."""

import time

import meshio
import numpy as np
import pytest
from damage import TRIALS, damaged, require_one_line, with_an_odd_number
from helpers import refused
from pxr import Gf, Usd, UsdGeom

from warp_pd import Sheet
from warp_pd.shapes.files import read_mesh

POINTS = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 2.0, 0.0], [0.0, 2.0, 0.0], [1.0, 1.0, 0.0]])
FAN = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
# Formats, by the suffix that chooses their reader, and the writer of meshio if it is another. Binary USD and HDF5 are
# left to their libraries.
FORMATS = {
    "msh": "gmsh", "msh 2": "gmsh22", "msh binary": "gmsh", "msh ansys": "ansys", "stl": "stl", "obj": "obj",
    "ply": "ply", "ply text": "ply", "vtu": "vtu", "vtk": "vtk", "off": "off", "inp": "abaqus", "bdf": "nastran",
    "mesh": "medit", "vol": "netgen", "tec": "tecplot", "xdmf": "xdmf", "xml": "dolfin-xml", "usda": "",
}  # fmt: skip

GMSH = """$MeshFormat
4.1 0 8
$EndMeshFormat
$Nodes
1 3 1 3
2 1 0 3
1
2
3
0 0 0
1 0 0
0 1 0
$EndNodes
$Elements
1 1 1 1
2 1 2 1
1 1 2 3
$EndElements
"""


def write(path, name):
    if name == "usda":
        stage = Usd.Stage.CreateNew(str(path))
        mesh = UsdGeom.Mesh.Define(stage, "/Sheet")
        mesh.CreatePointsAttr([Gf.Vec3f(*map(float, p)) for p in POINTS])
        mesh.CreateFaceVertexCountsAttr([3] * len(FAN))
        mesh.CreateFaceVertexIndicesAttr(FAN.ravel().tolist())
        stage.GetRootLayer().Save()
        return
    more = {"binary": name.endswith("binary")} if FORMATS[name] in ("gmsh", "gmsh22", "ansys") else {}
    if name.startswith("ply"):
        more = {"binary": name == "ply"}
    tags = {"gmsh:physical": [np.array([1, 1, 2, 2])], "gmsh:geometrical": [np.array([1, 1, 1, 1])]}
    mesh = meshio.Mesh(POINTS, [("triangle", FAN)], cell_data=tags if name == "msh 2" else {})
    mesh.write(path, file_format=FORMATS[name], **more)


@pytest.mark.parametrize("name", FORMATS)
def test_changed_bytes_and_numbers_of_a_mesh(tmp_path, name):
    path = tmp_path / f"sheet.{name.split()[0]}"
    write(path, name)
    whole, rng = path.read_bytes(), np.random.default_rng(5)
    for trial in range(TRIALS):
        path.write_bytes((damaged if trial % 2 else with_an_odd_number)(whole, rng))
        begin = time.perf_counter()
        require_one_line(lambda: Sheet.from_file(path, unit="m", thickness=1e-3, density=1000.0))
        assert time.perf_counter() - begin < 5.0, path.read_bytes()


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.msh", "(10 (0 1 5 0))\n(12 (0 1 4 0))\n(10 (1 1 ffffff 1 3)(\n0. 0. 0.\n", "the file ends too early"),
        ("a.tec", 'VARIABLES="X","Y"\nZONE N=3, E=1, F=FEPOINT, ET=TRIANGLE\n0 0\n', "the file ends too early"),
        ("b.msh", GMSH.replace("1\n2\n", "1\n9999999999\n"), "node number 9999999999: expected at most"),
        ("a.node", "3 2 0 0\n0 0 0\n1 1 0\n2 0 1\n", "expected .msh"),
        ("a.wkt", "TIN(((0 0 0,1 0 0,0 1 0,0 0 0)))", "expected .msh"),
        ("a.inp", "*NSET, NSET=A, GENERATE\n1, 99999999999\n", "set 'A' from 1 to 99999999999: expected at most"),
    ],
)
def test_small_meshes_that_would_take_for_ever_are_refused_at_once(tmp_path, name, text, said):
    (tmp_path / name).write_text(text)
    begin = time.perf_counter()
    with refused(match=said):
        read_mesh(tmp_path / name, unit="m")
    assert time.perf_counter() - begin < 5.0
