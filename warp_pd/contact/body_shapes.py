"""Shapes of rigid bodies: arguments of their distance functions, inertia, and outlines for drawing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
import warp as wp

from ..device.checks import InputError, not_negative, positive, vector
from ..device.cores import load_kernel
from ..device.fields import Array
from ..device.launches import with_values
from ..kernels.contact import distances
from ..kernels.contact.distances import FaceTree

# Largest error of the search of a mesh in float32, divided by the size of the body.
UNSURE = 1e-5
# Distance up to which a point searches the surface of a mesh, and within which it lists triangles [spacings].
FAR, CLOSE = 4.0, 0.25
# Fraction of a distance that a point remembers; the rest covers rounding to float32.
TRUST = 1.0 - 1e-6

Outline = tuple[np.ndarray, np.ndarray]
# Number of corners of a drawn circle, and of arcs from pole to pole.
AROUND, ARCS = 32, 16


@runtime_checkable
class BodyShape(Protocol):
    """Shape of a rigid body in the body frame, whose origin is the centre of mass.

    Attributes:
        kind: Name of the shape in results.
        distance: Warp function of its signed distance, see kernels/contact/distances.py.
        remembering: That of a point of the sheet which remembers the surface, or None.
        bounded: Whether the body is bounded and so has a finite mass; a half space is not.
        notes: What may be a mistake of the shape, for the notes of a run.
    """

    kind: ClassVar[str]
    distance: ClassVar[Any]
    remembering: ClassVar[Any] = None
    bounded: ClassVar[bool] = True
    notes: tuple[str, ...] = ()

    def sizes(self) -> tuple[float, ...]:
        """Sizes for the distance function, at most four numbers."""
        ...

    def radius(self) -> float:
        """Distance of the furthest point from the origin [m]."""
        ...

    def thinnest(self) -> float:
        """Smallest extent along any direction [m]."""
        ...

    def inertia(self) -> np.ndarray:
        """Inertia tensor about the centre of mass divided by mass [m^2], shape (3, 3), for uniform density."""
        raise InputError(f"{type(self).__name__}: an unbounded body has no mass: expected a motion along a BodyPath")

    def outline(self, extent: float) -> Outline:
        """Vertices [m], (V, 3), and triangles, (F, 3), for drawing; `extent` [m] is the size of the scene."""
        ...

    def edge_radius(self) -> float:
        """Least radius of its convex edges [m]: 0 where a point of the sheet meets one face or another."""
        return math.inf

    def surface(self) -> Outline | None:
        """Vertices and triangles of a mesh, which its distance function searches; None for other shapes."""
        return None

    def segments(self) -> tuple[np.ndarray, np.ndarray, float] | None:
        """Segments for contact with triangles: vertices [m], (V, 3), vertex pairs, (S, 2), and radius [m]; or None."""
        return None


@dataclass(frozen=True)
class Sphere(BodyShape):
    """A ball; `diameter` [m]."""

    diameter: float

    kind: ClassVar[str] = "sphere"
    distance: ClassVar[Any] = distances.sphere_distance

    def __post_init__(self) -> None:
        positive("Sphere.diameter", self.diameter)

    def sizes(self) -> tuple[float, ...]:
        """The radius."""
        return (0.5 * self.diameter,)

    def radius(self) -> float:
        """The radius [m]."""
        return 0.5 * self.diameter

    def thinnest(self) -> float:
        """The diameter [m]."""
        return self.diameter

    def segments(self) -> tuple[np.ndarray, np.ndarray, float] | None:
        """One segment of zero length at the centre, with the radius of the sphere."""
        return np.zeros((1, 3)), np.array([[0, 0]]), self.radius()

    def inertia(self) -> np.ndarray:
        """Two fifths of the squared radius [m^2], isotropic."""
        return 0.4 * self.radius() ** 2 * np.eye(3)

    def outline(self, extent: float) -> Outline:
        """Surface of revolution from circles of latitude."""
        polar = np.linspace(0.0, math.pi, ARCS + 1)
        return _turned(self.radius() * np.sin(polar), self.radius() * np.cos(polar))


@dataclass(frozen=True)
class Plane(BodyShape):
    """The half space below a plane through the origin with the outward normal `normal`."""

    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)

    kind: ClassVar[str] = "plane"
    distance: ClassVar[Any] = distances.plane_distance
    bounded: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if not np.any(vector("Plane.normal", self.normal, 3)):
            raise InputError(f"Plane.normal = {self.normal!r}: expected a nonzero vector")

    def sizes(self) -> tuple[float, ...]:
        """The unit normal."""
        normal = np.array(self.normal, float)
        return tuple((normal / np.linalg.norm(normal)).tolist())

    def radius(self) -> float:
        """Infinite."""
        return math.inf

    def thinnest(self) -> float:
        """Infinite."""
        return math.inf

    def outline(self, extent: float) -> Outline:
        """Square with sides of twice the extent."""
        normal = np.array(self.sizes())
        across = np.cross(normal, np.eye(3)[int(np.abs(normal).argmin())])
        across /= np.linalg.norm(across)
        corners = extent * np.array([across, np.cross(normal, across)])
        signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        return signs @ corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32)


@dataclass(frozen=True)
class Round(BodyShape):
    """A body about the axis z of its frame (base class); `diameter` and `length` [m]."""

    diameter: float
    length: float

    def __post_init__(self) -> None:
        positive(f"{type(self).__name__}.diameter", self.diameter)
        positive(f"{type(self).__name__}.length", self.length)

    def sizes(self) -> tuple[float, ...]:
        """The radius, and half of the length."""
        return 0.5 * self.diameter, 0.5 * self.length


@dataclass(frozen=True)
class Capsule(Round):
    """A cylinder along z with hemispherical ends; `length` [m] is that of the axis, without the ends."""

    kind: ClassVar[str] = "capsule"
    distance: ClassVar[Any] = distances.capsule_distance

    def radius(self) -> float:
        """Half of the total length [m]."""
        return 0.5 * (self.diameter + self.length)

    def thinnest(self) -> float:
        """The diameter [m]."""
        return self.diameter

    def segments(self) -> tuple[np.ndarray, np.ndarray, float] | None:
        """The axis, with the radius of the capsule."""
        radius, half = self.sizes()
        return np.array([[0.0, 0.0, -half], [0.0, 0.0, half]]), np.array([[0, 1]]), radius

    def inertia(self) -> np.ndarray:
        """Sum for the cylinder and the hemispheres, divided by mass [m^2]."""
        r, h = self.sizes()
        tube, ball = 2.0 * h * math.pi * r**2, 4.0 / 3.0 * math.pi * r**3
        along = 0.5 * tube * r**2 + 0.4 * ball * r**2
        across = tube * (0.25 * r**2 + h**2 / 3.0) + ball * (0.4 * r**2 + h**2 + 0.75 * h * r)
        return np.diag([across, across, along]) / (tube + ball)

    def outline(self, extent: float) -> Outline:
        """Surface of revolution from circles along the axis."""
        r, h = self.sizes()
        polar = np.linspace(0.0, 0.5 * math.pi, ARCS // 2 + 1)
        radii, heights = r * np.sin(polar), r * np.cos(polar) + h
        return _turned(np.append(radii, radii[::-1]), np.append(heights, -heights[::-1]))


@dataclass(frozen=True)
class Cylinder(Round):
    """A cylinder along z with flat ends; `diameter`, `length`, and radius `rounding` of its edges [m]."""

    rounding: float = 0.0

    kind: ClassVar[str] = "cylinder"
    distance: ClassVar[Any] = distances.cylinder_distance

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_rounding("Cylinder", self.rounding, self.thinnest())

    def sizes(self) -> tuple[float, ...]:
        """The radius, half of the length, and the rounding of the edges if there is any."""
        return (*super().sizes(), self.rounding)[: 3 if self.rounding else 2]

    def edge_radius(self) -> float:
        """The rounding [m]."""
        return self.rounding

    def radius(self) -> float:
        """Distance of the edges from the centre [m]."""
        less = 2.0 * self.rounding
        return 0.5 * math.hypot(self.diameter - less, self.length - less) + self.rounding

    def thinnest(self) -> float:
        """Diameter or length, whichever is smaller [m]."""
        return min(self.diameter, self.length)

    def inertia(self) -> np.ndarray:
        """Diagonal inertia tensor divided by mass [m^2]."""
        r, h = 0.5 * self.diameter, 0.5 * self.length
        if self.rounding:
            # Discs of the rounded ends, whose radii and heights are polynomials of sine and cosine.
            turn, weights = np.polynomial.legendre.leggauss(24)
            turn = 0.25 * math.pi * (turn + 1.0)
            radii = np.append(r, r - self.rounding + self.rounding * np.cos(turn))
            heights = np.append(0.0, h - self.rounding + self.rounding * np.sin(turn))
            thick = np.append(h - self.rounding, 0.25 * math.pi * weights * self.rounding * np.cos(turn))
            squares, z2 = radii**2, heights**2
            z2[0] = (h - self.rounding) ** 2 / 3.0
            volume = float((thick * squares).sum())
            along = 0.5 * float((thick * squares**2).sum()) / volume
            middle = 0.5 * along + float((thick * squares * z2).sum()) / volume
            return np.diag([middle, middle, along])
        across = 0.25 * r**2 + h**2 / 3.0
        return np.diag([across, across, 0.5 * r**2])

    def outline(self, extent: float) -> Outline:
        """Surface of revolution between the circular edges."""
        r, h, rounding = 0.5 * self.diameter, 0.5 * self.length, self.rounding
        polar = np.linspace(0.0, 0.5 * math.pi, ARCS // 2 + 1) if rounding else np.zeros(1)
        radii, heights = r - rounding + rounding * np.sin(polar), h - rounding + rounding * np.cos(polar)
        radii = np.concatenate([[0.0], radii, radii[::-1], [0.0]])
        return _turned(radii, np.concatenate([[h], heights, -heights[::-1], [-h]]))


@dataclass(frozen=True)
class Box(BodyShape):
    """A box; `sides` along x, y and z, and radius `rounding` of its edges and corners [m]."""

    sides: tuple[float, float, float]
    rounding: float = 0.0

    kind: ClassVar[str] = "box"
    distance: ClassVar[Any] = distances.box_distance

    def __post_init__(self) -> None:
        for side in vector("Box.sides", self.sides, 3):
            positive("Box.sides", float(side))
        _require_rounding("Box", self.rounding, self.thinnest())

    def sizes(self) -> tuple[float, ...]:
        """Half lengths of the sides, and the rounding of the edges if there is any."""
        halves = tuple(0.5 * side for side in self.sides)
        return (*halves, self.rounding) if self.rounding else halves

    def edge_radius(self) -> float:
        """The rounding [m]."""
        return self.rounding

    def radius(self) -> float:
        """Distance of the corners from the centre [m]."""
        return 0.5 * math.hypot(*(side - 2.0 * self.rounding for side in self.sides)) + self.rounding

    def thinnest(self) -> float:
        """The shortest side [m]."""
        return min(self.sides)

    def inertia(self) -> np.ndarray:
        """Diagonal inertia tensor divided by mass [m^2]."""
        squares = np.array(self.sides) ** 2
        if self.rounding:
            squares = 12.0 * self._mean_squares()
        return np.diag((squares.sum() - squares) / 12.0)

    def _mean_squares(self) -> np.ndarray:
        """Mean squares of the distances from the middle along x, y and z [m^2], (3,): of box, slabs, edges, corners."""
        halves, r = 0.5 * np.array(self.sides) - self.rounding, self.rounding
        pi, volume, found = math.pi, 0.0, np.zeros(3)
        for c in range(3):
            a, (b, d) = halves[c], np.delete(halves, c)
            volume = 8.0 * a * b * d + 8.0 * r * (a * b + b * d + d * a) + 2.0 * pi * r**2 * (a + b + d)
            volume += 4.0 / 3.0 * pi * r**3
            within = 4.0 * b * d + 4.0 * r * (b + d) + pi * r**2
            beyond = 8.0 / 3.0 * b * d * ((a + r) ** 3 - a**3)
            edges = 2.0 * (b + d) * (pi * (a * r) ** 2 + 8.0 / 3.0 * a * r**3 + 0.25 * pi * r**4)
            corners = 4.0 / 3.0 * pi * a**2 * r**3 + pi * a * r**4 + 4.0 / 15.0 * pi * r**5
            found[c] = 2.0 / 3.0 * a**3 * within + beyond + edges + corners
        return found / volume

    def outline(self, extent: float) -> Outline:
        """Triangles on the eight corners, or on spheres in them."""
        inner = 0.5 * np.array(self.sides) - self.rounding
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * inner
        if self.rounding:
            return _hull(corners, self.rounding)
        quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        return corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.int32)

    def segments(self) -> tuple[np.ndarray, np.ndarray, float] | None:
        """The twelve edges, with the radius of their rounding."""
        inner = Box(tuple(side - 2.0 * self.rounding for side in self.sides))  # type: ignore[arg-type]
        return *convex_edges(*inner.outline(0.0)), self.rounding


def _require_rounding(name: str, rounding: float, thinnest: float) -> None:
    if 2.0 * not_negative(f"{name}.rounding", rounding) >= thinnest:
        raise InputError(f"{name}.rounding = {rounding!r}: expected less than half its thickness, {0.5 * thinnest:.6g}")


def _hull(corners: np.ndarray, radius: float) -> Outline:
    """The convex hull of balls of a radius [m] about corners, (C, 3)."""
    from scipy.spatial import ConvexHull

    ball, _ = Sphere(2.0 * radius).outline(0.0)
    points = (corners[:, None] + ball).reshape(-1, 3)
    hull = ConvexHull(points)
    used, triangles = np.unique(hull.simplices, return_inverse=True)
    vertices, triangles = points[used], triangles.reshape(-1, 3)
    inwards = np.einsum("fc,fc->f", _unit_normals(vertices, triangles), hull.equations[:, :3]) < 0.0
    triangles[inwards] = triangles[inwards][:, ::-1]
    return vertices, triangles.astype(np.int32)


def convex_edges(vertices: np.ndarray, triangles: np.ndarray, least: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """The vertices [m], (V, 3), and the convex edges of a closed surface as vertex pairs, (S, 2).

    `least`: angle by which the normal turns at them, at least [rad].
    """
    face, corner, beyond = _sides(triangles)
    begin, end, opposite = (triangles[face, (corner + k) % 3] for k in (1, 2, 0))
    every = _unit_normals(vertices, triangles)
    normals = every[face[beyond]]
    height = np.einsum("sc,sc->s", normals, vertices[opposite] - vertices[begin])
    convex = height < -1e-9 * np.ptp(vertices)
    if least > 0.0:
        convex &= np.einsum("sc,sc->s", normals, every[face]) < math.cos(least)
    return vertices, np.column_stack([begin, end])[convex & (begin < end)]


def side_and_corner_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Normals of the sides opposite the corners of triangles, then angle-weighted normals of the corners, (F, 6, 3)."""
    normals = _unit_normals(vertices, triangles)
    face, _, beyond = _sides(triangles)
    sides = (normals[face] + normals[face[beyond]]).reshape(3, -1, 3)
    to = [vertices[np.roll(triangles, -k, axis=1)] - vertices[triangles] for k in (1, 2)]
    angles = np.arctan2(np.linalg.norm(np.cross(*to), axis=2), np.einsum("fkc,fkc->fk", *to))
    corners = np.zeros_like(vertices)
    np.add.at(corners, triangles, angles[:, :, None] * normals[:, None])
    return np.concatenate([sides.swapaxes(0, 1), corners[triangles]], axis=1)


