"""Animation of a sheet in one binary USD file, for usdview, Blender, Omniverse and other renderers.

One time code is one frame. The points of the sheet never change; triangles cut by a crack are removed from the mesh at
that frame.

Saving a binary USD layer again modifies it in place: the library overwrites the tables at its end before it has written
new ones, and a process killed at that moment leaves an unreadable file. Frames are therefore written to a working file
next to the animation, and each save replaces the animation by a finished copy with one rename.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdLux, Vt

from ..device.checks import InputError
from ..interfaces.frame import Frame, Surface
from .shapes import bounding_box, camera_place, damage_colours, plain_metadata, point_normals
from .usd_bodies import BALL, bind_material, define_ball, define_body, extent, poses, vectors, write_bodies

# Frames that a second shows, and from one save to the next.
FRAMES_PER_SECOND, SAVE_EVERY = 24.0, 25
_FOCAL_LENGTH = 50.0
_APERTURE = (36.0, 20.25)

# Rubber stretches several times over, but a fragment that flies off must not take the camera with it.
_LARGEST_VIEW = 4.0

_SHEET, _CAMERA = "/World/Sheet", "/World/Camera"


class UsdAnimation:
    """Writes frames into one binary USD file, which can be opened at any time after the first frame.

    A killed run leaves the frames up to the last save. Each save copies the file.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        surface: Surface,
        *,
        seconds_per_frame: float | None = None,
        append_from: int | None = None,
    ) -> None:
        """Begin an animation, or continue one.

        Args:
            path: The file. An existing file is replaced unless `append_from` is given.
            surface: The reference sheet.
            seconds_per_frame: Simulated time between frames [s], stored in the file so that the playback speed relative
                to real time is known.
            append_from: Index of the first new frame; earlier frames of the existing file are kept, later ones dropped.
                None and 0 begin a new file.
        """
        self.path = Path(path).resolve()
        self.surface = surface
        self._working_path = self.path.with_name(f".{self.path.stem}.unfinished.usdc")
        self._unsaved = 0
        self._frames = 0
        self._last_faces: NDArray[np.integer] | None = None
        self._reference_box = bounding_box(np.asarray(surface.points, np.float64))
        self._view_box = self._reference_box
        self._reference_normals = point_normals(surface.points, surface.faces, fallback=np.array([0.0, 0.0, 1.0]))
        if append_from:
            layer = _copied_layer(self.path, self._working_path)
        else:
            self.path.unlink(missing_ok=True)
            layer = _new_layer(self._working_path)
        self._stage: Usd.Stage | None = Usd.Stage.Open(layer)
        _describe_stage(self._stage, surface, seconds_per_frame)
        if append_from:
            try:
                self._continue_from(append_from)
            except ValueError:
                self._discard()
                raise

    def write(self, frame: Frame) -> None:
        """Add the next frame."""
        stage = self._open_stage()
        code = Usd.TimeCode(frame.index)
        if frame.index == 0:
            _define_sheet(stage, self.surface, has_damage=frame.damage is not None)
            _define_lights(stage)
            if self.surface.ball_diameter is not None:
                define_ball(stage, self.surface.ball_diameter)
            for body in self.surface.bodies:
                define_body(stage, body)
        self._write_sheet(UsdGeom.Mesh.Get(stage, _SHEET), frame, code)
        self._write_ball(stage, frame, code)
        write_bodies(stage, self.surface, frame, code)
        self._widen_view(frame.positions(self.surface), frame.faces(self.surface), frame.ball_center, frame.bodies)
        _aim_camera(stage, self._view_box)
        stage.SetEndTimeCode(frame.index)
        self._frames = frame.index + 1
        self._unsaved += 1
        if frame.index == 0 or self._unsaved >= SAVE_EVERY:
            self.save()

    def save(self) -> None:
        """Save the frames written so far to disk."""
        self._open_stage().GetRootLayer().Save()
        copy = self.path.with_name(f".{self.path.stem}.copy.usdc")
        shutil.copyfile(self._working_path, copy)
        os.replace(copy, self.path)
        self._unsaved = 0

    def close(self) -> None:
        """Save unsaved frames and close the file. A partially written frame is discarded."""
        if self._stage is None:
            return
        _drop_samples(self._stage, self._frames)
        if self._frames:
            self._stage.GetRootLayer().Save()
            os.replace(self._working_path, self.path)
        else:
            self._discard()
        self._stage = None
        published = Sdf.Layer.Find(str(self.path))
        if published:
            # Readers in this process that have the animation open would otherwise keep the old frames.
            published.Reload(force=True)

    def _discard(self) -> None:
        self._stage = None
        self._working_path.unlink()

    def _open_stage(self) -> Usd.Stage:
        assert self._stage is not None
        return self._stage

    def _continue_from(self, first: int) -> None:
        """Drop the frames from `first` on, and restore the state after the frame before it."""
        stage = self._open_stage()
        mesh = UsdGeom.Mesh.Get(stage, _SHEET)
        written = len(mesh.GetPointsAttr().GetTimeSamples()) if mesh else 0
        if not 0 < first <= written:
            raise ValueError(f"append_from is {first}; expected 0 to {written}, the number of frames in {self.path}")
        _drop_samples(stage, first)
        for index in range(first):
            points = np.asarray(mesh.GetPointsAttr().Get(index))
            faces = np.asarray(mesh.GetFaceVertexIndicesAttr().Get(index)).reshape(-1, 3)
            self._widen_view(points, faces, _ball_center(stage, index), poses(stage, self.surface.bodies, index))
        self._last_faces = faces
        self._frames = first
        stage.SetEndTimeCode(first - 1)

    def _write_sheet(self, mesh: UsdGeom.Mesh, frame: Frame, code: Usd.TimeCode) -> None:
        positions, faces = frame.positions(self.surface), frame.faces(self.surface)
        self._write_faces(mesh, faces, code)
        mesh.GetPointsAttr().Set(vectors(positions), code)
        mesh.GetExtentAttr().Set(extent(positions), code)
        normals = point_normals(positions, faces, fallback=self._reference_normals)
        mesh.GetNormalsAttr().Set(vectors(normals), code)
        mesh.GetPrim().GetAttribute("warp_pd:time").Set(float(frame.time), code)
        if frame.damage is not None:
            values = np.asarray(frame.damage, np.float32)
            UsdGeom.PrimvarsAPI(mesh).GetPrimvar("damage").Set(Vt.FloatArray.FromNumpy(values), code)
            mesh.GetDisplayColorAttr().Set(vectors(damage_colours(values)), code)

    def _write_faces(self, mesh: UsdGeom.Mesh, faces: NDArray[np.int32], code: Usd.TimeCode) -> None:
        """Write the triangles if a crack has cut any since the last frame; USD keeps them otherwise."""
        if self._last_faces is not None and np.array_equal(faces, self._last_faces):
            return
        mesh.GetFaceVertexCountsAttr().Set(Vt.IntArray.FromNumpy(np.full(len(faces), 3, np.int32)), code)
        mesh.GetFaceVertexIndicesAttr().Set(Vt.IntArray.FromNumpy(np.ascontiguousarray(faces).ravel()), code)
        self._last_faces = faces

    def _write_ball(self, stage: Usd.Stage, frame: Frame, code: Usd.TimeCode) -> None:
        if frame.ball_center is None or self.surface.ball_diameter is None:
            return
        sphere = UsdGeom.Sphere.Get(stage, BALL)
        sphere.GetPrim().GetAttribute("xformOp:translate").Set(Gf.Vec3d(*map(float, frame.ball_center)), code)

    def _widen_view(
        self,
        points: NDArray[np.floating],
        faces: NDArray[np.integer],
        ball_center: NDArray[np.floating] | None,
        placed: NDArray[np.floating] | None,
    ) -> None:
        """Extend the camera's bounding box by one frame: points with a face, the ball, and bodies."""
        boxes = [self._view_box]
        if len(faces):
            # In the precision of the file, so that a run that is resumed ends with the same camera.
            boxes.append(bounding_box(points[np.unique(faces)].astype(np.float32)))
        if ball_center is not None and self.surface.ball_diameter is not None:
            radius = 0.5 * self.surface.ball_diameter
            boxes.append(np.array([np.asarray(ball_center) - radius, np.asarray(ball_center) + radius]))
        for body, pose in zip(self.surface.bodies, () if placed is None else placed, strict=True):
            # A half space has no end.
            if body.kind != "plane":
                boxes.append(bounding_box(body.placed(np.asarray(pose, np.float32).astype(np.float64))))
        middle = self._reference_box.mean(axis=0)
        reach = 0.5 * _LARGEST_VIEW * np.linalg.norm(self._reference_box[1] - self._reference_box[0])
        self._view_box = np.clip(bounding_box(np.concatenate(boxes)), middle - reach, middle + reach)


