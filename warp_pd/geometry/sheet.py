"""The sheet: points with areas, a triangulation, thickness and density; rectangles; selections of points."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self, TypeVar

import numpy as np

from ..device.checks import (
    InputError,
    by_point,
    count,
    counts,
    finite,
    one_of,
    point_indices,
    positive,
    truth_values,
    vector,
)
from .regions import region_of
from .triangulation import Lattice, Segment, boundary_edges, doubled_normals, joined, lattice_triangles, moved_cut


@dataclass(frozen=True, eq=False, kw_only=True)
class Shape:
    """Points with areas, and a triangulation.

    Attributes:
        points: Reference positions [m], float64, shape (N, 2); of a curved sheet (N, 3).
        areas: Area represented by each point [m^2], shape (N,).
        triangles: Triangulation, counter-clockwise (of a curved sheet: seen from outside), shape (F, 3), int32.
        spacing: Distance of neighbouring points [m], the minimum on a graded sheet; the horizon is a multiple of it.
        lattice: The lattice if the points form a complete rectangular grid, otherwise None.
        cuts: Segments that no bond crosses.
        tips: Whether the ends of each cut are tips, inside the shape and not on another cut: a bond through a tip
            exists, so that a cut acts as long as it is drawn.
        inclusions: Point indices of each rigid inclusion.
        grid: Column and row of each point on a square grid of pitch `spacing`, -1 for other points, int32, shape (N,
            2); or None. Points on the grid are in order, row by row. The grid may have gaps.
        spacings: Local spacing at each point of a graded sheet [m], shape (N,); None if uniform.
        frames: Orthonormal tangent vectors at each point, columns e1 and e2, shape (N, 3, 2), of a curved sheet; or
            None.
        barriers: Edges of the sheet that no bond crosses, pairs of points with the sheet on the left, int32, shape
            (B, 2); or None if bonds are only limited by the horizon.
        bodies: Index (from 1) of the rigid inclusion that contains each point, 0 for the sheet and the edges of
            inclusions, int32, shape (N,); or None. Bonds join only points with equal indices.
        parts: Point indices of parts of the boundary, by name.
        pieces: Index (from 1) of the piece of each point, int32, shape (N,); None for a single piece. Bonds join only
            points of one piece.
        origins: Position of the origin of each piece [m], shape (pieces, 2); of a curved shape (pieces, 3); or None.
        notes: What may be a mistake of the shape, and what its reader changed, one line each; the summary of a run has
            them.
    """

    points: np.ndarray
    areas: np.ndarray
    triangles: np.ndarray
    spacing: float
    lattice: Lattice | None = None
    cuts: tuple[Segment, ...] = ()
    tips: tuple[tuple[bool, bool], ...] = ()
    inclusions: tuple[np.ndarray, ...] = ()
    grid: np.ndarray | None = None
    spacings: np.ndarray | None = None
    frames: np.ndarray | None = None
    barriers: np.ndarray | None = None
    bodies: np.ndarray | None = None
    parts: Mapping[str, np.ndarray] = field(default_factory=dict)
    pieces: np.ndarray | None = None
    origins: np.ndarray | None = None
    notes: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Number of points."""
        return len(self.points)

    @property
    def extent(self) -> np.ndarray:
        """Size along each axis [m]."""
        return np.asarray(np.ptp(self.points, axis=0))

    @property
    def whole_lattice(self) -> Lattice | None:
        """The lattice if the points are all of its points in order; None for a part of a lattice."""
        lattice = self.lattice
        return lattice if lattice is not None and self.size == lattice.columns * lattice.rows else None

    @property
    def widest_spacing(self) -> float:
        """The largest distance between neighbouring points [m]."""
        return self.spacing if self.spacings is None else float(self.spacings.max())

    @property
    def layout(self) -> str:
        """Layout of the families: "lattice", "grid" (with gaps) or "cloud"."""
        if self.lattice is not None:
            return "lattice"
        alike = self.spacings is None and self.frames is None
        return "grid" if self.grid is not None and alike else "cloud"

    @property
    def positions(self) -> np.ndarray:
        """Reference positions [m], shape (N, 3); z is zero on a flat sheet."""
        return np.column_stack([self.points, np.zeros((self.size, 3 - self.points.shape[1]))])

    def body_of(self, points: np.ndarray) -> np.ndarray:
        """Index (from 0) of the rigid inclusion of each of these points, of their shape; -1 outside."""
        body = np.full(self.size, -1, np.int32)
        for number, members in enumerate(self.inclusions):
            body[members] = number
        return np.asarray(body[points])

    def require_beside_bodies(self, name: str, tails: np.ndarray, heads: np.ndarray) -> None:
        """Check that a cut called `name` parts no points (`tails`, `heads`) of one rigid inclusion.

        Raises InputError, which names the place, if it does.
        """
        body = self.body_of(tails)
        inside = np.flatnonzero((body >= 0) & (body == self.body_of(heads)))
        if len(inside):
            place = tuple(self.points[tails[inside[0]]].round(6).tolist())
            raise InputError(f"{name} passes through a rigid inclusion at {place}: expected a cut beside it")

    @property
    def normals(self) -> np.ndarray:
        """Unit normals [-], shape (N, 3): +z on a flat sheet, outward on a curved one."""
        if self.frames is None:
            return np.tile([0.0, 0.0, 1.0], (self.size, 1))
        return np.cross(self.frames[..., 0], self.frames[..., 1])

    @functools.cached_property
    def folds(self) -> np.ndarray:
        """Twice the largest angle between the normal of a point and that of its triangles [degrees], shape (N,)."""
        largest = np.ones(self.size)
        if self.frames is None or not len(self.triangles):
            return 0.0 * largest
        triangles = np.asarray(self.triangles)
        normals = doubled_normals(self.points, triangles)
        normals = normals / np.linalg.norm(normals, axis=1)[:, None]
        for corner in range(3):
            np.minimum.at(largest, triangles[:, corner], (normals * self.normals[triangles[:, corner]]).sum(axis=1))
        return np.asarray(2.0 * np.degrees(np.arccos(np.clip(largest, -1.0, 1.0))))


