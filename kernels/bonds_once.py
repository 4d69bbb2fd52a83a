"""Forces of a lattice's bonds, each computed once, for a CPU.

The members of a stencil are sorted so that the reverse of member k is member n - 1 - k: the second half of them lies
ahead of the point. A thread computes the bonds ahead of its point; a second kernel sums both halves, those behind with
the other sign, in the order of the members. The two ends of a bond agree to the last bit, and so do the sums with those
of `sums_of_bonds`, which computes every bond at both ends.

The tables are arguments of their own, as a struct would be copied for every point, and the number of members is known
when the kernel is compiled, which spells out the loops of short stencils: together 2.3 times as fast as without.
"""

import functools

import warp as wp

from .bits import bit_of
from .effects import Kernel, kernel
from .families import WORD
from .numeric import numeric


@functools.cache
def bonds_once(bits: int, members: int, breakable: bool, pull: wp.Function, module: str) -> tuple[Kernel, Kernel]:
    """Kernels `forces_ahead`, which fills ahead [points, members / 2], and `sum_both_halves`, the internal force [N].

    Args:
        bits: 32 or 64.
        members: Of the stencil.
        breakable: Whether bonds can break.
        pull: Warp function (constants, weight, xi, U) -> force of a bond over the unit of force, vec3.
        module: Name of the Warp module, which no other number of members has.
    """
    types = numeric(bits)
    real, vec2, vec3, parameters = types.real, types.vec2, types.vec3, types.parameters
    half, word_size = members // 2, WORD

    @wp.func(module=module)
    def bits_of(intact: wp.array2d(dtype=wp.uint32), initial: wp.array2d(dtype=wp.uint32), row: int, i: int, word: int):
        if wp.static(breakable):
            return intact[word, i]
        else:
            return initial[row, word]

    @kernel(module, gathers=("displacement",))
    def forces_ahead(
        shift: wp.array(dtype=wp.int32),
        bond: wp.array(dtype=vec2),
        family_class: wp.array(dtype=wp.int32),
        weight: wp.array2d(dtype=real),
        initial: wp.array2d(dtype=wp.uint32),
        intact: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        inverse_horizon: real,
        first: int,
        ahead: wp.array2d(dtype=vec3),
    ):
        i = wp.tid() + first
        ui = displacement[i]
        row = family_class[i]
        mask = wp.uint32(0)
        for n in range(wp.static(half)):
            k = n + half
            if n == 0 or k % word_size == 0:
                mask = bits_of(intact, initial, row, i, k // word_size)
            if bit_of(mask, k % word_size):
                m = i + shift[k]
                both = weight[row, k] + weight[family_class[m], half - 1 - n]
                ahead[i, n] = pull(constants, both, bond[k], inverse_horizon * (displacement[m] - ui))

    @kernel(module, gathers=("ahead",))
    def sum_both_halves(
        shift: wp.array(dtype=wp.int32),
        family_class: wp.array(dtype=wp.int32),
        initial: wp.array2d(dtype=wp.uint32),
        intact: wp.array2d(dtype=wp.uint32),
        ahead: wp.array2d(dtype=vec3),
        unit_force: real,
        first: int,
        force: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        row = family_class[i]
        total = vec3(real(0.0), real(0.0), real(0.0))
        mask = wp.uint32(0)
        for k in range(wp.static(half)):
            if k % word_size == 0:
                mask = bits_of(intact, initial, row, i, k // word_size)
            if bit_of(mask, k % word_size):
                total -= ahead[i + shift[k], half - 1 - k]
        for n in range(wp.static(half)):
            k = n + half
            if n == 0 or k % word_size == 0:
                mask = bits_of(intact, initial, row, i, k // word_size)
            if bit_of(mask, k % word_size):
                total += ahead[i, n]
        force[i] = unit_force * total

    return forces_ahead, sum_both_halves
