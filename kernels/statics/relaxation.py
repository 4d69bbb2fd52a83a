"""Fictitious density of dynamic relaxation: row sums of the stiffness matrix, one number per point.

Underwood's condition (HE eq. 91), density >= dt^2/4 sum_j |K_ij|, makes a unit step stable. Using one number for all
three directions makes it independent of the frame (HE, after Sauve and Metzger). With dF_ij = sum_k u_k (x) g_k, an
intersection adds at most |A| |g_k| |g_l| between its points k and l, where A is the 6x6 second derivative of its
energy, so the row of k gains |A| |g_k| sum_l |g_l|. In a softened layout the damage of a family reduces its
contribution.

Adaptive mass damping is critical for the lowest mode still in motion. The Rayleigh quotient of the last step, omega^2 =
(v . K v) / (v . M v) with K v = -(change of force) / dt, tends to the square of the lowest frequency still in motion; c
= 2 omega damps that mode critically. Source: Underwood's adaptive dynamic relaxation, with the tangent along the motion
instead of a diagonal stiffness.
"""

import functools

import warp as wp

from ..block_sums import BLOCK
from ..bond_associated import family_mechanics
from ..effects import Kernel, kernel
from ..families import WORD, Layout, family_functions, lowest_bit, without_lowest_bit
from ..integrate import free_components
from ..kinematics import kinematics
from ..numeric import FunctionFactory, constants_of, numeric
from ..rupture import stiffness_left

# Density over that of the taut sheet below which a point counts as slack.
SLACK = 0.1