SIDES = ("left", "right", "bottom", "top")


def edge_points(shape: Shape, names: tuple[str, ...]) -> np.ndarray:
    """Indices of the points on the named edges; arguments as for `Sheet.edges`.

    They are ascending, except those of one part, which are in its order.
    """
    if len(names) == 1 and names[0] in shape.parts:
        return np.asarray(shape.parts[names[0]])
    known = {**_sides(shape), **shape.parts}
    chosen = np.zeros(shape.size, bool)
    for name in names or ("all",):
        if name == "all":
            known["all"] = whole_edge(shape)
        if name not in known:
            one_of("edge", name, {**known, "all": None})
        chosen[known[name]] = True
    return np.flatnonzero(chosen)


def whole_edge(shape: Shape) -> np.ndarray:
    """Points on the outline and around all holes, int32, ascending; cracks, slits and cuts do not count."""
    if "all" in shape.parts:
        return np.asarray(shape.parts["all"])
    # A cut removes triangles of a lattice, but not its outer points.
    if shape.lattice is not None or not len(shape.triangles):
        return np.flatnonzero(sum(_sides(shape).values(), np.zeros(shape.size, bool))).astype(np.int32)
    return np.unique(boundary_edges(np.asarray(shape.triangles))).astype(np.int32)


def edge_names(shape: Shape) -> dict[str, np.ndarray]:
    """Points of every name of `Sheet.edges`, for edits after which positions or triangles no longer give them."""
    sides = {name: np.flatnonzero(on).astype(np.int32) for name, on in _sides(shape).items()}
    return {**sides, **shape.parts, "all": whole_edge(shape)}


def _sides(shape: Shape) -> dict[str, np.ndarray]:
    """Masks of the points on the sides of the bounding box of a flat shape in one piece, shape (N,).

    They are within a quarter of a spacing of the sides; on a lattice exactly on them.
    """
    if shape.frames is not None or shape.pieces is not None:
        return {}
    tolerance = shape.spacing * (1e-6 if shape.lattice else 0.25)
    low, high = shape.points.min(axis=0), shape.points.max(axis=0)
    return {
        "left": shape.points[:, 0] < low[0] + tolerance,
        "right": shape.points[:, 0] > high[0] - tolerance,
        "bottom": shape.points[:, 1] < low[1] + tolerance,
        "top": shape.points[:, 1] > high[1] - tolerance,
    }


