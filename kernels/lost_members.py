"""Families of a lattice without the members that they lost; see kernels/undamaged_lattice.py."""

import functools
from dataclasses import dataclass

import warp as wp

from .bits import bit_of
from .effects import Kernel, kernel
from .kinematics import SAMPLE
from .numeric import numeric


@dataclass(frozen=True)
class LostMembers:
    """Warp functions of one precision; `lost` are the bits of lost members.

    Attributes:
        turn_shape: A tensor (11, 12, 22) in axes rotated by 90 degrees, or by 180.
        kept: (v, lost, k) -> v, or zero if member k is lost.
        add_if: (sum, here, part) -> the sum, with one more part if it is there.
        left_of: (K, undamaged det K^-1, whether the bond is lost) -> inverse of what is left of K, or zero.
    """

    turn_shape: wp.Function
    kept: wp.Function
    add_if: wp.Function
    left_of: wp.Function


@functools.cache
def lost_members(bits: int, half: bool) -> LostMembers:
    """The functions; with `half` axes rotate by 180 degrees."""
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @wp.func
    def turn_shape(shape: vec3):
        """A tensor (11, 12, 22) in those axes."""
        if wp.static(half):
            return shape
        else:
            return vec3(shape[2], -shape[1], shape[0])

    @wp.func
    def kept(v: vec3, lost: wp.uint32, k: int):
        """A vector of a member, or zero if the member is lost."""
        return wp.where(bit_of(lost, k), vec3(real(0.0), real(0.0), real(0.0)), v)

    @wp.func_native("if (here) for (int a = 0; a < 3; ++a) sum[a] += part[a]; return sum;")
    def add_if(sum: vec3, here: bool, part: vec3) -> vec3:
        """The sum with one more part, if it is there."""
        ...

    @wp.func
    def left_of(shape: vec3, undamaged_determinant: real, bond_lost: bool):
        """Inverse of what is left of a shape tensor, as `remaining_inverse`, or zero; also if its bond is lost."""
        determinant = shape[0] * shape[2] - shape[1] * shape[1]
        inverse = vec3(real(0.0), real(0.0), real(0.0))
        if determinant * undamaged_determinant >= real(wp.static(SAMPLE)) and not bond_lost:
            part = real(1.0) / determinant
            inverse = vec3(part * shape[2], -part * shape[1], part * shape[0])
        return inverse

    return LostMembers(turn_shape, kept, add_if, left_of)


@functools.cache
def changed_families(module: str) -> Kernel:
    """Kernel that lists the inner points that have lost bonds, in any order."""

    @kernel(module, per="list")
    def changed_families(
        family_class: wp.array(dtype=wp.int32),
        inner: int,
        full: wp.uint32,
        intact: wp.array2d(dtype=wp.uint32),
        first: int,
        damaged_points: wp.array(dtype=wp.int32),
        damaged_count: wp.array(dtype=wp.int32),
    ):
        i = wp.tid() + first
        if (wp.uint32(family_class[i] - inner) | (intact[0, i] ^ full)) != wp.uint32(0):
            if family_class[i] == inner:
                damaged_points[wp.atomic_add(damaged_count, 0, 1)] = i

    return changed_families
