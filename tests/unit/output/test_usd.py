"""The USD animation: valid, true to the frames it was given, and readable whatever happens to the run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pxr")

import itertools

from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdValidation, Vt

from warp_pd.frame import Frame, Surface
from warp_pd.output.usd import UsdAnimation

COLUMNS, ROWS, FRAMES = 6, 5, 7
SHEET = "/World/Sheet"


def make_surface(**changes) -> Surface:
    """A sheet of 6 x 5 points, 0.5 m x 0.4 m, with a ball above it."""
    points = np.array([[0.1 * column, 0.1 * row, 0.0] for row in range(ROWS) for column in range(COLUMNS)])
    corners = [row * COLUMNS + column for row in range(ROWS - 1) for column in range(COLUMNS - 1)]
    faces = np.array([triangle for a in corners for triangle in ((a, a + 1, a + 7), (a, a + 7, a + 6))], np.int32)
    values = {
        "points": points,
        "faces": faces,
        "ball_diameter": 0.1,
        "title": "tear",
        "metadata": {"version": "1", "points": 30},
    }
    return Surface(**{**values, **changes})


def make_frame(surface: Surface, at: int, **changes) -> Frame:
    """The ball pushes the middle down; from frame 2 on a tear runs from the left, one column a frame."""
    x, y = surface.points[:, 0], surface.points[:, 1]
    displacement = np.zeros_like(surface.points)
    displacement[:, 2] = -0.02 * at * np.sin(np.pi * x / 0.5) * np.sin(np.pi * y / 0.4)
    centres = surface.points[surface.faces].mean(axis=1)
    torn = (np.abs(centres[:, 1] - 0.2) < 0.1) & (centres[:, 0] < 0.1 * (at - 1))
    values = {
        "index": at,
        "time": 0.01 * at,
        "displacement": displacement,
        "velocity": np.full_like(surface.points, 0.1 * at),
        "intact_faces": ~torn,
        "damage": np.clip(2.0 * at / FRAMES - 4.0 * x, 0.0, 1.0),
        "ball_center": np.array([0.25, 0.2, 0.06 - 0.02 * at]),
    }
    return Frame(**{**values, **changes})


def write_all(path: Path, first: int = 0, last: int = FRAMES, **options) -> Surface:
    surface = make_surface()
    with UsdAnimation(path, surface, **options) as animation:
        for index in range(first, last):
            animation.write(make_frame(surface, index))
    return surface


@pytest.fixture(scope="module")
def surface() -> Surface:
    return make_surface()


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Usd.Stage:
    path = tmp_path_factory.mktemp("usd") / "animation.usd"
    write_all(path, save_every=3, seconds_per_frame=0.01)
    return Usd.Stage.Open(str(path))


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


def test_validators_do_find_errors(tmp_path: Path) -> None:
    write_all(tmp_path / "animation.usd")
    stage = Usd.Stage.Open(str(tmp_path / "animation.usd"))
    stage.ClearDefaultPrim()
    assert errors_of(stage) != []


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


def test_file_is_binary(tmp_path: Path) -> None:
    write_all(tmp_path / "animation.usd")
    assert (tmp_path / "animation.usd").read_bytes()[:8] == b"PXR-USDC"
    assert [entry.name for entry in tmp_path.iterdir()] == ["animation.usd"]


@pytest.mark.parametrize("index", range(FRAMES))
def test_mesh_is_the_frame(mesh: UsdGeom.Mesh, surface: Surface, index: int) -> None:
    frame = make_frame(surface, index)
    points = np.array(mesh.GetPointsAttr().Get(index))
    np.testing.assert_allclose(points, frame.positions(surface), atol=1e-7)
    np.testing.assert_array_equal(mesh.GetExtentAttr().Get(index), [points.min(axis=0), points.max(axis=0)])
    np.testing.assert_array_equal(faces_of(mesh, index), surface.faces[frame.intact_faces])
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
    with UsdAnimation(tmp_path / "a.usd", surface) as animation:
        animation.write(Frame(0, 0.0, still, still, intact_faces=intact))
    stage = Usd.Stage.Open(str(tmp_path / "a.usd"))
    normals = np.array(UsdGeom.Mesh.Get(stage, SHEET).GetNormalsAttr().Get(0))
    np.testing.assert_allclose(normals[0], np.array([1.0, 0.0, 2.0]) / np.sqrt(5.0), atol=1e-6)
    np.testing.assert_allclose(normals[4], [0.0, 0.0, 1.0], atol=1e-6)


def test_all_faces_torn_is_still_a_valid_file(tmp_path: Path, surface: Surface) -> None:
    with UsdAnimation(tmp_path / "a.usd", surface) as animation:
        animation.write(make_frame(surface, 0))
        animation.write(make_frame(surface, 1, intact_faces=np.zeros(len(surface.faces), bool)))
    stage = Usd.Stage.Open(str(tmp_path / "a.usd"))
    assert len(faces_of(UsdGeom.Mesh.Get(stage, SHEET), 1)) == 0
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
    surface = make_surface(ball_diameter=None)
    with UsdAnimation(tmp_path / "a.usd", surface) as animation:
        for index in range(3):
            frame = make_frame(surface, index, damage=None, intact_faces=None, ball_center=None)
            animation.write(frame)
    stage = Usd.Stage.Open(str(tmp_path / "a.usd"))
    mesh = UsdGeom.Mesh.Get(stage, SHEET)
    colour = mesh.GetDisplayColorPrimvar()
    assert colour.GetInterpolation() == UsdGeom.Tokens.constant and len(colour.Get()) == 1
    assert colour.GetTimeSamples() == []
    assert not damage_of(mesh)
    assert not stage.GetPrimAtPath("/World/Ball")
    assert not mesh.GetFaceVertexIndicesAttr().ValueMightBeTimeVarying()
    assert errors_of(stage) == []


def test_ball_follows(stage: Usd.Stage, surface: Surface) -> None:
    ball = UsdGeom.Sphere.Get(stage, "/World/Ball")
    assert ball.GetRadiusAttr().Get() == 0.05
    for index in range(FRAMES):
        centre = ball.ComputeLocalToWorldTransform(index).Transform(Gf.Vec3d(0, 0, 0))
        np.testing.assert_allclose(centre, make_frame(surface, index).ball_center, atol=1e-12)
        bounds = UsdGeom.BBoxCache(index, [UsdGeom.Tokens.default_]).ComputeWorldBound(ball.GetPrim())
        np.testing.assert_allclose(bounds.ComputeAlignedRange().GetSize(), [0.1] * 3, rtol=1e-6)


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
    distances = {}
    for name, displacement, intact in (
        ("still", still, without_first),
        ("loose", loose, without_first),
        ("stretched", stretched, without_first),
    ):
        with UsdAnimation(tmp_path / f"{name}.usd", surface) as animation:
            animation.write(make_frame(surface, 0, displacement=still, intact_faces=intact))
            animation.write(make_frame(surface, 1, displacement=displacement, intact_faces=intact))
        stage = Usd.Stage.Open(str(tmp_path / f"{name}.usd"))
        assert np.all(np.abs(in_picture(stage, (surface.points + displacement)[1:])) < 1.0)
        place = UsdGeom.Camera.Get(stage, "/World/Camera").ComputeLocalToWorldTransform(0)
        distances[name] = np.linalg.norm(place.ExtractTranslation() - Gf.Vec3d(0.25, 0.2, 0.0))
    assert distances["loose"] == distances["still"] < distances["stretched"]


def test_material_reads_the_display_colour_and_something_shines(stage: Usd.Stage) -> None:
    material, _ = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(SHEET)).ComputeBoundMaterial()
    shader = material.ComputeSurfaceSource()[0]
    assert shader.GetShaderId() == "UsdPreviewSurface"
    reader = UsdShade.Shader(shader.GetInput("diffuseColor").GetConnectedSources()[0][0].source.GetPrim())
    assert reader.GetShaderId() == "UsdPrimvarReader_float3"
    assert reader.GetInput("varname").Get() == "displayColor"
    assert {prim.GetTypeName() for prim in stage.Traverse()} >= {"DomeLight", "DistantLight"}


WRITE_UNTIL_KILLED = """
import sys
from test_output_usd import FRAMES, UsdAnimation, make_frame, make_surface
surface = make_surface()
animation = UsdAnimation(sys.argv[1], surface, save_every=int(sys.argv[2]))
for index in range(10**6):
    animation.write(make_frame(surface, index))
    print(index, flush=True)
