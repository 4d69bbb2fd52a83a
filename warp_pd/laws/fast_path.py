"""Fast kernels of the variational bond-associated law, and when they are used.

On a CPU one kernel serves all families. On a GPU undamaged families inside a lattice or grid have a separate
kernel, if the material is isotropic. It puts all other points on a list, which a second kernel works through with two
bonds per thread. Clouds, and sheets too small to fill a GPU with one thread per point, use only the second kernel.

The bond forces of large lattices pass through a ring buffer, some strips of the sheet at a time: all of them would take
most of the memory. Two strips run beside each other, and gather the forces of earlier ones between their own: what
waits for memory and what computes fill the same processors.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import warp as wp

from ..device.context import Context
from ..device.fields import Array
from ..device.launches import OfStrip, Span, Stage, with_values
from ..device.streams import MAIN, SECOND, SIDE
from ..interfaces import BondBreaking
from ..kernels.factories import FunctionFactory
from ..kernels.families import WORD
from ..kernels.family_blocks import block_force, families_together, threads_of_family
from ..kernels.family_rows import family_rows
from ..kernels.pointwise import Pointwise
from ..kernels.reverse_bonds import gather_reverse_bonds
from ..kernels.undamaged_lattice import Stencil, undamaged_lattice_force
from ..materials import capabilities
from .strips import Listed, Strip, found_lists, known_lists, strips_of
from .undamaged_lattice import undamaged_stencil
from .variational import BondAssociatedLaw

# Largest family whose bonds share a thread block, and largest that a CPU sums by rows; larger ones compile slowly.
MAX_MEMBERS, MAX_CPU_MEMBERS = 64, 256
# Threads per block of the kernel of undamaged families: with a family in registers, few threads fit a multiprocessor.
UNDAMAGED_BLOCK = 64
# Maximum number of blocks of the kernel of all others: enough to fill a GPU; each works until all families are done.
# With a list most blocks would find nothing, and starting them takes time.
MAX_BLOCKS, MAX_LISTED_BLOCKS = 8192, 1056
# Maximum number of threads that break bonds of a list.
MAX_LISTED_THREADS = 2**15
# Points of a strip, and number of points from which on a sheet has strips.
STRIP, STRIPS_FROM = 57_000, 2**20
# How many strips later the kernel of undamaged families gathers the forces of a strip. Two neighbouring strips are
# computed while the last but one before each of them is gathered, with what lies behind that.
LAG = 2
ROOM = LAG + 2
# The same where strips follow each other, as those of several processes do: each waits for its few families at edges.
LONG_STRIP, LONG_STRIPS_FROM = 2**20, 2**21
# Number of bonds up to which all families of a sheet use the second kernel.
MAX_SHARED = 300_000


class FastForce(Protocol):
    """Fast kernels on one sheet and device."""

    def breaks_bonds(self, breaking: BondBreaking) -> bool:
        """Whether the kernels of the force can break the bonds."""
        ...

    def add_force(self, stage: Stage, displacement: Array, force: Array, breaking: BondBreaking | None) -> None:
        """Add the launches of the internal force [N] at a displacement [m], both (N,) vec3.

        In the stages of `breaking`, for which `breaks_bonds` must be true, bonds break before.
        """
        ...

    def add_energy(self, stage: Stage, displacement: Array, energies: Array) -> None:
        """Add the launch of the energy of each family [J], (N,) float64, at a displacement [m], (N,) vec3."""
        ...


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
        gridded: Whether the sheet is a grid with gaps.
    """

    def __init__(self, force: BondAssociatedLaw, near: FunctionFactory, stencil: tuple[Stencil, int] | None) -> None:
        self.force, self.near, self.stencil = force, near, stencil
        w: Context = force.context
        vec3 = w.types.vec3
        self.gridded = force.families.layout == "grid"
        # Several processes divide launches around exchanges instead (device/overlap.py).
        self.streams = w.share is None
        # The kernel of all others is compiled for its own block size.
        self.shared_module = f"{w.module}_shared_{force.families.members}"
        # Empty families of the outermost halo would take as long as others.
        here = slice(0, force.points) if w.share is None else w.share.whole_families
        reach, self.strips = 0, [Strip(0, here.start, here.stop, 0, force.points)]
        least, most, room = (STRIPS_FROM, STRIP, ROOM) if self.streams else (LONG_STRIPS_FROM, LONG_STRIP, 1)
        if stencil is not None and force.points >= least:
            reach = force.families.index_reach()
            self.strips = strips_of(here, force.points, reach, most, room)
        self.lag = LAG if self.streams and len(self.strips) > 1 else 0
        self.module = self._undamaged_module()
        # Divisions are then accurate to two units in the last place in float32 on a GPU; errors against float64 stay.
        for module in (self.module, self.shared_module):
            w.use_fast_math(module)
        self.moments = self._moments()
        self.lists: list[Listed] = []
        if stencil is not None and self.known:
            assert force.families.family_class is not None
            self.lists = known_lists(w, force.owner, self.strips, force.families.family_class != stencil[1])
        elif stencil is not None:
            self.lists = found_lists(w, force.owner, self.strips, room)
        if len(self.strips) > 1:
            shape = (force.families.members, room * self.strips[0].size + 2 * reach)
            self.bond_force = w.array("bond_force_ring", force.owner, vec3, shape=shape, per="bond")
        else:
            self.bond_force = force.pairs

    @property
    def known(self) -> bool:
        """Whether it is known from the start which families are not those of the stencil."""
        return self.streams and self.force.intact is None

    def _undamaged_module(self) -> str:
        """Name of the module of the kernel of undamaged families: all sheets that need the same kernel share it."""
        _, bits, _, broken, _ = self.force.key
        stencil = None if self.stencil is None else self.stencil[0]
        near = (self.near.__module__, self.near.__qualname__)
        gather = self.force.context.module if self.lag else None
        cuda = self.force.context.device.is_cuda
        key = (bits, near, stencil, self.gridded, broken is not None, self.known, gather, cuda)
        return "warp_pd_undamaged_" + hashlib.sha1(repr(key).encode()).hexdigest()[:12]

    def _moments(self) -> Array:
        """Array of (c_k X_k / horizon, 1 / c_k) of each row, shape (n, R); zero where there is no member."""
        families = self.force.families
        share = families.member_shares
        moments = np.zeros((families.members, len(share), 3))
        moments[..., :2] = (share[..., None] * families.bonds).transpose(1, 0, 2)
        np.divide(1.0, share.T, out=moments[..., 2], where=share.T > 0.0)
        context = self.force.context
        return context.array("moments", self.force.owner, context.types.vec3, moments, per="table")

    def add_force(self, stage: Stage, displacement: Array, force: Array, breaking: BondBreaking | None) -> None:
        """Add the launches of the internal force [N] at a displacement [m], both (N,) vec3; bonds may break before."""
        if self.stencil is None:
            self._add_shared(stage, self.strips[0], None, displacement, force, breaking)
            self._add_gather(stage, 0, force)
            return
        count = len(self.strips)
        for number in range(count + self.lag):
            # Neighbouring strips run beside each other: one fills the GPU when the other one comes to its end.
            stream = SECOND if self.lag and number % 2 else MAIN
            part = self._part(number, stream, False)
            if number >= count:
                self._add_gather(stage, number - self.lag, force, part)
                continue
            strip, others = self.strips[number], self.lists[number]
            self._add_undamaged(stage, number, *self.stencil, displacement, force, breaking, part)
            if others.most:
                part = self._part(number, SIDE, True) if self.known else part
                self._add_listed(stage, strip, others, displacement, force, breaking, part)
            if not self.lag:
                self._add_gather(stage, number, force)

    def _part(self, number: int, stream: int, listed: bool) -> OfStrip | None:
        return OfStrip(number, stream, listed, LAG) if self.lag or self.known else None

    def _add_listed(
        self, stage: Stage, strip: Strip, listed: Listed, displacement: Array, force: Array,
        breaking: BondBreaking | None, part: OfStrip | None,
    ) -> None:  # fmt: skip
        """Add the launches of the families of a list, whose bonds break before, if energies are summed up."""
        if breaking is not None and breaking.before is not None:
            if breaking.acts(stage):
                threads = min(listed.most, MAX_LISTED_THREADS)
                breaking.before(stage, listed.points, listed.count, threads, part)
            breaking = None
        self._add_shared(stage, strip, listed, displacement, force, breaking, part)

    def breaks_bonds(self, breaking: BondBreaking) -> bool:
        """The kernel of undamaged families must know which of them stay so; without it, no list is known before."""
        return breaking.before is None if self.stencil is None else breaking.squared_stretch is not None

    def add_energy(self, stage: Stage, displacement: Array, energies: Array) -> None:
        """Add the launch of the energy of each family [J], (N,) float64: that of the reference kernels."""
        self.force.add_reference_energy(stage, displacement, energies)

    def _add_undamaged(
        self, stage: Stage, number: int, stencil: Stencil, inner: int, displacement: Array, force: Array,
        breaking: BondBreaking | None, part: OfStrip | None,
    ) -> None:  # fmt: skip
        law, strip, others = self.force, self.strips[number], None if self.known else self.lists[number]
        gather, gathering, begin, end = None, 0, 0, 0
        if self.lag:
            gather, values = self._gather(max(number - self.lag, 0), force)
            gathering = with_values(gather.arguments(), values)
            if number >= self.lag:
                begin, end = self.strips[number - self.lag].gather_begin, self.strips[number - self.lag].gather_end
        _, bits, _, broken, _ = law.key
        kernel = undamaged_lattice_force(
            bits, self.near, stencil, self.gridded, broken is not None, breaking is not None, not self.known, gather,
            self.module,
        )  # fmt: skip
        stage.launch(
            law.owner, kernel, strip.size, begin=strip.begin, block_dim=UNDAMAGED_BLOCK, strip=part,
            family_class=law.struct.family_class, inner=inner, intact=law.intact, displacement=displacement,
            places=law.struct.centres if self.gridded else law.lattice_columns,
            # An argument, not a constant, so that the compiler does not unroll the loop over the turns.
            turns=stencil.turns, constants=law.constants, inverse_horizon=law.inverse_horizon,
            unit_force=law.unit_volume * law.inverse_horizon * law.families.areas[inner],
            squared_stretch=breaking.squared_stretch if breaking is not None and breaking.acts(stage) else np.inf,
            gathering=gathering, gather_begin=begin, gather_end=end, stride=strip.size,
            others=None if others is None else others.points, other_count=None if others is None else others.count,
            bond_force=self.bond_force, force=force,
        )  # fmt: skip

    def _add_shared(
        self, stage: Stage, strip: Strip, listed: Listed | None, displacement: Array, force: Array,
        breaking: BondBreaking | None, part: OfStrip | None = None,
    ) -> None:  # fmt: skip
        """Add the launch of the families of a list, or of all of a strip."""
        law, w = self.force, self.force.context
        layout, bits, material, broken, _ = law.key
        members = law.families.members
        together, sharing = families_together(members), threads_of_family(members)
        if listed is None:
            blocks = min(-(-strip.size // together), MAX_BLOCKS)
        else:
            blocks = min(-(-listed.most // together), MAX_LISTED_BLOCKS)
        kernel = block_force(
            layout, bits, material, self.near, broken, None if breaking is None else breaking.kernel, members,
            listed is not None, w.module, self.shared_module,
        )  # fmt: skip
        stage.launch(
            law.owner, kernel, blocks * together * sharing, block_dim=together * sharing, strip=part,
            family=law.struct, intact=law.intact,
            others=None if listed is None else listed.points,
            other_count=None if listed is None else listed.count, start=strip.begin, stop=strip.end,
            moments=self.moments, displacement=displacement, constants=law.constants,
            inverse_horizon=law.inverse_horizon, unit_force=law.unit_volume * law.inverse_horizon, blocks=blocks,
            breaks_now=int(breaking is not None and breaking.acts(stage)),
            criterion=0 if breaking is None else breaking.values, horizon=law.families.horizon,
            spared_mask=None if breaking is None else breaking.spared,
            remaining=None if breaking is None else law.intact,
            bond_force=self.bond_force, force=force, span=Span(together, MAX_BLOCKS) if listed is None else None,
        )  # fmt: skip

    def _gather(self, number: int, force: Array) -> tuple[Pointwise, dict[str, Any]]:
        """The stage that gathers the forces of a strip, with its arguments."""
        law, w, strip = self.force, self.force.context, self.strips[number]
        used = None if self.stencil is None or self.known else self.lists[number]
        layout, bits, _, _, _ = law.key
        steps, members = law.families.steps, law.families.members
        gather = gather_reverse_bonds(
            layout, bits, members, None if steps is None else tuple(map(tuple, steps.tolist())),
            self.bond_force.shape[1] < law.points, used is not None, w.module,
        )  # fmt: skip
        return gather, {
            "family": law.struct, "columns": law.lattice_columns, "bond_force": self.bond_force,
            "other_count": None if used is None else used.count, "first_point": strip.gather_begin, "force": force,
        }  # fmt: skip

    def _add_gather(self, stage: Stage, number: int, force: Array, part: OfStrip | None = None) -> None:
        strip = self.strips[number]
        gather, values = self._gather(number, force)
        threads = strip.gather_end - strip.gather_begin
        stage.pointwise(self.force.owner, gather, threads, begin=strip.gather_begin, strip=part, **values)
