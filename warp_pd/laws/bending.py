"""Bending stiffness beside a force law: an energy of the curvature of the deformed sheet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import warp as wp

from ..device.checks import InputError, positive, said
from ..device.fields import Array
from ..device.launches import Stage
from ..families import pack
from ..interfaces import BuiltLaw, History, Tangent
from ..interfaces.context import Context
from ..interfaces.phases import Phase
from ..kernels.bending import ROWS, BendingKernels, bending
from ..kernels.effects import Kernel
from .bending_tangent import BendingTangent
from .slopes import CHUNK, fitted_slopes

OWNER = "bending"
# Points that are held in all three components, or in a rigid inclusion.
HELD, RIGID = 7, 8
# Strain of the differences that give the modulus of a law.
STRAIN = 1e-3
# Numbers of tables that differ by less count as the same: the round-off of a lattice.
SAME = 1e-10


def with_bending(law: BuiltLaw, context: Context, given: bool | float) -> BuiltLaw:
    """The law with bending stiffness beside it; the law itself without.

    Args:
        law: The force law on the device.
        context: Its context.
        given: True for the stiffness of a plate of the material and the thickness, or a stiffness D [N m], with
            Poisson's ratio of the material; False for none. The integers 0 and 1 are refused: they may be meant as
            False and True.

    Raises:
        InputError: for several processes, bonds that break in static equilibrium, several materials, or a material
            without stiffness.
    """
    if isinstance(given, bool | np.bool_):
        given = bool(given)
    elif isinstance(given, str) or not np.isscalar(given) or (isinstance(given, int | np.integer) and given in (0, 1)):
        # 1 may be meant as True or as 1 N m, a stiffness that no rubber sheet has.
        raise InputError(
            f"bending = {said(given)}: expected True, False or a stiffness D [N m], a positive number such as 1e-6"
        )
    else:
        positive("bending", given)
    if given is False:
        return law
    if context.partition is not None:
        raise InputError(f"bending = {given}: not supported on several processes; expected a run in one process")
    if context.features.breakable and not context.features.dynamic:
        raise InputError(f"bending = {given}: damage not supported in static equilibrium; expected Explicit")
    if context.regions or context.by_point or context.remembers:
        raise InputError(f"bending = {given}: expected one material, the same at all points")
    return BendingForce(law, context, given)


def plate_stiffness(law: BuiltLaw, given: bool | float) -> tuple[float, float]:
    """E / (12 (1 - nu^2)) [Pa] of the law, or the stiffness that was given, and Poisson's ratio.

    Raises:
        InputError: if the law has no energy density or no stiffness.
    """
    steps = np.array([1.0 - STRAIN, 1.0, 1.0 + STRAIN])
    try:
        density = law.energy_density(steps[:, None], steps[None, :])
    except InputError:
        raise InputError(f"bending = {given}: expected a law with an energy density") from None
    modulus = (density[0, 1] - 2.0 * density[1, 1] + density[2, 1]) / STRAIN**2
    mixed = (density[0, 0] + density[2, 2] - density[0, 2] - density[2, 0]) / (4.0 * STRAIN**2)
    if not modulus > 0.0:
        raise InputError(f"bending = {given}: expected a material with stiffness")
    return float(modulus) / 12.0, float(mixed / modulus)


class BendingForce(BuiltLaw):
    """A force law with bending beside it.

    The law stays a law of families, which parts ask for their own purposes; bending has its own tables.

    Attributes:
        law: The law; attributes of `BuiltLaw` that are not listed here are its own.
        context: Its context.
        kernels: Kernels of bending.
        plate: Their tables.
        energy: Energy of bending at each point at the last frame [J], (N,) float64.
        lost: Energy lost to damage at each point at the last frame [J], (N,) float64; None if it is not tracked.
        needs_finest: On coarser lattices the stiffness would be that of shorter waves.
    """

    needs_finest = "bending: expected False"

    def __init__(self, law: BuiltLaw, context: Context, given: bool | float) -> None:
        self.law, self.context = law, context
        self.label, self.weights, self.has_energy = law.label, law.weights, law.has_energy
        self.families, self.struct, self.intact = law.families, law.struct, law.intact
        self.constants, self.energy_constants, self.point_values = law.constants, law.energy_constants, law.point_values
        self.horizon_ratio, self.inverse_horizon = law.horizon_ratio, law.inverse_horizon
        self.unit_volume, self.correction = law.unit_volume, law.correction
        self.earlier_energy, self.driving_energy = law.earlier_energy, law.driving_energy
        self.partial_energy = law.partial_energy
        self.goes_slack, self.slack_frequency = law.goes_slack, law.slack_frequency
        f = context.features
        self.kernels: BendingKernels = bending(
            context.bits, context.sheet.frames is not None, f.breakable, f.softened, f.breakable and f.tracked
        )
        self.stiffness, self.poisson = self._stiffness(given)
        self.slopes = fitted_slopes(context.sheet, (context.held & HELD == HELD) | (context.held & RIGID != 0))
        self.plate: Any = self._tables()
        n, faces = context.sheet.size, len(context.sheet.triangles)
        self.slope, self.moment = self.slope_array("slope"), self.slope_array("moment")
        self.pulls = self.triangle_array("pulls")
        self.energy = context.array("bending_energy", OWNER, wp.float64, shape=n)
        self.lost: Array | None = None
        self._softening: Array | None = None
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

    def _stiffness(self, given: bool | float) -> tuple[np.ndarray, float]:
        """D of each point [N m], (N,), and Poisson's ratio."""
        sheet = self.context.sheet
        unit, poisson = plate_stiffness(self.law, given)
        softer = 1.0 if sheet.stiffness is None else sheet.stiffness
        each = unit * sheet.thickness**3 * softer if given is True else given
        return np.broadcast_to(np.asarray(each, float), sheet.size), poisson

    def _tables(self) -> Any:
        sheet, triangles, planes = self.context.sheet, self.context.sheet.triangles, self.slopes.planes
        x, curved = sheet.positions, len(planes) > 1
        sides = np.stack([x[triangles[:, k]] - x[triangles[:, 0]] for k in (1, 2)], axis=2)
        corners = range(3) if curved else range(1)
        # A side keeps its length in the planes of its corners.
        flat = np.stack([np.einsum("fcb,fcm->fbm", planes[triangles[:, c] % len(planes)], sides) for c in corners])
        flat *= np.linalg.norm(sides, axis=1)[None, :, None] / np.linalg.norm(flat, axis=2)[:, :, None]
        area = 0.5 * np.linalg.norm(np.cross(sides[:, :, 0], sides[:, :, 1]), axis=1)
        t = self.context.types
        values = self._point_tables(len(x), t)
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
        if self.context.features.breakable:
            plate.left = self.context.array(
                "bending_left", OWNER, t.real, np.ones(len(triangles)), per="face", restart=True
            )
        return plate

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
        torn = self._spans(ring) if self.context.features.breakable else {}
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
        """Vectors g and r of the stress-free sheet [m], (6, F, 3); see kernels/bending.py."""
        s, x, triangles = self.slopes, self.context.sheet.positions, self.context.sheet.triangles
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
                damage=self._softening, left=self.plate.left, lost=self._lost,
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
        self.add_slopes(stage, displacement, self.slope)
        stage.launch(
            OWNER, self.kernels.moments, len(self.context.sheet.triangles), plate=self.plate,
            displacement=displacement, slope=self.slope, pulls=self.pulls,
        )  # fmt: skip
        self.add_sums(stage, self.kernels.gather, None, out)

    def add_sums(self, stage: Stage, gather: Kernel, changes: Array | None, force: Array) -> None:
        """Add the launches that add the force of what triangles store, or its change, to `force`."""
        stage.launch(
            OWNER, gather, self.context.sheet.size, plate=self.plate, pulls=self.pulls, changes=changes, sign=-1.0,
            moment=self.moment, force=force,
        )  # fmt: skip
        stage.launch(
            OWNER, self.kernels.spread, self.context.sheet.size, plate=self.plate, moment=self.moment, sign=-1.0,
            force=force,
        )  # fmt: skip

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

    def stored_energy(self) -> Mapping[str, Array]:
        """The strain energy of the law, and the energy of bending."""
        return {**self.law.stored_energy(), "bending": self.energy}

    def lost_energy(self) -> Mapping[str, Array]:
        """What the law loses, and the energy of bending lost to damage."""
        lost = self.law.lost_energy()
        return lost if self.lost is None else {**lost, "bending_lost": self.lost}

    def soften(self, damage: Array, near: Array) -> None:
        """Reduce the stiffness of the law, and of triangles by the damage of their corners, (N,)."""
        self.law.soften(damage, near)
        self._softening = damage
        left = (1.0 - damage.numpy()[self.context.sheet.triangles].max(axis=1)) ** 2
        self.plate.left.assign(left)

    def tangent(self, context: Context, geometric: bool) -> Tangent:
        """The tangent of the law and of bending, for Newton's method.

        Raises:
            InputError: if the law has none.
        """
        return BendingTangent(self, self.law.tangent(context, geometric))

    # What it does as without bending -------------------------------------------------------------------

    @property
    def strain_energy(self) -> Array | None:
        """Energy of each family at the last frame, without bending [J]."""
        return self.law.strain_energy

    @property
    def force_path(self) -> str:
        """Name of the force path of the law."""
        return self.law.force_path

    def begin(self) -> None:
        """Do the host work of the law at the start of a run."""
        self.law.begin()

    def screen_with_force(self, stage: Stage, squared_stretch: float, exceeding: Array) -> bool:
        """Add the law's launch that computes its force and flags blocks of points whose bonds may break."""
        return self.law.screen_with_force(stage, squared_stretch, exceeding)

    def bond_force(self) -> Array:
        """Force of each family on its pairs [N]."""
        return self.law.bond_force()

    def represented_areas(self) -> np.ndarray:
        """Area represented by the bonds of each point [m^2]."""
        return self.law.represented_areas()

    def energy_density(self, stretch: np.ndarray, across: Any = 1.0) -> np.ndarray:
        """Energy density of stretch [J/m^3]."""
        return self.law.energy_density(stretch, across)

    def fictitious_mass(self, stage: Stage) -> Array | None:
        """Add the launches of the law's fictitious mass."""
        return self.law.fictitious_mass(stage)

    def request_fields(self, names: Sequence[str]) -> None:
        """Add fields of the law to the frames."""
        self.law.request_fields(names)

    def field_names(self) -> Sequence[str]:
        """Names of the fields of the law."""
        return self.law.field_names()

    def sums(self) -> Mapping[str, Array]:
        """Point arrays of the law to sum."""
        return self.law.sums()

    def column_names(self) -> Sequence[str]:
        """Names of the law's columns."""
        return self.law.column_names()

    def columns(self, totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """Values of the law's columns."""
        return self.law.columns(totals, elapsed)

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes of the law."""
        return self.law.notes(history, load_duration)

    def fingerprint(self) -> str:
        """Hash of the law's user functions."""
        return self.law.fingerprint()

    def likely_cause(self, safety: float) -> str:
        """The law's likely cause if a run diverged."""
        return self.law.likely_cause(safety)


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
