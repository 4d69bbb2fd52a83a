"""Sheets of any shape: how users make and edit them."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..device.checks import InputError, count, evaluate, finite, numbers, positive, truth_values, vector
from ..geometry.sheet import ByPoint
from ..geometry.sheet import Sheet as PlainSheet

if TYPE_CHECKING:
    from ..geometry.triangulation import Segment
    from .lines import Named


class Sheet(PlainSheet):
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

    @classmethod
    def filled(
        cls,
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
        areas: str = "shared",
    ) -> Self:
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
            areas: As for `rectangle`.

        Raises:
            InputError: as for `rectangle`, or if the jitter is outside [0, 0.5) or the seed is invalid.
        """
        count("seed", seed, 0)
        if not 0.0 <= finite("jitter", jitter) < 0.5:
            raise InputError(f"jitter = {jitter!r}: expected a fraction of the spacing, at least 0 and less than 0.5")
        solid: dict[str, Any] = {"thickness": thickness, "density": density}
        if finite("turn", turn) % 90.0 == 0.0 and jitter == 0.0:
            return cls.rectangle(width, height, **solid, points=points, origin=origin, layers=layers, areas=areas)
        from .clouds import filled

        shape = filled(width, height, points, origin, layers, turn=turn, jitter=jitter, seed=seed, areas=areas)
        return cls.of(shape, **solid)

    @classmethod
    def outline(
        cls,
        boundary: Any,
        *,
        spacing: float | Callable[[np.ndarray, np.ndarray], np.ndarray],
        thickness: ByPoint,
        density: ByPoint,
        holes: Named = (),
        cracks: Named = (),
        inclusions: Named = (),
    ) -> Self:
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
        from .outline import outline

        return cls.of(outline(boundary, holes, cracks, inclusions, spacing), thickness=thickness, density=density)

    @classmethod
    def from_points(
        cls,
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
    ) -> Self:
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
        from .clouds import cloud

        return cls.of(
            cloud(points, triangles, areas, spacing, outline, graded, holes), thickness=thickness, density=density
        )

    @classmethod
    def from_file(
        cls,
        path: str | os.PathLike[str],
        *,
        thickness: ByPoint,
        density: ByPoint,
        unit: str | float | None = None,
        part: str | None = None,
        closed: bool = False,
        graded: bool = False,
    ) -> Self:
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
        from .files import flat_shape, read_mesh

        mesh = read_mesh(path, unit=unit, part=part, closed=closed)
        if not mesh.flat:
            curved = cls.from_surface(
                mesh.vertices, mesh.triangles, thickness=thickness, density=density, graded=graded
            )
            return replace(curved, parts={**curved.parts, **mesh.parts}, notes=mesh.notes)
        return cls.of(flat_shape(mesh, graded), thickness=thickness, density=density)

    @classmethod
    def from_surface(
        cls,
        vertices: np.ndarray,
        triangles: np.ndarray,
        *,
        thickness: ByPoint,
        density: ByPoint,
        spacing: float | None = None,
        graded: bool = False,
    ) -> Self:
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
        from .surfaces import surface

        return cls.of(surface(vertices, triangles, spacing, graded), thickness=thickness, density=density)

    @classmethod
    def tube(
        cls, radius: float, length: float, *, thickness: ByPoint, density: ByPoint, points: int | tuple[int, int] = 80
    ) -> Self:
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
        from .surfaces import tube

        return cls.of(tube(radius, length, points), thickness=thickness, density=density)

    @classmethod
    def sphere(cls, radius: float, *, thickness: ByPoint, density: ByPoint, points: int = 20) -> Self:
        """A sphere about the origin with a geodesic grid of nearly equal triangles and exact total area.

        Args:
            radius: Radius [m].
            thickness: Thickness [m].
            density: Density [kg/m^3].
            points: Approximate number of points on a quarter of the circumference.

        Raises:
            InputError: if the radius, thickness or density is not positive, or `points` is less than 2.
        """
        from .surfaces import sphere

        return cls.of(sphere(radius, points), thickness=thickness, density=density)

    def slit(self, *path: Any, where: Callable[..., np.ndarray] | None = None) -> Self:
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
        from .surface_edits import opened, slit_along, slits_at

        if self.frames is None:
            raise InputError("slit: expected a curved sheet; use cut, or cracks in Sheet.outline, for a flat one")
        if len(path) == 1 and callable(path[0]):
            level = numbers("slit: level(x, y, z)", evaluate("slit: level(x, y, z)", path[0], self.points.T))
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

    def cut(self, start: tuple[float, float], end: tuple[float, float]) -> Self:
        """A copy in which no bond crosses the segment from `start` to `end` [m].

        These bonds are not part of the families, so a cut does not count as damage. Points on the segment belong to its
        left side. Bonds through an end inside the sheet stay: with its ends on columns of points, or midway between
        two, a cut acts as long as it is drawn. Triangles crossed by the cut are removed, also from pictures.

        Raises:
            InputError: if the segment has no length or crosses no triangle, or the sheet is curved and needs
                `slit`.
        """
        from .edits import slit

        self._require_flat("cut")
        segment: Segment = (tuple(vector("start", start, 2)), tuple(vector("end", end, 2)))  # type: ignore[assignment]
        return slit(self, segment, f"cut from {start!r} to {end!r}")

    def hole(self, centre: tuple[float, ...], radius: float) -> Self:
        """A copy without the points closer than `radius` [m] to `centre`; the other points stay on their grid.

        On a grid, cells that lost a corner are also removed, and the areas of the points around them shrink. On a
        curved sheet, triangles that lost a corner are removed. So the rim has steps, and `notes` say by how much the
        hole of a flat sheet is larger than the circle. `Sheet.outline` has points on the rim.

        Raises:
            InputError: if the hole contains no points, removes the whole sheet, or takes part of a rigid body.
        """
        from .edits import punched, stepped_rim

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

    def turned(self, degrees: float) -> Self:
        """A copy rotated about the centre of the sheet, as a cloud without a lattice; "left" remains the former left.

        Raises:
            InputError: if the angle is not a number, or the sheet is curved.
        """
        from .edits import turned

        self._require_flat("turned")
        sheet, rotation = turned(self, finite("degrees", degrees))
        return sheet if self.stretch is None else replace(sheet, stretch=rotation @ self.stretch @ rotation.T)

    def plot(self, path: str | os.PathLike[str] | None = None) -> Any:
        """Draw the sheet; a notebook displays the picture. See `warp_pd.draw_sheet`."""
        from ..viewer.shape_plot import draw_shape

        return draw_shape(self, path, thickness=self.thickness, stiffness=self.stiffness)

    def _require_flat(self, what: str) -> None:
        if self.frames is not None:
            raise InputError(f"{what}: expected a flat sheet, got a curved one")
