"""CPU kernels that compute the force of each lattice bond only once.

The members of a stencil are sorted so that the reverse of member k is member n - 1 - k: the second half lies ahead of
the point, i.e. at higher indices. A thread computes the bonds ahead of its point; a second kernel sums both halves in
the order of the members, with a minus sign for the bonds behind. The sums are bitwise equal to those of
`sums_of_bonds`, which computes every bond at both ends.

If bonds break by their stretch, the first kernel also flags the blocks of points that `break_bonds` must check, as
`screening` in kernels/rupture.py does. Bonds then break between the two kernels, and the second kernel skips them.

The tables are separate arguments because a struct would be copied for every point. The number of members is a
compile-time constant, so loops over short stencils are unrolled. Together these two make the kernels 2.3 times as fast.
"""

import functools

import warp as wp

from ..effects import Kernel, kernel
from ..families import WORD, bit_of
from ..numeric import numeric
from ..rupture import SCREENED


@functools.cache
def bonds_once(bits: int, members: int, breakable: bool, pull: wp.Function) -> tuple[Kernel, Kernel]:
    """Kernels `forces_ahead` and `sum_both_halves`.

    The first fills ahead [points, members / 2] with the forces of the bonds ahead, divided by the unit of force, by
    blocks of SCREENED points; if `exceeding` [blocks] is given, it also flags blocks with a bond that may break. The
    second sums the internal force [N]. `pull` is (constants, weight, xi, U) -> force of a bond divided by the unit of
    force, vec3.
    """
    types = numeric(bits)
    real, vec2, vec3, parameters = types.real, types.vec2, types.vec3, types.parameters
    half, word_size, block = members // 2, WORD, SCREENED

    @wp.func
    def bits_of(intact: wp.array2d(dtype=wp.uint32), initial: wp.array2d(dtype=wp.uint32), row: int, i: int, word: int):
        if wp.static(breakable):
            return intact[word, i]
        else:
            return initial[row, word]

    @kernel(per="block")
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
        nearly: real,
        first: int,
        ahead: wp.array2d(dtype=vec3),
        exceeding: wp.array(dtype=wp.uint8),
    ):
        """`nearly` is the squared stretch |Y|^2/|X|^2 above which a bond may break."""
        b = wp.tid() + first
        beyond = wp.uint8(0)
        for i in range(b * block, wp.min((b + 1) * block, displacement.shape[0])):
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
                    xi = bond[k]
                    U = inverse_horizon * (displacement[m] - ui)
                    ahead[i, n] = pull(constants, both, xi, U)
                    if wp.static(breakable):
                        Y = vec3(xi[0] + U[0], xi[1] + U[1], U[2])
                        if wp.dot(Y, Y) > nearly * wp.dot(xi, xi):
                            beyond = wp.uint8(1)
        if exceeding:
            exceeding[b] = beyond

    @kernel(gathers=("ahead",))
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
