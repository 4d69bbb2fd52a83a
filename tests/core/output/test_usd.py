"""What the USD animation shows: valid, and true to the frames that it is made from."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from torn_frames import COLUMNS, FRAMES, ROWS, make_frame, make_surface

from warp_pd import Box, Capsule, Cylinder, InputError, Sphere
from warp_pd.device.checks import OutputError
from warp_pd.interfaces.frame import Body, Frame, Surface
from warp_pd.output.vtkhdf import VtkHdfSeries

pytest.importorskip("pxr")

from pxr import Gf, Usd, UsdGeom, UsdShade, UsdValidation

from warp_pd.output.usd import write_animation

SHEET = "/World/Sheet"


def animated(folder: Path, surface: Surface, frames: list[Frame], **options) -> Usd.Stage:
    """The animation of some frames."""
    folder.mkdir(exist_ok=True)
    series = VtkHdfSeries(folder / "frames.vtkhdf", surface)
    for frame in frames:
        series.write(frame)
    write_animation(folder / "animation.usd", folder / "frames.vtkhdf", **options)
    return Usd.Stage.Open(str(folder / "animation.usd"))


def all_frames(surface: Surface) -> list[Frame]:
    return [make_frame(surface, index) for index in range(FRAMES)]


@pytest.fixture(scope="module")
def surface() -> Surface:
    return make_surface()


@pytest.fixture(scope="module")
def stage(surface: Surface, tmp_path_factory: pytest.TempPathFactory) -> Usd.Stage:
    return animated(tmp_path_factory.mktemp("usd"), surface, all_frames(surface), seconds_per_frame=0.01)


@pytest.fixture(scope="module")
def mesh(stage: Usd.Stage) -> UsdGeom.Mesh:
    return UsdGeom.Mesh.Get(stage, SHEET)


def faces_of(mesh: UsdGeom.Mesh, index: int) -> np.ndarray:
    return np.array(mesh.GetFaceVertexIndicesAttr().Get(index)).reshape(-1, 3)


def damage_of(mesh: UsdGeom.Mesh) -> UsdGeom.Primvar:
    return UsdGeom.PrimvarsAPI(mesh).GetPrimvar("damage")


def errors_of(stage: Usd.Stage) -> list[str]:
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert validators
    return [error.GetMessage() for error in UsdValidation.ValidationContext(validators).Validate(stage)]


def test_every_validator_of_usd_is_content(stage: Usd.Stage) -> None:
    assert errors_of(stage) == []


def test_stage_says_its_units_and_its_time(stage: Usd.Stage) -> None:
    assert stage.GetDefaultPrim().GetPath() == "/World"
    assert UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == 24.0
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, FRAMES - 1)
    assert stage.GetRootLayer().customLayerData["warp_pd"] == {
        "version": "1",
        "points": 30,
        "seconds_per_frame": 0.01,
    }


def test_file_is_binary_and_replaces_one_that_is_open_here(tmp_path: Path, surface: Surface) -> None:
    held = animated(tmp_path, surface, all_frames(surface))
    animated(tmp_path, surface, all_frames(surface)[:3])
    assert held.GetEndTimeCode() == 2
    assert len(UsdGeom.Mesh.Get(held, SHEET).GetPointsAttr().GetTimeSamples()) == 3
    assert (tmp_path / "animation.usd").read_bytes()[:8] == b"PXR-USDC"
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["animation.usd", "frames.vtkhdf"]


def test_an_animation_that_fails_leaves_the_one_before(
    tmp_path: Path, surface: Surface, monkeypatch: pytest.MonkeyPatch
) -> None:
    animated(tmp_path, surface, all_frames(surface))
    before = (tmp_path / "animation.usd").read_bytes()

    def full(*_arguments) -> None:
        raise OSError("disk full")

    with monkeypatch.context() as patch:
        # A disk that is full.
        patch.setattr("warp_pd.output.usd._aim_camera", full)
        with pytest.raises(OutputError, match=r"animation\.usd: disk full"):
            write_animation(tmp_path / "animation.usd", tmp_path / "frames.vtkhdf")
    (tmp_path / "broken.vtkhdf").write_bytes(b"x")
    with pytest.raises(InputError, match="expected a complete VTKHDF file"):
        write_animation(tmp_path / "animation.usd", tmp_path / "broken.vtkhdf")
    assert (tmp_path / "animation.usd").read_bytes() == before and not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("index", range(FRAMES))
def test_mesh_is_the_frame(mesh: UsdGeom.Mesh, surface: Surface, index: int) -> None:
    frame = make_frame(surface, index)
    points = np.array(mesh.GetPointsAttr().Get(index))
    np.testing.assert_allclose(points, frame.positions(surface), atol=1e-7)
    np.testing.assert_array_equal(faces_of(mesh, index), surface.faces[frame.intact_faces])
    drawn = points[faces_of(mesh, index)].reshape(-1, 3)
    np.testing.assert_array_equal(mesh.GetExtentAttr().Get(index), [drawn.min(axis=0), drawn.max(axis=0)])
    np.testing.assert_allclose(damage_of(mesh).Get(index), frame.damage, atol=1e-7)
    assert mesh.GetPrim().GetAttribute("warp_pd:time").Get(index) == frame.time
    counts, indices = mesh.GetFaceVertexCountsAttr().Get(index), mesh.GetFaceVertexIndicesAttr().Get(index)
    assert UsdGeom.Mesh.ValidateTopology(indices, counts, len(points))[0]


def test_torn_faces_stay_gone_and_faces_are_written_when_they_change(mesh: UsdGeom.Mesh) -> None:
    triangles = [set(map(tuple, faces_of(mesh, index))) for index in range(FRAMES)]
    assert all(later <= earlier for earlier, later in itertools.pairwise(triangles))
    assert len(triangles[-1]) < len(triangles[0])
    changes = [0.0] + [float(i) for i in range(1, FRAMES) if triangles[i] != triangles[i - 1]]
    assert mesh.GetFaceVertexIndicesAttr().GetTimeSamples() == changes
    assert mesh.GetFaceVertexCountsAttr().GetTimeSamples() == changes
    assert 1 < len(changes) < FRAMES


def test_normals_are_unit_and_follow_the_slope(mesh: UsdGeom.Mesh, surface: Surface) -> None:
    assert mesh.GetNormalsInterpolation() == UsdGeom.Tokens.vertex
    np.testing.assert_allclose(mesh.GetNormalsAttr().Get(0), np.tile([0.0, 0.0, 1.0], (30, 1)), atol=1e-6)
    for index in range(FRAMES):
        normals = np.array(mesh.GetNormalsAttr().Get(index))
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
        assert np.all(normals[:, 2] > 0.0)
    # Left of the middle the sheet goes down towards +x, so its normal leans towards +x; on the right, back.
    leaning = np.array(mesh.GetNormalsAttr().Get(1))[:, 0].reshape(ROWS, COLUMNS)
    assert np.all(leaning[1:4, 1] > 0.01)
    assert np.all(leaning[1:4, 4] < -0.01)


def test_normals_are_weighted_with_area_and_a_loose_point_keeps_its_first(tmp_path: Path) -> None:
    points = np.array([[0.0, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 1], [5, 5, 0]])
    surface = Surface(points, np.array([[0, 1, 2], [0, 2, 3], [2, 1, 4]], np.int32))
    intact = np.array([True, True, False])
    still = np.zeros_like(points)
    frames = [Frame(k, 0.0, still, still, intact_faces=mask) for k, mask in enumerate((None, intact))]
    stage = animated(tmp_path, surface, frames)
    normals = np.array(UsdGeom.Mesh.Get(stage, SHEET).GetNormalsAttr().Get(1))
    np.testing.assert_allclose(normals[0], np.array([1.0, 0.0, 2.0]) / np.sqrt(5.0), atol=1e-6)
    np.testing.assert_allclose(normals[4], [0.0, 0.0, 1.0], atol=1e-6)


def test_all_faces_torn_is_still_a_valid_file(tmp_path: Path, surface: Surface) -> None:
    torn = make_frame(surface, 1, intact_faces=np.zeros(len(surface.faces), bool))
    stage = animated(tmp_path, surface, [make_frame(surface, 0), torn])
    mesh = UsdGeom.Mesh.Get(stage, SHEET)
    assert len(faces_of(mesh, 1)) == 0 and mesh.GetExtentAttr().Get(1) == mesh.GetExtentAttr().Get(0)
    assert errors_of(stage) == []


def test_colours_follow_damage(mesh: UsdGeom.Mesh) -> None:
    colour = mesh.GetDisplayColorPrimvar()
    assert colour.GetInterpolation() == damage_of(mesh).GetInterpolation() == UsdGeom.Tokens.vertex
    before, after = np.array(colour.Get(0)), np.array(colour.Get(FRAMES - 1))
    damage = np.array(damage_of(mesh).Get(FRAMES - 1))
    assert damage.min() == 0.0 and damage.max() == 1.0
    np.testing.assert_array_equal(after[damage == 0.0], before[damage == 0.0])
    assert np.all(np.linalg.norm(after - before, axis=1)[damage > 0.3] > 0.2)
    assert before[0, 0] > before[0, 2] and after[damage == 1.0][0, 2] > after[damage == 1.0][0, 0]
    order = np.argsort(damage)
    luminance = (after @ [0.2126, 0.7152, 0.0722])[order]
    assert np.all(np.diff(luminance) <= 1e-6)


def test_without_damage_one_constant_colour_and_no_primvar(tmp_path: Path) -> None:
    surface = make_surface(bodies=())
    frames = [make_frame(surface, index, damage=None, intact_faces=None, bodies=None) for index in range(3)]
    stage = animated(tmp_path, surface, frames)
    mesh = UsdGeom.Mesh.Get(stage, SHEET)
    colour = mesh.GetDisplayColorPrimvar()
    assert colour.GetInterpolation() == UsdGeom.Tokens.constant and len(colour.Get()) == 1
    assert colour.GetTimeSamples() == []
    assert not damage_of(mesh)
    assert not stage.GetPrimAtPath("/World/Bodies")
    assert not mesh.GetFaceVertexIndicesAttr().ValueMightBeTimeVarying()
    assert errors_of(stage) == []


def test_ball_follows(stage: Usd.Stage, surface: Surface) -> None:
    ball = UsdGeom.Sphere.Get(stage, "/World/Bodies/ball")
    assert ball.GetRadiusAttr().Get() == 0.05
    for index in range(FRAMES):
        centre = ball.ComputeLocalToWorldTransform(index).Transform(Gf.Vec3d(0, 0, 0))
        np.testing.assert_allclose(centre, make_frame(surface, index).bodies[0, :3], atol=1e-12)
        bounds = UsdGeom.BBoxCache(index, [UsdGeom.Tokens.default_]).ComputeWorldBound(ball.GetPrim())
        np.testing.assert_allclose(bounds.ComputeAlignedRange().GetSize(), [0.1] * 3, rtol=1e-6)


SHAPES = [
    (Sphere(0.02), (0.01, 0.01, 0.01)),
    (Capsule(0.02, 0.06), (0.01, 0.01, 0.04)),
    (Cylinder(0.02, 0.06), (0.01, 0.01, 0.03)),
    (Cylinder(0.02, 0.06, rounding=0.003), (0.01, 0.01, 0.03)),
    (Box((0.02, 0.04, 0.06)), (0.01, 0.02, 0.03)),
    (Box((0.02, 0.04, 0.06), rounding=0.003), (0.01, 0.02, 0.03)),
]


@pytest.mark.parametrize(("shape", "half"), SHAPES)
def test_extent_of_a_body_is_that_of_its_shape(tmp_path: Path, shape: Any, half: tuple[float, ...]) -> None:
    """Half of the sides of the box around a body [m], in the animation and of the triangles that pictures draw."""
    outline = shape.outline(1.0)
    np.testing.assert_allclose([outline[0].min(axis=0), outline[0].max(axis=0)], [np.negative(half), half], rtol=1e-12)
    surface = make_surface(bodies=(Body("body", shape.kind, shape.sizes(), *outline),))
    stage = animated(tmp_path, surface, [make_frame(surface, 0)])
    extent = UsdGeom.Boundable.Get(stage, "/World/Bodies/body").GetExtentAttr().Get()
    np.testing.assert_allclose(extent, [np.negative(half), half], rtol=1e-7)


def in_picture(stage: Usd.Stage, points: np.ndarray) -> np.ndarray:
    """Where points appear: across and upwards from -1 to 1 inside the picture, and depth."""
    frustum = UsdGeom.Camera.Get(stage, "/World/Camera").GetCamera(0).frustum
    to_picture = frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()
    return np.array([to_picture.Transform(Gf.Vec3d(*map(float, point))) for point in points])


def test_camera_sees_the_whole_sheet_through_the_whole_animation(stage: Usd.Stage, mesh: UsdGeom.Mesh) -> None:
    seen = np.concatenate([in_picture(stage, np.array(mesh.GetPointsAttr().Get(index))) for index in range(FRAMES)])
    assert np.all(np.abs(seen) < 1.0)
    assert np.ptp(seen[:, 0]) > 0.8
    # From the front and above: the back edge (+y) stands higher in the picture, and +x is to the right.
    corners = in_picture(stage, np.array([[0.0, 0, 0], [0.5, 0, 0], [0, 0.4, 0]]))
    assert corners[1, 0] > corners[0, 0] and corners[2, 1] > corners[0, 1]


def test_camera_steps_back_from_a_sheet_that_stretches_but_not_for_a_loose_point(
    tmp_path: Path, surface: Surface
) -> None:
    still = np.zeros_like(surface.points)
    stretched = surface.points * [2.0, 0.0, 0.0]
    loose = still.copy()
    loose[0] = [0.0, 0.0, 100.0]
    without_first = ~np.any(surface.faces == 0, axis=1)
    distances, extents = {}, {}
    for name, displacement, intact in (
        ("still", still, without_first),
        ("loose", loose, without_first),
        ("stretched", stretched, without_first),
    ):
        moved = [
            make_frame(surface, k, displacement=u, intact_faces=intact) for k, u in enumerate((still, displacement))
        ]
        stage = animated(tmp_path / name, surface, moved)
        assert np.all(np.abs(in_picture(stage, (surface.points + displacement)[1:])) < 1.0)
        extents[name] = np.array(UsdGeom.Mesh.Get(stage, SHEET).GetExtentAttr().Get(1))
        place = UsdGeom.Camera.Get(stage, "/World/Camera").ComputeLocalToWorldTransform(0)
        distances[name] = np.linalg.norm(place.ExtractTranslation() - Gf.Vec3d(0.25, 0.2, 0.0))
    np.testing.assert_array_equal(extents["loose"], extents["still"])
    assert distances["loose"] == distances["still"] < distances["stretched"]


def test_material_reads_the_display_colour_and_something_shines(stage: Usd.Stage) -> None:
    material, _ = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(SHEET)).ComputeBoundMaterial()
    shader = material.ComputeSurfaceSource()[0]
    assert shader.GetShaderId() == "UsdPreviewSurface"
    reader = UsdShade.Shader(shader.GetInput("diffuseColor").GetConnectedSources()[0][0].source.GetPrim())
    assert reader.GetShaderId() == "UsdPrimvarReader_float3"
    assert reader.GetInput("varname").Get() == "displayColor"
    assert {prim.GetTypeName() for prim in stage.Traverse()} >= {"DomeLight", "DistantLight"}