# Points are counted in 32 bits.
MAX_POINTS = 2**31 - 1


def rectangle(
    width: float,
    height: float,
    points: int | tuple[int, int],
    origin: tuple[float, float],
    layers: tuple[int, int],
    centred: bool,
    areas: str = "shared",
) -> Shape:
    """A rectangle on a regular grid; arguments as for `Sheet.rectangle`."""
    width, height = positive("width", width), positive("height", height)
    one_of("centred", centred, (True, False))
    one_of("areas", areas, ("shared", "whole"))
    if not 1.0 / MAX_POINTS < height / width < MAX_POINTS:
        raise InputError(f"width = {width:g}, height = {height:g}: expected sides that the points can both resolve")
    x0, y0 = vector("origin", origin, 2)
    if isinstance(points, tuple | list):
        columns, rows = counts("points", points, 3)
    else:
        columns = count("points", points, 3)
        rows = max(3, round(height / width * (columns - 1)) + 1)
    if centred:
        dx = width / columns
        rows = rows if isinstance(points, tuple | list) else max(3, round(height / dx))
        dy = height / rows
        x0, y0 = x0 + 0.5 * dx, y0 + 0.5 * dy
    else:
        dx, dy = width / (columns - 1), height / (rows - 1)
    across, along = counts("layers", layers, 0)
    columns, rows, x0, y0 = columns + 2 * across, rows + 2 * along, x0 - across * dx, y0 - along * dy
    if columns * rows > MAX_POINTS:
        raise InputError(
            f"points = {points!r} with layers = {layers!r}, {columns} x {rows} in all: expected at most {MAX_POINTS}"
        )
    x, y = x0 + dx * np.arange(columns), y0 + dy * np.arange(rows)
    width_x, width_y = np.full(columns, dx), np.full(rows, dy)
    if not centred and areas == "shared":
        width_x[[0, -1]] *= 0.5
        width_y[[0, -1]] *= 0.5
    return Shape(
        points=np.stack(np.broadcast_arrays(x, y[:, None]), axis=-1).reshape(-1, 2),
        areas=(width_y[:, None] * width_x).ravel(),
        triangles=lattice_triangles(columns, rows),
        spacing=float(np.sqrt(dx * dy)),
        lattice=Lattice(columns, rows, dx, dy),
    )


AnySheet = TypeVar("AnySheet", bound="Sheet")