def _sides(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sides of a closed surface: triangle, opposite corner, index of the same side in the neighbour; (3 F,) each."""
    face, corner = np.tile(np.arange(len(triangles)), 3), np.repeat(np.arange(3), len(triangles))
    begin, end = triangles[face, (corner + 1) % 3], triangles[face, (corner + 2) % 3]
    beyond = np.empty(len(face), np.int64)
    # In the neighbouring triangle the side runs the other way.
    beyond[np.lexsort((begin, end))] = np.lexsort((end, begin))
    return face, corner, beyond


def _unit_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _turned(radii: np.ndarray, heights: np.ndarray) -> Outline:
    """Surface of revolution of a profile about z, from top to bottom; the first and last radius are zero."""
    angle = np.linspace(0.0, 2.0 * math.pi, AROUND, endpoint=False)
    circles = np.stack(
        [np.outer(radii, np.cos(angle)), np.outer(radii, np.sin(angle)), np.repeat(heights[:, None], AROUND, axis=1)],
        axis=-1,
    )[1:-1].reshape(-1, 3)
    vertices = np.vstack([[[0.0, 0.0, heights[0]]], circles, [[0.0, 0.0, heights[-1]]]])
    here = np.arange(AROUND)
    after = (here + 1) % AROUND
    last, rows = len(vertices) - 1, len(radii) - 2
    triangles = [np.column_stack([np.zeros(AROUND, int), 1 + here, 1 + after])]
    for row in range(rows - 1):
        top, low = 1 + row * AROUND, 1 + (row + 1) * AROUND
        triangles.append(np.column_stack([top + here, low + here, low + after]))
        triangles.append(np.column_stack([top + here, low + after, top + after]))
    low = 1 + (rows - 1) * AROUND
    triangles.append(np.column_stack([low + here, np.full(AROUND, last), low + after]))
    return vertices, np.vstack(triangles).astype(np.int32)


def in_frame(points: np.ndarray, place: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Points [m], shape (N, 3), in the frame of a body with a given position [m] and unit quaternion."""
    return np.asarray((points - place) @ rotation_matrix(rotation))


def rotation_matrix(q: np.ndarray) -> np.ndarray:
    """The rotation matrix of a unit quaternion (x, y, z, w), shape (3, 3)."""
    axis, w = q[:3], q[3]
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.asarray(np.eye(3) + 2.0 * (w * cross + cross @ cross))


def on_device(
    shape: BodyShape, device: wp.Device, spacing: float = 0.0, remembered: Mapping[str, Array] | None = None
) -> tuple[Any, Any]:
    """Arguments of the shape's distance function, and what must stay alive with them, None if it is no mesh.

    `remembered`: arrays in which the points of a sheet, with this `spacing` [m], remember the surface of a mesh.
    """
    made = distances.BodyShape()
    sizes = shape.sizes()
    made.size = wp.vec4d(*sizes, *[0.0] * (4 - len(sizes)))
    surface = shape.surface()
    return (made, None) if surface is None else _mesh_on_device(made, sizes[0], surface, device, spacing, remembered)


def _mesh_on_device(
    made: Any, size: float, surface: tuple[np.ndarray, np.ndarray], device: wp.Device, spacing: float,
    remembered: Mapping[str, Array] | None,
) -> tuple[Any, Any]:  # fmt: skip
    """`on_device` of a mesh of this size [m]."""
    vertices, triangles = surface
    mesh = wp.Mesh(
        points=wp.array(vertices.astype(np.float32), dtype=wp.vec3, device=device),
        indices=wp.array(triangles.astype(np.int32).ravel(), dtype=wp.int32, device=device),
        # Built once, searched in every step.
        bvh_constructor="sah",
    )
    of: Any = distances.MeshSurface()
    of.size, of.mesh, of.tree = size, mesh.id, _face_tree(vertices[triangles].astype(np.float32), device)
    a, b, c = vertices[triangles].swapaxes(0, 1)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    of.triangles = wp.array(np.stack([a, b - a, c - a, normal], axis=1), dtype=wp.vec3d, device=device)
    of.normals = wp.array(side_and_corner_normals(vertices, triangles), dtype=wp.vec3d, device=device)
    of.far, of.close, of.unsure, of.trust = FAR * spacing, CLOSE * spacing, UNSURE * size, TRUST
    for struct in (of, made):
        with_values(struct, remembered or {})
    made.surface = wp.array([of], dtype=distances.MeshSurface, device=device)
    return made, (mesh, of)


def _face_tree(corners: np.ndarray, device: wp.Device) -> Any:
    """Tree of boxes around triangles with these corners [m], (F, 3, 3) float32; see kernels/contact/distances.py."""
    made = FaceTree()
    made.leaves = 1 << (max(len(corners), 2) - 1).bit_length()
    order = order_of_leaves(corners.mean(axis=1))
    bounds = np.full((2, 2 * made.leaves, 3), np.inf, np.float32)
    bounds[0, made.leaves :][: len(order)] = corners[order].min(axis=1)
    bounds[1, made.leaves :][: len(order)] = -corners[order].max(axis=1)
    level = made.leaves
    while level > 1:
        children = bounds[:, level : 2 * level].reshape(2, level // 2, 2, 3)
        level //= 2
        bounds[:, level : 2 * level] = children.min(axis=2)
    lower, upper = bounds[0], -bounds[1]
    empty = np.pad(order, (0, made.leaves - len(order)), constant_values=-1)
    made.order = wp.array(empty, dtype=wp.int32, device=device)
    made.lower, made.upper = (wp.array(np.ascontiguousarray(x), dtype=wp.vec3, device=device) for x in (lower, upper))
    return made


def order_of_leaves(centres: np.ndarray) -> np.ndarray:
    """Triangles with these centres, shape (F, 3) or more columns, in an order that keeps neighbours together, (F,)."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(centres, leafsize=1).indices, np.int32)


def signed_distances(
    shape: BodyShape, points: np.ndarray, device: wp.Device, made: tuple[Any, Any] | None = None
) -> np.ndarray:
    """Normals (columns 1 to 3) and signed distances [m] (4) of points in the frame of a shape, shape (N, 4).

    `made` is the result of `on_device` for this shape and device; None to create it.
    """
    body, mesh = made or on_device(shape, device)
    kernel = distances.distances(shape.distance)
    found = wp.empty(len(points), dtype=wp.vec4d, device=device)
    # A mesh is searched as far as the furthest point.
    reach = 2.0 * float(np.linalg.norm(points, axis=1).max(initial=0.0)) + (shape.sizes()[0] if mesh else 0.0)
    arm: Any = wp.array(np.ascontiguousarray(points, np.float64), dtype=wp.vec3d, device=device)
    load_kernel(kernel, device)
    wp.launch(kernel, len(points), inputs=[arm, reach, body, 0], outputs=[found], device=device)
    return np.asarray(found.numpy())
