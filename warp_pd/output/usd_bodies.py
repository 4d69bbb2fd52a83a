"""Rigid bodies in a USD file, and helpers for materials, vector arrays and extents."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from ..interfaces.frame import Body
from .shapes import bounding_box

_COLOUR = (0.32, 0.37, 0.42)


def define_body(stage: Usd.Stage, body: Body) -> None:
    """Define the shape of a body in the body frame; as a triangle mesh if USD lacks the shape."""
    path, sizes = _path_of(body), body.sizes
    if body.kind == "sphere":
        shape = UsdGeom.Sphere.Define(stage, path)
        shape.CreateRadiusAttr(sizes[0])
    elif body.kind in ("capsule", "cylinder"):
        shape = (UsdGeom.Capsule if body.kind == "capsule" else UsdGeom.Cylinder).Define(stage, path)
        shape.CreateAxisAttr(UsdGeom.Tokens.z)
        shape.CreateRadiusAttr(sizes[0])
        shape.CreateHeightAttr(2.0 * sizes[1])
    else:
        shape = UsdGeom.Mesh.Define(stage, path)
        shape.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        shape.CreatePointsAttr(vectors(body.vertices))
        shape.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(body.triangles), 3, np.int32)))
        shape.CreateFaceVertexIndicesAttr(
            Vt.IntArray.FromNumpy(np.ascontiguousarray(body.triangles, np.int32).ravel())
        )  # fmt: skip
    shape.CreateExtentAttr(extent(body.vertices))
    shape.AddTranslateOp()
    shape.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
    shape.CreateDisplayColorAttr(Vt.Vec3fArray([Gf.Vec3f(*_COLOUR)]))
    bind_material(shape, "/World/Materials/Steel", roughness=0.25)


def _path_of(body: Body) -> str:
    return f"/World/Bodies/{body.name}"


def place_body(stage: Usd.Stage, body: Body, pose: NDArray[np.float64], code: Usd.TimeCode) -> None:
    """Write the position [m] and quaternion of a body, shape (7,), at a frame."""
    prim = stage.GetPrimAtPath(_path_of(body))
    x, y, z, qx, qy, qz, qw = map(float, pose)
    prim.GetAttribute("xformOp:translate").Set(Gf.Vec3d(x, y, z), code)
    prim.GetAttribute("xformOp:orient").Set(Gf.Quatd(qw, qx, qy, qz), code)


def bind_material(shape: UsdGeom.Gprim, path: str, *, roughness: float) -> None:
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


def vectors(values: NDArray[np.floating]) -> Vt.Vec3fArray:
    """Vectors, shape (N, 3), in the precision of the file."""
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))


def extent(points: NDArray[np.floating]) -> Vt.Vec3fArray:
    """Lowest and highest corner of points [m], shape (N, 3)."""
    return vectors(bounding_box(np.asarray(points, np.float32)))
