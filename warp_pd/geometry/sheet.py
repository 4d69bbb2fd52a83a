"""The sheet: material points with areas, a triangulation for pictures and edges, thickness and density."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ..device.checks import InputError, by_point, finite, point_indices, positive, vector
from .clouds import cloud
from .edits import punched, slit, turned
from .files import flat_shape, read_mesh
from .lines import Named
from .outline import outline
from .rectangles import filled, line, rectangle
from .selection import SelectableShape
from .shape import Shape
from .stretching import before_stretch
from .surface_edits import slit_surface
from .surfaces import sphere, surface, tube
from .triangulation import Segment

# A number, one for each point, shape (N,), or a function of the coordinates of the points, each of shape (N,).
ByPoint = float | np.ndarray | Callable[..., np.ndarray]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Sheet(SelectableShape):
    """A shape with a thickness and a density.

    Make one with `rectangle` or `outline`; `cut`, `hole`, `inclusion`, `stiffened` and `turned` change a copy. All that
    make one take thickness and density as a number, an array with one for each point, or a function of x and y, on a
    curved sheet of x, y and z.

    Attributes:
        thickness: Thickness [m], a number or shape (N,); for a bar, whose `areas` are lengths [m], the cross section
            [m^2]. Where it varies, the family of a point has the thickness of that point.
        density: Mass per reference volume [kg/m^3], a number or shape (N,).
        stiffness: Factor on the moduli of the material at each point, shape (N,); None: 1 everywhere.
        stretch: In-plane deformation gradient from the stress-free sheet to this one, shape (2, 2); None: this sheet
            is stress-free.
    """

    thickness: float | np.ndarray
    density: float | np.ndarray
    stiffness: np.ndarray | None = None
    stretch: np.ndarray | None = None

    @staticmethod
    def of(shape: Shape, *, thickness: ByPoint, density: ByPoint) -> Sheet:
        """A sheet of a shape.

        Args:
            shape: Points, areas and triangles.
            thickness: [m].
            density: [kg/m^3].

        Raises:
            InputError: for a thickness or density that is not above zero, or not one for each point.
        """
        arrays = {each.name: vars(shape)[each.name] for each in fields(shape)}
        return Sheet(
            **arrays,
            thickness=by_point("thickness", thickness, shape.points),
            density=by_point("density", density, shape.points),
        )

    @property
    def mean_thickness(self) -> float:
        """Mean over the points [m]; the number itself if it is one."""
        return float(np.mean(self.thickness)) if np.ndim(self.thickness) else float(self.thickness)

    @property
    def factors(self) -> np.ndarray | None:
        """Factor on the energy of each family, that of the mean thickness and the law's material, (N,); None: 1."""
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
    ) -> Sheet:
        """A rectangle on a regular grid whose outer points lie on its edges, or half a spacing inside.

        Args:
            width: Length along x [m].
            height: Length along y [m].
            thickness: [m].
            density: [kg/m^3].
            points: Points along x and y, or along x alone: then the spacing along y is as near to that along
                x as whole points allow.
            origin: Position of the lower left corner [m].
            layers: Rows of points outside the left and right edges, and outside the bottom and top edges: a clamp
                as wide as the horizon leaves every family in the rectangle whole there (HE section 4.3). With
                corrected weights hold the edge itself: families across it see a kink, an error of first order.
            centred: Whether the points are the centres of equal cells, half a spacing inside the edges, as in most
                peridynamic papers; the triangles, which join points, then end there too.

        Raises:
            InputError: for a size, thickness or density that is not above zero, fewer than 3 points, or layers
                below zero.
        """
        return Sheet.of(rectangle(width, height, points, origin, layers, centred), thickness=thickness, density=density)

    @staticmethod
    def line(length: float, section: ByPoint, *, density: ByPoint, points: int) -> Sheet:
        """A bar along x: one row of points at the centres of equal cells, for one-dimensional laws.

        Args:
            length: [m].
            section: Area of its cross section [m^2].
            density: [kg/m^3].
            points: Number of points.

        Raises:
            InputError: for a number that is not above zero, or fewer than 3 points.
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
        """A rectangle whose inside is a grid turned against its edges, or a jittered one: cracks must not see which.

        The edges carry the points of `rectangle`, also those that layers continue. With no turn and no jitter it is
        `rectangle` itself, a lattice; otherwise a cloud.

        Args:
            width: Length along x [m].
            height: Length along y [m].
            thickness: [m].
            density: [kg/m^3].
            points: As for `rectangle`; they set the spacing.
            origin: Position of the lower left corner [m].
            layers: As for `rectangle`.
            turn: Angle of the grid about the middle of the rectangle [degrees].
            jitter: Largest shift of a point along x and along y, in spacings, below one half.
            seed: Of the generator of the jitter, a whole number of 0 or more.

        Raises:
            InputError: as `rectangle`, or for a jitter outside [0, 0.5) or another seed.
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
        """A sheet of any outline: points lie exactly on its edges, on cracks and around inclusions.

        Inside is a square grid wherever it fits, and relaxed points between it and the curves. A bond exists only where
        the way between its points stays in the sheet. Weights "corrected" are second order up to every edge.

        Args:
            boundary: A `Polygon`, `Circle`, `Spline`, corners of a polygon [m], shape (C, 2), or a function from t in
                [0, 1] to points.
            spacing: Distance of points [m], or a function of x and y, both of shape (P,), to distances: the horizon
                follows it.
            thickness: [m].
            density: [kg/m^3].
            holes: Closed curves, as `boundary`; a mapping names them, otherwise they are "hole 1", "hole 2", ...
            cracks: Polylines, shape (L, 2), that end in the sheet or on its edge; names as for holes, "crack 1". Each
                point of a crack becomes two, one for each face; its tip is one point.
            inclusions: Closed curves whose inside is rigid; names as for holes, "inclusion 1".

        Raises:
            InputError: for curves that cross or leave the sheet, or a spacing too coarse for them.
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
    ) -> Sheet:
        """A sheet on any cloud of points; no bond leaves its triangulation.

        Its boundary is the part "outline" (of several pieces "outline 1", ...), holes are "hole 1", "hole 2", ..., the
        largest first.

        Args:
            points: Positions [m], shape (N, 2).
            thickness: [m].
            density: [kg/m^3].
            triangles: Triangulation, shape (F, 3); by default Delaunay's, without triangles whose
                circumscribed circle is wider than two and a half spacings (notches and holes).
            areas: Area of each point [m^2]; by default a third of each adjacent triangle.
            spacing: Reference spacing [m]; by default the root of the mean area of the points.
            outline: A closed curve, as for `Sheet.outline`, or what `read_outline` gives: Delaunay's triangles are then
                those inside it.

        Raises:
            InputError: for coincident points, coordinates that are not finite, wrong shapes, or points outside the
                outline.
        """
        return Sheet.of(cloud(points, triangles, areas, spacing, outline), thickness=thickness, density=density)

    @staticmethod
    def from_file(
        path: str | os.PathLike[str],
        *,
        thickness: ByPoint,
        density: ByPoint,
        unit: str | float | None = None,
        part: str | None = None,
        closed: bool = False,
    ) -> Sheet:
        """A sheet on the vertices of a mesh, such as a .msh, .stl, .obj, .ply, .vtu or .usd file.

        A mesh whose points all have one z is a flat sheet; its z is dropped. No bond crosses its boundary, whose rings
        are the parts "outline" and "hole 1", "hole 2", ..., the largest first. Named groups of points and lines of a
        .msh file are parts, too. Any other mesh is a curved sheet, as from `from_surface`.

        Args:
            path: The file, as for `warp_pd.geometry.files.read_mesh`, which says what it refuses.
            thickness: [m].
            density: [kg/m^3].
            unit: Of the coordinates: "m", "mm", "cm", "in", or a number of meters; None for a USD file that says its
                own.
            part: Name of the mesh or of the group of faces to take.
            closed: Whether the surface must have no boundary.

        Raises:
            InputError: for a file that cannot be read, a missing unit, or a bad mesh, with the indices of what is bad.
        """
        mesh = read_mesh(path, unit=unit, part=part, closed=closed)
        if not mesh.flat:
            curved = Sheet.from_surface(mesh.vertices, mesh.triangles, thickness=thickness, density=density)
            return replace(curved, parts={**curved.parts, **mesh.parts})
        return Sheet.of(flat_shape(mesh), thickness=thickness, density=density)

    @staticmethod
    def from_surface(
        vertices: np.ndarray,
        triangles: np.ndarray,
        *,
        thickness: ByPoint,
        density: ByPoint,
        spacing: float | None = None,
    ) -> Sheet:
        """A curved sheet: a surface of triangles in space, free of stress as it is.

        Its open edges are the part "rim". A third of each triangle belongs to each of its corners.

        Args:
            vertices: Positions [m], shape (N, 3).
            triangles: Counter-clockwise seen from outside, shape (F, 3).
            thickness: [m].
            density: [kg/m^3].
            spacing: Reference spacing [m]; by default the root of the mean area of the points.

        Raises:
            InputError: for coincident vertices, or one without a triangle, triangles without area, or of different
                orientation, or wrong shapes.
        """
        return Sheet.of(surface(vertices, triangles, spacing), thickness=thickness, density=density)

    @staticmethod
    def tube(
        radius: float, length: float, *, thickness: ByPoint, density: ByPoint, points: int | tuple[int, int] = 80
    ) -> Sheet:
        """A tube along z from z = 0, a rolled square lattice; its ends are the parts "bottom" and "top".

        Args:
            radius: [m].
            length: [m].
            thickness: [m].
            density: [kg/m^3].
            points: Points around, or around and along; by default the spacing along is as near to that around as
                whole points allow.

        Raises:
            InputError: for a size, thickness or density that is not above zero, fewer than 6 points around or 3 along.
        """
        return Sheet.of(tube(radius, length, points), thickness=thickness, density=density)

    @staticmethod
    def sphere(radius: float, *, thickness: ByPoint, density: ByPoint, points: int = 20) -> Sheet:
        """A sphere about the origin, a geodesic grid of triangles almost alike; its areas sum to that of the sphere.

        Args:
            radius: [m].
            thickness: [m].
            density: [kg/m^3].
            points: Points on a quarter of the circumference, about.

        Raises:
            InputError: for a size, thickness or density that is not above zero, or fewer than 2 points.
        """
        return Sheet.of(sphere(radius, points), thickness=thickness, density=density)

    def plot(self, path: str | os.PathLike[str] | None = None) -> Any:
        """A picture of the sheet, which a notebook shows; see `warp_pd.draw_sheet`."""
        from .shape_plot import draw_shape

        return draw_shape(self, path, thickness=self.thickness, stiffness=self.stiffness)

    def slit(self, *path: tuple[float, float, float]) -> Sheet:
        """A copy of a curved sheet with a slit along edges of its triangles, for a cut in a tube, sphere or mesh.

        Each point on the slit becomes two, one for each face, and no bond crosses it; its tips stay one. An end on an
        open edge of the sheet opens that edge. Its points are the parts "slit 1", "slit 1 left" and "slit 1 right" as
        seen along it from outside.

        Args:
            path: Two or more places [m]; the slit takes the shortest way through the points nearest to them.

        Raises:
            InputError: for a flat sheet, fewer than two places, or a slit that meets itself or an edge on its way.
        """
        if self.frames is None:
            raise InputError("slit: expected a curved sheet; a flat one has cut, and cracks in Sheet.outline")
        if len(path) < 2:
            raise InputError(f"slit holds {len(path)} places: expected two at least")
        places = np.array([vector(f"slit: path[{k}]", place, 3) for k, place in enumerate(path)])
        changed, source = slit_surface(self, places, f"slit from {path[0]!r} to {path[-1]!r}")
        return replace(self, **changed, **self.at_points(lambda values: values[source]))

    def cut(self, start: tuple[float, float], end: tuple[float, float]) -> Sheet:
        """A copy in which no bond crosses the segment from `start` to `end` [m].

        The families never hold those bonds, so a cut counts as shape, not as damage. Points on the segment
        itself belong to its left side. The triangles that it crosses are gone, from pictures too.

        Raises:
            InputError: for a segment of no length, one that crosses no triangle of the sheet, or a curved sheet, which
                has `slit`.
        """
        self._require_flat("cut")
        segment: Segment = (tuple(vector("start", start, 2)), tuple(vector("end", end, 2)))  # type: ignore[assignment]
        return slit(self, segment, f"cut from {start!r} to {end!r}")

    def hole(self, centre: tuple[float, ...], radius: float) -> Sheet:
        """A copy without the points nearer than `radius` [m] to `centre`; the others keep their places on a grid.

        On a grid, the cells that lost a corner go too, and the areas of the points around them shrink. So do triangles
        of a curved sheet.

        Raises:
            InputError: if the hole holds no point or leaves no sheet.
        """
        offset = self.points - vector("centre", centre, self.points.shape[1])
        inside = np.linalg.norm(offset, axis=1) < positive("radius", radius) * (1.0 - 1e-9)
        smaller, kept = punched(self, inside, f"hole at {centre!r} of radius {radius!r}")
        return replace(smaller, **self.at_points(lambda values: values[kept]))

    def at_points(self, change: Callable[[np.ndarray], np.ndarray]) -> dict[str, Any]:
        """Thickness, density and stiffness, those that are arrays changed: for a copy with other points."""
        values = {name: getattr(self, name) for name in ("thickness", "density", "stiffness")}
        return {name: change(value) if np.ndim(value) else value for name, value in values.items()}

    def inclusion(self, centre: tuple[float, ...], radius: float) -> Sheet:
        """A copy in which the points within `radius` [m] of `centre` move as one rigid body.

        Raises:
            InputError: if it holds fewer than three points, or points on one line.
        """
        members = self.within(centre, radius)
        offset = self.points[members] - self.points[members[:1]]
        if len(members) < 3 or np.linalg.matrix_rank(offset, tol=1e-6 * self.spacing) < 2:
            inclusion = f"inclusion at {centre!r} of radius {radius!r} holds {len(members)} points"
            raise InputError(f"{inclusion}: expected three or more that are not on one line")
        return replace(self, inclusions=(*self.inclusions, members))

    def stiffened(self, points: np.ndarray, factor: float) -> Sheet:
        """A copy whose material is `factor` times as stiff at `points`: all its moduli are.

        A family deforms as the material of its own point. So a bond between two materials has half its energy from
        each: W_ij Psi_i(F_ij) + W_ji Psi_j(F_ji) in the bond-associated law, the mean of both ends in bond-based laws.

        Raises:
            InputError: for a factor that is not above zero, or an index that does not exist.
        """
        stiffness = np.ones(self.size) if self.stiffness is None else self.stiffness.copy()
        stiffness[point_indices("stiffened: points", points, self.size)] *= positive("stiffened: factor", factor)
        return replace(self, stiffness=stiffness)

    def prestretched(self, first: float, second: float | None = None) -> Sheet:
        """A copy that was stretched before it was clamped, such as the skin of a drum.

        Points, selections and displacements are those of this sheet, as it is clamped. Its state without stress is
        smaller by the stretches; thickness, density and areas of the mass are those of that state.

        Args:
            first: Stretch along x [-], more than 1 for tension.
            second: Stretch along y [-]; by default as along x.

        Raises:
            InputError: for a stretch that is not above zero, a bar, rigid inclusions, or two stretches of a curved
                sheet.
        """
        stretches = positive("first", first), positive("second", first if second is None else second)
        before = np.eye(2) if self.stretch is None else self.stretch
        (stretched := replace(self, stretch=np.diag(stretches) @ before)).unstretched()
        return stretched

    def unstretched(self) -> Sheet:
        """The sheet before it was stretched, without stress: the reference of strains.

        Raises:
            InputError: for rigid inclusions, which were made after the sheet was stretched.
        """
        return self if self.stretch is None else replace(before_stretch(self, self.stretch), stretch=None)

    def placement(self) -> np.ndarray | None:
        """Displacement of the points when the sheet was stretched and clamped [m], shape (N, 3), or None."""
        return None if self.stretch is None else self.positions - self.unstretched().positions

    def turned(self, degrees: float) -> Sheet:
        """A copy whose points are turned about the middle of the sheet; it forgets its lattice.

        Raises:
            InputError: for an angle that is not a number, or a curved sheet.
        """
        self._require_flat("turned")
        sheet, rotation = turned(self, finite("degrees", degrees))
        return sheet if self.stretch is None else replace(sheet, stretch=rotation @ self.stretch @ rotation.T)
