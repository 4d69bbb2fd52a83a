"""Measures for scenes: cracks, reactions, and functions of the history."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from .device.checks import InputError, point_indices, positive, vector
from .families import unpack
from .geometry.sheet import Sheet
from .geometry.triangulation import components, directed_edges, joined_points, shared_sides, triangle_areas, undirected
from .interfaces import History
from .materials import Material, capabilities
from .materials.energy import cauchy_stress, energy_density

if TYPE_CHECKING:
    from .interfaces.frame import Frame
    from .run.built import Built

__all__ = [
    "TearLine", "at_peak", "at_time", "distance_from_local_plane", "energy_release_rate", "growth_rate",
    "largest", "row_at", "stress_at", "support_force", "support_torque", "time_above", "time_below", "torn",
    "virial_stress", "when_above", "worst_balance",
]  # fmt: skip

# Rounds of averaging along a crack face, enough to take the stairs of the triangulation out of its length:
# straight cracks at any angle to any grid then measure within 3 % (tests/core/test_measures.py).
SMOOTHING_ROUNDS = 3
# Pieces below this area, in squared spacings, are shreds: they belong to the crack, not to its faces.
SHRED = 16.0
# Torn patches below this area, in squared spacings, are single broken bonds, not cracks: a slack sheet that
# crumples has many.
PATCH = 4.0
# Share of the radius of a ring around a crack tip that moves with the tip as a whole, and this motion in spacings.
RIGID_SHARE, NUDGE = 0.5, 1e-4
# Radius around a place within which points are fitted [spacings].
FITTED = 5.0
# Radius of such a ring below which it is refused [spacings].
LEAST_RADIUS = 4.0


class TearLine:
    """Length, direction and position of the cracks of a run, on lattices and clouds.

    A face (a triangle of the reference sheet) is torn when a bond along one of its edges has broken. The edges between
    torn and intact faces form the two sides of a crack. The crack length is half the length of these edges in the
    reference configuration, after smoothing of their staircase shape. Initial cuts and the edges of the sheet are not
    counted. A band of torn faces counts once, whatever its width, also if it contains small intact pieces. Small
    patches of torn faces, less than about four spacings of crack, are not counted.

    Attributes:
        sheet: The sheet.
        centres: Centre of each face [m], shape (F, 2).
        areas: Area of each face [m^2], shape (F,).
    """

    def __init__(self, sheet: Sheet) -> None:
        self.sheet = sheet
        self.centres = sheet.points[sheet.triangles].mean(axis=1)
        self.areas = triangle_areas(sheet.points, sheet.triangles)
        self._edges, self._beside = _shared_edges(sheet.triangles)
        self._last: tuple[np.ndarray, np.ndarray] | None = None

    def length(self, intact: np.ndarray) -> float:
        """Crack length [m]; `intact`, shape (F,), is the mask of intact faces."""
        return 0.5 * float(np.linalg.norm(self._crack_faces(intact), axis=1).sum())

    def alignment(self, intact: np.ndarray, turn: float = 0.0) -> float:
        """How closely cracks follow a grid: the mean of cos 8 (angle - turn) along them [-]; NaN if nothing is torn.

        1 means along the axes and diagonals of a square grid rotated by `turn` degrees, -1 halfway between them, and 0
        no preferred direction.

        Raises:
            InputError: on a curved sheet.
        """
        self._require_flat("alignment")
        along = self._crack_faces(intact)
        length = np.linalg.norm(along, axis=1)
        if length.sum() == 0.0:
            return float("nan")
        angle = np.arctan2(along[:, 1], along[:, 0]) - np.deg2rad(turn)
        return float((length * np.cos(8.0 * angle)).sum() / length.sum())

    def _crack_faces(self, intact: np.ndarray) -> np.ndarray:
        """Vectors along the crack edges [m] after smoothing, shape (E, 2)."""
        if intact.all():
            return np.zeros((0, self.sheet.points.shape[1]))
        whole = self.without_specks(intact)
        free = self._edges[whole[self._beside].sum(axis=1) == 1]
        return _smoothed_edges(self.sheet.points, free)

    def _require_flat(self, what: str) -> None:
        if self.sheet.frames is not None:
            raise InputError(f"TearLine.{what}: expected a flat sheet, got a curved one")

    def direction(self, intact: np.ndarray) -> float:
        """Angle of the cracks' principal axis to the x axis [degrees], in (-90, 90]; NaN if nothing is torn."""
        self._require_flat("direction")
        torn = ~self.without_specks(intact)
        if not torn.any():
            return float("nan")
        weights = self.areas[torn] / self.areas[torn].sum()
        offset = self.centres[torn] - weights @ self.centres[torn]
        axis = np.linalg.eigh((offset.T * weights) @ offset)[1][:, 1]
        angle = float(np.rad2deg(np.arctan2(axis[1], axis[0])))
        return angle - 180.0 if angle > 90.0 else angle + 180.0 if angle <= -90.0 else angle

    def deviation(self, intact: np.ndarray, start: tuple[float, float], towards: tuple[float, float]) -> float:
        """Root mean square distance of the torn faces from a straight line [m]; NaN if nothing is torn."""
        self._require_flat("deviation")
        torn = ~self.without_specks(intact)
        if not torn.any():
            return float("nan")
        along = np.subtract(towards, start) / np.linalg.norm(np.subtract(towards, start))
        offset = self.centres[torn] - start
        distance = along[0] * offset[:, 1] - along[1] * offset[:, 0]
        return float(np.sqrt((distance**2 * self.areas[torn]).sum() / self.areas[torn].sum()))

    def reach(self, intact: np.ndarray, start: tuple[float, float], towards: tuple[float, float]) -> float:
        """Extent of the torn faces from `start` in the direction of `towards` [m]; 0 if nothing is torn."""
        self._require_flat("reach")
        torn = ~self.without_specks(intact)
        if not torn.any():
            return 0.0
        along = np.subtract(towards, start) / np.linalg.norm(np.subtract(towards, start))
        return max(0.0, float(((self.centres[torn] - start) @ along).max()))

    def pieces(self, intact: np.ndarray, least_fraction: float = 0.01) -> int:
        """Number of pieces with at least `least_fraction` of the sheet's area; faces that share a point are of one."""
        whole = self.sheet.triangles[intact]
        label = joined_points(self.sheet.size, whole)
        area = np.bincount(label[whole[:, 0]], self.areas[intact])
        return int((area >= least_fraction * self.areas.sum()).sum())

    def attached_fraction(self, intact: np.ndarray, points: np.ndarray) -> float:
        """Fraction of the sheet's area that is connected to the given points through intact faces [-]."""
        label, area = self._joined(intact)
        attached = intact & np.isin(self.sheet.triangles, points).any(axis=1)
        return float(area[np.unique(label[attached])].sum() / self.areas.sum())

    def without_specks(self, intact: np.ndarray) -> np.ndarray:
        """Mask of intact faces, shape (F,), after small torn patches are set intact and then small pieces torn."""
        # Several measures ask for the same frame, and the next frame is often torn no further.
        if self._last is None or not np.array_equal(self._last[0], intact):
            self._last = intact.copy(), self._without_specks(intact)
        return self._last[1]

    def _without_specks(self, intact: np.ndarray) -> np.ndarray:
        unit, areas = self.sheet.spacing**2, self.areas
        if self.sheet.spacings is not None:
            # As if the spacing were the least one everywhere.
            areas = areas * unit / self.sheet.spacings[self.sheet.triangles].mean(axis=1) ** 2
        label, area = self._joined(~intact, areas)
        whole = intact | (area[label] < PATCH * unit)
        label, area = self._joined(whole, areas)
        return np.asarray(whole & (area[label] >= SHRED * unit))

    def _joined(self, intact: np.ndarray, areas: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Piece of each face, shape (F,), and area of each piece [m^2]; torn faces are in pieces of zero area."""
        label = components(len(intact), self._beside[intact[self._beside].all(axis=1)])
        count = int(label.max()) + 1
        return label, np.bincount(label[intact], (self.areas if areas is None else areas)[intact], minlength=count)


def _shared_edges(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges that two triangles share, shape (E, 2), and those triangles, shape (E, 2)."""
    edges = directed_edges(triangles)
    one, other = shared_sides(undirected(edges)).T
    return np.sort(edges[one], axis=1), np.column_stack([one, other]) % len(triangles)


def _smoothed_edges(points: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Edge vectors after every point with exactly two neighbours has been averaged with them."""
    if len(edges) == 0:
        return np.zeros((0, points.shape[1]))
    used, local = np.unique(edges, return_inverse=True)
    a, b = local.reshape(edges.shape).T
    place = points[used].copy()
    degree = np.bincount(np.concatenate([a, b]), minlength=len(used))
    chain = degree == 2
    for _ in range(SMOOTHING_ROUNDS):
        around = np.zeros_like(place)
        np.add.at(around, a, place[b])
        np.add.at(around, b, place[a])
        place[chain] = 0.5 * place[chain] + 0.25 * around[chain]
    return np.asarray(place[b] - place[a])


def support_force(built: Built, points: np.ndarray) -> np.ndarray:
    """Force of a support on its points [N], shape (3,), without their inertia.

    It balances the internal force and the loads on the points; components that nothing holds count as 0. With
    `Explicit` the push of bodies along held components is not in it, with a note; nor what `Reaction` names besides.

    Raises:
        InputError: if nothing holds any of the points.
    """
    return np.asarray(_support_forces(built, points, "support_force").sum(axis=0))


def support_torque(built: Built, points: np.ndarray, about: Sequence[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Torque of a support on its points about a point [N m], shape (3,), without their inertia.

    Args:
        built: The built simulation.
        points: The points of the support.
        about: The point [m], (x, y, z).

    Raises:
        InputError: if nothing holds any of the points.
    """
    arms = built.context.whole.positions[points] + built.to_numpy(built.state.displacement)[points] - np.asarray(about)
    return np.asarray(np.cross(arms, _support_forces(built, points, "support_torque")).sum(axis=0))


def _support_forces(built: Built, points: np.ndarray, name: str) -> np.ndarray:
    """Force of supports on each of the points [N], shape (P, 3), for the function `name`."""
    state, points = built.state, point_indices("points", points, built.context.whole.size)
    mask = state.held_mask
    held = np.zeros(len(points), np.uint8) if mask is None else built.context.whole_array(mask)[points]
    from .parts.reaction import read_supports, require_held

    require_held("points", held)
    read_supports(f"measures.{name}", points, held, built.context)
    force = built.to_numpy(state.force)[points]
    if state.external is not None:
        force = force + built.to_numpy(state.external)[points]
    return np.where((held[:, None] >> np.arange(3)) & 1 == 1, -force, 0.0)


def energy_release_rate(built: Built, tip: Sequence[float], direction: Sequence[float], radius: float) -> float:
    """Energy that a crack of an elastic sheet in equilibrium would release per area [J/m^2] if it grew.

    The crack runs where this exceeds the tearing energy. It is the J-integral of Rice (J. Appl. Mech. 35, 1968) over a
    ring around the tip, as the change of energy where the tip moves through the material and takes the displacements
    with it (Li, Shih and Needleman, Eng. Fract. Mech. 21, 1985). Triangles that the crack cuts are left out.

    Args:
        built: The built simulation, with one hyperelastic material.
        tip: The tip of the crack [m], (x, y) on the undeformed sheet.
        direction: Direction in which it would grow, any length.
        radius: Outer radius of the ring [m]: it must not reach an edge of the sheet, and there must be no body in it.
            It should be ten spacings or more, and half of it wider than the band of a damage field.

    Raises:
        InputError: for a curved sheet, another material, or a ring that is too small or reaches an edge.
    """
    material, sheet, device = _elastic_material(built, "energy_release_rate"), built.context.sheet, built.context.device
    corners, follows, thickness = _ring(built, np.array(vector("tip", tip, 2)), positive("radius", radius))
    along = np.array(vector("direction", direction, 2))
    along /= np.linalg.norm(along)
    flat = _sides(sheet.points, corners)
    deformed = _sides(sheet.positions + built.to_numpy(built.state.displacement), corners)
    # The displacements that the tip takes with it turn with the sheet around it.
    mean = np.average(deformed @ np.linalg.inv(flat), axis=0, weights=np.linalg.det(flat))
    turn, _, back = np.linalg.svd(mean, full_matrices=False)
    shift = _sides(follows[:, None] * along, corners)
    carried = _sides(follows[:, None] * (turn @ back @ along), corners)

    def energy(moved: float) -> float:
        reference = flat + moved * shift
        gradient = (deformed + moved * carried) @ np.linalg.inv(reference)
        squares = np.linalg.eigvalsh(gradient.swapaxes(1, 2) @ gradient)
        stretches = np.sqrt(np.maximum(squares, 0.0))
        density = energy_density(material, stretches[:, 1], stretches[:, 0], device)
        return float((0.5 * np.linalg.det(reference) * thickness) @ density)

    moved = NUDGE * sheet.spacing
    return (energy(-moved) - energy(moved)) / (2.0 * moved)


def stress_at(built: Built, place: Sequence[float]) -> np.ndarray:
    """Principal Cauchy stresses of an elastic sheet at a place, larger first [Pa], shape (2,); for peaks at free edges.

    A point field is a mean over a family, which at an edge lies half a spacing inside, so a peak there is too low to
    first order in the spacing. This is the stress of the gradient, at the place, of a cubic polynomial fitted to the
    positions of points within five spacings, not beyond cracks.

    Args:
        built: The built simulation, with one hyperelastic material that has a `volume`.
        place: The place [m], (x, y) on the sheet as it was given, such as a point of the edge of a hole.

    Raises:
        InputError: for a curved sheet, another material, a damaged place, or one with too few points around it.
    """
    material, sheet, given = _elastic_material(built, "stress_at"), built.context.sheet, built.context.given
    at = np.array(vector("place", place, 2))
    away = built.context.clamped_positions[:, :2] - at
    size = np.linalg.norm(away, axis=1)
    nearest = int(size.argmin())
    spacing = float(given.spacing if given.spacings is None else given.spacings[nearest])
    around = _connected(built, nearest, size <= FITTED * spacing)
    x, y = away[around].T / (FITTED * spacing)
    fit = np.column_stack([x**a * y**b for a in range(4) for b in range(4 - a)])
    weights = 1.0 - x**2 - y**2
    if size[nearest] > spacing or np.linalg.matrix_rank(fit * weights[:, None], 1e-3) < fit.shape[1]:
        raise InputError(
            f"place = {tuple(at.tolist())}: expected a place on the sheet, with some twenty points within five "
            f"spacings of {spacing:.4g} m"
        )
    if built.law.damage is not None and built.to_numpy(built.law.damage)[around].max() > 0.0:
        raise InputError(f"place = {tuple(at.tolist())}: expected a place without damage")
    deformed = sheet.positions[around] + built.to_numpy(built.state.displacement)[around]
    # Relative to points nearby, as a sheet far from the origin would lose its digits.
    values = np.column_stack([sheet.points[around] - sheet.points[nearest], deformed - deformed.mean(axis=0)])
    found = np.linalg.lstsq(fit * weights[:, None], values * weights[:, None], rcond=None)[0]
    # Slopes by x and by y, the terms (a, b) = (1, 0) and (0, 1).
    slopes = found[[4, 1]].T
    gradient = slopes[2:] @ np.linalg.inv(slopes[:2])
    stress = cauchy_stress(material, gradient[None], built.context.device)[0]
    return np.asarray(np.linalg.eigvalsh(stress)[::-1])


def _connected(built: Built, start: int, allowed: np.ndarray) -> np.ndarray:
    """The allowed points that intact bonds join to one of them, in ascending order; `allowed` is a mask, (N,)."""
    families, found, new = built.law.families, np.zeros(len(allowed), bool), np.array([start])
    while len(new):
        found[new] = True
        members = families.members_of(new)
        joined = members >= 0
        if built.law.intact is not None:
            joined &= unpack(built.law.intact.numpy()[-families.words :, new].T, families.members)
        reached = np.unique(members[joined])
        new = reached[allowed[reached] & ~found[reached]]
    return np.flatnonzero(found)


def _sides(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Vectors from the first corner of triangles to the others, as columns, shape (F, dimensions, 2)."""
    return np.stack([points[corners[:, k]] - points[corners[:, 0]] for k in (1, 2)], axis=-1)


def _ring(built: Built, tip: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles of a ring around a tip, how far each point follows the tip, and stiffness left times thickness.

    The last one is over the thickness at the tip.
    """
    sheet, softening = built.context.sheet, built.law.damage
    away = np.linalg.norm(built.context.clamped_positions[:, :2] - tip, axis=1)
    if away[built.context.given.edges("all")].min() < radius:
        raise InputError(f"radius = {radius:.6g}: expected a ring that does not reach an edge of the sheet")
    follows = np.clip((1.0 - away / radius) / (1.0 - RIGID_SHARE), 0.0, 1.0)
    corners = sheet.triangles if built.rupture is None else sheet.triangles[built.rupture.intact_faces.numpy() != 0]
    corners = corners[np.ptp(follows[corners], axis=1) > 0.0]
    if radius < LEAST_RADIUS * sheet.spacing or not len(corners):
        raise InputError(f"radius = {radius:.6g}: expected ten spacings of {sheet.spacing:.6g} m, four at least")
    thickness = np.broadcast_to(sheet.thickness, sheet.size)
    left = 1.0 if softening is None else (1.0 - built.to_numpy(softening)[corners].mean(axis=1)) ** 2
    return corners, follows, left * thickness[corners].mean(axis=1) / thickness[away.argmin()]


def _elastic_material(built: Built, asked: str) -> Material:
    """The material of a flat, elastic sheet of one material."""
    sheet, law = built.context.sheet, built.simulation.force
    known, title = capabilities(law.material), f"{asked}: force = {type(law).__name__}"
    if sheet.frames is not None:
        raise InputError(f"{asked}: expected a flat sheet, got a curved one")
    if built.context.partition is not None:
        raise InputError(f"{asked}: expected a run in one process")
    varies = known.regions or known.by_point is not None or sheet.stiffness is not None
    if varies or not hasattr(law.material, "functions"):
        raise InputError(f"{title}: expected one hyperelastic material")
    if built.law.columns().lost:
        raise InputError(f"{title}: expected a law without viscosity")
    return cast("Material", law.material)


def virial_stress(built: Built, point: int) -> np.ndarray:
    """In-plane nominal stress at a point of a lattice [Pa], (2, 2), from its bonds (VE eq. 78).

    Half the sum of (pair force) (x) X divided by the volume of the point; for laws that store `bond_force`.
    """
    force, sheet = built.law, built.context.sheet
    families, halves = force.families, built.to_numpy(force.bond_force())[:, :, :2]
    exists = families.rows_of_points(families.exists)[point]
    k = np.flatnonzero(exists)
    at = np.full_like(k, point)
    pair = halves[k, at] - halves[families.reverse_members(at, k), families.heads(at, k)]
    volume = (sheet.areas * sheet.thickness)[point]
    return np.asarray(0.5 * pair.T @ (families.bonds[k] * families.horizon) / volume)


def torn(frame: Frame) -> np.ndarray:
    """Mask of torn faces, shape (F,).

    Raises:
        InputError: if bonds cannot break.
    """
    if frame.intact_faces is None:
        raise InputError("damage = None: expected a rupture criterion to measure cracks")
    return ~frame.intact_faces


def at_time(name: str, time: float) -> Callable[[History], float | None]:
    """Function of a history: column `name` at a time [s], linear between frames; None until that time."""

    def value(history: History) -> float | None:
        times = [row["time"] for row in history]
        if times[-1] < time * (1.0 - 1e-9):
            return None
        return float(np.interp(time, times, [row[name] for row in history]))

    return value


def largest(name: str) -> Callable[[History], float | None]:
    """Function of a history: the largest value of column `name`; None if it is missing in every row."""
    return lambda history: max((row[name] for row in history if not math.isnan(row[name])), default=None)


def at_peak(name: str, of: str) -> Callable[[History], float | None]:
    """Function of a history: column `name` in the frame in which column `of` is largest.

    None if that is the first or the last frame: `of` may be larger beyond.
    """

    def value(history: History) -> float | None:
        rows = [row for row in history if not math.isnan(row[of])]
        top = max(range(len(rows)), key=lambda k: rows[k][of], default=0)
        return rows[top][name] if 0 < top < len(rows) - 1 else None

    return value


def time_above(name: str, threshold: float) -> Callable[[History], float | None]:
    """Function of a history: time [s] of the first frame with column `name` above a threshold, or None."""

    def value(history: History) -> float | None:
        return next((row["time"] for row in history if row[name] > threshold), None)

    return value


def time_below(name: str, threshold: float) -> Callable[[History], float | None]:
    """Function of a history: time [s] of the first frame with column `name` below a threshold, or None."""

    def value(history: History) -> float | None:
        return next((row["time"] for row in history if row[name] < threshold), None)

    return value


def when_above(name: str, of: str, threshold: float) -> Callable[[History], float | None]:
    """Function of a history: column `name` in the first frame with column `of` above a threshold, or None."""

    def value(history: History) -> float | None:
        return next((row[name] for row in history if row[of] > threshold), None)

    return value


def worst_balance(history: History) -> float | None:
    """The largest absolute energy balance error of a history [-]; None if it is not tracked."""
    errors = [abs(row["balance_error"]) for row in history if "balance_error" in row]
    return max(errors) if errors else None


def row_at(points: np.ndarray, height: float) -> np.ndarray:
    """Indices of the points in the row whose y is nearest to `height` [m], from left to right.

    Args:
        points: Positions [m], shape (N, 2) or (N, 3).
        height: Height [m].
    """
    y = points[:, 1]
    # Frames hold single precision; rows are many times further apart.
    row = np.flatnonzero(np.abs(y - y[np.argmin(np.abs(y - height))]) <= 1e-5 * np.ptp(y))
    return row[np.argsort(points[row, 0])]


def growth_rate(history: History, name: str) -> np.ndarray:
    """Rate of the running maximum of column `name`, by central differences, one value per frame.

    It is never negative: cracks do not heal, although their measured length decreases when small pieces join them.
    """
    times = np.array([row["time"] for row in history])
    values: Any = np.maximum.accumulate([row[name] for row in history])
    return np.gradient(values, times) if len(times) > 1 else np.zeros(len(times))


# Least ratio of the middle to the largest principal moment of members that determine a plane.
COLLINEAR = 1e-10


def distance_from_local_plane(built: Built, frame: Frame, points: Any) -> np.ndarray:
    """Distance of points from the plane fitted to the deformed positions of their family members.

    The plane is the unweighted least-squares fit to the members, without the point itself. On a smooth surface the
    distance is about the curvature times a fraction of the squared horizon. If bonds can break, only members with
    currently intact bonds are used, so the result is valid only for the latest frame.

    Args:
        built: The simulation.
        frame: Its latest frame; any frame if bonds cannot break.
        points: Point indices, shape (P,), in any order.

    Returns:
        Distances [m], shape (P,), at least 0; NaN where the members are fewer than three or collinear.

    Raises:
        InputError: if there are no points, or an index does not exist.
    """
    sheet, families = built.simulation.sheet, built.law.families
    point_indices("points", points, sheet.size)
    chosen = np.atleast_1d(np.asarray(points, dtype=np.int64))
    members = families.members_of(chosen)
    present = members >= 0
    if built.law.intact is not None:
        words = built.law.intact.numpy()[-families.words :, chosen].T
        present &= unpack(words, families.members)
    position = sheet.positions + np.asarray(frame.displacement, np.float64)
    # About the point itself, so that a sheet far from the origin keeps its digits.
    arm = np.where(present[..., None], position[np.maximum(members, 0)] - position[chosen, None], 0.0)
    number = present.sum(axis=1)
    centre = arm.sum(axis=1) / np.maximum(number, 1)[:, None]
    centred = np.where(present[..., None], arm - centre[:, None], 0.0)
    moments, axes = np.linalg.eigh(centred.transpose(0, 2, 1) @ centred)
    distance = np.abs((centre * axes[..., 0]).sum(axis=1))
    return np.where((number >= 3) & (moments[:, 1] > COLLINEAR * moments[:, 2]), distance, np.nan)
