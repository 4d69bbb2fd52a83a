"""The sheet: points with areas, a triangulation, thickness and density."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, Self, TypeVar

import numpy as np

from ..device.checks import InputError, by_point, finite, point_indices, positive, truth_values, vector
from .rectangles import line, rectangle
from .regions import edge_points, region_of
from .shape import Shape
from .topology import joined
from .triangulation import Lattice, moved_cut

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
        shape = line(length, points)
        return cls.of(shape, thickness=by_point("section", section, shape.points), density=density)

    def __repr__(self) -> str:
        """One line."""
        extent = " x ".join(f"{length:.4g}" for length in self.extent)
        return f"{type(self).__name__}({extent} m, {self.size} points, spacing {self.spacing:.4g} m)"

    def as_cloud(self) -> Self:
        """Copy of the shape without its lattice or grid; bonds are then stored in a table."""
        return replace(self, lattice=None, grid=None)

    def edges(self, *names: str) -> np.ndarray:
        """Indices of the points on named edges; "all" is the outline and all holes.

        Names are those in `parts` and, on a flat sheet, the sides of the bounding box: left, right, bottom, top. On a
        cloud, the points of a side are those within a quarter of a spacing.

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
