"""The variational bond-associated force with the family in registers, for any family.

The same sums as `plain_force` in kernels/bond_associated.py, which reads displacements and writes forces through
memory for every member of every intersection. Here members are read once, forces written once, and the loops
over members are spelled out for a fixed number of them; members outside an intersection take part with weight
zero, so that neighbouring threads of a GPU do the same.
"""

import functools

import warp as wp

from .bond_associated import bond_associated
from .families import WORD, family_functions
from .kinematics import kinematics
from .numeric import numeric


@functools.cache
def register_force(layout, bits, material, near, breakable, members, listed, module, fast_module):
    """Kernel that fills bond_force [members, ring] and force [points], its own half; variational form.

    Point i has column i % ring of `bond_force`.

    `near` is the factory of stress_near, `members` the most members of a family, `fast_module` the module of the
    kernel itself. With `listed`, the points are those on the list `others`, instead of all. Other arguments as of
    `bond_associated`.
    """
    types = numeric(bits)
    real, vec3, parameters = types.real, types.vec3, types.parameters
    f = family_functions(layout, bits, module)
    Family = f.struct
    mechanics = bond_associated(layout, bits, material, breakable, "variational", module).mechanics
    present, is_whole, green = mechanics.present, mechanics.is_whole, mechanics.green
    inverse_shape, area_weight, family_scale = (
        mechanics.inverse_shape, mechanics.area_weight, mechanics.family_scale,
    )  # fmt: skip
    stress_near, stress_on_members = near(bits), kinematics(bits).stress_on_members
    n, word_size = members, WORD
    words = -(-n // WORD)
    Vectors = wp.types.matrix(shape=(n, 3), dtype=real)
    Bonds = wp.types.matrix(shape=(n, 2), dtype=real)
    Numbers = wp.types.vector(length=n, dtype=real)
    Words = wp.types.vector(length=words, dtype=wp.uint32)

    @wp.kernel(module=fast_module, enable_backward=False)
    def any_family_force(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        others: wp.array(dtype=wp.int32),
        other_count: wp.array(dtype=wp.int32),
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        inverse_horizon: real,
        unit_force: real,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
        force: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        if wp.static(listed):
            if i >= other_count[0]:
                return
            i = others[i]
        standing = Words()
        for word in range(wp.static(words)):
            standing[word] = present(family, alive, i, wp.static(word))
        origin = displacement[i]
        U = Vectors()
        T = Vectors()
        X = Bonds()
        areas = Numbers()
        weighted = Numbers()
        for k in range(wp.static(n)):
            if (standing[wp.static(k // word_size)] & wp.uint32(wp.static(1 << (k % word_size)))) != wp.uint32(0):
                m = f.neighbour(family, i, wp.static(k))
                bond = f.bond(family, i, wp.static(k))
                a = f.area(family, m)
                U[k] = inverse_horizon * (displacement[m] - origin)
                X[k, 0] = bond[0]
                X[k, 1] = bond[1]
                areas[k] = a
                weighted[k] = f.influence(family, i, wp.static(k)) * a
        whole = is_whole(family, alive, i)
        total = real(0.0)
        guess = real(0.0)
        for j in range(family.members):
            here = j // word_size
            if ((present(family, alive, i, here) >> wp.uint32(j - here * word_size)) & wp.uint32(1)) != wp.uint32(0):
                common = Words()
                for word in range(wp.static(words)):
                    common[word] = f.common(family, i, j, wp.static(word)) & standing[word]
                G1 = vec3(real(0.0), real(0.0), real(0.0))
                G2 = vec3(real(0.0), real(0.0), real(0.0))
                shape = vec3(real(0.0), real(0.0), real(0.0))
                size = real(0.0)
                for k in range(wp.static(n)):
                    bit = common[wp.static(k // word_size)] & wp.uint32(wp.static(1 << (k % word_size)))
                    c = wp.where(bit != wp.uint32(0), weighted[k], real(0.0))
                    G1 += (c * X[k, 0]) * U[k]
                    G2 += (c * X[k, 1]) * U[k]
                inverse = vec3(real(0.0), real(0.0), real(0.0))
                if whole:
                    inverse = f.shape(family, i, j)
                else:
                    for k in range(wp.static(n)):
                        bit = common[wp.static(k // word_size)] & wp.uint32(wp.static(1 << (k % word_size)))
                        c = wp.where(bit != wp.uint32(0), weighted[k], real(0.0))
                        x = X[k, 0]
                        y = X[k, 1]
                        shape += vec3((c * x) * x, (c * x) * y, (c * y) * y)
                        size += wp.where(bit != wp.uint32(0), areas[k], real(0.0))
                    inverse = inverse_shape(shape)
                if inverse[0] > real(0.0):
                    H1 = G1 * inverse[0] + G2 * inverse[1]
                    H2 = G1 * inverse[1] + G2 * inverse[2]
                    S, guess = stress_near(green(H1, H2), constants, guess)
                    weight = area_weight(family, i, j, whole, size)
                    total += weight
                    A1, A2 = stress_on_members(H1, H2, S, weight, inverse)
                    for k in range(wp.static(n)):
                        bit = common[wp.static(k // word_size)] & wp.uint32(wp.static(1 << (k % word_size)))
                        on = wp.where(bit != wp.uint32(0), real(1.0), real(0.0))
                        T[k] = T[k] + ((on * X[k, 0]) * A1 + (on * X[k, 1]) * A2)
        scale = unit_force * family_scale(family, i, whole, total)
        slot = i % bond_force.shape[1]
        pull = vec3(real(0.0), real(0.0), real(0.0))
        for k in range(wp.static(n)):
            t = (scale * weighted[k]) * T[k]
            bond_force[wp.static(k), slot] = t
            pull += t
        force[i] = pull

    return any_family_force


@functools.cache
def gather_mates(layout, bits, members, listed, module):
    """Kernel that takes from each point's own half of the force [points] what the families around it do to it.

    Broken bonds carry zero, so the bonds of the undamaged sheet will do. `listed`: whether a list of other points
    was used, which is emptied.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3
    f = family_functions(layout, bits, module)
    Family = f.struct
    n, word_size = members, WORD

    @wp.kernel(module=module, enable_backward=False)
    def gather_from_mates(
        family: Family,
        bond_force: wp.array2d(dtype=vec3),
        first: int,
        other_count: wp.array(dtype=wp.int32),
        force: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        if wp.static(listed):
            # The list is used up; the next launches begin another.
            if wp.tid() == 0:
                other_count[0] = 0
        ring = bond_force.shape[1]
        slot = i % ring
        push = vec3(real(0.0), real(0.0), real(0.0))
        for k in range(wp.static(n)):
            members_here = f.whole(family, i, wp.static(k // word_size))
            if (members_here & wp.uint32(wp.static(1 << (k % word_size)))) != wp.uint32(0):
                column = slot + f.neighbour(family, i, wp.static(k)) - i
                if column < 0:
                    column += ring
                if column >= ring:
                    column -= ring
                push += bond_force[f.mate(family, i, wp.static(k)), column]
        force[i] = force[i] - push

    return gather_from_mates