# A number, one for each point, shape (N,), or a function of the coordinates of the points, each of shape (N,).
ByPoint = float | np.ndarray | Callable[..., np.ndarray]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Sheet(Shape):
    """A shape with a thickness and a density.

    Users take `shapes.sheet.Sheet`, which has more ways to make and to edit one.

    Attributes:
        thickness: Thickness [m], a number or shape (N,); for a bar, whose `areas` are lengths [m], the cross section
            [m^2]. Where it varies, all bonds of a point's family use the thickness at that point.
        density: Mass per reference volume [kg/m^3], a number or shape (N,).
        stiffness: Factor on the moduli of the material at each point, shape (N,); None for 1 everywhere.
        stretch: In-plane deformation gradient from the stress-free sheet to this one, shape (2, 2); None if this sheet
            is stress-free.
    """

    thickness: float | np.ndarray
    density: float | np.ndarray
    stiffness: np.ndarray | None = None
    stretch: np.ndarray | None = None

    @classmethod
    def of(cls, shape: Shape, *, thickness: ByPoint, density: ByPoint) -> Self:
        """Create a sheet from a shape.

        Args:
            shape: Points, areas and triangles.
            thickness: Thickness [m].
            density: Density [kg/m^3].

        Raises:
            InputError: if thickness or density is not positive, or does not have one value per point.
        """
        arrays = {each.name: vars(shape)[each.name] for each in fields(shape)}
        return cls(
            **arrays,
            thickness=by_point("thickness", thickness, shape.points),
            density=by_point("density", density, shape.points),
        )

    @property
    def mean_thickness(self) -> float:
        """Mean thickness over the points [m]."""
        return float(np.mean(self.thickness)) if np.ndim(self.thickness) else float(self.thickness)

    @property
    def factors(self) -> np.ndarray | None:
        """Factor on the energy of each family due to varying thickness and stiffness, (N,); None for 1."""
        if not np.ndim(self.thickness):
            return self.stiffness
        relative = np.asarray(self.thickness / self.mean_thickness)
        return relative if self.stiffness is None else self.stiffness * relative

    @classmethod
    def rectangle(
        cls,
        width: float,
        height: float,
        *,
        thickness: ByPoint,
        density: ByPoint,
        points: int | tuple[int, int] = 101,
        origin: tuple[float, float] = (0.0, 0.0),
        layers: tuple[int, int] = (0, 0),
        centred: bool = False,
        areas: str = "shared",
    ) -> Self:
        """A rectangle on a regular grid whose outer points lie on its edges, or half a spacing inside.

        Args:
            width: Length along x [m].
            height: Length along y [m].
            thickness: Thickness [m].
            density: Density [kg/m^3].
            points: Number of points along x and y, or only along x; the spacing along y is then as close as possible to
                that along x.
            origin: Position of the lower left corner [m].
            layers: Number of point layers outside the left and right edges, and outside the bottom and top edges. With
                a clamp as wide as the horizon, all families in the rectangle are complete there (HE section 4.3). With
                corrected weights, hold the edge itself instead: families across it see a kink, a first-order error.
            centred: Whether the points are the centres of equal cells, as in most peridynamic papers; the outer points,
                and so the triangles, then end half a spacing inside the edges.
            areas: "shared": points on edges and corners have half and quarter areas, and the sheet has its area;
                "whole": every point has the area of a cell, as papers count that use one volume a point (BA, NN). For
                laws with weights "published".

        Raises:
            InputError: if a size, thickness or density is not positive, there are fewer than 3 points, or layers are
                negative.
        """
        shape = rectangle(width, height, points, origin, layers, centred, areas)
        return cls.of(shape, thickness=thickness, density=density)

    @classmethod
    def line(cls, length: float, section: ByPoint, *, density: ByPoint, points: int) -> Self:
        """A bar along x: one row of points at the centres of equal cells, for one-dimensional laws.

        Args:
            length: Length [m].
            section: Area of its cross section [m^2].
            density: Density [kg/m^3].
            points: Number of points.

        Raises:
            InputError: if a number is not positive, or there are fewer than 3 points.
        """
        spacing = positive("length", length) / count("points", points, 3)
        if points > MAX_POINTS:
            raise InputError(f"points = {points!r}: expected at most {MAX_POINTS}")
        shape = Shape(
            points=np.column_stack([spacing * (np.arange(points) + 0.5), np.zeros(points)]),
            areas=np.full(points, spacing),
            triangles=np.zeros((0, 3), np.int32),
            spacing=spacing,
            lattice=Lattice(points, 1, spacing, spacing),
        )
        return cls.of(shape, thickness=by_point("section", section, shape.points), density=density)

    def __repr__(self) -> str:
        """One line."""
        extent = " x ".join(f"{length:.4g}" for length in self.extent)
        return f"{type(self).__name__}({extent} m, {self.size} points, spacing {self.spacing:.4g} m)"

    def as_cloud(self) -> Self:
        """Copy of the shape without its lattice or grid; bonds are then stored in a table."""
        return replace(self, lattice=None, grid=None, parts=edge_names(self))

    def edges(self, *names: str) -> np.ndarray:
        """Indices of the points on named edges; "all" is the outline and all holes.

        Names are those in `parts` and, on a flat sheet, the sides of the bounding box: left, right, bottom, top. On a
        cloud, the points of a side are those within a quarter of a spacing. Edits keep the points of each name.

        Raises:
            InputError: for any other name.
        """
        return region_of(edge_points(self, names), self.points)

    def nearest(self, x: float, y: float, z: float | None = None) -> int:
        """Index of the point nearest to (x, y), on a curved sheet to (x, y, z).

        Raises:
            InputError: if z is given on a flat sheet, or missing on a curved one.
        """
        if (z is None) != (self.frames is None):
            expected = "a number on a curved sheet" if z is None else "None on a flat sheet"
            raise InputError(f"z = {z!r}: expected {expected}")
        place = (finite("x", x), finite("y", y), *([] if z is None else [finite("z", z)]))
        return int(np.argmin(((self.points - place) ** 2).sum(axis=1)))

    def within(self, centre: tuple[float, ...], radius: float) -> np.ndarray:
        """Indices of the points no further than `radius` [m] from `centre`, (x, y), on a curved sheet (x, y, z)."""
        offset = self.points - vector("centre", centre, self.points.shape[1])
        reach = positive("radius", radius) * (1.0 + 1e-9)
        return region_of(np.flatnonzero(np.linalg.norm(offset, axis=1) <= reach), self.points)

    def where(self, condition: Callable[..., np.ndarray]) -> np.ndarray:
        """Indices of the points for which `condition(x, y)` holds, on a curved sheet `condition(x, y, z)`.

        Its arguments and its result have shape (N,).

        Raises:
            InputError: if `condition` is not a function, or does not return N booleans.
        """
        holds = truth_values("condition", condition, *self.points.T)
        return region_of(np.flatnonzero(holds), self.points)

    def at_points(self, change: Callable[[np.ndarray], np.ndarray]) -> dict[str, Any]:
        """Thickness, density and stiffness for a copy with other points, with `change` applied to arrays."""
        values = {name: getattr(self, name) for name in ("thickness", "density", "stiffness")}
        return {name: change(value) if np.ndim(value) else value for name, value in values.items()}

    def inclusion(self, centre: tuple[float, ...], radius: float) -> Self:
        """A copy in which the points within `radius` [m] of `centre` move as one rigid body.

        Raises:
            InputError: if it contains fewer than three points, only collinear points, points of another rigid body or
                all of them, or, on a curved sheet, patches that are not connected, such as both sides of a tube.
        """
        members, contains = self.within(centre, radius), f"inclusion at {centre!r} of radius {radius!r} contains"
        if not len(members):
            raise InputError(f"{contains} no points: expected a larger one")
        if len(members) == self.size:
            raise InputError(f"{contains} the whole sheet: expected a smaller one")
        if self.frames is not None and (patches := len(np.unique(joined(self.triangles, members)))) > 1:
            raise InputError(f"{contains} {patches} patches that are not connected: expected a smaller one")
        return self.rigid(members)

    def rigid(self, points: np.ndarray, mass: float | None = None) -> Self:
        """A copy in which `points` move as one rigid body, such as a frame at an edge.

        On a prestretched sheet the body is glued on after the stretch. A `Fixed` or a `Motion` of all its points, in
        x, y and z, holds or moves it; a `Fixed` of all of them in one or two components guides it.

        Args:
            points: Point indices.
            mass: Mass of the body [kg], spread evenly over the area of its points; by default that of the points.

        Raises:
            InputError: if there are fewer than three points, only collinear points, points of another rigid body or all
                points of the sheet, or the mass is not positive.
        """
        members = point_indices("rigid: points", points, self.size)
        offset = self.points[members] - self.points[members[:1]]
        if len(members) < 3 or np.linalg.matrix_rank(offset, tol=1e-6 * self.spacing) < 2:
            raise InputError(
                f"rigid: got {len(members)} points on a line: expected three or more that are not collinear"
            )
        others = np.concatenate([[], *self.inclusions])
        if len(np.union1d(members, others)) == self.size:
            raise InputError(
                f"rigid: all {self.size} points of the sheet would be in rigid bodies: expected some outside"
            )
        if len(shared := np.intersect1d(members, others)):
            raise InputError(
                f"rigid: point {int(shared[0])} is in another rigid body: expected bodies that share no point"
            )
        density = self.density
        if mass is not None:
            volume = (self.unstretched().areas * self.thickness)[members].sum()
            density = np.broadcast_to(np.asarray(self.density, float), self.size).copy()
            density[members] = positive("rigid: mass", mass) / volume
        return replace(self, inclusions=(*self.inclusions, members), density=density)

    def stiffened(self, points: np.ndarray, factor: float) -> Self:
        """A copy in which all moduli of the material are multiplied by `factor` at `points`.

        All bonds of a point's family use the material at that point. A bond between two materials therefore gets half
        of its energy from each: W_ij Psi_i(F_ij) + W_ji Psi_j(F_ji) in the bond-associated law, the mean of both ends
        in bond-based laws.

        Raises:
            InputError: if the factor is not positive, or an index does not exist.
        """
        stiffness = np.ones(self.size) if self.stiffness is None else self.stiffness.copy()
        stiffness[point_indices("stiffened: points", points, self.size)] *= positive("stiffened: factor", factor)
        return replace(self, stiffness=stiffness)

    def prestretched(self, first: float, second: float | None = None) -> Self:
        """A copy that was stretched before it was clamped, such as the skin of a drum.

        Points, selections and displacements refer to the clamped sheet. The stress-free sheet is smaller by the
        stretches; thickness, density and mass refer to the stress-free sheet.

        Args:
            first: Stretch along x [-], greater than 1 for tension.
            second: Stretch along y [-]; by default equal to `first`.

        Raises:
            InputError: if a stretch is not positive, for a bar or rigid inclusions, or for different stretches of a
                curved sheet.
        """
        if self.inclusions:
            raise InputError(
                f"prestretched: the sheet has {len(self.inclusions)} rigid inclusions, which do not stretch: expected "
                "prestretched(...).rigid(points), glued on after the stretch, or an initial_displacement that "
                "stretches the sheet around them"
            )
        stretches = positive("first", first), positive("second", first if second is None else second)
        before = np.eye(2) if self.stretch is None else self.stretch
        (stretched := replace(self, stretch=np.diag(stretches) @ before)).unstretched()
        return stretched

    def unstretched(self) -> Self:
        """The stress-free sheet before prestretching, the reference for strains."""
        return self if self.stretch is None else replace(before_stretch(self, self.stretch), stretch=None)

    def placement(self) -> np.ndarray | None:
        """Displacement of the points by prestretching [m], shape (N, 3), or None."""
        return None if self.stretch is None else self.positions - self.unstretched().positions


