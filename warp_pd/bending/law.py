"""Bending stiffness beside a force law: an energy of the curvature of the deformed sheet, its force and its tangent."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError
from ..device.fields import Array
from ..device.launches import Stage
from ..families import pack
from ..interfaces import SLOPE, BuiltLaw, Columns
from ..kernels.bending.plate import ROWS, BendingKernels, bending
from ..step import Phase
from .slopes import CHUNK, fitted_slopes

OWNER = "bending"
# Points that are held in all three components, or in a rigid inclusion.
HELD, RIGID = 7, 8
# Strain of the differences that give the modulus of a law.
STRAIN = 1e-3
# What the law with bending takes from the law: attributes, and methods in which bending changes nothing.
OF_THE_LAW = (
    "label", "weights", "has_energy", "families", "struct", "intact", "constants", "energy_constants", "point_values",
    "horizon_ratio", "unit_volume", "correction", "earlier_energy", "driving_energy",
    "partial_energy", "represented", "goes_slack", "slack_force", "slack_frequency", "slack_stiffness",
    "begin", "screen_with_force", "bond_force", "represented_areas", "energy_density",
    "request_fields", "field_names", "add_shown", "notes", "doubts", "fingerprint", "likely_cause",
)  # fmt: skip
# Numbers of tables that differ by less count as the same: the round-off of a lattice.
SAME = 1e-10


def plate_stiffness(law: BuiltLaw) -> tuple[float, float]:
    """E / (12 (1 - nu^2)) [Pa] of the law, and Poisson's ratio.

    Raises:
        InputError: if the law has no energy density or no stiffness.
    """
    steps = np.array([1.0 - STRAIN, 1.0, 1.0 + STRAIN])
    try:
        density = law.energy_density(steps[:, None], steps[None, :])
    except InputError:
        raise InputError("loads = Plate: expected a law with an energy density") from None
    modulus = (density[0, 1] - 2.0 * density[1, 1] + density[2, 1]) / STRAIN**2
    mixed = (density[0, 0] + density[2, 2] - density[0, 2] - density[2, 0]) / (4.0 * STRAIN**2)
    if not modulus > 0.0:
        raise InputError("loads = Plate: expected a material with stiffness")
    return float(modulus) / 12.0, float(mixed / modulus)


class BendingForce(BuiltLaw):
    """A force law with bending beside it.

    The law stays a law of families, which parts ask for their own purposes; bending has its own tables.

    Attributes:
        law: The law; OF_THE_LAW names what this object has from it.
        context: Its context.
        kernels: Kernels of bending.
        plate: Their tables.
        energy: Energy of bending at each point at the last frame [J], (N,) float64.
        lost: Energy lost to damage at each point at the last frame [J], (N,) float64; None if it is not tracked.
        needs_finest: On coarser lattices the stiffness would be that of shorter waves.
    """

    needs_finest = "loads = Plate: not supported"
    resists_bending = True

    def __init__(self, law: BuiltLaw, context: Context, given: float | None) -> None:
        self.law, self.context = law, context
        for name in OF_THE_LAW:
            setattr(self, name, getattr(law, name))
        layout = context.layout
        self.kernels: BendingKernels = bending(
            context.bits, layout.curved, layout.breakable, layout.softened,
            layout.breakable and context.options.tracked,
        )  # fmt: skip
        self.stiffness, self.poisson = self._stiffness(given)
        clamped = (context.held & HELD == HELD) | (context.held & RIGID != 0)
        level = context.held & SLOPE != 0
        self.slopes = fitted_slopes(context.sheet, clamped, level)
        # Of the stress-free sheet, held slopes are those that its points have.
        none = np.zeros_like(level)
        self.free_slopes = fitted_slopes(context.sheet, clamped, none) if level.any() else self.slopes
        self.plate: Any = self._tables()
        n, faces = context.sheet.size, len(context.sheet.triangles)
        self.slope, self.moment = self.slope_array("slope"), self.slope_array("moment")
        self.pulls = self.triangle_array("pulls")
        self.energy = context.array("bending_energy", OWNER, wp.float64, shape=n)
        self.lost: Array | None = None
        self._lost: Array | None = None
        if self.kernels.share_lost is not None:
            self.lost = context.array("bending_lost", OWNER, wp.float64, shape=n)
            self._lost = context.array("bending_lost_faces", OWNER, wp.float64, shape=faces, per="face", restart=True)

    def slope_array(self, name: str) -> Array:
        """An array of 3 x 2 matrices at the points, (6, N)."""
        return self.context.array(f"bending_{name}", OWNER, self.context.types.real, shape=(6, self.context.sheet.size))

    def triangle_array(self, name: str) -> Array:
        """An array of what triangles store, (ROWS, F)."""
        return self.context.array(
            f"bending_{name}", OWNER, self.context.types.real, shape=(ROWS, len(self.context.sheet.triangles)),
            per="face",
        )  # fmt: skip

    def _stiffness(self, given: float | None) -> tuple[np.ndarray, float]:
        """D of each point [N m], (N,), and Poisson's ratio."""
        sheet = self.context.sheet
        unit, poisson = plate_stiffness(self.law)
        softer = 1.0 if sheet.stiffness is None else sheet.stiffness
        each = unit * sheet.thickness**3 * softer if given is None else given
        return np.broadcast_to(np.asarray(each, float), sheet.size), poisson

    def _tables(self) -> Any:
        sheet, triangles = self.context.sheet, self.context.sheet.triangles
        sides, flat = self._sides(), self.flat_sides()
        curved = len(self.slopes.planes) > 1
        flat = flat if curved else flat[:1]
        area = 0.5 * np.linalg.norm(np.cross(sides[:, :, 0], sides[:, :, 1]), axis=1)
        t = self.context.types
        values = self._point_tables(sheet.size, t)
        steps = triangles - triangles[:, :1]
        stiffness = self.stiffness[triangles].mean(axis=1) * area
        shapes = np.moveaxis(flat, 0, 1).reshape(len(area), -1) / sheet.spacing
        numbers = np.column_stack([shapes, stiffness / stiffness.max()])
        kind, one = kinds(steps, numbers)
        values |= {
            "face_kind": (wp.int32, kind), "first_corner": (wp.int32, triangles[:, 0]),
            "corners": (wp.vec3i, steps[one]), "sides": (t.mat22, flat[:, one]),
            "stiffness": (t.real, stiffness[one]),
        }  # fmt: skip
        if curved:
            values["rest_sides"] = (t.vec3, np.moveaxis(sides, 2, 0))
            values["rest"] = (t.vec3, self._rest(sides, flat))
        plate = self.kernels.Plate()
        for name, (dtype, value) in values.items():
            setattr(plate, name, self.context.array(f"plate_{name}", OWNER, dtype, value, per="table"))
        plate.poisson = self.poisson
        if self.context.layout.breakable:
            plate.left = self.context.array(
                "bending_left", OWNER, t.real, np.ones(len(triangles)), per="face", restart=True
            )
        return plate

    def _sides(self) -> np.ndarray:
        """The two sides of each triangle [m], columns, (F, 3, 2)."""
        x, triangles = self.context.sheet.positions, self.context.sheet.triangles
        return np.stack([x[triangles[:, k]] - x[triangles[:, 0]] for k in (1, 2)], axis=2)

    def flat_sides(self) -> np.ndarray:
        """These in the plane of each corner, where they keep their length [m], (3, F, 2, 2)."""
        sides, triangles, planes = self._sides(), self.context.sheet.triangles, self.slopes.planes
        flat = np.stack([np.einsum("fcb,fcm->fbm", planes[triangles[:, c] % len(planes)], sides) for c in range(3)])
        flat *= np.linalg.norm(sides, axis=1)[None, :, None] / np.linalg.norm(flat, axis=2)[:, :, None]
        return flat

    def _point_tables(self, size: int, t: Any) -> dict[str, tuple[Any, np.ndarray]]:
        """Tables of the kinds of points."""
        s, triangles = self.slopes, self.context.sheet.triangles
        places, order = _columns(s.point, size)
        ring, weights = _filled(places, (s.other - s.point)[order], 0), _filled(places, s.weights[order], 0.0)
        places, order = _columns(s.other, size)
        fitted, back = _filled(places, (s.point - s.other)[order], 0), _filled(places, s.weights[order], 0.0)
        places, order = _columns(triangles.ravel(), size)
        first = np.zeros(size, int)
        first[places[1][::-1]] = order[::-1] // 3
        around = _filled(places, order - 3 * first[places[1]], -1)
        own = weights.sum(axis=0)
        counts = [np.bincount(owners, minlength=size) for owners in (s.point, s.other, triangles.ravel())]
        scaled = [np.moveaxis(w, 1, 0).reshape(size, -1) * self.context.sheet.spacing for w in (weights, back)]
        torn = self._spans(ring) if self.context.layout.breakable else {}
        checked = [values for _, values in torn.values()]
        kind, one = kinds(np.concatenate([counts, ring, fitted, around, *checked]).T, np.column_stack(scaled))
        return {name: (dtype, values[:, one]) for name, (dtype, values) in torn.items()} | {
            "kind": (wp.int32, kind), "ring": (wp.int32, ring[:, one]), "weights": (t.vec2, weights[:, one]),
            "own": (t.vec2, own[one]), "fitted": (wp.int32, fitted[:, one]), "fitted_weights": (t.vec2, back[:, one]),
            "counts": (wp.vec3i, np.stack(counts, axis=1)[one]), "around": (wp.int32, around[:, one]),
            "first_triangle": (wp.int32, first),
        }  # fmt: skip

    def _spans(self, ring: np.ndarray) -> dict[str, tuple[Any, np.ndarray]]:
        """Bonds between each point and those of its fit; if one of them breaks, the fit reaches across a tear.

        A fit point beyond the horizon is reached over a member of both families.
        """
        families, size, x = self.law.families, ring.shape[1], self.context.sheet.positions
        parts, far = [], []
        for begin in range(0, size, CHUNK):
            points = np.arange(begin, min(begin + CHUNK, size))
            members, spans = families.members_of(points), np.zeros((len(points), families.members), bool)
            for other in points + ring[:, points]:
                bond = members == other[:, None]
                spans |= bond
                beyond = (other != points) & ~bond.any(axis=1)
                far.append(np.column_stack([points, other])[beyond])
            parts.append(spans)
        own, (start, end) = np.concatenate(parts), np.concatenate(far).T
        of_start = families.members_of(start)
        shared = (of_start[:, :, None] == families.members_of(end)[:, None]).any(axis=2) & (of_start >= 0)
        away = np.linalg.norm(x[of_start] - 0.5 * (x[start] + x[end])[:, None], axis=2)
        first = np.where(shared, away, np.inf).argmin(axis=1) if len(start) else start
        own[start, first] |= shared.any(axis=1)
        over = of_start[np.arange(len(start)), first]
        second = (families.members_of(over) == end[:, None]) & shared.any(axis=1)[:, None]
        steps, bits = np.zeros((1, size), int), pack(own)[None]
        if len(start):
            places, order = _columns(start, size)
            steps = np.concatenate([steps, _filled(places, (over - start)[order], 0)])
            bits = np.concatenate([bits, _filled(places, pack(second)[order], 0)])
        return {
            "via": (wp.int32, steps),
            "spans": (wp.uint32, np.moveaxis(bits, 1, 2).reshape(-1, size)),
        }

    def _rest(self, sides: np.ndarray, flat: np.ndarray) -> np.ndarray:
        """Vectors g and r of the stress-free sheet [m], (6, F, 3); see kernels/bending/plate.py."""
        s, x, triangles = self.free_slopes, self.context.sheet.positions, self.context.sheet.triangles
        slope = np.zeros((len(x), 3, 2))
        np.add.at(slope, s.point, np.einsum("ec,eb->ecb", x[s.other] - x[s.point], s.weights))
        d = np.stack([np.einsum("fcb,fbm->mfc", slope[triangles[:, c]], flat[c]) for c in range(3)])
        first, second = sides[:, :, 0], sides[:, :, 1]
        return np.stack([
            d[1, 0] - d[0, 0],
            d[2, 1] - d[0, 1],
            0.5 * (d[1, 1] - d[0, 1] + d[2, 0] - d[0, 0]),
            first - 0.5 * (d[0, 0] + d[1, 0]),
            second - 0.5 * (d[0, 1] + d[2, 1]),
            second - first - 0.5 * (d[1, 1] - d[1, 0] + d[2, 1] - d[2, 0]),
        ])  # fmt: skip

    # What a law does, with bending ---------------------------------------------------------------------

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of the law, and of the force or the energy of bending."""
        self.law.add(phase, stage)
        state = self.context.state
        if phase is Phase.INTERNAL_VARIABLES and self.kernels.weaken is not None:
            stage.launch(
                OWNER, self.kernels.weaken, len(self.context.sheet.triangles), plate=self.plate,
                displacement=state.displacement, velocity=state.velocity, step=state.step, intact=self.law.intact,
                damage=self.damage, left=self.plate.left, lost=self._lost,
            )  # fmt: skip
        elif phase is Phase.INTERNAL_FORCE:
            self._add_bending(stage, state.displacement, state.force)
        elif phase is Phase.FRAME:
            self.add_slopes(stage, state.displacement, self.slope)
            stage.launch(
                OWNER, self.kernels.energy, self.context.sheet.size, plate=self.plate, displacement=state.displacement,
                slope=self.slope, out=self.energy,
            )  # fmt: skip
            if self.kernels.share_lost is not None:
                stage.launch(
                    OWNER, self.kernels.share_lost, self.context.sheet.size, plate=self.plate, lost=self._lost,
                    out=self.lost,
                )  # fmt: skip

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the internal force [N] at a displacement [m], both (N,) vec3."""
        self.law.add_force(stage, displacement, out)
        self._add_bending(stage, displacement, out)

    def _add_bending(self, stage: Stage, displacement: Array, out: Array) -> None:
        n = self.context.sheet.size
        self.add_slopes(stage, displacement, self.slope)
        stage.launch(
            OWNER, self.kernels.moments, len(self.context.sheet.triangles), plate=self.plate,
            displacement=displacement, slope=self.slope, pulls=self.pulls,
        )  # fmt: skip
        stage.launch(
            OWNER, self.kernels.gather, n, plate=self.plate, pulls=self.pulls, sign=-1.0, moment=self.moment, force=out
        )
        stage.launch(OWNER, self.kernels.spread, n, plate=self.plate, moment=self.moment, sign=-1.0, force=out)

    def add_slopes(self, stage: Stage, displacement: Array, slope: Array) -> None:
        """Add the launch of the slopes of a displacement."""
        stage.launch(
            OWNER,
            self.kernels.slopes,
            self.context.sheet.size,
            plate=self.plate,
            displacement=displacement,
            slope=slope,
        )

    def columns(self) -> Columns:
        """Columns of the law, the energy of bending [J], and what of it is lost to damage [J]."""
        of_law = self.law.columns()
        lost = {} if self.lost is None else {"bending_lost": self.lost}
        return replace(of_law, stored={**of_law.stored, "bending": self.energy}, lost={**of_law.lost, **lost})

    def soften(self, damage: Array, near: Array) -> None:
        """Reduce the stiffness of the law, and of triangles by the damage of their corners, (N,)."""
        self.law.soften(damage, near)
        self.damage = damage
        left = (1.0 - damage.numpy()[self.context.sheet.triangles].max(axis=1)) ** 2
        self.plate.left.assign(left)

    @property
    def strain_energy(self) -> Array | None:
        """Energy of each family at the last frame, without bending [J]."""
        return self.law.strain_energy

    @property
    def force_path(self) -> str:
        """Name of the force path of the law."""
        return self.law.force_path


def kinds(steps: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Kind of each row, by whole steps and by numbers of order 1 that agree within SAME; and a row of each kind."""
    parts = np.column_stack([steps, np.rint(numbers / SAME)]).astype(np.int64)
    factors = np.random.default_rng(0).integers(1, 2**62, parts.shape[1])
    _, one, kind = np.unique(parts @ factors, return_index=True, return_inverse=True)
    return kind, one


def _columns(owner: np.ndarray, size: int) -> tuple[tuple[np.ndarray, np.ndarray, int, int], np.ndarray]:
    """Places of sorted entries in a table with a column for each owner, and the order that sorts them."""
    order = np.argsort(owner, kind="stable")
    counts = np.bincount(owner, minlength=size)
    column = owner[order]
    row = np.arange(len(owner)) - (np.cumsum(counts) - counts)[column]
    return (row, column, int(counts.max()), size), order


def _filled(places: tuple[np.ndarray, np.ndarray, int, int], values: np.ndarray, empty: float) -> np.ndarray:
    """The table with these values at their places, and `empty` elsewhere."""
    row, column, most, size = places
    table = np.full((most, size, *values.shape[1:]), empty, values.dtype)
    table[row, column] = values
    return table
