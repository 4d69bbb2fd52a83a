"""Pressure inside a closed surface, from a gas or a prescribed volume."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, finite, not_negative, positive, show
from ..device.clock import Schedule, factor_schedule
from ..device.fields import Array
from ..device.launches import Stage
from ..geometry.sheet import Sheet
from ..geometry.surface import cells_of, other_diagonals
from ..geometry.triangulation import boundary_edges, boundary_rings, require_one_side
from ..interfaces import BuiltLaw, BuiltLoad, Columns, History, Load
from ..interfaces.scales import Scales, largest_factor
from ..kernels.block_sums import GROUP, add_groups
from ..kernels.gas.enclosed_volume import (
    BLOCK,
    enclosed_pressure,
    enclosed_volume,
    gas_leak,
    polytropic_gas,
    prescribed_volume,
)
from ..kernels.rupture import face_damage
from ..kernels.surface_pressure import ENCLOSED
from ..parts.loads import Ramp
from ..parts.surface_pressure import PressedSurface
from ..step import Phase

# Distance of a ring from a plane, over the size of the sheet, and a volume over its cube, that count as zero.
TOLERANCE = 1e-9
# Pressure of the air at a height of 30 km [Pa].
THINNEST_AIR = 1200.0
# Volume that may be missing at the end, over the prescribed one.
CLOSE_VOLUME = 0.01


class Enclosed(Load):
    """A pressure inside an enclosed volume that depends on that volume (base class).

    The sheet is a closed surface, or its edges are held and every ring of edges is closed by a cap. All components of a
    ring must be held, or, if it is in a coordinate plane, those normal to the plane. The force on a point is the
    pressure times the exact derivative of the volume of the triangles, so the net force and torque on a closed surface
    vanish.

    Pressure acts only on triangles not cut by a crack. A damage field reduces it by (1 - d)^2, since nothing presses on
    the opening of a tear. The volume includes all triangles. A sheet encloses one volume.
    """

    only_one: ClassVar[str] = "loads that enclose a volume: expected at most one"

    def law(self, volume: float) -> tuple[Any, tuple[float, ...]]:
        """Pressure law and its constants (at most four), for the initial volume `volume` [m^3]."""
        raise NotImplementedError(f"{type(self).__name__}.law: expected an implementation that returns a pressure law")

    def schedule(self) -> Schedule | None:
        """Schedule of the factor of the pressure law; None for 1."""
        return None

    @property
    def extra(self) -> float:
        """Additional volume, not under the sheet [m^3]."""
        return 0.0

    @property
    def outflow(self) -> tuple[float, float]:
        """Discharge coefficient of crack openings [-] (0: no leak), and gas density outside [kg/m^3]."""
        return 0.0, 1.0

    @property
    def loses(self) -> bool:
        """Whether the contents change in the steps of a run: `BuiltEnclosed.left` then exists."""
        return self.outflow[0] > 0.0

    def misses(self, pressure: float, volume: float) -> list[str]:
        """Notes on what was asked and is not there at the end, at a pressure [Pa] and a volume [m^3]."""
        return []

    def build(self, context: Context, law: BuiltLaw) -> BuiltLoad:
        """Build the volume on a device."""
        return BuiltEnclosed(self, context, law)


@dataclass(frozen=True)
class EnclosedGas(Enclosed):
    """A gas inside the sheet: (p + ambient) (V / m)^n is constant, with the amount of gas m.

    The load factor of static solvers does not scale it: vary `amount` in load time instead.

    Attributes:
        gauge: Initial pressure above ambient [Pa].
        ambient: Absolute pressure outside [Pa].
        exponent: Polytropic exponent n: 1 for isothermal, 1.4 for adiabatic air.
        amount: Pairs (time [s], amount of gas divided by the initial amount), or None for constant 1. Added gas has the
            entropy (n = 1: the temperature) of the gas inside.
        chamber: Additional volume [m^3], such as that of a rigid vessel closed by a flat sheet.
        leak: Discharge coefficient of torn triangles [-], 0.6 to 1: gas flows through them as through an orifice, dm/dt
            = -leak A sqrt(2 p rho). With 0 the gas stays inside a torn sheet and accelerates its pieces too much. Only
            with the solver Explicit.
        density: Density of the gas at ambient pressure [kg/m^3], for the leak.
    """

    gauge: float = 0.0
    ambient: float = 101325.0
    exponent: float = 1.0
    amount: Ramp = None
    chamber: float = 0.0
    leak: float = 0.0
    density: float = 1.2

    def __post_init__(self) -> None:
        finite("EnclosedGas.gauge", self.gauge)
        if np.ndim(self.ambient):
            raise InputError(
                f"EnclosedGas.ambient = {show(self.ambient)}: expected one number, the pressure outside at the start; "
                "a Pressure acts like its fall since then, Pressure(fall, ramp=[(0, 0), (duration, 1)])"
            )
        not_negative("EnclosedGas.ambient", self.ambient)
        positive("EnclosedGas.ambient + EnclosedGas.gauge", self.ambient + self.gauge)
        positive("EnclosedGas.exponent", self.exponent)
        not_negative("EnclosedGas.chamber", self.chamber)
        positive("EnclosedGas.density", self.density)
        if not_negative("EnclosedGas.leak", self.leak) > 0.0 and self.ambient == 0.0:
            raise InputError(f"EnclosedGas.leak = {self.leak!r}: expected 0 if the ambient pressure is 0")
        schedule = self.schedule()
        for value in () if schedule is None else schedule.values[:, 0]:
            positive("EnclosedGas.amount", float(value))

    def doubts(self, sheet: Sheet, scales: Scales) -> Sequence[str]:
        """Whether the sheet cannot carry its pressure, the air outside is thin, or the chamber is vast."""
        thin = 0.0 < self.ambient < THINNEST_AIR
        return [
            *scales.of_force(
                f"EnclosedGas.gauge of {self.gauge:g} Pa is", abs(self.gauge) * scales.area, "Pressures are in Pa"
            ),
            *scales.of_volume("EnclosedGas.chamber is", self.chamber),
            *([f"EnclosedGas.ambient is {self.ambient:g} Pa; is it in bar or kPa? Air has 101325 Pa"] if thin else []),
        ]

    @property
    def extra(self) -> float:
        """The chamber [m^3]."""
        return self.chamber

    @property
    def outflow(self) -> tuple[float, float]:
        """The leak, and the density outside [kg/m^3]."""
        return self.leak, self.density

    def schedule(self) -> Schedule | None:
        """The amount of gas."""
        return factor_schedule("EnclosedGas.amount", self.amount)

    def law(self, volume: float) -> tuple[Any, tuple[float, ...]]:
        """The law of the gas. Raises InputError if the volume is not positive."""
        if volume <= 0.0:
            raise InputError(
                f"EnclosedGas: the sheet encloses {volume:.4g} m^3 at the start; expected a positive volume: "
                "give `chamber`, the volume below a flat sheet, or turn triangles that face inwards"
            )
        return polytropic_gas, (self.ambient + self.gauge, volume, self.ambient, self.exponent)


@dataclass(frozen=True)
class EnclosedVolume(Enclosed):
    """A prescribed volume, as from a liquid pump: p = stiffness (prescribed volume - V).

    The pressure may rise and fall along the path, so static solvers can pass a maximum of the pressure.

    Attributes:
        volume: Pairs (time [s], volume under the sheet [m^3]).
        stiffness: Bulk modulus of the liquid divided by its volume [Pa/m^3]. The volume is less than prescribed by p /
            stiffness. Static paths are stable if the stiffness exceeds the steepest decrease of the pressure with
            volume.
    """

    volume: Sequence[tuple[float, float]]
    stiffness: float

    def __post_init__(self) -> None:
        positive("EnclosedVolume.stiffness", self.stiffness)
        if self.schedule() is None:
            raise InputError("EnclosedVolume.volume = None: expected pairs (time, volume)")

    def doubts(self, sheet: Sheet, scales: Scales) -> Sequence[str]:
        """Whether the sheet cannot stretch that far."""
        return scales.of_volume("EnclosedVolume.volume reaches", largest_factor(self.volume))

    def schedule(self) -> Schedule | None:
        """The prescribed volume."""
        return factor_schedule("EnclosedVolume.volume", self.volume)

    def law(self, volume: float) -> tuple[Any, tuple[float, ...]]:
        """Pressure proportional to the missing volume."""
        return prescribed_volume, (self.stiffness,)

    def misses(self, pressure: float, volume: float) -> list[str]:
        """A note if the volume is not the prescribed one."""
        missing = pressure / self.stiffness
        prescribed = volume + missing
        if abs(missing) <= CLOSE_VOLUME * abs(prescribed):
            return []
        return [
            f"EnclosedVolume.stiffness = {self.stiffness:g}: the last volume is {volume:.4g} m^3, {prescribed:.4g} is "
            f"prescribed, as it yields by {abs(missing):.2g} m^3 to the pressure: expected a larger one"
        ]


class BuiltEnclosed(BuiltLoad):
    """An enclosed volume on a device.

    Attributes:
        enclosed: Pressure [Pa], volume [m^3], and derivative of the pressure along the last direction.
        left: Factor on the law's factor, such as the amount of gas left [-]; one float64, in restart files, or None.
        constants: Constants of the pressure law.
    """

    follows_displacement = True
    symmetric = True

    def __init__(self, load: Enclosed, context: Context, law: BuiltLaw) -> None:
        self.owner, self._misses = type(load).__name__, load.misses
        self.label, self.context, self._family_law, self._extra = f"loads: {self.owner}", context, law, load.extra
        sheet = context.sheet
        caps = self._caps()
        # Positions about the middle keep the round-off of the volume small.
        middle = 0.5 * (sheet.positions.min(axis=0) + sheet.positions.max(axis=0))
        positions = sheet.positions - middle
        extent = float(np.ptp(positions, axis=0).max())
        cuts = [sheet.triangles]
        if (turned := other_diagonals(positions, sheet.triangles)) is not sheet.triangles:
            cuts.append(turned)
        faces = np.concatenate(cuts)
        triangles = np.concatenate([faces, *caps * len(cuts)])
        volume = volume_of(positions + context.initial_displacement, triangles) / len(cuts)
        self._coefficient = 1.0 / (6.0 * len(cuts))
        pressure_law, constants = load.law(load.extra + (volume if abs(volume) > TOLERANCE * extent**3 else 0.0))
        self.constants = wp.vec4d(*constants, *[0.0] * (4 - len(constants)))
        self._schedule = context.clock.register(load.schedule())
        breakable, self._outflow = law.intact is not None, load.outflow
        leaks = self._outflow[0] > 0.0
        self.left: Array | None = None
        if load.loses:
            self.left = context.array("gas_left", self.owner, wp.float64, np.ones(1), per="once", restart=True)
        if leaks and not breakable:
            raise InputError(f"{self.owner}.leak = {self._outflow[0]!r}: expected 0 if bonds cannot break")
        if leaks and context.at_rest:
            raise InputError(f"{self.owner}.leak = {self._outflow[0]!r}: expected 0, or the solver Explicit")
        key = (context.bits, pressure_law, self._schedule is not None, load.loses)
        self._set_pressure = enclosed_pressure(*key)
        even, cells = np.ones(sheet.size), cells_of(positions, sheet.triangles)
        self._surface = PressedSurface(self.owner, context, law, cells, even, ENCLOSED)
        self._allocate_faces(faces, triangles, breakable)
        self._allocate_sums(len(triangles))
        self._allocate_leak(len(faces), leaks)

    def _allocate_faces(self, faces: np.ndarray, triangles: np.ndarray, breakable: bool) -> None:
        """Allocate the triangles, including caps, and, if bonds can break, flags for those of the sheet, `faces`."""
        context = self.context
        self._triangles = context.array("closed_triangles", self.owner, wp.vec3i, triangles, per="table")
        self._intact = self._edges = None
        if breakable:
            self._edges = context.array("triangles", self.owner, wp.vec3i, faces, per="table")
            self._intact = context.array("pressed_faces", self.owner, wp.uint8, shape=len(faces), per="table")

    def _allocate_sums(self, triangles: int) -> None:
        """Allocate the partial sums of the volume: blocks of triangles, and blocks of blocks."""
        context, blocks = self.context, -(-triangles // BLOCK)
        self._blocks = context.array("volume_of_blocks", self.owner, wp.float64, shape=(2, blocks), per="block")
        self._sums = context.array("volume_sums", self.owner, wp.float64, shape=(2, -(-blocks // GROUP)), per="block")
        self.enclosed = context.array("enclosed", self.owner, wp.float64, shape=3, per="once")

    def _allocate_leak(self, faces: int, leaks: bool) -> None:
        """Allocate the sums of open areas, if gas leaks through cracks."""
        self._open_blocks = self._open = None
        if leaks:
            context, blocks = self.context, -(-faces // BLOCK)
            self._open_blocks = context.array("open_areas", self.owner, wp.float64, shape=(2, blocks), per="block")
            shape = (2, -(-blocks // GROUP))
            self._open = context.array("open_area_sums", self.owner, wp.float64, shape=shape, per="block")

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes on what the load misses, and if the sheet is torn and nothing flows out."""
        pressure, volume, _ = self.enclosed.numpy().tolist()
        missed = self._misses(pressure, volume)
        if self._intact is None or self._outflow[0] > 0.0:
            return missed
        torn = int(np.count_nonzero(self._intact.numpy() == 0))
        note = (
            f"{self.owner}: {torn} triangles are torn and nothing flows out, so that what is enclosed drives the pieces"
        )
        return [*missed, f"{note}: EnclosedGas(leak=, density=) lets gas out"] if torn else missed

    def _caps(self) -> list[np.ndarray]:
        """Triangles of the caps that close the edges of the sheet, ring by ring."""
        sheet, held = self.context.sheet, self.context.held
        if len(sheet.triangles) == 0:
            raise InputError(f"{self.owner}: the sheet has no triangles; expected a surface that encloses a volume")
        place = sheet.positions + self.context.initial_displacement
        extent = float(np.ptp(place, axis=0).max())
        caps = []
        for ring in edge_rings(sheet.triangles):
            flat = np.ptp(place[ring], axis=0) <= TOLERANCE * extent
            everywhere = int(np.bitwise_and.reduce(held[ring])) & 7
            if everywhere != 7 and not any(flat[c] and everywhere & (1 << c) for c in range(3)):
                loose = int(ring[np.flatnonzero((held[ring] & 7) != 7)[0]])
                raise InputError(
                    f"{self.owner}: point {loose} at {np.round(place[loose], 6).tolist()} m is on an edge of the sheet "
                    "and free: expected a closed surface, or edges that are held, so that a cap can close them"
                )
            caps.append(cap_of(ring))
        return caps

    def add_pressure(self, stage: Stage, displacement: Array, direction: Array | None = None) -> None:
        """Add the launches that fill `enclosed` at a displacement [m]."""
        context = self.context
        stage.launch(
            self.owner, enclosed_volume(context.bits, direction is not None), self._blocks.shape[1],
            triangles=self._triangles, positions=self._surface.positions, displacement=displacement,
            direction=direction, sums=self._blocks,
        )  # fmt: skip
        self._add_groups(stage, self._blocks, self._sums)
        stage.launch(
            self.owner, self._set_pressure, 1,
            sums=self._sums, coefficient=self._coefficient, chamber=self._extra, constants=self.constants,
            factors=context.clock.scheduled, schedule=self._schedule or 0, left=self.left, enclosed=self.enclosed,
        )  # fmt: skip

    def _add_groups(self, stage: Stage, blocks: Array, sums: Array) -> None:
        """Add the launch that adds up groups of blocks."""
        stage.launch(self.owner, add_groups, sums.size, sums=blocks, maxima=0, group=GROUP, shorter=sums)

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches of the volume, its pressure, and the force on the points."""
        self.add_pressure(stage, displacement)
        self._surface.add_force(stage, displacement, 1.0, out, enclosed=self.enclosed)

    def _add_torn(self, stage: Stage) -> None:
        """Add the launch that finds the triangles cut by cracks, if bonds can break."""
        if self._intact is not None:
            context, law = self.context, self._family_law
            stage.launch(
                self.owner, face_damage(context.layout), len(self._intact),
                family=law.struct, triangles=self._edges, intact_faces=self._intact,
            )  # fmt: skip

    def _add_leak(self, stage: Stage) -> None:
        """Add the launches of the gas leak in a step."""
        context, displacement = self.context, self.context.state.displacement
        assert self._open_blocks is not None and self._open is not None
        sum_open, lose_gas = gas_leak(context.bits, self._schedule is not None)
        self.add_pressure(stage, displacement)
        self._add_torn(stage)
        stage.launch(
            self.owner, sum_open, self._open_blocks.shape[1],
            triangles=self._edges, intact_faces=self._intact, positions=self._surface.positions,
            displacement=displacement, sums=self._open_blocks,
        )  # fmt: skip
        self._add_groups(stage, self._open_blocks, self._open)
        stage.launch(
            self.owner, lose_gas, 1,
            sums=self._open, enclosed=self.enclosed, discharge=6.0 * self._coefficient * self._outflow[0],
            density=self._outflow[1], constants=self.constants, step=context.state.step,
            factors=context.clock.scheduled, schedule=self._schedule or 0, left=self.left,
        )  # fmt: skip

    def add_tangent(self, stage: Stage, displacement: Array, direction: Array, out: Array) -> bool:
        """Add the launches of the derivative of the force along a direction."""
        if self._intact is not None:
            return False
        self.add_pressure(stage, displacement, direction)
        self._surface.add_tangent(stage, displacement, direction, 1.0, out, enclosed=self.enclosed)
        return True

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of the leak, and those of the volume and pressure for the history."""
        if phase is Phase.INTERNAL_VARIABLES and self._open is not None:
            self._add_leak(stage)
        if phase is Phase.FRAME:
            self.add_pressure(stage, self.context.state.displacement)
            self._add_torn(stage)

    def columns(self) -> Columns:
        """Pressure and volume."""
        return Columns(("pressure", "volume"), self._row)

    def _row(self, totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """Pressure above ambient [Pa] and volume [m^3], including the chamber."""
        pressure, volume, _ = self.enclosed.numpy().tolist()
        return {"pressure": pressure, "volume": volume}


def edge_rings(triangles: np.ndarray) -> list[np.ndarray]:
    """Closed rings of boundary edges (edges of only one triangle), in the direction of the triangles."""
    require_one_side(triangles)
    free = boundary_edges(triangles)
    begins, times = np.unique(free[:, 0], return_counts=True)
    if (times > 1).any():
        raise InputError(
            f"triangles: two boundaries of the sheet meet at point {begins[times > 1][0]}: expected separate boundaries"
        )
    # In order of their first points, so that the rings, and the caps on them, do not depend on that of the triangles.
    return [ring.astype(np.int32) for ring in boundary_rings(free[np.argsort(free[:, 0])])]


def cap_of(ring: np.ndarray) -> np.ndarray:
    """Triangle fan that closes a ring, int32, shape (R - 2, 3); flat if the ring is."""
    return np.column_stack([np.full(len(ring) - 2, ring[0]), ring[2:], ring[1:-1]]).astype(np.int32)


def volume_of(positions: np.ndarray, triangles: np.ndarray) -> float:
    """Volume enclosed by a surface [m^3], positive if its triangles are counter-clockwise seen from outside."""
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    return float(np.einsum("fc,fc->", a, np.cross(b, c)) / 6.0)
