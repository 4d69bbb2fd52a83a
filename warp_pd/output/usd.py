"""Animation of a sheet in one binary USD file, for usdview, Blender, Omniverse and other renderers.

It is made from the file of the frames. One time code is one frame. The points of the sheet never change; triangles cut
by a crack are removed from the mesh at that frame.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from ..device.checks import InputError, OutputError
from ..geometry.triangulation import doubled_normals, vector_sums
from ..interfaces.frame import Body
from .vtkhdf import SeriesInfo, read_frames, read_outlines, read_series, same_arrays

# Linear red, green and blue from natural rubber to torn. It darkens all the way, so that it also reads in
# grey print, and turns red early: along a crack the damage is near 0.4, the fraction of bonds that cross it.
RAMP_DAMAGE = (0.0, 0.15, 0.4, 0.7, 1.0)
RAMP_COLOUR = np.array(
    [[0.80, 0.52, 0.26], [0.86, 0.36, 0.13], [0.72, 0.06, 0.10], [0.32, 0.01, 0.24], [0.03, 0.02, 0.22]]
)

# From where a camera looks at the sheet: from the front, a little to the right, and above.
VIEW_DIRECTION = np.array([0.45, -0.80, 0.62])
VIEW_MARGIN = 1.12


def damage_colours(damage: NDArray[np.floating]) -> NDArray[np.float64]:
    """Linear red, green and blue of the damage, shape (N, 3): amber 0, red around 0.4, deep blue 1."""
    return np.stack([np.interp(damage, RAMP_DAMAGE, channel) for channel in RAMP_COLOUR.T], axis=-1)


def bounding_box(points: NDArray[np.floating]) -> NDArray[np.float64]:
    """Lowest and highest corner of points [m], shape (2, 3)."""
    # Along rows: across them NumPy takes several times as long.
    columns = np.ascontiguousarray(points.T)
    return np.array([columns.min(axis=1), columns.max(axis=1)], np.float64)


def point_normals(
    positions: NDArray[np.floating], faces: NDArray[np.integer], *, fallback: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Unit normals at the points, shape (N, 3): the mean over each point's faces, weighted with their area.

    A point without a face, or whose faces cancel, takes its `fallback`, shape (N, 3) or (3,).
    """
    # As long as twice the area: a plain sum is weighted with the area already.
    sums = vector_sums(doubled_normals(positions, faces), faces, len(positions))
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    usable = lengths > 1e-12 * max(lengths.max(), np.finfo(np.float64).tiny)
    return np.where(usable, sums / np.where(usable, lengths, 1.0), fallback)


