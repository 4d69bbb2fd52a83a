"""Force paths of the bond-associated law on a GPU (ways to compute the force).

A thread block works on several families, two bonds per thread; in a large lattice or grid a separate kernel handles
undamaged families, and thread blocks work on a list of all others.

The pair forces of a large sheet pass through a ring buffer, one strip of the sheet at a time, because storing all of
them would take most of the memory.
"""

from __future__ import annotations

import math
import weakref
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import warp as wp

from ..device.fields import Array
from ..device.launches import Span, Stage, with_values
from ..families.partition import ALIGNED
from ..kernels.fast.family_blocks import FamilyBlock, block_force
from ..kernels.fast.reverse_bonds import gather_reverse_bonds
from ..kernels.fast.stencil import Stencil
from ..kernels.fast.undamaged_lattice import undamaged_lattice_force
from ..kernels.numeric import FunctionFactory
from ..kernels.tearing.damage_field import OtherFamilies
from ..laws.force_paths import BondAssociatedLaw, Reference
from ..laws.weight_tables import moments_of
from ..materials import capabilities
from .undamaged_lattice import undamaged_stencil


@dataclass(frozen=True)
class Tuning:
    """Constants that select the path of a sheet and divide the work of its kernels; measured in docs/performance.md."""

    # Largest family that is divided among a block of threads; larger ones compile slowly.
    block_members: int = 64
    # Bonds of a thread of a block; more where that leaves enough threads to fill a GPU, which takes this many bonds.
    bonds_of_thread: int = 2
    many_bonds_of_thread: int = 4
    block_bonds: int = 2_000_000
    # Number of bonds of a sheet from which on undamaged families have their own kernel: fewer do not fill a GPU with
    # one thread a point.
    lattice_bonds: int = 300_000
    # Threads per block of that kernel, twice as many in float64: with a family in registers, few threads fit a
    # multiprocessor; in float64 it does not fit, and is read again.
    lattice_block: int = 64
    # Maximum number of blocks of families: enough to fill a GPU; each works until all families are done. With a list
    # most blocks would find nothing, and starting them takes time.
    blocks: int = 8192
    listed_blocks: int = 1056
    # Columns of the ring of a lattice, from twice as many points on. Every strip waits for its few other families,
    # which take as long as 2^16 undamaged ones.
    ring: int = 2**19


TUNING = Tuning()


@dataclass(frozen=True)
class Strip:
    """A strip of a sheet: points begin to end - 1, and the points whose force is complete after this strip."""

    begin: int
    end: int
    gather_begin: int
    gather_end: int