def before_stretch(shape: AnySheet, gradient: np.ndarray) -> AnySheet:
    """The shape that becomes `shape` by a uniform stretch about its centre.

    `gradient` is the deformation gradient in the plane, shape (2, 2); a multiple of the identity for a curved shape.
    """
    even = bool(np.array_equal(gradient, gradient[0, 0] * np.eye(2)))
    if len(shape.triangles) == 0:
        raise InputError("prestretched: the sheet is a bar: expected a sheet with an area; take `initial_displacement`")
    if shape.points.shape[1] == 3 and not even:
        raise InputError(
            f"prestretched: gradient = {gradient.tolist()}: expected one stretch in all directions for a curved sheet"
        )
    inverse = np.linalg.inv(gradient) if shape.points.shape[1] == 2 else np.eye(3) / gradient[0, 0]
    middle = 0.5 * (shape.points.min(axis=0) + shape.points.max(axis=0))

    def back(place: np.ndarray) -> np.ndarray:
        return np.asarray((place - middle) @ inverse.T + middle)

    area, lattice = float(np.linalg.det(gradient)), shape.lattice
    if lattice is not None:
        dx, dy = lattice.dx / gradient[0, 0], lattice.dy / gradient[1, 1]
        diagonal = gradient[0, 1] == gradient[1, 0] == 0.0
        lattice = Lattice(lattice.columns, lattice.rows, float(dx), float(dy)) if diagonal else None
    return replace(
        shape,
        points=back(shape.points),
        areas=shape.areas / area,
        spacing=shape.spacing / float(np.sqrt(area)),
        lattice=lattice,
        cuts=tuple(moved_cut(cut, back) for cut in shape.cuts),
        grid=shape.grid if even else None,
        spacings=None if shape.spacings is None else shape.spacings / np.sqrt(area),
    )
