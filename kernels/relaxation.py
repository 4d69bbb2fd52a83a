"""Fictitious density of dynamic relaxation: sums of the rows of the stiffness, one number a point.

Underwood's condition (HE eq. 91), density >= dt^2/4 sum_j |K_ij|, makes a unit step stable; one number for the
three directions keeps it free of the frame (HE, after Sauve and Metzger). With dF_ij = sum_k u_k (x) g_k, an
intersection adds at most |A| |g_k| |g_l| between its points k and l, A the 6x6 second derivative of its energy:
the row of k gains |A| |g_k| sum_l |g_l|.
"""

import functools

import warp as wp

from .bond_associated import bond_associated
from .families import WORD, family_functions
from .numeric import numeric


@functools.cache
def row_sums(layout, bits, material, response, breakable, form, module):
    """Kernels `family_rows` and `sum_rows`; arguments as `bond_associated_tangent`.

    family_rows fills row [members, points] with what the family of a point adds to the rows of its members, and
    own [points] with its own row; sum_rows adds up both ends of the bonds to the density [N/m].
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3
    parameters = types.parameters
    f = family_functions(layout, bits, module)
    Family = f.struct
    law = bond_associated(layout, bits, material, breakable, form, module).mechanics
    present, is_whole, has, intersection = law.present, law.is_whole, law.has, law.intersection
    green, area_weight, family_scale = law.green, law.area_weight, law.family_scale
    response_of = response(bits)
    word_size = WORD

    @wp.kernel(module=module, enable_backward=False)
    def family_rows(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        inverse_horizon: real,
        unit_stiffness: real,
        first: int,
        row: wp.array2d(dtype=vec3),
        own: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        for k in range(family.members):
            row[k, i] = vec3(real(0.0), real(0.0), real(0.0))
        whole = is_whole(family, alive, i)
        total = real(0.0)
        centre_row = real(0.0)
        for j in range(family.members):
            if has(family, alive, i, j):
                G1, G2, inverse, size = intersection(family, alive, displacement, displacement, real(0.0), i, j, whole)
                if inverse[0] > real(0.0):
                    H1 = inverse_horizon * G1
                    H2 = inverse_horizon * G2
                    S, T = response_of(green(H1, H2), constants)
                    weight = area_weight(family, i, j, whole, size)
                    total += weight
                    F1 = H1 + vec3(real(1.0), real(0.0), real(0.0))
                    F2 = H2 + vec3(real(0.0), real(1.0), real(0.0))
                    stretch = wp.dot(F1, F1) + wp.dot(F2, F2)
                    bound = wp.abs(S[0, 0]) + real(2.0) * wp.abs(S[0, 1]) + wp.abs(S[1, 1])
                    bound += stretch * (wp.abs(T[0]) + wp.abs(T[1]) + wp.abs(T[3]) + wp.abs(T[5]))
                    sizes = real(0.0)
                    c1 = real(0.0)
                    c2 = real(0.0)
                    for word in range(family.words):
                        members = f.common(family, i, j, word) & present(family, alive, i, word)
                        k = word * word_size
                        while members != wp.uint32(0):
                            if (members & wp.uint32(1)) != wp.uint32(0):
                                c = f.influence(family, i, k) * f.area(family, f.neighbour(family, i, k))
                                xi = f.bond(family, i, k)
                                g1 = c * (inverse[0] * xi[0] + inverse[1] * xi[1])
                                g2 = c * (inverse[1] * xi[0] + inverse[2] * xi[1])
                                c1 -= g1
                                c2 -= g2
                                sizes += wp.sqrt(g1 * g1 + g2 * g2)
                            members = members >> wp.uint32(1)
                            k += 1
                    centre = wp.sqrt(c1 * c1 + c2 * c2)
                    sizes += centre
                    share = weight * bound * sizes
                    centre_row += share * centre
                    for word in range(family.words):
                        members = f.common(family, i, j, word) & present(family, alive, i, word)
                        k = word * word_size
                        while members != wp.uint32(0):
                            if (members & wp.uint32(1)) != wp.uint32(0):
                                c = f.influence(family, i, k) * f.area(family, f.neighbour(family, i, k))
                                xi = f.bond(family, i, k)
                                g1 = c * (inverse[0] * xi[0] + inverse[1] * xi[1])
                                g2 = c * (inverse[1] * xi[0] + inverse[2] * xi[1])
                                gained = share * wp.sqrt(g1 * g1 + g2 * g2)
                                row[k, i] = row[k, i] + vec3(gained, real(0.0), real(0.0))
                            members = members >> wp.uint32(1)
                            k += 1
        scale = unit_stiffness * family_scale(family, i, whole, total)
        own[i] = scale * centre_row
        for k in range(family.members):
            row[k, i] = scale * row[k, i]

    @wp.kernel(module=module, enable_backward=False)
    def sum_rows(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        row: wp.array2d(dtype=vec3),
        own: wp.array(dtype=real),
        least: real,
        first: int,
        density: wp.array(dtype=real),
    ):
        """A point that nothing holds keeps the density `least`, whatever the unit."""
        i = wp.tid() + first
        total = own[i]
        for k in range(family.members):
            if has(family, alive, i, k):
                total += row[f.mate(family, i, k), f.neighbour(family, i, k)][0]
        density[i] = wp.max(total, least)

    return family_rows, sum_rows
