"""Rigid bodies in a VTKHDF file: their outlines once, and a column of poses each.

The functions get open groups of the file, whose types HDF5 does not export.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..interfaces.frame import Body, Frame, Surface
from .hdf_columns import add_rows, create_column

# What the names of columns with the position and quaternion of a body begin with.
POSE = "pose_"


def lay_out_bodies(root: Any, steps: Any, own: Any, surface: Surface) -> None:
    """Store the outlines, and create the columns of poses."""
    for body in surface.bodies:
        column = f"{POSE}{body.name}"
        create_column(root.require_group("FieldData"), column, np.float64, (7,))
        create_column(steps.require_group("FieldDataOffsets"), column, np.int64)
        create_column(steps.require_group("FieldDataSizes"), column, np.int64, (2,))
        stored = own.create_group(body.name)
        stored.attrs["kind"], stored.attrs["sizes"] = body.kind, body.sizes
        stored["vertices"], stored["triangles"] = body.vertices, body.triangles


def add_poses(root: Any, steps: Any, surface: Surface, frame: Frame) -> None:
    """Add the poses of a frame."""
    poses = () if frame.bodies is None else frame.bodies
    for body, pose in zip(surface.bodies, poses, strict=True):
        column = f"{POSE}{body.name}"
        add_rows(root["FieldData"][column], [pose])
        add_rows(steps["FieldDataOffsets"][column], [frame.index])
        add_rows(steps["FieldDataSizes"][column], [[7, 1]])


def bodies_in(file: Any, index: int) -> list[tuple[NDArray[np.float64], NDArray[np.integer]]]:
    """Vertices [m], shape (V, 3), and triangles of each body in a frame."""
    found = []
    for name, stored in file["warp_pd"].items():
        body = Body(name, str(stored.attrs["kind"]), (), stored["vertices"][:], stored["triangles"][:])
        found.append((body.placed(file["VTKHDF/FieldData"][f"{POSE}{name}"][index]), body.triangles))
    return found


def outlines_in(file: Any) -> list[tuple[Body, NDArray[np.float64]]]:
    """The ball, a sphere without vertices, and each body, with its position [m] and quaternion, shape (frames, 7)."""
    found = []
    own, columns = file["warp_pd"], file["VTKHDF"].get("FieldData", {})
    if "ball_diameter" in own.attrs:
        centres = columns["ball_center"][:]
        poses = np.hstack([centres, np.broadcast_to([0.0, 0.0, 0.0, 1.0], (len(centres), 4))])
        radius = 0.5 * float(own.attrs["ball_diameter"])
        found.append((Body("ball", "sphere", (radius,), np.empty((0, 3)), np.empty((0, 3), np.int64)), poses))
    for name, stored in own.items():
        kind, sizes = str(stored.attrs["kind"]), tuple(float(size) for size in stored.attrs["sizes"])
        body = Body(name, kind, sizes, stored["vertices"][:], stored["triangles"][:])
        found.append((body, columns[f"{POSE}{name}"][:]))
    return found
