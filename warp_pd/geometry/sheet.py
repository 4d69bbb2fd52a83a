"""The sheet: points with areas, a triangulation, thickness and density."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ..device.checks import InputError, by_point, called, finite, numbers, point_indices, positive, truth_values, vector
from ..shapes.edits import before_stretch, punched, slit, stepped_rim, turned
from ..shapes.files import flat_shape, read_mesh
from ..shapes.lines import Named
from ..shapes.outline import outline
from ..shapes.surface_edits import opened, slit_along, slits_at
from ..shapes.surfaces import sphere, surface, tube
from .clouds import cloud
from .edges import edge_points
from .rectangles import filled, line, rectangle
from .regions import region_of
from .shape import Shape
from .topology import joined
from .triangulation import Segment

# A number, one for each point, shape (N,), or a function of the coordinates of the points, each of shape (N,).
ByPoint = float | np.ndarray | Callable[..., np.ndarray]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Sheet(Shape):
    """A shape with a thickness and a density.

    Create a sheet with `rectangle`, `outline` or another constructor; `cut`, `slit`, `hole`, `inclusion`, `rigid`,
    `stiffened` and `turned` return modified copies. All constructors accept thickness and density as a number, an array
    with one value per point, or a function of x and y (on a curved sheet of x, y and z).

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

    @staticmethod
    def of(shape: Shape, *, thickness: ByPoint, density: ByPoint) -> Sheet:
        """Create a sheet from a shape.

        Args:
            shape: Points, areas and triangles.
            thickness: Thickness [m].
            density: Density [kg/m^3].

        Raises:
            InputError: if thickness or density is not positive, or does not have one value per point.
        """
        arrays = {each.name: vars(shape)[each.name] for each in fields(shape)}
        return Sheet(
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

    @staticmethod
    def rectangle(
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
    ) -> Sheet:
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
        return Sheet.of(shape, thickness=thickness, density=density)

    @staticmethod
    def line(length: float, section: ByPoint, *, density: ByPoint, points: int) -> Sheet:
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
        return Sheet.of(shape, thickness=by_point("section", section, shape.points), density=density)

    @staticmethod
    def filled(
        width: float,
        height: float,
        *,
        thickness: ByPoint,
        density: ByPoint,
        points: int | tuple[int, int] = 101,
        origin: tuple[float, float] = (0.0, 0.0),
        layers: tuple[int, int] = (0, 0),
        turn: float = 0.0,
        jitter: float = 0.0,
        seed: int = 0,
    ) -> Sheet:
        """A rectangle with a rotated or jittered grid inside, to test that cracks do not depend on the grid.

        The edges and layers have the same points as `rectangle`. Without rotation and jitter the result is that of
        `rectangle`, a lattice; otherwise it is a cloud.

        Args:
            width: Length along x [m].
            height: Length along y [m].
            thickness: Thickness [m].
            density: Density [kg/m^3].
            points: As for `rectangle`; they set the spacing.
            origin: Position of the lower left corner [m].
            layers: As for `rectangle`.
            turn: Rotation of the grid about the centre of the rectangle [degrees].
            jitter: Maximum shift of a point along x and along y in spacings, less than 0.5.
            seed: Seed of the jitter, a nonnegative integer.

        Raises:
            InputError: as for `rectangle`, or if the jitter is outside [0, 0.5) or the seed is invalid.
        """
        shape = filled(width, height, points, origin, layers, turn=turn, jitter=jitter, seed=seed)
        return Sheet.of(shape, thickness=thickness, density=density)

    @staticmethod
    def outline(
        boundary: Any,
        *,
        spacing: float | Callable[[np.ndarray, np.ndarray], np.ndarray],
        thickness: ByPoint,
        density: ByPoint,
        holes: Named = (),
        cracks: Named = (),
        inclusions: Named = (),
    ) -> Sheet:
        """A sheet with any outline, with points exactly on its edges, cracks and inclusion boundaries.

        The interior is a square grid where it fits, and relaxed points between the grid and the curves. A bond exists
        only if the path between its points stays in the sheet. Weights "corrected" are second-order accurate up to
        every edge.

        Args:
            boundary: A `Polygon`, `Circle`, `Spline`, corners of a polygon [m], shape (C, 2), or a function from t in
                [0, 1] to points.
            spacing: Spacing [m], or a function from x and y, both of shape (P,), to local spacings; the horizon is
                proportional to it.
            thickness: Thickness [m].
            density: Density [kg/m^3].
            holes: Closed curves, as for `boundary`; a mapping gives them names, otherwise they are "hole 1", "hole 2",
                ...
            cracks: Polylines, shape (L, 2), that end in the sheet or on its edge; names as for holes, "crack 1". Each
                point of a crack is doubled, one copy per face, except at its tip.
            inclusions: Closed curves of rigid regions; names as for holes, "inclusion 1".

        Raises:
            InputError: if curves cross or leave the sheet, or the spacing is too coarse for them.
        """
        return Sheet.of(outline(boundary, holes, cracks, inclusions, spacing), thickness=thickness, density=density)

    @staticmethod
    def from_points(
        points: np.ndarray,
        *,
        thickness: ByPoint,
        density: ByPoint,
        triangles: np.ndarray | None = None,
        areas: np.ndarray | None = None,
        spacing: float | None = None,
        outline: Any = None,
        holes: Named = (),
        graded: bool = False,
    ) -> Sheet:
        """A sheet on any cloud of points; no bond leaves its triangulation.

        Its boundary is the part "outline" ("outline 1", ... for several pieces); holes are "hole 1", "hole 2", ...,
        largest first.

        Args:
            points: Positions [m], shape (N, 2).
            thickness: Thickness [m].
            density: Density [kg/m^3].
            triangles: Triangulation, shape (F, 3); by default the Delaunay triangulation without triangles whose
                circumcircle is wider than 2.5 spacings (notches and holes).
            areas: Area of each point [m^2]; by default a third of each adjacent triangle.
            spacing: Reference spacing [m]; by default the square root of the mean area of the points.
            outline: A closed curve, as for `Sheet.outline`, or a result of `read_outline`; the Delaunay triangles
                inside it are then used.
            holes: Closed curves that the sheet leaves open, as for `Sheet.outline`, with their names; without them a
                hole of the cloud is covered by triangles if its points lie within 2.5 spacings, or an outline is given.
            graded: Whether the horizon follows the local size of the triangles, instead of `spacing`.

        Raises:
            InputError: for coincident points, coordinates that are not finite, wrong array shapes, or points outside
                the outline or inside a hole.
        """
        return Sheet.of(
            cloud(points, triangles, areas, spacing, outline, graded, holes), thickness=thickness, density=density
        )

    @staticmethod
    def from_file(
        path: str | os.PathLike[str],
        *,
        thickness: ByPoint,
        density: ByPoint,
        unit: str | float | None = None,
        part: str | None = None,
        closed: bool = False,
        graded: bool = False,
    ) -> Sheet:
        """A sheet on the vertices of a mesh, such as a .msh, .stl, .obj, .ply, .vtu or .usd file.

        A mesh whose points all have the same z becomes a flat sheet, without z. No bond crosses its boundary, whose
        rings are the parts "outline" and "hole 1", "hole 2", ..., largest first. Named groups of points and lines of a
        .msh file are parts, too. Any other mesh becomes a curved sheet, as from `from_surface`.

        Args:
            path: The file, see `warp_pd.shapes.files.read_mesh`.
            thickness: Thickness [m].
            density: Density [kg/m^3].
            unit: Unit of the coordinates: "m", "mm", "cm", "in", or a number of meters; None for a USD file that
                specifies it.
            part: Name of the mesh or of the group of faces to use.
            closed: Whether the surface must have no boundary.
            graded: Whether the horizon follows the local size of the triangles, for meshes that are finer in places.

        Raises:
            InputError: if the file cannot be read, the unit is missing, or the mesh is invalid, naming the offending
                indices.
        """
        mesh = read_mesh(path, unit=unit, part=part, closed=closed)
        if not mesh.flat:
            curved = Sheet.from_surface(
                mesh.vertices, mesh.triangles, thickness=thickness, density=density, graded=graded
            )
            return replace(curved, parts={**curved.parts, **mesh.parts}, notes=mesh.notes)
        return Sheet.of(flat_shape(mesh, graded), thickness=thickness, density=density)

    @staticmethod
    def from_surface(
        vertices: np.ndarray,
        triangles: np.ndarray,
        *,
        thickness: ByPoint,
        density: ByPoint,
        spacing: float | None = None,
        graded: bool = False,
    ) -> Sheet:
        """A curved sheet from a triangulated surface, which is its stress-free state.

        Its open edges are the part "rim". A third of each triangle belongs to each of its corners.

        Args:
            vertices: Positions [m], shape (N, 3).
            triangles: Counter-clockwise seen from outside, shape (F, 3).
            thickness: Thickness [m].
            density: Density [kg/m^3].
            spacing: Reference spacing [m]; by default the square root of the mean area of the points.
            graded: Whether the horizon follows the local size of the triangles, instead of `spacing`.

        Raises:
            InputError: for coincident vertices, vertices without a triangle, triangles without area or with
                inconsistent orientation, or wrong array shapes.
        """
        return Sheet.of(surface(vertices, triangles, spacing, graded), thickness=thickness, density=density)

    @staticmethod
    def tube(
        radius: float, length: float, *, thickness: ByPoint, density: ByPoint, points: int | tuple[int, int] = 80
    ) -> Sheet:
        """A tube along z from z = 0, a rolled square lattice; its ends are the parts "bottom" and "top".

        Args:
            radius: [m].
            length: [m].
            thickness: Thickness [m].
            density: Density [kg/m^3].
            points: Number of points around, or around and along; by default the spacing along the tube is as close as
                possible to that around.

        Raises:
            InputError: if a size, thickness or density is not positive, or there are fewer than 6 points around or 3
                along.
        """
        return Sheet.of(tube(radius, length, points), thickness=thickness, density=density)

    @staticmethod
    def sphere(radius: float, *, thickness: ByPoint, density: ByPoint, points: int = 20) -> Sheet:
        """A sphere about the origin with a geodesic grid of nearly equal triangles and exact total area.

        Args:
            radius: Radius [m].
            thickness: Thickness [m].
            density: Density [kg/m^3].
            points: Approximate number of points on a quarter of the circumference.

        Raises:
            InputError: if the radius, thickness or density is not positive, or `points` is less than 2.
        """
        return Sheet.of(sphere(radius, points), thickness=thickness, density=density)

    def __repr__(self) -> str:
        """One line."""
        extent = " x ".join(f"{length:.4g}" for length in self.extent)
        return f"{type(self).__name__}({extent} m, {self.size} points, spacing {self.spacing:.4g} m)"

    def as_cloud(self) -> Sheet:
        """Copy of the shape without its lattice or grid; bonds are then stored in a table."""
        return replace(self, lattice=None, grid=None)

    def _require_flat(self, what: str) -> None:
        if self.frames is not None:
            raise InputError(f"{what}: expected a flat sheet, got a curved one")

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

    def plot(self, path: str | os.PathLike[str] | None = None) -> Any:
        """Draw the sheet; a notebook displays the picture. See `warp_pd.draw_sheet`."""
        from ..viewer.shape_plot import draw_shape

        return draw_shape(self, path, thickness=self.thickness, stiffness=self.stiffness)

    def slit(self, *path: Any, where: Callable[..., np.ndarray] | None = None) -> Sheet:
        """A copy of a curved sheet, such as a tube, sphere or mesh, with a slit along its surface.

        Points near the slit are moved onto it, by up to half an edge of a triangle. Each point on the slit is then
        doubled, one copy per face, and no bond crosses the slit; its tips are not doubled. An end on an open edge of
        the sheet opens that edge. The points are the parts "slit 1", "slit 1 left" and "slit 1 right", as seen along
        the path from outside.

        Args:
            path: Two or more positions [m], straight between them: there the slit lies in the plane that contains them
                and the mean of their normals. A path that returns to its first position cuts out a piece. Or one
                function level(x, y, z): the slit is where it is zero, such as a plane or a ball, with its positive side
                on the left.
            where: Condition(x, y, z) that limits the slit of a level, as for `where`.

        Raises:
            InputError: for a flat sheet, fewer than two positions, one off the sheet, a level without zeros, or a slit
                that meets itself, or an edge except at its ends.
        """
        if self.frames is None:
            raise InputError("slit: expected a curved sheet; use cut, or cracks in Sheet.outline, for a flat one")
        if len(path) == 1 and callable(path[0]):
            level = numbers("slit: level(x, y, z)", called("slit: level(x, y, z)", path[0], self.points.T))
            if level.shape != (self.size,):
                raise InputError(f"slit: level(x, y, z): expected {self.size} numbers, got shape {level.shape}")
            inside = None if where is None else truth_values("slit: where", where, *self.points.T)
            slits, name = slits_at(self, level, inside), "slit where level(x, y, z) = 0"
        else:
            if len(path) < 2 or where is not None:
                expected = "two or more positions" if where is None else "one function before where"
                raise InputError(f"slit: expected {expected}, got {len(path)}")
            places = np.array([vector(f"slit: path[{k}]", place, 3) for k, place in enumerate(path)])
            ends = [tuple(place.tolist()) for place in places[[0, -1]]]
            slits, name = [slit_along(self, places)], f"slit from {ends[0]} to {ends[1]}"
        changed, values = opened(self, slits, name)
        return replace(self, **changed, **self.at_points(values))

    def cut(self, start: tuple[float, float], end: tuple[float, float]) -> Sheet:
        """A copy in which no bond crosses the segment from `start` to `end` [m].

        These bonds are not part of the families, so a cut does not count as damage. Points on the segment belong to its
        left side. Bonds through an end inside the sheet stay: with its ends on columns of points, or midway between
        two, a cut acts as long as it is drawn. Triangles crossed by the cut are removed, also from pictures.

        Raises:
            InputError: if the segment has no length or crosses no triangle, or the sheet is curved and needs
                `slit`.
        """
        self._require_flat("cut")
        segment: Segment = (tuple(vector("start", start, 2)), tuple(vector("end", end, 2)))  # type: ignore[assignment]
        return slit(self, segment, f"cut from {start!r} to {end!r}")

    def hole(self, centre: tuple[float, ...], radius: float) -> Sheet:
        """A copy without the points closer than `radius` [m] to `centre`; the other points stay on their grid.

        On a grid, cells that lost a corner are also removed, and the areas of the points around them shrink. On a
        curved sheet, triangles that lost a corner are removed. So the rim has steps, and `notes` say by how much the
        hole of a flat sheet is larger than the circle. `Sheet.outline` has points on the rim.

        Raises:
            InputError: if the hole contains no points, removes the whole sheet, or takes part of a rigid body.
        """
        offset = self.points - vector("centre", centre, self.points.shape[1])
        inside = np.linalg.norm(offset, axis=1) < positive("radius", radius) * (1.0 - 1e-9)
        name = f"hole at {centre!r} of radius {radius!r}"
        smaller, kept = punched(self, inside, name)
        touched = ~kept
        touched[kept] = ~np.isclose(smaller.areas, self.areas[kept], rtol=1e-9, atol=0.0)
        if any(touched[members].any() for members in self.inclusions):
            raise InputError(
                f"{name} changes the mass of a rigid body: expected a hole beside it; or make the hole first"
            )
        note = stepped_rim(self, smaller, touched, radius)
        if note:
            smaller = replace(smaller, notes=(*smaller.notes, f"{name}: {note}"))
        return replace(smaller, **self.at_points(lambda values: values[kept]))

    def at_points(self, change: Callable[[np.ndarray], np.ndarray]) -> dict[str, Any]:
        """Thickness, density and stiffness for a copy with other points, with `change` applied to arrays."""
        values = {name: getattr(self, name) for name in ("thickness", "density", "stiffness")}
        return {name: change(value) if np.ndim(value) else value for name, value in values.items()}

    def inclusion(self, centre: tuple[float, ...], radius: float) -> Sheet:
        """A copy in which the points within `radius` [m] of `centre` move as one rigid body.

        Raises:
            InputError: if it contains fewer than three points, only collinear points, points of another rigid body or
                all of them, or, on a curved sheet, patches that do not hang together, such as both sides of a tube.
        """
        members, contains = self.within(centre, radius), f"inclusion at {centre!r} of radius {radius!r} contains"
        if not len(members):
            raise InputError(f"{contains} no points: expected a larger one")
        if len(members) == self.size:
            raise InputError(f"{contains} the whole sheet: expected a smaller one")
        if self.frames is not None and (patches := len(np.unique(joined(self.triangles, members)))) > 1:
            raise InputError(f"{contains} {patches} patches that do not hang together: expected a smaller one")
        return self.rigid(members)

    def rigid(self, points: np.ndarray, mass: float | None = None) -> Sheet:
        """A copy in which `points` move as one rigid body, such as a frame at an edge.

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
            volume = (self.areas * self.thickness)[members].sum()
            density = np.broadcast_to(np.asarray(self.density, float), self.size).copy()
            density[members] = positive("rigid: mass", mass) / volume
        return replace(self, inclusions=(*self.inclusions, members), density=density)

    def stiffened(self, points: np.ndarray, factor: float) -> Sheet:
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

    def prestretched(self, first: float, second: float | None = None) -> Sheet:
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
        stretches = positive("first", first), positive("second", first if second is None else second)
        before = np.eye(2) if self.stretch is None else self.stretch
        (stretched := replace(self, stretch=np.diag(stretches) @ before)).unstretched()
        return stretched

    def unstretched(self) -> Sheet:
        """The stress-free sheet before prestretching, the reference for strains.

        Raises:
            InputError: if rigid inclusions were added after prestretching.
        """
        return self if self.stretch is None else replace(before_stretch(self, self.stretch), stretch=None)

    def placement(self) -> np.ndarray | None:
        """Displacement of the points by prestretching [m], shape (N, 3), or None."""
        return None if self.stretch is None else self.positions - self.unstretched().positions

    def turned(self, degrees: float) -> Sheet:
        """A copy rotated about the centre of the sheet, as a cloud without a lattice.

        Raises:
            InputError: if the angle is not a number, or the sheet is curved.
        """
        self._require_flat("turned")
        sheet, rotation = turned(self, finite("degrees", degrees))
        return sheet if self.stretch is None else replace(sheet, stretch=rotation @ self.stretch @ rotation.T)
