"""Fast kernels of the variational bond-associated law, and when they are used.

On a CPU one kernel serves all families. On a GPU undamaged families inside a lattice or grid have a kernel of their
own, if the material is isotropic, and so have damaged ones there. All others, those of clouds, and of sheets too small
to fill a GPU with one thread per point, share blocks of threads, with two bonds per thread.

The bond forces of large sheets pass through a ring buffer, one strip of the sheet at a time: all of them would take
most of the memory. Where bonds of a lattice cannot break, two short strips run beside each other, and gather the forces
of earlier ones between their own: what waits for memory and what computes fill the same processors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..device.fields import Array
from ..device.launches import OfStrip, Span, Stage, with_values
from ..device.streams import MAIN, SECOND, SIDE
from ..geometry.sheet import Sheet
from ..interfaces import BondBreaking, Law
from ..interfaces.context import Context
from ..kernels.effects import Kernel
from ..kernels.factories import FunctionFactory
from ..kernels.families import WORD, is_compact
from ..kernels.family_blocks import block_force, families_together, threads_of_family
from ..kernels.family_rows import family_rows
from ..kernels.lost_members import changed_families
from ..kernels.pointwise import Pointwise
from ..kernels.reverse_bonds import gather_reverse_bonds
from ..kernels.stencil import Stencil
from ..kernels.undamaged_lattice import undamaged_lattice_force
from ..materials import capabilities
from .family_struct import moments_of
from .point_lists import Lists, Run
from .strips import Strip, long_strips, short_strips
from .undamaged_lattice import undamaged_stencil
from .variational import BondAssociatedLaw, FastForce

if TYPE_CHECKING:
    from .bond_associated import BondAssociated

# Largest family whose bonds share a thread block, and largest that a CPU sums by rows; larger ones compile slowly.
MAX_MEMBERS, MAX_CPU_MEMBERS = 64, 256
# Largest horizon [spacings] with so few members also on an irregular cloud.
MAX_COMPACT = 4.0
# Largest horizon at which tables of few bytes cost no time; clouds of a larger one have them from so many points on.
FREE_COMPACT, COMPACT_FROM = 2.5, 2**20
# Largest number of points of such a cloud: entries of its tables have numbers of 31 bits.
MAX_COMPACT_POINTS = 2**24
# Threads per block of the kernel of undamaged families: with a family in registers, few threads fit a multiprocessor.
UNDAMAGED_BLOCK = 64
# Threads of the kernel of damaged families inside a lattice: as many as a GPU holds at once.
DAMAGED_THREADS = 528 * UNDAMAGED_BLOCK
# Maximum number of blocks of the kernel of all others: enough to fill a GPU; each works until all families are done.
# With a list most blocks would find nothing, and starting them takes time.
MAX_BLOCKS, MAX_LISTED_BLOCKS = 8192, 1056
# Columns of the ring: every strip waits for its few families at edges, which take as long as 2^16 others.
RING = 2**20
# The same of a cloud, which has no such families.
CLOUD_RING = 2**18
# Points of a short strip, and number of points from which on a lattice has such strips.
STRIP, STRIPS_FROM = 57_000, 2**20
# How many strips later the kernel of undamaged families gathers the forces of a short strip. Two neighbouring strips
# are computed while the last but one before each of them is gathered, with what lies behind that.
LAG = 2
ROOM = LAG + 2
# Number of bonds up to which all families of a sheet use the second kernel.
MAX_SHARED = 300_000


def fast_path(force: BondAssociatedLaw, inverse: np.ndarray, weights: np.ndarray) -> FastForce | None:
    """The fast kernels for a force law on a sheet, or None if there are none.

    Args:
        force: The law on its sheet and device.
        inverse: K^-1 by row, shape (R, n, 3).
        weights: W divided by the reference area by row, shape (R, n).
    """
    members = force.families.members
    if not force.fast or force.weights == "published":
        return None
    if not shares_memory(force.context.device):
        return RowSums(force) if sums_rows(force) else None
    known = capabilities(force.material)
    if known.near is None or members > MAX_MEMBERS:
        return None
    # By the whole sheet: several processes take the same kernels as one.
    small = force.context.whole.size * members <= MAX_SHARED
    stencil = undamaged_stencil(force.families, inverse, weights) if known.isotropic and not small else None
    return FastPath(force, known.near, stencil)


def has_blocks(law: BondAssociated) -> bool:
    """Whether families of a law, on a cloud of its horizon, share blocks of threads that find shape tensors."""
    near = capabilities(law.material).near
    able = law.fast and law.weights != "published" and law.broken == "drop" and near is not None
    return able and law.horizon <= MAX_COMPACT


def compact_tables(law: Law, sheet: Sheet, device: wp.Device) -> str:
    """Name of the influence function if the families are those of kernels/compact_clouds.py, or empty."""
    flat_cloud = sheet.layout == "cloud" and sheet.frames is None and sheet.size < MAX_COMPACT_POINTS
    pays = law.horizon <= FREE_COMPACT or sheet.size >= COMPACT_FROM
    if not (law.compact and flat_cloud and pays and shares_memory(device)):
        return ""
    return law.compact if sheet.spacings is None else "table"


def shares_memory(device: wp.Device) -> bool:
    """Whether the threads of a block have shared memory."""
    return bool(device.is_cuda)


# What only viscous laws give to the kernel of a CPU.
NO_PRONY: dict[str, Any] = {"step": None, "prony": None, "strain": None, "overstress": None, "viscous_work": None}


def sums_rows(force: BondAssociatedLaw) -> bool:
    """Whether the kernel of a CPU can take a law on a sheet."""
    return not shares_memory(force.context.device) and force.families.members <= MAX_CPU_MEMBERS


class RowSums:
    """The fast kernels of a CPU.

    Attributes:
        kernels: By what they fill in, see `family_rows`.
    """

    def __init__(self, force: BondAssociatedLaw, what: Sequence[str] = ("force", "energy")) -> None:
        self.force = force
        layout, bits, material, broken, _ = force.key
        near, words = capabilities(force.material).near, -(-force.families.members // WORD)
        self.kernels = {
            name: family_rows(layout, bits, material, near, broken, words, name, force.context.module) for name in what
        }

    def breaks_bonds(self, breaking: BondBreaking) -> bool:
        """They cannot."""
        return False

    def add_force(self, stage: Stage, displacement: Array, force: Array, breaking: BondBreaking | None) -> None:
        """Add the launches of the internal force [N] at a displacement [m], both (N,) vec3."""
        assert breaking is None
        self.add_pairs(stage, displacement, "force", NO_PRONY)
        self.force.add_gather(stage, self.force.kernels.gather, self.force.pairs, force)

    def add_pairs(self, stage: Stage, displacement: Array, what: str, prony: Mapping[str, Any]) -> None:
        """Add the launch that fills the forces of each family on its pairs [N]; `what` as for `family_rows`."""
        law = self.force
        stage.launch(
            law.owner, self.kernels[what], law.points, **law.family_arguments(displacement), constants=law.constants,
            unit=law.unit_volume * law.inverse_horizon, bond_force=law.pairs, energies=None, **prony,
        )  # fmt: skip

    def add_energy(self, stage: Stage, displacement: Array, energies: Array) -> None:
        """Add the launch of the energy of each family [J], (N,) float64, at a displacement [m], (N,) vec3."""
        law = self.force
        stage.launch(
            law.owner, self.kernels["energy"], law.points, **law.family_arguments(displacement),
            constants=law.constants, unit=law.unit_volume, bond_force=None, energies=energies, **NO_PRONY,
        )  # fmt: skip


class FastPath:
    """The fast kernels of a GPU.

    Attributes:
        near: Factory of the material's stress_near.
        stencil: Stencil of undamaged inner families and the class that they share, or None.
        listed: Whether all other families are on a list.
        gridded: Whether the sheet is a grid with gaps.
    """

    def __init__(self, force: BondAssociatedLaw, near: FunctionFactory, stencil: tuple[Stencil, int] | None) -> None:
        self.force, self.near, self.stencil = force, near, stencil
        w: Context = force.context
        vec3 = w.types.vec3
        self.listed = stencil is not None
        self.gridded = force.families.layout == "grid"
        # Several processes divide launches around exchanges, and lists of damaged families are of the whole sheet.
        self.beside = self.listed and w.partition is None and force.intact is None
        self.lists = None if stencil is None else Lists.of(force, self.whole_families, stencil[1])
        self.compact = is_compact(w.layout)
        # The families of a cloud are all alike to their kernel: its strips may be short, and then stay in the cache.
        self.ring = CLOUD_RING if self.compact else RING
        here, divided = self.whole_families, self.listed or (self.compact and w.partition is None)
        self.strips = self._strips() if divided else [Strip(0, here.start, here.stop, 0, force.points)]
        self.lag = LAG if self.beside and len(self.strips) > 1 else 0
        self.moments: Array | None = None
        if not self.compact:
            self.moments = w.array("moments", force.owner, vec3, moments_of(force.families), per="table")
        members = force.families.members
        if len(self.strips) > 1:
            self.bond_force = w.array("bond_force_ring", force.owner, vec3, shape=(members, self.ring), per="bond")
        else:
            self.bond_force = force.pairs

    @property
    def _drops(self) -> bool:
        """Whether inner families that lost bonds have a kernel: not if others get their weight, or they fade."""
        return self.force.key[3] == "drop" and not self.force.context.features.gradual

    @property
    def whole_families(self) -> slice:
        """Points around all whole families; the empty ones of the outermost halo would take as long as others."""
        partition = self.force.context.partition
        return slice(0, self.force.points) if partition is None else partition.whole_families

    def _strips(self) -> list[Strip]:
        """Strips of the sheet, each with the points whose force is complete after it."""
        points, reach = self.force.points, self.force.families.index_reach
        if not self.beside:
            return long_strips(self.whole_families, points, reach() if points > 2 * self.ring else 0, self.ring)
        around = reach() if points >= STRIPS_FROM else points
        strips = short_strips(self.whole_families, points, around, STRIP, ROOM)
        self.ring = ROOM * strips[0].size + 2 * around
        return strips

    def add_force(self, stage: Stage, displacement: Array, force: Array, breaking: BondBreaking | None) -> None:
        """Add the launches of the internal force [N] at a displacement [m], both (N,) vec3; bonds may break before."""
        if self.lag:
            self._add_short_strips(stage, displacement, force)
            return
        for strip in self.strips:
            if self.lists is None:
                self._add_shared(stage, Run(None, None, strip.begin, strip.end), displacement, force, breaking)
            else:
                self._add_listed(stage, strip, self.lists, displacement, force, breaking)
            self._add_gather(stage, strip, force)

    def _add_short_strips(self, stage: Stage, displacement: Array, force: Array) -> None:
        """Strips beside each other: one fills the GPU when the other one comes to its end."""
        assert self.lists is not None and self.stencil is not None
        for number in range(len(self.strips) + self.lag):
            part = OfStrip(number, SECOND if number % 2 else MAIN, listed=False, apart=self.lag)
            if number >= len(self.strips):
                self._add_gather(stage, self.strips[number - self.lag], force, part)
                continue
            strip = self.strips[number]
            self._add_undamaged(stage, strip, *self.stencil, displacement, force, None, part)
            edges, part = self.lists.edges_between(strip.begin, strip.end), OfStrip(number, SIDE, True, self.lag)
            self._add_shared(stage, edges, displacement, force, None, part=part)

    def _add_listed(
        self, stage: Stage, strip: Strip, lists: Lists, displacement: Array, force: Array,
        breaking: BondBreaking | None,
    ) -> None:  # fmt: skip
        """Kernels of inner families and of all others, beside each other on one GPU if bonds cannot break.

        A few families keep a GPU waiting as long as a hundred thousand. Where bonds can break, it gained nothing.
        """
        assert self.stencil is not None
        law, beside = self.force, self.beside
        undamaged = (stage, strip, *self.stencil, displacement, force, breaking)
        if not beside:
            # What exchanges wait for comes first.
            self._add_undamaged(*undamaged)
        if lists.damaged is not None:
            assert law.intact is not None
            stage.launch(
                law.owner, changed_families(law.context.module), strip.end - strip.begin, begin=strip.begin,
                family_class=law.struct.family_class, inner=self.stencil[1], full=self.stencil[0].all_members,
                intact=law.intact, damaged_points=lists.damaged, damaged_count=lists.counts[1:],
            )  # fmt: skip
        edges = lists.edges_between(strip.begin, strip.end)
        self._add_shared(stage, edges, displacement, force, breaking, beside=beside)
        if lists.damaged is not None and self._drops:
            self._add_damaged(stage, lists, *self.stencil, displacement, force, breaking)
        elif lists.damaged is not None:
            changed = Run(lists.damaged, lists.counts[1:], 0, law.points)
            self._add_shared(stage, changed, displacement, force, breaking)
        if beside:
            self._add_undamaged(*undamaged)
        if breaking is not None:
            near = Run(lists.near_breaking, lists.counts, 0, law.points)
            self._add_shared(stage, near, displacement, force, breaking)

    def breaks_bonds(self, breaking: BondBreaking) -> bool:
        """The kernel of undamaged families must know which of them stay so."""
        return self.stencil is None or breaking.squared_stretch is not None

    def add_energy(self, stage: Stage, displacement: Array, energies: Array) -> None:
        """Add the launch of the energy of each family [J], (N,) float64: that of the reference kernels."""
        self.force.add_reference_energy(stage, displacement, energies)

    def _add_undamaged(
        self, stage: Stage, strip: Strip, stencil: Stencil, inner: int, displacement: Array, force: Array,
        breaking: BondBreaking | None, part: OfStrip | None = None,
    ) -> None:  # fmt: skip
        law = self.force
        gather, gathering, begin, end = None, 0, 0, 0
        if self.lag:
            earlier = self.strips[max(strip.number - self.lag, 0)]
            gather, values = self._gather(earlier, force)
            gathering = with_values(gather.arguments(), values)
            if strip.number >= self.lag:
                begin, end = earlier.gather_begin, earlier.gather_end
        stage.launch(
            law.owner, self._lattice_kernel(stencil, False, breaking, gather), strip.size, begin=strip.begin,
            block_dim=UNDAMAGED_BLOCK, beside=self.beside and part is None, strip=part,
            family_class=law.struct.family_class, gathering=gathering, gather_begin=begin, gather_end=end,
            stride=strip.size, inner=inner, **self._of_lattice(stage, stencil, inner, displacement, force, breaking),
        )  # fmt: skip

    def _add_damaged(
        self, stage: Stage, lists: Lists, stencil: Stencil, inner: int, displacement: Array, force: Array,
        breaking: BondBreaking | None,
    ) -> None:  # fmt: skip
        stage.launch(
            self.force.owner, self._lattice_kernel(stencil, True, breaking), DAMAGED_THREADS, block_dim=UNDAMAGED_BLOCK,
            damaged_points=lists.damaged, damaged_count=lists.counts[1:],
            stride=DAMAGED_THREADS, **self._of_lattice(stage, stencil, inner, displacement, force, breaking),
        )  # fmt: skip

    def _lattice_kernel(
        self, stencil: Stencil, damaged: bool, breaking: BondBreaking | None, gather: Pointwise | None = None
    ) -> Kernel:
        _, bits, _, broken, _ = self.force.key
        return undamaged_lattice_force(
            bits, self.near, stencil, self.gridded, broken is not None, breaking is not None, damaged, gather,
            self.force.context.module,
        )  # fmt: skip

    def _of_lattice(
        self, stage: Stage, stencil: Stencil, inner: int, displacement: Array, force: Array,
        breaking: BondBreaking | None,
    ) -> dict[str, Any]:  # fmt: skip
        """Arguments of both kernels of inner families."""
        law, lists = self.force, self.lists
        assert lists is not None
        return {
            "intact": law.intact, "displacement": displacement,
            "places": law.struct.centres if self.gridded else law.lattice_columns,
            # An argument, not a constant, so that the compiler does not unroll the loop over the turns.
            "turns": stencil.turns, "constants": law.constants, "inverse_horizon": law.inverse_horizon,
            "unit_force": law.unit_volume * law.inverse_horizon * law.families.areas[inner],
            "others": lists.near_breaking,
            "squared_stretch": breaking.squared_stretch if breaking is not None and breaking.acts(stage) else np.inf,
            "other_count": lists.counts, "bond_force": self.bond_force, "force": force,
        }  # fmt: skip

    def _add_shared(
        self, stage: Stage, run: Run, displacement: Array, force: Array, breaking: BondBreaking | None,
        beside: bool = False, part: OfStrip | None = None,
    ) -> None:  # fmt: skip
        law, w = self.force, self.force.context
        layout, bits, material, broken, _ = law.key
        members, listed = law.families.members, run.points is not None
        if run.stop == run.start:
            return
        together, sharing = families_together(members), threads_of_family(members)
        blocks = min(-(-(run.stop - run.start) // together), MAX_LISTED_BLOCKS if listed else MAX_BLOCKS)
        kernel = block_force(
            layout, bits, material, self.near, broken, None if breaking is None else breaking.kernel, members,
            listed, w.module,
        )  # fmt: skip
        stage.launch(
            law.owner, kernel, blocks * together * sharing, block_dim=together * sharing, family=law.struct,
            side_stream=beside, beside=beside, strip=part, intact=law.intact,
            others=run.points, other_count=run.count, start=run.start, stop=run.stop,
            moments=self.moments, displacement=displacement, constants=law.constants,
            inverse_horizon=law.inverse_horizon, unit_force=law.unit_volume * law.inverse_horizon, blocks=blocks,
            breaks_now=int(breaking is not None and breaking.acts(stage)),
            criterion=0 if breaking is None else breaking.values, horizon=law.families.horizon,
            spared_mask=None if breaking is None else breaking.spared,
            remaining=None if breaking is None else law.intact,
            bond_force=self.bond_force, force=force, span=None if listed else Span(together, MAX_BLOCKS),
        )  # fmt: skip

    def _gather(self, strip: Strip, force: Array) -> tuple[Pointwise, dict[str, Any]]:
        """The stage that gathers the forces of a strip, with its arguments."""
        law, lists = self.force, self.lists
        layout, bits, _, _, _ = law.key
        counts = None if lists is None or lists.damaged is None else lists.counts
        steps = law.families.steps
        gather = gather_reverse_bonds(
            layout, bits, law.families.members, None if steps is None else tuple(map(tuple, steps.tolist())),
            self.bond_force.shape[1] < law.points, counts is not None, law.context.module,
        )  # fmt: skip
        return gather, {
            "family": law.struct, "columns": law.lattice_columns, "bond_force": self.bond_force, "other_count": counts,
            "first_point": strip.gather_begin, "force": force,
        }  # fmt: skip

    def _add_gather(self, stage: Stage, strip: Strip, force: Array, part: OfStrip | None = None) -> None:
        gather, values = self._gather(strip, force)
        points = strip.gather_end - strip.gather_begin
        stage.pointwise(self.force.owner, gather, points, begin=strip.gather_begin, strip=part, **values)