def strips_of(here: slice, points: int, reach: int, ring: int) -> list[Strip]:
    """Divide a sheet into strips that pass through a ring buffer of `ring` columns; a single strip for small sheets.

    The forces of a strip stay in the buffer until the points of this and the previous strip have gathered them.

    Args:
        here: Points with nonempty families.
        points: Number of points.
        reach: Largest difference of the indices of two points that share a bond.
        ring: Number of columns.
    """
    # Strips end where lines of memory do, as far as columns of the ring do.
    step = math.gcd(ring, ALIGNED)
    size = ring - 2 * reach - step + 1
    if points <= 2 * ring or size < ring // 2:
        return [Strip(here.start, here.stop, 0, points)]
    strips: list[Strip] = []
    begin, gathered = here.start, 0
    while begin < here.stop:
        end = min((begin + size) // step * step, here.stop)
        complete = points if end == here.stop else (end - reach) // step * step
        strips.append(Strip(begin, end, gathered, complete))
        begin, gathered = end, complete
    return strips


class BondForces:
    """The pair forces, [members, points] or a ring buffer of fewer columns, and the stage that gathers them.

    Attributes:
        strips: Strips of the sheet, in order.
        array: The forces [N], vec3.
    """

    def __init__(self, law: BondAssociatedLaw, ring: int | None = None) -> None:
        self.law: BondAssociatedLaw = weakref.proxy(law)
        here, points = whole_families(law), law.points
        self.entries = reverse_entries(law)
        self.strips = [Strip(here.start, here.stop, 0, points)]
        if ring is not None:
            self.strips = strips_of(here, points, law.families.index_reach(), ring)
        if len(self.strips) == 1:
            self.array = law.pairs
            return
        shape = (law.families.members, ring)
        self.array = law.context.array(
            "bond_force_ring", law.owner, law.context.types.vec3, shape=shape, per="bond", intermediate=True
        )

    @property
    def turns_over(self) -> bool:
        """Whether strips reuse the columns of earlier ones."""
        return len(self.strips) > 1

    def add_gather(self, stage: Stage, strip: Strip, force: Array, other_count: Array | None = None) -> None:
        """Add the stage that gathers the forces of a strip, and empties the list of other families if given."""
        law = self.law
        steps = law.families.steps
        gather = gather_reverse_bonds(
            law.layout, law.families.members, None if steps is None else tuple(map(tuple, steps.tolist())),
            self.turns_over, other_count is not None, self.entries is not None,
        )  # fmt: skip
        # The launch may leave ghost points out.
        partition = law.context.partition
        first = strip.gather_begin if partition is None else max(strip.gather_begin, partition.owned.start)
        stage.pointwise(
            law.owner, gather, strip.gather_end - strip.gather_begin, begin=strip.gather_begin, family=law.struct,
            columns=law.lattice_columns, bond_force=self.array, damage=law.damage, near_damage=law.near_damage,
            other_count=other_count, entries=self.entries, first_point=first, force=force,
        )  # fmt: skip


def reverse_entries(law: BondAssociatedLaw) -> Array | None:
    """Index of the entry of each bond's reverse bond in [members, points], int32; None where it is of no use.

    Bonds that do not exist have their own index: the force of their family on them is zero.
    """
    families, points = law.families, law.points
    many = families.members * points >= 2**31
    if families.layout != "cloud" or law.context.partition is not None or many:
        return None
    assert families.neighbours is not None
    own = np.arange(points, dtype=np.int32) + points * np.arange(families.members, dtype=np.int32)[:, None]
    to = families.reverses.T.astype(np.int32) * points + families.neighbours.T
    return law.context.array("reverse_entries", law.owner, wp.int32, np.where(families.exists.T, to, own), per="table")


def whole_families(law: BondAssociatedLaw) -> slice:
    """Range of points with complete families; empty families of the outermost halo would waste time."""
    partition = law.context.partition
    return slice(0, law.points) if partition is None else partition.whole_families


@dataclass(frozen=True)
class Selected:
    """A selection of families: the points start to stop - 1, or these entries of a list.

    Attributes:
        start: First point or entry.
        stop: Last point or entry, plus 1.
        points: The list, or None.
        count: Device array with the number of entries of the list, or None.
    """

    start: int
    stop: int
    points: Array | None = None
    count: Array | None = None


class FamilyBlocks(Reference):
    """The GPU path with several families per thread block.

    Attributes:
        near: Factory of the material's stress_near.
    """

    name: ClassVar[str] = "blocks"

    def __init__(self, law: BondAssociatedLaw, near: FunctionFactory, forces: BondForces) -> None:
        super().__init__(law)
        self.near, self.forces = near, forces
        context = law.context
        self.moments = context.array("moments", law.owner, context.types.vec3, moments_of(law.families), per="table")

    @staticmethod
    def near_stress(law: BondAssociatedLaw) -> FunctionFactory | None:
        """Factory of the material's stress_near, or None if thread blocks do not support the law here."""
        return capabilities(law.material).near if law.families.members <= TUNING.block_members else None

    @classmethod
    def of(cls, law: BondAssociatedLaw, inverse: np.ndarray, weights: np.ndarray) -> Reference | None:
        """The path on a GPU if families are not too large and the material has stress_near; see `Reference.of`."""
        near = cls.near_stress(law)
        if near is None:
            return None
        return cls(law, near, BondForces(law))

    def add_others(self, stage: Stage, displacement: Array, force: Array) -> None:
        """Add the launches of each strip."""
        for strip in self.forces.strips:
            self.add_families(stage, Selected(strip.begin, strip.end), displacement, force)
            self.forces.add_gather(stage, strip, force)

    def add_families(self, stage: Stage, chosen: Selected, displacement: Array, force: Array) -> None:
        """Add the launch for the selected families."""
        law = self.law
        members, count = law.families.members, chosen.stop - chosen.start
        listed = chosen.points is not None
        if not count:
            return
        # By the whole sheet: several processes get the bits of one.
        many = not listed and law.context.bits == 32 and law.context.whole.size * members > TUNING.block_bonds
        block = FamilyBlock(members, TUNING.many_bonds_of_thread if many else TUNING.bonds_of_thread)
        blocks = min(-(-count // block.together), TUNING.listed_blocks if listed else TUNING.blocks)
        kernel = block_force(law.layout, self.near, block, listed, self.forces.turns_over)
        stage.launch(
            law.owner, kernel, blocks * block.threads, block_dim=block.threads, family=law.struct,
            others=chosen.points, other_count=chosen.count, start=chosen.start, stop=chosen.stop,
            moments=self.moments, displacement=displacement, constants=law.constants,
            unit_force=law.unit_force, blocks=blocks,
            bond_force=self.forces.array, force=force, span=None if listed else Span(block.together, TUNING.blocks),
        )  # fmt: skip


class UndamagedLattice(Reference):
    """The GPU path with a separate kernel for undamaged families inside a lattice or grid; others in thread blocks.

    Attributes:
        stencil: Stencil of the undamaged inner families.
        inner: Index of the table row that they share.
    """

    name: ClassVar[str] = "undamaged lattice"

    def __init__(self, law: BondAssociatedLaw, near: FunctionFactory, stencil: Stencil, inner: int) -> None:
        super().__init__(law)
        self.stencil, self.inner = stencil, inner
        context, breakable = law.context, law.layout.breakable
        self.forces = BondForces(law, TUNING.ring)
        self.blocks = FamilyBlocks(law, near, self.forces)
        gridded = law.families.layout == "grid"
        self.places = law.struct.centres if gridded else law.lattice_columns
        self.kernel = undamaged_lattice_force(context.bits, near, stencil, gridded, breakable)
        here = whole_families(law)
        assert law.families.family_class is not None
        self.edges = np.flatnonzero(law.families.family_class[here] != inner).astype(np.int32) + np.int32(here.start)
        # Where bonds can break, the kernel finds the others; else they are those at edges.
        listed = None if breakable else self.edges if len(self.edges) else np.zeros(1, np.int32)
        count = None if breakable else np.array([len(self.edges)], np.int32)
        self.others = context.array("other_points", law.owner, wp.int32, listed, shape=law.points, per="table")
        self.count = context.array("other_count", law.owner, wp.int32, count, shape=1, per="once")
        if breakable:
            values = {
                "family_class": law.struct.family_class, "inner": inner, "undamaged": (1 << law.families.members) - 1,
                "stop": self.forces.strips[0].end, "points": self.others, "count": self.count,
            }  # fmt: skip
            self.other_families = with_values(OtherFamilies(), values)

    @classmethod
    def of(cls, law: BondAssociatedLaw, inverse: np.ndarray, weights: np.ndarray) -> Reference | None:
        """The path on a large, uniform lattice or grid with an isotropic material if FamilyBlocks applies, too."""
        near = FamilyBlocks.near_stress(law)
        # By the whole sheet: several processes take the same path as one.
        whole = law.context.whole
        large = whole.size * law.families.members > TUNING.lattice_bonds and np.ndim(whole.thickness) == 0
        if near is None or not large or not capabilities(law.material).isotropic:
            return None
        found = undamaged_stencil(law.families, inverse, weights)
        return None if found is None else cls(law, near, *found)

    def add_undamaged(self, stage: Stage, displacement: Array, force: Array) -> None:
        """Add the launch of the undamaged families of the first strip, which need not wait for an exchange."""
        self._add_strip(stage, self.forces.strips[0], displacement, force)

    def add_others(self, stage: Stage, displacement: Array, force: Array) -> None:
        """Add the launches of each strip, without that of `add_undamaged`."""
        for number, strip in enumerate(self.forces.strips):
            if number > 0:
                self._add_strip(stage, strip, displacement, force)
            self._add_others(stage, strip, displacement, force)

    def _add_strip(self, stage: Stage, strip: Strip, displacement: Array, force: Array) -> None:
        """Add the launch of the undamaged families of a strip."""
        law = self.law
        listed = (self.others, self.count) if law.layout.breakable else (None, None)
        stage.launch(
            law.owner, self.kernel, strip.end - strip.begin, begin=strip.begin,
            block_dim=TUNING.lattice_block * law.context.bits // 32,
            family_class=law.struct.family_class, inner=self.inner, intact=law.intact, displacement=displacement,
            places=self.places,
            # An argument, not a constant, so that the compiler does not unroll the loop over the turns.
            turns=self.stencil.turns, constants=law.constants, inverse_horizon=law.inverse_horizon,
            unit_force=law.unit_force * law.families.areas[self.inner],
            bond_force=self.forces.array, force=force, others=listed[0], other_count=listed[1],
        )  # fmt: skip

    def _add_others(self, stage: Stage, strip: Strip, displacement: Array, force: Array) -> None:
        """Add the launches of the other families of a strip, and the gather of its forces."""
        law = self.law
        if law.intact is None:
            start, stop = np.searchsorted(self.edges, (strip.begin, strip.end)).tolist()
            edges = Selected(start, stop, self.others, self.count)
            self.blocks.add_families(stage, edges, displacement, force)
            self.forces.add_gather(stage, strip, force)
            return
        self.blocks.add_families(stage, Selected(0, law.points, self.others, self.count), displacement, force)
        self.forces.add_gather(stage, strip, force, self.count)


# In the order in which they are tried.
PATHS = (UndamagedLattice, FamilyBlocks)