def camera_place(
    box: NDArray[np.float64], apertures: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Eye and target [m] from which a whole box, shape (2, 3), is visible, and their distance [m].

    `apertures` are width and height of the picture divided by the focal length.
    """
    target = box.mean(axis=0)
    towards_camera = VIEW_DIRECTION / np.linalg.norm(VIEW_DIRECTION)
    right = np.cross([0.0, 0.0, 1.0], towards_camera)
    right /= np.linalg.norm(right)
    axes = np.array([right, np.cross(towards_camera, right), towards_camera])
    corners = np.array([[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    across, upwards, nearer = axes @ (corners - target).T * VIEW_MARGIN
    slopes = 0.5 * np.array(apertures)
    for_width, for_height = np.abs(across) / slopes[0] + nearer, np.abs(upwards) / slopes[1] + nearer
    distance = float(max(for_width.max(), for_height.max()))
    return target + distance * towards_camera, target, distance


# Frames that a second shows, and that the memory holds.
FRAMES_PER_SECOND, SAVE_EVERY = 24.0, 25
_FOCAL_LENGTH = 50.0
_APERTURE = (36.0, 20.25)
# Colour of rigid bodies.
_STEEL = (0.32, 0.37, 0.42)

# Rubber stretches several times over, but a fragment that flies off must not take the camera with it.
_LARGEST_VIEW = 4.0


def write_animation(path: Path, frames: Path, seconds_per_frame: float | None = None) -> None:
    """Write the frames of a VTKHDF file into a binary USD file, which replaces an existing one when complete.

    Args:
        path: The USD file.
        frames: The file of the frames.
        seconds_per_frame: Simulated time between frames [s], stored in the file so that the playback speed relative to
            real time is known.

    Raises:
        InputError: if the frames are damaged.
        OutputError: if the file cannot be written.
    """
    path = path.resolve()
    unfinished = path.with_name(f".{path.stem}.unfinished.usdc")
    try:
        unfinished.unlink(missing_ok=True)
        # A failed call in this process may still have one of that name open.
        layer = Sdf.Layer.Find(str(unfinished)) or Sdf.Layer.CreateNew(str(unfinished))
        layer.Clear()
        _fill(Usd.Stage.Open(layer), frames, seconds_per_frame)
        os.replace(unfinished, path)
    except (OSError, Tf.ErrorException) as error:
        # Those of USD name places in its sources.
        reason = (error.strerror or str(error)) if isinstance(error, OSError) else "the disk may be full"
        raise OutputError(f"a result file could not be written: {path}: {reason}") from error
    finally:
        unfinished.unlink(missing_ok=True)
    published = Sdf.Layer.Find(str(path))
    if published:
        # Readers in this process that have the animation open would otherwise keep the old frames.
        published.Reload(force=True)


def _fill(stage: Usd.Stage, frames: Path, seconds_per_frame: float | None) -> None:
    """Add everything to an empty stage, and save it."""
    info, bodies = read_series(frames), read_outlines(frames)
    _describe_stage(stage, info, seconds_per_frame)
    mesh = _define_sheet(stage, info.metadata["title"], has_damage="damage" in info.fields)
    _define_lights(stage)
    for body, _ in bodies:
        _define_body(stage, body)
    before, boxes, used = None, [], np.zeros(info.points, bool)
    for index, (time, positions, faces, fields) in enumerate(read_frames(frames, range(info.frames))):
        if index == 0:
            reference = positions - fields["displacement"]
            fallback = point_normals(reference, faces, fallback=np.array([0.0, 0.0, 1.0]))
            boxes.append(bounding_box(reference))
        code = Usd.TimeCode(index)
        # USD keeps the triangles until a crack cuts some.
        if not same_arrays(faces, before):
            _set_faces(mesh, faces, code)
            before = faces
            used[:] = False
            used[faces] = True
        mesh.GetPointsAttr().Set(_vectors(positions), code)
        mesh.GetNormalsAttr().Set(_vectors(point_normals(positions, faces, fallback=fallback)), code)
        mesh.GetPrim().GetAttribute("warp_pd:time").Set(time, code)
        if "damage" in fields:
            damage = Vt.FloatArray.FromNumpy(fields["damage"])
            UsdGeom.PrimvarsAPI(mesh).GetPrimvar("damage").Set(damage, code)
            mesh.GetDisplayColorAttr().Set(_vectors(damage_colours(fields["damage"])), code)
        for body, poses in bodies:
            _place_body(stage, body, poses[index], code)
            # A half space has no end.
            if body.kind != "plane":
                boxes.append(bounding_box(body.placed(poses[index])))
        # A point that tore off belongs to no face, and may be far away.
        if len(faces):
            boxes.append(bounding_box(positions[used]))
            mesh.GetExtentAttr().Set(_vectors(boxes[-1]), code)
        if (index + 1) % SAVE_EVERY == 0:
            stage.Save()
    _aim_camera(stage, _view(boxes))
    stage.Save()


def _view(boxes: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """The box [m], shape (2, 3), that the camera shows: all boxes, the first of them that of the reference sheet."""
    middle = boxes[0].mean(axis=0)
    reach = 0.5 * _LARGEST_VIEW * np.linalg.norm(boxes[0][1] - boxes[0][0])
    return np.clip(bounding_box(np.concatenate(boxes)), middle - reach, middle + reach)


def _describe_stage(stage: Usd.Stage, info: SeriesInfo, seconds_per_frame: float | None) -> None:
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(FRAMES_PER_SECOND)
    stage.SetFramesPerSecond(FRAMES_PER_SECOND)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(info.frames - 1)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    layer = stage.GetRootLayer()
    layer.documentation = info.metadata["title"]
    known = {name: value for name, value in info.metadata.items() if name not in ("title", "positions")}
    pace = {} if seconds_per_frame is None else {"seconds_per_frame": float(seconds_per_frame)}
    layer.customLayerData = {"warp_pd": known | pace}


def _define_sheet(stage: Usd.Stage, title: str, *, has_damage: bool) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, "/World/Sheet")
    # Without this USD smooths the triangles as a Catmull-Clark surface, and rounds every crack tip.
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(True)
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    time = mesh.GetPrim().CreateAttribute("warp_pd:time", Sdf.ValueTypeNames.Double)
    time.SetDocumentation("Simulated time [s].")
    if title:
        mesh.GetPrim().SetDisplayName(title)
    colour = mesh.GetDisplayColorPrimvar()
    if has_damage:
        colour.SetInterpolation(UsdGeom.Tokens.vertex)
        UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("damage", Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.vertex)
    else:
        colour.SetInterpolation(UsdGeom.Tokens.constant)
        colour.Set(_vectors(damage_colours(np.zeros(1))))
    _bind_material(mesh, "/World/Materials/Rubber", roughness=0.6)
    return mesh


def _define_body(stage: Usd.Stage, body: Body) -> None:
    """Define the shape of a body in the body frame; as a triangle mesh if USD lacks the shape."""
    path, sizes = _path_of(body), body.sizes
    if body.kind == "sphere":
        shape = UsdGeom.Sphere.Define(stage, path)
        shape.CreateRadiusAttr(sizes[0])
    elif body.kind in ("capsule", "cylinder") and len(sizes) == 2:
        shape = (UsdGeom.Capsule if body.kind == "capsule" else UsdGeom.Cylinder).Define(stage, path)
        shape.CreateAxisAttr(UsdGeom.Tokens.z)
        shape.CreateRadiusAttr(sizes[0])
        shape.CreateHeightAttr(2.0 * sizes[1])
    else:
        shape = UsdGeom.Mesh.Define(stage, path)
        shape.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        shape.CreatePointsAttr(_vectors(body.vertices))
        _set_faces(shape, body.triangles, Usd.TimeCode.Default())
    shape.CreateExtentAttr(UsdGeom.Boundable.ComputeExtentFromPlugins(shape, Usd.TimeCode.Default()))
    shape.AddTranslateOp()
    shape.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
    shape.CreateDisplayColorAttr(Vt.Vec3fArray([Gf.Vec3f(*_STEEL)]))
    _bind_material(shape, "/World/Materials/Steel", roughness=0.25)


def _set_faces(mesh: UsdGeom.Mesh, faces: NDArray[np.integer], code: Usd.TimeCode) -> None:
    mesh.GetFaceVertexCountsAttr().Set(Vt.IntArray.FromNumpy(np.full(len(faces), 3, np.int32)), code)
    mesh.GetFaceVertexIndicesAttr().Set(Vt.IntArray.FromNumpy(faces.astype(np.int32).ravel()), code)


def _path_of(body: Body) -> str:
    return f"/World/Bodies/{body.name}"


def _place_body(stage: Usd.Stage, body: Body, pose: NDArray[np.float64], code: Usd.TimeCode) -> None:
    """Write the position [m] and quaternion of a body, shape (7,), at a frame."""
    prim = stage.GetPrimAtPath(_path_of(body))
    x, y, z, qx, qy, qz, qw = map(float, pose)
    prim.GetAttribute("xformOp:translate").Set(Gf.Vec3d(x, y, z), code)
    prim.GetAttribute("xformOp:orient").Set(Gf.Quatd(qw, qx, qy, qz), code)


def _bind_material(shape: UsdGeom.Gprim, path: str, *, roughness: float) -> None:
    """Bind a plain material that takes its colour from `primvars:displayColor`."""
    material = UsdShade.Material.Define(shape.GetPrim().GetStage(), path)
    reader = UsdShade.Shader.Define(shape.GetPrim().GetStage(), f"{path}/Colour")
    reader.CreateIdAttr("UsdPrimvarReader_float3")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
    surface = UsdShade.Shader.Define(shape.GetPrim().GetStage(), f"{path}/Surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(roughness)
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(
        reader.CreateOutput("result", Sdf.ValueTypeNames.Float3)
    )
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", Sdf.ValueTypeNames.Token))
    UsdShade.MaterialBindingAPI.Apply(shape.GetPrim()).Bind(material)


def _vectors(values: NDArray[np.floating]) -> Vt.Vec3fArray:
    """Vectors, shape (N, 3), in the precision of the file."""
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))


def _define_lights(stage: Usd.Stage) -> None:
    dome = UsdLux.DomeLight.Define(stage, "/World/Sky")
    dome.CreateIntensityAttr(0.5)
    sun = UsdLux.DistantLight.Define(stage, "/World/Sun")
    sun.CreateIntensityAttr(2.5)
    # Wide enough for soft shadow edges.
    sun.CreateAngleAttr(2.0)
    # A distant light shines along its -z: tilted, it shows folds and the bulge under a ball.
    sun.AddRotateXYZOp().Set(Gf.Vec3f(35.0, -25.0, 0.0))


def _aim_camera(stage: Usd.Stage, box: NDArray[np.float64]) -> None:
    """Place the camera so that the whole box [m], shape (2, 3), just fits its picture."""
    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    eye, target, distance = camera_place(box, (_APERTURE[0] / _FOCAL_LENGTH, _APERTURE[1] / _FOCAL_LENGTH))
    place = Gf.Matrix4d().SetLookAt(Gf.Vec3d(*eye.tolist()), Gf.Vec3d(*target.tolist()), Gf.Vec3d(0, 0, 1))
    camera.MakeMatrixXform().Set(place.GetInverse())
    camera.CreateFocalLengthAttr(_FOCAL_LENGTH)
    camera.CreateHorizontalApertureAttr(_APERTURE[0])
    camera.CreateVerticalApertureAttr(_APERTURE[1])
    # The default range begins at 1 m, behind a sheet the size of a hand.
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.01 * distance, 100.0 * distance))


def describe_animation(path: Path) -> str:
    """Describe an animation.usd in a few lines."""
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException:
        raise InputError(f"file = {str(path)!r}: USD cannot read it") from None
    lines = [f"{path}: time codes {stage.GetStartTimeCode():g} to {stage.GetEndTimeCode():g}"]
    lines.append(f"  {stage.GetTimeCodesPerSecond():g} a second, up {UsdGeom.GetStageUpAxis(stage)}")
    lines += [f"  {prim.GetPath()} ({prim.GetTypeName()})" for prim in stage.Traverse() if prim.GetTypeName()]
    return "\n".join(lines)