"""


@pytest.mark.parametrize(("save_every", "kill_after", "kept"), [(4, 10, 9), (1, 37, 37)])
def test_killed_run_leaves_what_was_saved(tmp_path: Path, save_every: int, kill_after: int, kept: int) -> None:
    path = tmp_path / "animation.usd"
    here = Path(__file__).resolve().parent
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(here), str(here.parent)])}
    process = subprocess.Popen(
        [sys.executable, "-c", WRITE_UNTIL_KILLED, str(path), str(save_every)],
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    )
    assert process.stdout is not None
    while int(process.stdout.readline()) < kill_after:
        pass
    process.kill()
    assert process.wait() == -signal.SIGKILL
    process.stdout.close()
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh.Get(stage, SHEET)
    frames = len(mesh.GetPointsAttr().GetTimeSamples())
    assert frames >= kept
    assert stage.GetEndTimeCode() == frames - 1
    surface = make_surface()
    for index in range(frames):
        frame = make_frame(surface, index)
        np.testing.assert_allclose(mesh.GetPointsAttr().Get(index), frame.positions(surface), atol=1e-6)
        np.testing.assert_array_equal(faces_of(mesh, index), frame.faces(surface))
    # What the killed run left lying about is not in the way of the next one.
    write_all(path, frames, frames + 2, append_from=frames)
    assert Usd.Stage.Open(str(path)).GetEndTimeCode() == frames + 1
    assert [entry.name for entry in tmp_path.iterdir()] == ["animation.usd"]


def text_of(path: Path) -> str:
    return Sdf.Layer.FindOrOpen(str(path)).ExportToString()


@pytest.mark.parametrize("first", range(FRAMES + 1))
def test_appending_equals_writing_in_one_go(tmp_path: Path, first: int) -> None:
    write_all(tmp_path / "whole.usd")
    parts, surface = tmp_path / "parts.usd", make_surface()
    with UsdAnimation(parts, surface) as animation:
        for index in range(FRAMES):
            healthy = index < first
            changes = {} if healthy else {"damage": np.ones(30), "intact_faces": np.zeros(40, bool)}
            animation.write(make_frame(surface, index, **changes))
    write_all(parts, first, append_from=first)
    assert text_of(parts) == text_of(tmp_path / "whole.usd")


def test_source_of_an_append_stays_whole_until_the_next_save(tmp_path: Path, surface: Surface) -> None:
    path = tmp_path / "animation.usd"
    write_all(path)
    before = path.read_bytes()
    animation = UsdAnimation(path, surface, append_from=3)
    animation.write(make_frame(surface, 3))
    assert path.read_bytes() == before
    animation.save()
    assert path.read_bytes() != before
    assert animation.frames == 4
    animation.close()


def test_rewriting_a_file_that_is_open_here(tmp_path: Path) -> None:
    path = tmp_path / "animation.usd"
    write_all(path)
    held = Usd.Stage.Open(str(path))
    abandoned = UsdAnimation(path, make_surface())
    abandoned.write(make_frame(abandoned.surface, 0))
    write_all(path, last=3)
    assert held.GetEndTimeCode() == 2
    assert len(UsdGeom.Mesh.Get(held, SHEET).GetPointsAttr().GetTimeSamples()) == 3
    assert abandoned.frames == 1


def test_half_a_frame_is_not_kept(tmp_path: Path, surface: Surface, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "animation.usd"
    with pytest.raises(KeyboardInterrupt), UsdAnimation(path, surface) as animation:
        animation.write(make_frame(surface, 0))
        monkeypatch.setattr("warp_pd.output.usd._normals", interrupt)
        animation.write(make_frame(surface, 1))
    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.Mesh.Get(stage, SHEET).GetPointsAttr().GetTimeSamples() == [0.0]
    assert not stage.GetAttributeAtPath(f"{SHEET}.faceVertexCounts").GetTimeSamples()[1:]


def interrupt(*_arguments, **_options) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"index": 2}, "index"),
        ({"displacement": np.zeros((29, 3))}, "displacement"),
        ({"velocity": np.full((30, 3), np.nan)}, "velocity"),
        ({"damage": np.full(30, 1.5)}, "damage"),
        ({"damage": None}, "damage"),
        ({"intact_faces": np.ones(40, int)}, "intact_faces"),
        ({"ball_center": None}, "ball_center"),
        ({"point_data": {"stress": np.zeros((30, 2))}}, "stress"),
    ],
)
def test_wrong_frame_is_refused_in_one_line(tmp_path: Path, surface: Surface, changes, names: str) -> None:
    with UsdAnimation(tmp_path / "a.usd", surface) as animation:
        animation.write(make_frame(surface, 0))
        with pytest.raises(ValueError, match=names) as caught:
            animation.write(make_frame(surface, 1, **changes))
        assert "allowed" in str(caught.value) and "\n" not in str(caught.value)
        animation.write(make_frame(surface, 1))


@pytest.mark.parametrize(
    ("name", "options", "error"),
    [
        ("a.usd", {"frames_per_second": 0.0}, ValueError),
        ("a.usd", {"save_every": 0}, ValueError),
        ("a.usd", {"seconds_per_frame": float("nan")}, ValueError),
        ("a.vtk", {}, ValueError),
        ("nowhere/a.usd", {}, OSError),
        ("missing.usd", {"append_from": 2}, OSError),
        ("short.usd", {"append_from": 3}, ValueError),
        ("broken.usd", {"append_from": 1}, ValueError),
        ("short.usd", {"append_from": -1}, ValueError),
    ],
)
def test_wrong_argument_is_refused_in_one_line(tmp_path: Path, name: str, options, error) -> None:
    write_all(tmp_path / "short.usd", last=2)
    (tmp_path / "broken.usd").write_bytes(b"PXR-USDC" + bytes(200))
    with pytest.raises(error, match="allowed") as caught:
        UsdAnimation(tmp_path / name, make_surface(), **options)
    assert "\n" not in str(caught.value)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["broken.usd", "short.usd"]


@pytest.mark.parametrize(
    "changes",
    [
        {"points": np.zeros((30, 2))},
        {"faces": np.array([[0, 1, 30]])},
        {"faces": np.zeros((2, 3))},
        {"ball_diameter": -1.0},
    ],
)
def test_wrong_surface_is_refused_in_one_line(changes) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(changes))}.*allowed"):
        make_surface(**changes)


def test_writing_after_close_is_refused(tmp_path: Path, surface: Surface) -> None:
    animation = UsdAnimation(tmp_path / "a.usd", surface)
    animation.close()
    animation.close()
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ValueError, match="closed"):
        animation.write(make_frame(surface, 0))


def test_a_broken_mesh_would_be_noticed() -> None:
    assert not UsdGeom.Mesh.ValidateTopology(Vt.IntArray([0, 1, 30]), Vt.IntArray([3]), 30)[0]
