"""Fast kernels of the variational bond-associated law, and when they are taken.

Whole families inside a square lattice have a kernel of their own, if the material is isotropic. On a GPU it puts all
other points on a list, which a second kernel works off with the family in registers, so that threads side by side
do the same; on clouds there is only the second. On a CPU registers are few: there all others take the plain kernel.

Small sheets do not fill a GPU with a thread a point: there every thread has one bond.

The forces between the points of large lattices pass through a ring, a strip of the sheet at a time: they would take
most of the memory, and a strip of them stays in the cache of a GPU.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from .whole_lattice import whole_stencil

if TYPE_CHECKING:
    from .bond_associated import BondAssociatedForce

# Largest family that is held in registers; larger ones compile slowly and spill.
MOST_MEMBERS = 48
# Threads of a block: a family in registers leaves room for few threads on a processor.
BLOCK = 64
# Columns of the ring: every strip waits for the few families at edges, which take as long as 2^16 whole ones.
RING = 2**20
# On sheets of at most so many bonds a thread has one bond; in float64, where a thread a point is slower, so many more.
MOST_BOND_THREADS = {32: 400_000, 64: 1_000_000}


def fast_path(force: BondAssociatedForce, inverse: np.ndarray, weights: np.ndarray) -> FastPath | BondThreads | None:
    """The fast kernels for a force law on a sheet, or None where there are none.

    Args:
        force: The law on its sheet and device.
        inverse: K^-1 by row, shape (R, n, 3).
        weights: W over the reference area by row, shape (R, n).
    """
    material = force.law.material
    near = getattr(material, "near", None)
    if not force.law.fast or force.weights == "published" or near is None:
        return None
    stencil = whole_stencil(force.families, inverse, weights) if getattr(material, "isotropic", False) else None
    on_gpu = in_registers(force.workspace.device)
    bonds = force.points * force.families.members
    if on_gpu and bonds <= MOST_BOND_THREADS[force.workspace.bits] and force.signature[3] != "redistribute":
        return BondThreads(force, near)
    registers = on_gpu and force.families.members <= MOST_MEMBERS
    return FastPath(force, near, stencil, registers) if stencil or registers else None


def in_registers(device: Any) -> bool:
    """Whether families that are not whole are held in registers."""
    return bool(device.is_cuda)


class FastPath:
    """The fast kernels on one sheet and device.

    Attributes:
        near: Factory of the material's stress_near.
        stencil: Stencil of whole families and the kind that they share, or None.
        registers: Whether all other families are held in registers.
    """

    def __init__(self, force: BondAssociatedForce, near: Any, stencil: Any, registers: bool) -> None:
        self.force, self.near, self.stencil, self.registers = force, near, stencil, registers
        w = force.workspace
        spelled_out = repr((stencil, force.families.members)).encode()
        self.module = f"{w.module}_fast_{hashlib.sha1(spelled_out).hexdigest()[:8]}"
        # Division to two units in the last place, in float32 on a GPU; errors against float64 stay the same.
        wp.get_module(self.module).options["fast_math"] = w.bits == 32
        self.listed = registers and stencil is not None
        self.others = w.array("other_points", force.owner, wp.int32, shape=force.points) if self.listed else None
        self.other_count = w.array("other_count", force.owner, wp.int32, shape=1) if self.listed else None
        self.strips = self._strips() if self.listed else []
        members = force.families.members
        if len(self.strips) > 1:
            self.bond_force = w.array("bond_force_ring", force.owner, force.types.vec3, shape=(members, RING))
        else:
            self.bond_force = force.bond_force

    def _strips(self) -> list[Strip]:
        """Strips of the sheet, each with the points whose force is complete with it."""
        assert self.force.families.shift is not None
        points, reach = self.force.points, int(np.abs(self.force.families.shift).max())
        size = RING - 2 * reach
        if points <= 2 * RING or size < RING // 2:
            return [Strip(0, points, 0, points)]
        strips: list[Strip] = []
        for begin in range(0, points, size):
            end = min(begin + size, points)
            gathered = strips[-1].gather_end if strips else 0
            strips.append(Strip(begin, end, gathered, points if end == points else end - reach))
        return strips

    def add_force(self, stage: str, displacement: Any, force: Any) -> None:
        """Add the launches of the internal force [N] at a displacement [m], both (N,) vec3."""
        everything = Strip(0, self.force.points, 0, self.force.points)
        for strip in self.strips or [everything]:
            if self.stencil is not None:
                self._add_whole(stage, strip, displacement, force)
            if self.registers:
                self._add_registers(stage, strip, displacement, force)
        if not self.registers:
            self.force.add_plain_families(stage, displacement, inner=self.stencil[1])
            self.force.add_gather(stage, self.force.bond_force, force)

    def _add_whole(self, stage: str, strip: Strip, displacement: Any, force: Any) -> None:
        from ..kernels.whole_lattice import whole_lattice_force

        law, (stencil, inner) = self.force, self.stencil
        _, bits, _, breakable, _ = law.signature
        kernel = whole_lattice_force(bits, self.near, stencil, breakable is not None, self.listed, self.module)
        launch = law.workspace.launch(
            stage, law.owner, kernel, strip.end - strip.begin, begin=strip.begin,
            kind=law.struct.kind, inner=inner, alive=law.alive, displacement=displacement, columns=law.columns,
            # Not a number in the code: the turns must not be spelled out.
            turns=4, constants=law.constants, inverse_horizon=law.inverse_horizon,
            unit_force=law.unit_volume * law.inverse_horizon * law.families.areas[inner], others=self.others,
            other_count=self.other_count, bond_force=self.bond_force, force=force,
        )  # fmt: skip
        launch.block_dim = BLOCK

    def _add_registers(self, stage: str, strip: Strip, displacement: Any, force: Any) -> None:
        from ..kernels.family_registers import gather_mates, register_force

        law, w = self.force, self.force.workspace
        layout, bits, material, breakable, _ = law.signature
        members = law.families.members
        launch = w.launch(
            stage, law.owner,
            register_force(
                layout, bits, material, self.near, breakable, members, self.listed, w.module, self.module
            ),
            strip.end - strip.begin, family=law.struct, alive=law.alive, others=self.others,
            other_count=self.other_count, displacement=displacement, constants=law.constants,
            inverse_horizon=law.inverse_horizon, unit_force=law.unit_volume * law.inverse_horizon,
            bond_force=self.bond_force, force=force,
        )  # fmt: skip
        launch.block_dim = BLOCK
        w.launch(
            stage, law.owner, gather_mates(layout, bits, members, self.listed, w.module),
            strip.gather_end - strip.gather_begin, begin=strip.gather_begin,
            family=law.struct, bond_force=self.bond_force, other_count=self.other_count, force=force,
        )  # fmt: skip


class BondThreads:
    """A thread a bond, on one small sheet and device.

    Attributes:
        near: Factory of the material's stress_near.
    """

    def __init__(self, force: BondAssociatedForce, near: Any) -> None:
        self.force, self.near = force, near
        w = force.workspace
        self.module = f"{w.module}_bonds"
        wp.get_module(self.module).options["fast_math"] = w.bits == 32
        shape = (2, force.families.members, force.points)
        self.stress = w.array("bond_stress", force.owner, force.types.vec3, shape=shape)

    def add_force(self, stage: str, displacement: Any, force: Any) -> None:
        """Add the launches of the internal force [N] at a displacement [m], both (N,) vec3."""
        from ..kernels.bond_threads import bond_threads

        law, w = self.force, self.force.workspace
        layout, bits, material, breakable, _ = law.signature
        threads = law.points * law.families.members
        bond_stress, member_force = bond_threads(layout, bits, material, self.near, w.module, self.module, breakable)
        w.launch(
            stage, law.owner, bond_stress, threads,
            **law.family_arguments(displacement), constants=law.constants, stress=self.stress,
        )  # fmt: skip
        w.launch(
            stage, law.owner, member_force, threads,
            family=law.struct, alive=law.alive, stress=self.stress,
            unit_force=law.unit_volume * law.inverse_horizon, bond_force=law.bond_force,
        )  # fmt: skip
        law.add_gather(stage, law.bond_force, force)


@dataclass(frozen=True)
class Strip:
    """Points begin to end - 1 of a sheet, and those whose force is complete with the forces of these families."""

    begin: int
    end: int
    gather_begin: int
    gather_end: int