def _new_layer(path: Path) -> Sdf.Layer:
    """An empty layer, even if a failed run in this process still has one of that name open."""
    layer = Sdf.Layer.Find(str(path))
    if layer:
        layer.Clear()
        return layer
    path.unlink(missing_ok=True)
    return Sdf.Layer.CreateNew(str(path))


def _copied_layer(source: Path, path: Path) -> Sdf.Layer:
    """The layer of `source` copied to a new file, so that the source stays valid until the next save."""
    shutil.copyfile(source, path)
    layer = Sdf.Layer.Find(str(path))
    if layer:
        layer.Reload(force=True)
        return layer
    try:
        return Sdf.Layer.FindOrOpen(str(path))
    except Tf.ErrorException as error:
        path.unlink()
        raise InputError(f"{source}: expected a USD file that can be read") from error


def _describe_stage(stage: Usd.Stage, surface: Surface, seconds_per_frame: float | None) -> None:
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(FRAMES_PER_SECOND)
    stage.SetFramesPerSecond(FRAMES_PER_SECOND)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    layer = stage.GetRootLayer()
    layer.documentation = surface.title
    layer.customLayerData = {"warp_pd": plain_metadata(surface.metadata, seconds_per_frame)}


def _define_sheet(stage: Usd.Stage, surface: Surface, *, has_damage: bool) -> None:
    mesh = UsdGeom.Mesh.Define(stage, _SHEET)
    # Without this USD smooths the triangles as a Catmull-Clark surface, and rounds every crack tip.
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(True)
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    time = mesh.GetPrim().CreateAttribute("warp_pd:time", Sdf.ValueTypeNames.Double)
    time.SetDocumentation("Simulated time [s].")
    if surface.title:
        mesh.GetPrim().SetDisplayName(surface.title)
    colour = mesh.GetDisplayColorPrimvar()
    if has_damage:
        colour.SetInterpolation(UsdGeom.Tokens.vertex)
        UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("damage", Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.vertex)
    else:
        colour.SetInterpolation(UsdGeom.Tokens.constant)
        colour.Set(vectors(damage_colours(np.zeros(1))))
    bind_material(mesh, "/World/Materials/Rubber", roughness=0.6)


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
    camera = UsdGeom.Camera.Define(stage, _CAMERA)
    eye, target, distance = camera_place(box, (_APERTURE[0] / _FOCAL_LENGTH, _APERTURE[1] / _FOCAL_LENGTH))
    place = Gf.Matrix4d().SetLookAt(Gf.Vec3d(*eye.tolist()), Gf.Vec3d(*target.tolist()), Gf.Vec3d(0, 0, 1))
    camera.MakeMatrixXform().Set(place.GetInverse())
    camera.CreateFocalLengthAttr(_FOCAL_LENGTH)
    camera.CreateHorizontalApertureAttr(_APERTURE[0])
    camera.CreateVerticalApertureAttr(_APERTURE[1])
    # The default range begins at 1 m, behind a sheet the size of a hand.
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.01 * distance, 100.0 * distance))


def _drop_samples(stage: Usd.Stage, first: int) -> None:
    """Remove every value at time codes from `first` on."""
    for prim in stage.Traverse():
        for attribute in prim.GetAuthoredAttributes():
            for code in attribute.GetTimeSamples():
                if code >= first:
                    attribute.ClearAtTime(code)


def _ball_center(stage: Usd.Stage, index: int) -> NDArray[np.float64] | None:
    """Centre of the ball [m] at an already written frame, shape (3,)."""
    translate = stage.GetAttributeAtPath(f"{BALL}.xformOp:translate")
    return np.array(translate.Get(index)) if translate else None


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
