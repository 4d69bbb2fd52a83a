"""Rupture by energy release rate (VE eqs. 64 to 68): the work of a bond over the crack surface that it stands for.

Each step adds to a bond the work of the force between its two points, half of it for each, over h dx:

    G = w V_i V_j / (h dx),     w = int t |X| ds,     t the mean of the force densities of the two ends,

and the bond breaks for good when G passes the critical value of one interaction. Both ends compute the same number.
"""

import functools

import warp as wp

from .families import WORD, family_functions
from .numeric import numeric
from .standing import standing_bonds


@functools.cache
def critical_energy(layout, bits, tracked, spared, earlier_energy, module):
    """Kernels `add_release` and `break_bonds`; arguments as of `damage.critical_stretch`."""
    types = numeric(bits)
    real, vec3, parameters = types.real, types.vec3, types.parameters
    f = family_functions(layout, bits, module)
    Family = f.struct
    has = standing_bonds(layout, bits, True, module).has
    word_size = WORD

    @wp.kernel(module=module, enable_backward=False)
    def add_release(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        velocity: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        bond_force: wp.array2d(dtype=vec3),
        inverse_surface: real,
        first: int,
        energy_release: wp.array2d(dtype=real),
    ):
        i = wp.tid() + first
        for k in range(family.members):
            if has(family, alive, i, k):
                m = f.neighbour(family, i, k)
                pull = bond_force[k, i] - bond_force[f.mate(family, i, k), m]
                work = real(0.5) * step[0] * wp.dot(pull, velocity[m] - velocity[i])
                energy_release[k, i] = energy_release[k, i] + inverse_surface * work

    @wp.func(module=module)
    def surviving(
        family: Family,
        energy_release: wp.array2d(dtype=real),
        critical: real,
        spared_mask: wp.array(dtype=wp.uint8),
        i: int,
        word: int,
        standing: wp.uint32,
    ):
        """The bits of `standing` whose bonds have not released the critical energy."""
        survivors = standing
        members = standing
        k = word * word_size
        bit = wp.uint32(1)
        while members != wp.uint32(0):
            if (members & wp.uint32(1)) != wp.uint32(0):
                over = energy_release[k, i] > critical
                if wp.static(spared):
                    m = f.neighbour(family, i, k)
                    over = over and spared_mask[i] == wp.uint8(0) and spared_mask[m] == wp.uint8(0)
                if over:
                    survivors = survivors & ~bit
            members = members >> wp.uint32(1)
            bit = bit << wp.uint32(1)
            k += 1
        return survivors

    @wp.kernel(module=module, enable_backward=False)
    def break_spent_bonds(
        family: Family,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        energy_release: wp.array2d(dtype=real),
        critical: real,
        spared_mask: wp.array(dtype=wp.uint8),
        constants: parameters,
        inverse_horizon: real,
        unit_volume: real,
        first: int,
        alive: wp.array2d(dtype=wp.uint32),
        released: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        back = real(0.5) * step[0]
        breaks = bool(False)
        for word in range(family.words):
            standing = alive[word, i]
            if surviving(family, energy_release, critical, spared_mask, i, word, standing) != standing:
                breaks = True
        if breaks:
            before = real(0.0)
            if wp.static(tracked):
                before = earlier_energy(family, alive, displacement, velocity, back, constants, inverse_horizon, i)
            for word in range(family.words):
                alive[word, i] = surviving(family, energy_release, critical, spared_mask, i, word, alive[word, i])
            if wp.static(tracked):
                after = earlier_energy(family, alive, displacement, velocity, back, constants, inverse_horizon, i)
                released[i] = released[i] + wp.float64(unit_volume * (before - after))

    return add_release, break_spent_bonds
