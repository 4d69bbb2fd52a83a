"""The damage field of a `TearingEnergy` on a device."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, by_point, point_indices
from ..device.fields import Array, to_host
from ..device.launches import Span, Stage, with_values
from ..families import notes_on_reach
from ..geometry.couplings import crack_segments, gradient_couplings, points_near
from ..geometry.sheet import Sheet
from ..interfaces import BuiltLaw, Columns, History
from ..interfaces.scales import Scales
from ..kernels.tearing.damage_field import NEAR as SEVERED_NEAR
from ..kernels.tearing.damage_field import OtherFamilies, field_struct
from ..kernels.tearing.damage_step import (
    RESIDENT,
    TOGETHER,
    WAITING_BLOCK,
    FieldOptions,
    drive_kernel,
    empty,
    find_kernel,
    finish_kernel,
    of_frames,
    pack,
    rouse_kernel,
    sweep_kernel,
    wake_kernel,
)
from ..kernels.threads import lanes_of
from ..parts.rupture import AT_REST, Damaged
from ..step import Phase
from .cut_profiles import CutEnds, damage_of_cuts, initial_damage
from .damage_ghosts import LAYERS, DamageGhosts
from .early_softening import EarlySoftening
from .field_constants import relaxations, screen_of
from .field_settings import FieldSettings

# Largest damage of a cut at the start, and by how much it must grow until bonds break there.
MOST_AT_START, GROWN = 0.98, 1e-3
# Fraction of the damage of a crack's profile, half a spacing from the crack, at which a point is severed.
SEVERED = 0.96
# Distance from initial damage up to which intact material may start above its strength, in lengths of the field.
BESIDE = 4.0
# Energy density over the strength, by triangles, from which a start is above the strength for certain.
SURELY = 1.5
# The damage is found once every INTERVAL steps, by LEAST_SWEEPS + SWEEPS length / spacing sweeps. The next steps go on
# from there.
INTERVAL = 2
LEAST_SWEEPS, SWEEPS = 4, 1.0
# Factor of the sweeps over length / spacing with `every_step`; more change nothing.
CLOSER = 4.0
# Threads that share the list of points: as many as a GPU holds at once, and few on a CPU, where they take turns.
GPU_THREADS, CPU_THREADS = 2**15, 64
# The number of neighbours is a multiple of it.
NEIGHBOURS = 4
# Up to this many points a GPU lists them in the launch that also finds their damage, each block this many at a time.
# More points need more threads.
FEW_POINTS, LOOKED_AT = 2**16, 152
# Number of points from which on several launches find the damage beside the force of undamaged families, which then
# takes long enough.
MANY_POINTS = 2**18
# Blocks of a GPU that look for points to list.
GPU_LOOKS = 2**10
# Families whose driving energy a GPU computes at once, each by several threads.
GPU_FAMILIES = 2**13
# Static equilibrium: change of the damage below which nothing more happens; sweeps between two looks at it, over those
# in motion; largest number of looks at one displacement.
SETTLED, SWEEPS_AT_REST, MAX_REPEATS = 1e-3, 16, 50
# Relative residual down to which the displacement follows the damage while this changes.
CLOSE_ENOUGH = 1e-3
# Mean damage that a run may gain before a note says so.
MUCH_DAMAGE = 0.3


def finds_at_once(context: Context) -> bool:
    """Whether one launch finds the damage of a step: on a GPU, whose blocks can wait for each other."""
    return context.device.is_cuda and not context.at_rest and context.partition is None


class DamageField(Damaged):
    """The damage field on a device.

    Attributes:
        field: Damage of the points, (N,), in the precision of the simulation.
        limit: Energy density at which intact material begins to tear [J/m^3], the minimum over all points.
        sweeps: Number of sweeps of the damage each time.
    """

    close_enough = CLOSE_ENOUGH

    def __init__(self, rupture: FieldSettings, context: Context, law: BuiltLaw) -> None:
        super().__init__("TearingEnergy", rupture, context, law)
        self.rupture = rupture
        if rupture.every_step and context.at_rest:
            raise InputError(
                "TearingEnergy.every_step = True: expected False with a static solver or implicit steps, which "
                "find the damage in equilibrium"
            )
        whole, real = context.whole, context.types.real
        self._energy = by_point("TearingEnergy.energy", rupture.energy, context.given.points)
        self.constants = rupture.constants(context, law.families.horizon, law.energy_density)
        self.length, self.limit = self.constants.length, self.constants.limit
        self.tear_energy = 0.25 * float(np.min(self._energy)) * self.length * context.whole.mean_thickness
        self._fastest = self.constants.steepness
        weak = self._fastest > 2.0
        self._ghosts = None if context.partition is None else DamageGhosts(self.owner, context)
        self._own = slice(0, context.sheet.size) if self._ghosts is None else self._ghosts.own
        self._cuts: CutEnds | None = None
        self._at_start, ahead = self._profile(whole)
        self._least = context.here(self._at_start)
        self._at_begin: tuple[np.ndarray, ...] = ()
        self._declare(self._least)
        self._declare_couplings(self._least)
        self._declare_severing(self._least, context.here(ahead))
        finest = whole.spacing if whole.spacings is None else whole.spacings.min()
        # Without acceleration their number grows with the square of the length.
        self._every, closer = (1, CLOSER) if rupture.every_step else (INTERVAL, 1.0)
        growth = closer * SWEEPS * (self.length / finest) ** (2 if weak else 1)
        self.sweeps = 2 * round(0.5 * (LEAST_SWEEPS + growth))
        self.sweeps *= SWEEPS_AT_REST if context.at_rest else 1
        factors = self.sweeps * [1.0] if weak else relaxations(self.sweeps)
        screen, few = screen_of(law, context, self.owner, self.limit)
        shared = context.device.is_cuda and law.partial_energy is not None
        self._lanes = lanes_of(law.families.members) if shared else 1
        assert law.earlier_energy is not None
        self._of = FieldOptions(
            context.layout, self.spared is not None, rupture.screened, few, self.released is not None, weak,
            law.earlier_energy, law.driving_energy or law.earlier_energy, law.partial_energy if shared else None,
            self._lanes, len(self._neighbours),
        )  # fmt: skip
        self._softening = self.field
        if weak:
            softened = self.constants.softened(self._least)
            self._softening = context.array("softening", self.owner, real, softened, restart=True, own_exchange=True)
        self._arrays = with_values(field_struct(context.bits)(), {
            **screen, "spared_mask": self.spared, "scale": self._scale, "fastest": self._fastest, "ahead": self._ahead,
            "neighbours": self._neighbours, "couplings": self._couplings, "squared_reach": self._reach,
            "relaxations": context.array("relaxations", self.owner, real, factors, per="table"), "damage": self.field,
            "other": self._other, "before": self._before, "driving": self._driving, "severed_at": self._severed_at,
            "softening": self._softening, "awake": self._awake, "near_damage": self._near, "listed": self._listed,
            "count": self._count, "found": self._found, "arrived": self._arrived,
        })  # fmt: skip
        law.soften(self._softening, self._near)
        self._refuse_early(law)

    def _refuse_early(self, law: BuiltLaw) -> None:
        """Refuse a start far above the strength before kernels are compiled; `begin` is exact."""
        context = self.context
        one_material = not context.layout.varies
        alike = one_material and self.spared is None and context.partition is None
        if not alike or not context.initial_displacement.any():
            return
        from .field_constants import density_at_start

        density = density_at_start(context, law) * self._fastest / self.constants.units
        density[points_near(context.whole.points, self._at_start > 0.0, BESIDE * self.length)] = 0.0
        if density.max(initial=0.0) > SURELY:
            self._refuse_start(float(density.max()))

    def _refuse_start(self, times: float) -> None:
        """Raise InputError for a start at so many times the strength."""
        begins = f"{times * self.limit:.3g} J/m^3, above the strength of {self.limit:.3g} J/m^3"
        if np.ndim(self._energy):
            begins = f"{times:.3g} times the strength of a point"
        raise InputError(
            f"damage = TearingEnergy: the sheet starts with {begins} that a length of {self.length:.3g} m "
            f"stands for; expected a shorter length or a larger energy"
        )

    def _declare(self, profile: np.ndarray) -> None:
        """Declare the arrays of the field, whose damage at the start is `profile`, and of the list of points."""
        context, owner, n, real = self.context, self.owner, self.context.sheet.size, self.context.types.real
        self.field = context.array("damage_field", owner, real, profile, restart=True, own_exchange=True)
        severed_anew = np.maximum(self._severing(context.whole), self._at_start + GROWN)
        self._early = EarlySoftening(owner, context, self.constants, self._at_start, severed_anew)
        self._other = context.array("damage_after_sweep", owner, real, profile, own_exchange=True)
        self._before = context.array("damage_before", owner, real, shape=n)
        self._driving = context.array("driving", owner, real, shape=n, own_exchange=True)
        self._awake = context.array("awake", owner, wp.uint8, shape=n)
        self._near = context.array("near_damage", owner, wp.uint8, shape=n)
        self._listed = context.array("listed_points", owner, wp.int32, shape=n, per="table")
        self._count = context.array("listed_count", owner, wp.int32, shape=1, per="once")
        self._threads = min(GPU_THREADS if context.device.is_cuda else CPU_THREADS, n)
        # Blocks of a GPU that sweep wait for each other: at most one for each multiprocessor.
        if context.device.is_cuda:
            refuse_shared_device(context.device)
        blocks = min(context.device.sm_count, -(-n // WAITING_BLOCK))
        # In equilibrium there are many sweeps over few points: one CPU thread runs them sooner than so many launches.
        on_cpu = 1 if context.at_rest and self._ghosts is None else self._threads
        self._sweepers = blocks * WAITING_BLOCK if context.device.is_cuda else on_cpu
        # Whether several launches find the damage of a step beside the force of undamaged families, or one launch does
        # before it, and whether this also lists the points.
        at_once, self._looks = finds_at_once(context), n <= FEW_POINTS
        beside = self._ghosts is not None or (at_once and n >= MANY_POINTS)
        self._beside = beside and not context.at_rest and self.law.other_families is not None
        self._at_once = at_once and not self._beside
        self._arrived = context.array("arrived_sweepers", owner, wp.int32, shape=1, per="once")
        self._found: Array | None = None
        if not context.device.is_cuda:
            threads = -(-(self._own.stop - self._own.start) // TOGETHER)
            self._found = context.array("listed_by_threads", owner, wp.int32, shape=threads, per="table")

    def _declare_couplings(self, profile: np.ndarray) -> None:
        """Declare what couples the damage of neighbours and scales what drives it, and the energy of the field."""
        context, law, sheet = self.context, self.law, self.context.sheet
        areas, real = law.represented_areas(), context.types.real
        # A point whose bonds determine no deformation stores no energy; the field passes through its own area.
        areas = np.where(areas > 0.0, areas, sheet.areas)
        if self._ghosts is None:
            neighbours, couplings = gradient_couplings(sheet)
        else:
            areas, (neighbours, couplings) = self._ghosts.areas(areas), self._ghosts.couplings()
        couplings *= 2.0 * self.length**2 / areas
        units = self.constants.units
        unit = context.here(units) if isinstance(units, np.ndarray) else units
        # Energy of the field per area [J/m^2]; between two points it is the mean of theirs.
        per_area = unit * sheet.thickness
        if isinstance(per_area, np.ndarray):
            couplings *= 0.5 * (1.0 + per_area[neighbours] / per_area)
        # Kernels are compiled for numbers of neighbours: for few of these, missing ones are the point itself.
        more = -len(neighbours) % NEIGHBOURS
        neighbours = np.vstack([neighbours, np.tile(np.arange(sheet.size, dtype=np.int32), (more, 1))])
        couplings = np.vstack([couplings, np.zeros((more, sheet.size))])
        self._neighbours = context.array("field_neighbours", self.owner, wp.int32, neighbours, per="bond")
        self._couplings = context.array("field_couplings", self.owner, real, couplings, per="bond")
        relative = sheet.thickness / context.whole.mean_thickness
        scale = law.families.reference_area / (areas * unit * relative)
        self._scale = context.array("driving_scale", self.owner, real, scale)
        self._limits = context.array("limit_energy", self.owner, real, per_area * areas)
        apart = profile - profile[neighbours]
        stored = per_area * areas * (profile + 0.25 * (couplings * apart**2).sum(axis=0))
        self.fracture = context.array("fracture", self.owner, wp.float64, stored)
        self._fracture_at_start = context.total(self.fracture)

    def _declare_severing(self, profile: np.ndarray, ahead: np.ndarray) -> None:
        """Declare the damage at which points are severed; `ahead` are those beyond the ends of cracks."""
        context, sheet, real = self.context, self.context.sheet, self.context.types.real
        spacing = np.full(sheet.size, sheet.spacing) if sheet.spacings is None else sheet.spacings
        severed_at = self._severing(sheet)
        ahead = ahead & (profile + GROWN > severed_at)
        self._ahead = context.array("ahead_of_cut", self.owner, wp.uint8, ahead)
        self._severed_at = context.array(
            "severed_at", self.owner, real, np.maximum(severed_at, profile + GROWN), restart=True, own_exchange=True
        )
        reach = (SEVERED_NEAR * spacing / self.law.families.horizon) ** 2
        self._reach = context.array("severed_reach", self.owner, real, reach)

    def _severing(self, sheet: Sheet) -> np.ndarray:
        """Damage at which the points of a sheet that starts without damage are severed, (N,)."""
        spacing = np.full(sheet.size, sheet.spacing) if sheet.spacings is None else sheet.spacings
        return np.asarray(SEVERED * (1.0 - 0.25 * np.minimum(spacing / self.length, 1.0)) ** 2)

    def assign(self, damage: np.ndarray) -> None:
        """Set the damage of all points, (N,)."""
        self.field.assign(damage)
        if self._softening is not self.field:
            self._softening.assign(self.constants.softened(damage))

    def _profile(self, sheet: Sheet) -> tuple[np.ndarray, np.ndarray]:
        """Initial damage, (N,), including that around cuts, and a mask of the points beyond the ends of cuts."""
        damage, ahead = np.zeros(sheet.size), np.zeros(sheet.size, bool)
        if self.rupture.cut_profile and len(crack_segments(sheet)):
            damage, ahead, self._cuts = damage_of_cuts(sheet, self.length)
        if self.rupture.initial_damage is not None:
            damage = np.maximum(damage, initial_damage(self.rupture.initial_damage, sheet.size))
        damage = np.minimum(damage, MOST_AT_START)
        if self.rupture.spared is not None:
            damage[point_indices("TearingEnergy.spared", self.rupture.spared, sheet.size)] = 0.0
        return damage, ahead

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of a phase."""
        super().add(phase, stage)
        if phase is Phase.START:
            self._add_rousing(stage)
            if self._at_once:
                self._add_finding(stage, 0)
            else:
                self._add_list(stage)
                self._add_empty(stage)
        if phase is Phase.RESTORE:
            self._add_rousing(stage)
        if phase is Phase.SEVERING and self._beside:
            with stage.every(self._every):
                self._add_severing(stage, self.law.other_families)
                self._add_empty(stage)
        if phase is Phase.FRAME:
            self._add_energy(stage)

    def _add_energy(self, stage: Stage) -> None:
        stage.launch(
            self.owner, of_frames(self.context.bits)[0], self.context.sheet.size, neighbours=self._neighbours,
            couplings=self._couplings, limit=self._limits, damage=self.field, out=self.fracture,
        )  # fmt: skip

    def add_breaking(self, stage: Stage) -> None:
        """Add the launches that find damage and, unless there is more to do beside, break bonds."""
        with stage.every(self._every):
            if self._at_once:
                self._add_finding(stage, self.sweeps)
                return
            self._add_sweeps(stage)
            if not self._beside:
                self._add_severing(stage)
                self._add_empty(stage)

    def compose_breaking(self) -> None:
        """Compose the stages of alternate minimisation."""
        damage = self.context.stage("damage", AT_REST)
        self._add_empty(damage)
        self._add_rousing(damage)
        self._add_sweeps(damage)
        rupture = self.context.stage("rupture", AT_REST)
        self._add_severing(rupture)
        self._add_rousing(rupture)
        self._add_energy(self.context.stage("energy of the damage", AT_REST))

    def break_exceeding(self, again: bool) -> bool:
        """Minimise the energy over the damage at the current displacement, and break bonds near full damage.

        The damage of a point is bounded below by its value at the last load step, or when one of its bonds broke.
        Sweeps start from these bounds because they only increase the damage.

        Returns:
            Whether the damage changed by more than SETTLED, or a bond broke.
        """
        # Sweeps leave the outermost ghost points wrong.
        intact, field, own = self.intact.numpy().copy(), self.field.numpy().copy(), self._own
        if self.released is not None and not again:
            self._at_begin = intact, field, self.released.numpy().copy()
        now = self._minimise(again)
        self.context.run("rupture")
        broken = (self.intact.numpy() != intact).any(axis=0)
        self._least[broken] = now[broken]
        changed = bool(np.abs(now - field)[own].max() > SETTLED or broken[own].any())
        # If nothing changed, the displacement is in equilibrium with the previous damage.
        if self.context.communicator.any(changed):
            self.assign(now)
            return changed
        self.assign(field)
        if self.released is not None:
            self._release(self.released)
        return changed

    def _release(self, released: Array) -> None:
        """Sum the energy that damage and broken bonds have released in a step: at its end, as if all broke there."""
        intact = self.intact.numpy().copy()
        for array, values in zip((self.intact, self._before, released), self._at_begin, strict=True):
            array.assign(values)
        self.context.run("rupture")
        self.intact.assign(intact)

    def energy_at_rest(self, again: bool | None) -> float:
        """Energy of the field [J] that `break_at_rest` would find, or of the damage as it is."""
        field = self.field.numpy().copy()
        if again is not None:
            self._minimise(again)
        self.context.run("energy of the damage")
        self.field.assign(field)
        return float(self.context.total(self.fracture))

    def _minimise(self, again: bool) -> np.ndarray:
        """Minimise the energy over the damage above its bounds; return the damage, (N,)."""
        if not again:
            self._least = self.field.numpy().copy()
        # Sweeps write only listed points; all others need the current damage in both arrays.
        self.field.assign(self._least)
        self._other.assign(self._least)
        now = self._least
        for _ in range(MAX_REPEATS):
            before = now
            self.context.run("damage")
            now = self.field.numpy().copy()
            if not self.context.communicator.any(bool(np.abs(now - before)[self._own].max() > 0.1 * SETTLED)):
                break
        return now

    def _add_rousing(self, stage: Stage) -> None:
        """Add the launch that marks awake points."""
        stage.launch(
            self.owner, rouse_kernel(self.context.layout), self.context.sheet.size, family=self.law.struct,
            a=self._arrays,
        )  # fmt: skip

    def _add_finding(self, stage: Stage, sweeps: int) -> None:
        """Add the launches of a GPU that find the damage of a step; without sweeps only what drives it."""
        if not self._looks:
            self._add_looking(stage)
        device, blocks, threads = self.context.device, 1, 1
        if device.is_cuda:
            # Fewer blocks come together sooner, more find the damage of many points sooner.
            n, together, threads = self.context.sheet.size, RESIDENT[self.context.bits], WAITING_BLOCK
            blocks = min(device.sm_count, -(-n // LOOKED_AT)) if self._looks else device.sm_count * together
        stage.launch(
            self.owner, find_kernel(self._of, self._looks), blocks * threads, block_dim=WAITING_BLOCK, blocks=blocks,
            sweeps=sweeps, a=self._arrays, **self.arguments(),
        )  # fmt: skip

    def _add_sweeps(self, stage: Stage) -> None:
        """Add the launches that list points and sweep over them."""
        sweeps = self.sweeps
        self._add_list(stage)
        if self._ghosts is not None:
            self._ghosts.add_exchange(stage, self.field, self._driving, self._severed_at)
            self._ghosts.add_listing(
                stage, self._threads, driving=self._driving, damage=self.field, other=self._other, before=self._before,
                listed=self._listed, count=self._count,
            )  # fmt: skip
        together = 1 if self._found is not None and self._sweepers > 1 else sweeps if self._ghosts is None else LAYERS
        for begin in range(0, sweeps, together):
            if self._ghosts is not None and begin and begin % LAYERS == 0:
                self._ghosts.add_exchange(stage, self.field, self._other)
            stage.launch(
                self.owner, sweep_kernel(self._of), self._sweepers, sweep_begin=begin,
                sweep_end=min(begin + together, sweeps), block_dim=WAITING_BLOCK, side_stream=self._beside,
                **self._shared(self._sweepers),
            )  # fmt: skip

    def _add_severing(self, stage: Stage, others: Any = None) -> None:
        """Add the launch that breaks bonds of listed points, and adds families to a list of `others` that is full."""
        stage.launch(
            self.owner, finish_kernel(self._of), self._threads, others=others or OtherFamilies(), **self.arguments(),
            **self._shared(self._threads),
        )  # fmt: skip

    def _shared(self, stride: int) -> dict[str, Any]:
        """Arguments common to all launches on listed points, `stride` of them at once."""
        return {"a": self._arrays, "stride": stride, "only_if": self._count}

    def _add_empty(self, stage: Stage) -> None:
        """Add the launch that empties the list; on a CPU `pack` begins a new list instead."""
        if self._found is None:
            # It need not hold up what follows.
            stage.launch(self.owner, empty, 1, count=self._count, only_if=self._count, side_stream=True)

    def _add_looking(self, stage: Stage) -> None:
        """Add the launches that list points."""
        own, shared = self._own, self._ghosts is not None
        # Points of a GPU may be divided, so that those far from other processes do not wait for their displacements.
        span = Span(stage.block_dim, GPU_LOOKS) if self._found is None else None
        blocks = 1 if span is None else span.blocks(own.stop - own.start)
        threads = blocks * stage.block_dim if self._found is None else len(self._found)
        stage.launch(
            self.owner, wake_kernel(self._of, self._found is None, shared), threads, family=self.law.struct,
            displacement=self.context.state.displacement, a=self._arrays, start=own.start, stop=own.stop,
            blocks=blocks, span=span, side_stream=self._beside,
        )  # fmt: skip
        if self._found is not None:
            stage.launch(self.owner, pack, 1, found=self._found, listed=self._listed, count=self._count)

    def _add_list(self, stage: Stage) -> None:
        """Add the launches that list points and compute their driving energy."""
        self._add_looking(stage)
        families = min(self._threads, GPU_FAMILIES) if self._lanes > 1 else self._threads
        stage.launch(
            self.owner, drive_kernel(self._of), families * self._lanes, family=self.law.struct,
            displacement=self.context.state.displacement, constants=self.law.energy_constants,
            side_stream=self._beside, **self._shared(families),
        )  # fmt: skip

    def _add_damage(self, stage: Stage) -> None:
        stage.launch(
            self.owner, of_frames(self.context.bits)[1], self.context.sheet.size, damage=self.field, out=self.damage
        )  # fmt: skip
        self.add_faces(stage)

    def begin(self) -> None:
        """Check that no intact material away from cracks would tear in the initial state.

        Beside a crack the energy has no limit, and one that starts above Gc is about to run.

        Raises:
            InputError: if any would.
        """
        driving = to_host(self._driving).astype(float)
        driving[(to_host(self.field) > 0.0) | (to_host(self._before) < 0.0)] = 0.0
        if (driving * self._fastest > 1.0).any():
            whole = self.context.whole
            damaged = self._at_start > 0.0
            driving[self.context.here(points_near(whole.points, damaged, BESIDE * self.length))] = 0.0
        most = -self.context.communicator.minimum(-float(driving.max(initial=0.0)))
        if most * self._fastest > 1.0:
            self._refuse_start(most * self._fastest)

    def fingerprint(self) -> str:
        """A hash of the tearing energies if they vary, because functions of the same name may differ."""
        if not callable(self.rupture.energy):
            return ""
        return hashlib.sha1(np.asarray(self._energy).tobytes()).hexdigest()[:12]

    def columns(self) -> Columns:
        """Columns of the damage, and the energy of the field since the start."""
        damage = super().columns()
        names = (*damage.names, "fracture")
        return replace(
            damage, names=names, at_frame=self._row, units={"fracture": "J"}, sums={"fracture": self.fracture}
        )

    def _row(self, totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """Largest and mean damage, and the energy of the field since the start [J]."""
        damage = self.context.whole_array(self.damage)
        self._early.look(damage)
        return {**self.means(damage), "fracture": totals["fracture"] - self._fracture_at_start}

    def doubts(self, scales: Scales) -> Sequence[str]:
        """Whether a sheet with a crack may reach its strength before the crack moves."""
        return self._early.expected()

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes on the length and strength in use, and on damage spread over much of the sheet."""
        said = self.constants.notes() + notes_on_reach(self.context.whole, self.law.families.horizon)
        if self._cuts is not None:
            said += self._cuts.notes(
                self.length, self.constants.bias, self.context.whole.spacing, self._at_start, self.context.whole.points
            )
        if isinstance(self._energy, np.ndarray):
            spacing, resolved = self.context.sheet.spacing, self.constants.resolved
            from .field_constants import narrow_seam

            said += narrow_seam(self._energy, self.context.given.points, spacing, self.length, resolved)
        gained = history[-1]["mean_damage"] - self._at_start.mean()
        if early := self._early.found():
            said += early
        elif gained > MUCH_DAMAGE:
            said.append(
                f"the mean damage grew by {gained:.0%}: most of the sheet, not only a tear, exceeds its strength of "
                f"{self.limit:.3g} J/m^3"
            )
        return [*said, *super().notes(history, load_duration)]


def refuse_shared_device(device: Any) -> None:
    """Check that no other process can be on a GPU at the same moment.

    Blocks that wait for each other must all be on the GPU. MPS lets kernels of several processes on it at once, so that
    each can hold the room that the others wait for, for ever. Without MPS processes take turns.
    """
    pipe = Path(os.environ.get("CUDA_MPS_PIPE_DIRECTORY", "/tmp/nvidia-mps"), "control")
    if device.is_cuda and pipe.exists():
        raise InputError(
            f"device = {device.alias!r}: NVIDIA's MPS shares it (there is {str(pipe)!r}); a damage field could wait "
            "for ever: expected a GPU without MPS, on which processes take turns"
        )