@functools.cache
def row_sums(layout: Layout, response: FunctionFactory, form: str) -> tuple[Kernel, Kernel]:
    """Kernels `family_rows` and `sum_rows`; `response` as for `bond_associated_tangent`, `form` as for the force.

    family_rows fills row [members, points] with the contributions of the family of a point to the rows of its members,
    and own [points] with its contribution to the row of the point itself; sum_rows sums both ends of the bonds to the
    density [N/m].
    """
    types, bits = layout.types, layout.bits
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family = f.struct
    law = family_mechanics(layout, form)
    visit = law.visit
    motion, family_scale = kinematics(bits, layout.curved), law.family_scale
    response_of = response(bits)
    Constants = constants_of(response_of)
    word_size = WORD
    left = stiffness_left(bits)

    @wp.func
    def arm(family: Family, i: int, k: int, inverse: vec3):
        """g_k."""
        c = f.influence(family, i, k) * f.area(family, f.neighbour(family, i, k))
        return c * motion.times(inverse, f.bond(family, i, k))

    @kernel(gathers=("displacement",))
    def family_rows(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        unit_stiffness: real,
        damage: wp.array(dtype=real),
        first: int,
        row: wp.array2d(dtype=vec3),
        own: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        for k in range(family.members):
            row[k, i] = vec3(real(0.0), real(0.0), real(0.0))
        undamaged = f.is_undamaged(family, i)
        total = real(0.0)
        centre_row = real(0.0)
        for j in range(family.members):
            there, H1, H2, inverse, weight, tilt = visit(family, displacement, i, j, undamaged)
            if there:
                S, T = response_of(motion.green(H1, H2, tilt), f.of_bond(family, i, j, constants))
                total += weight
                F1, F2 = motion.gradient(H1, H2, tilt)
                stretch = wp.dot(F1, F1) + wp.dot(F2, F2)
                bound = wp.abs(S[0, 0]) + real(2.0) * wp.abs(S[0, 1]) + wp.abs(S[1, 1])
                bound += stretch * (wp.abs(T[0]) + wp.abs(T[1]) + wp.abs(T[3]) + wp.abs(T[5]))
                sizes = real(0.0)
                c1 = real(0.0)
                c2 = real(0.0)
                for word in range(family.words):
                    members = f.common(family, i, j, word) & f.intact_members(family, i, word)
                    while members != wp.uint32(0):
                        k = word * word_size + lowest_bit(members)
                        members = without_lowest_bit(members)
                        g = arm(family, i, k, inverse)
                        c1 -= g[0]
                        c2 -= g[1]
                        sizes += wp.sqrt(g[0] * g[0] + g[1] * g[1])
                centre = wp.sqrt(c1 * c1 + c2 * c2)
                sizes += centre
                contribution = weight * bound * sizes
                centre_row += contribution * centre
                for word in range(family.words):
                    members = f.common(family, i, j, word) & f.intact_members(family, i, word)
                    while members != wp.uint32(0):
                        k = word * word_size + lowest_bit(members)
                        members = without_lowest_bit(members)
                        g = arm(family, i, k, inverse)
                        gained = contribution * wp.sqrt(g[0] * g[0] + g[1] * g[1])
                        row[k, i] = row[k, i] + vec3(gained, real(0.0), real(0.0))
        scale = unit_stiffness * family_scale(family, i, total)
        if wp.static(layout.softened):
            scale = left(damage[i]) * scale
        own[i] = scale * centre_row
        for k in range(family.members):
            row[k, i] = scale * row[k, i]

    @kernel(gathers=("row",))
    def sum_rows(
        family: Family,
        row: wp.array2d(dtype=vec3),
        own: wp.array(dtype=real),
        least: real,
        taut: wp.array(dtype=real),
        first: int,
        density: wp.array(dtype=real),
    ):
        """Sum the density of a point, at least `least`; a slack point gets that of a taut one, if that is given."""
        i = wp.tid() + first
        total = own[i]
        for k in range(family.members):
            if f.is_intact(family, i, k):
                total += row[f.reverse(family, i, k), f.neighbour(family, i, k)][0]
        total = wp.max(total, least)
        if taut:
            if total < real(SLACK) * taut[i]:
                total = taut[i]
        density[i] = total

    return family_rows, sum_rows


@functools.cache
def adaptive_damping(bits: int, following: bool) -> tuple[Kernel, Kernel]:
    """Kernels `measure_motion` (sums blocks of points in a fixed order) and `set_damping` (a single thread).

    `following`: loads depend on the displacement; the external force is then part of the stiffness.
    """
    types = numeric(bits)
    real, vec3, block = types.real, types.vec3, BLOCK
    without_held = free_components(bits)

    @kernel(per="block")
    def measure_motion(
        mass: wp.array(dtype=real),
        held_mask: wp.array(dtype=wp.uint8),
        velocity: wp.array(dtype=vec3),
        force: wp.array(dtype=vec3),
        external: wp.array(dtype=vec3),
        first: int,
        previous: wp.array(dtype=vec3),
        sums: wp.array2d(dtype=wp.float64),
    ):
        b = wp.tid() + first
        inertia = wp.float64(0.0)
        stiffness = wp.float64(0.0)
        for i in range(b * block, wp.min((b + 1) * block, velocity.shape[0])):
            v = velocity[i]
            if held_mask:
                v = without_held(held_mask[i], 0, v)
            total = force[i]
            if wp.static(following):
                total += external[i]
            inertia += wp.float64(mass[i] * wp.dot(v, v))
            stiffness += wp.float64(wp.dot(v, previous[i] - total))
            previous[i] = total
        sums[0, b] = inertia
        sums[1, b] = stiffness

    @kernel(per="once")
    def set_damping(
        sums: wp.array2d(dtype=wp.float64),
        step: wp.array(dtype=real),
        first: int,
        damping: wp.array(dtype=real),
    ):
        inertia = wp.float64(0.0)
        stiffness = wp.float64(0.0)
        for b in range(sums.shape[1]):
            inertia += sums[0, b]
            stiffness += sums[1, b]
        dt = wp.float64(step[0])
        omega = wp.float64(0.0)
        if inertia > wp.float64(0.0) and stiffness > wp.float64(0.0):
            omega = wp.sqrt(stiffness / (dt * inertia))
        damping[0] = real(wp.min(wp.float64(2.0) * omega, wp.float64(1.5) / dt))

    return measure_motion, set_damping
