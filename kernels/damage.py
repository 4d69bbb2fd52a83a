"""Rupture by critical stretch or by energy release rate, and the damage of a point.

A bond whose stretch |Y|/|X|, or whose energy release rate (kernels/critical_energy.py), passes the critical one breaks
for good. Both ends compute the same number from the same words, so their bits agree without being compared.

The force changes between two steps, so the energy that breaking releases is taken half a step back: then
the energy balance of central differences stays second order in the step through rupture.
"""

import functools

import warp as wp

from .families import WORD, family_functions
from .numeric import numeric


@functools.cache
def breaking(layout, bits, by_energy, tracked, spared, earlier_energy, module):
    """Kernel `break_bonds`.

    Args:
        layout: "lattice" or "cloud".
        bits: 32 or 64.
        by_energy: Whether `critical` is an energy release rate, instead of a squared stretch.
        tracked: Whether the energy that breaking releases is summed up, per point.
        spared: Whether the bonds of some points never break.
        earlier_energy: Warp function of the force law (None if not tracked).
        module: Name of the Warp module.
    """
    types = numeric(bits)
    real, vec3, parameters = types.real, types.vec3, types.parameters
    f = family_functions(layout, bits, module)
    Family = f.struct
    word_size = WORD

    @wp.func(module=module)
    def spent(
        family: Family,
        displacement: wp.array(dtype=vec3),
        energy_release: wp.array2d(dtype=real),
        horizon: real,
        critical: real,
        i: int,
        k: int,
        m: int,
    ):
        if wp.static(by_energy):
            return energy_release[k, i] > critical
        else:
            X = horizon * f.bond(family, i, k)
            U = displacement[m] - displacement[i]
            Y = vec3(X[0] + U[0], X[1] + U[1], U[2])
            return wp.dot(Y, Y) > critical * wp.dot(X, X)

    @wp.func(module=module)
    def surviving(
        family: Family,
        displacement: wp.array(dtype=vec3),
        energy_release: wp.array2d(dtype=real),
        horizon: real,
        critical: real,
        spared_mask: wp.array(dtype=wp.uint8),
        i: int,
        word: int,
        standing: wp.uint32,
    ):
        """The bits of `standing` whose bonds are not spent.

        Without branches: a thread of a GPU has the loads of several members under way at once.
        """
        survivors = standing
        bit = wp.uint32(1)
        first_member = word * word_size
        for k in range(first_member, wp.min(first_member + word_size, family.members)):
            there = (standing & bit) != wp.uint32(0)
            m = wp.where(there, f.neighbour(family, i, k), i)
            over = spent(family, displacement, energy_release, horizon, critical, i, k, m)
            if wp.static(spared):
                over = over and spared_mask[i] == wp.uint8(0) and spared_mask[m] == wp.uint8(0)
            survivors = survivors & ~wp.where(over, bit, wp.uint32(0))
            bit = bit << wp.uint32(1)
        return survivors

    @wp.kernel(module=module, enable_backward=False)
    def break_bonds(
        family: Family,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        energy_release: wp.array2d(dtype=real),
        horizon: real,
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
        breaks = bool(False)
        for word in range(family.words):
            standing = alive[word, i]
            left = surviving(family, displacement, energy_release, horizon, critical, spared_mask, i, word, standing)
            if left != standing:
                breaks = True
        if breaks:
            back = real(0.0)
            before = real(0.0)
            if wp.static(tracked):
                back = real(0.5) * step[0]
                before = earlier_energy(family, alive, displacement, velocity, back, constants, inverse_horizon, i)
            for word in range(family.words):
                alive[word, i] = surviving(
                    family, displacement, energy_release, horizon, critical, spared_mask, i, word, alive[word, i]
                )
            if wp.static(tracked):
                after = earlier_energy(family, alive, displacement, velocity, back, constants, inverse_horizon, i)
                released[i] = released[i] + wp.float64(unit_volume * (before - after))

    return break_bonds


@functools.cache
def point_damage(layout, bits, module):
    """Kernel `damage`; arguments as of `breaking`."""
    real = numeric(bits).real
    f = family_functions(layout, bits, module)
    Family = f.struct
    word_size = WORD

    @wp.kernel(module=module, enable_backward=False)
    def damage(family: Family, alive: wp.array2d(dtype=wp.uint32), first: int, out: wp.array(dtype=wp.float32)):
        """Area of the members that were lost over that of the initial family."""
        i = wp.tid() + first
        lost = real(0.0)
        for word in range(family.words):
            members = f.whole(family, i, word) & ~alive[word, i]
            k = word * word_size
            while members != wp.uint32(0):
                if (members & wp.uint32(1)) != wp.uint32(0):
                    lost += f.area(family, f.neighbour(family, i, k))
                members = members >> wp.uint32(1)
                k += 1
        out[i] = wp.float32(wp.min(lost / f.family_area(family, i), real(1.0)))

    return damage


@functools.cache
def face_damage(layout, bits, module):
    """Kernel `find_intact_faces`; arguments as of `breaking`."""
    f = family_functions(layout, bits, module)
    Family = f.struct
    word_size = WORD

    @wp.func(module=module)
    def lost(family: Family, alive: wp.array2d(dtype=wp.uint32), i: int, j: int):
        """Whether the family of i has lost its bond to j."""
        found = bool(False)
        for word in range(family.words):
            members = f.whole(family, i, word) & ~alive[word, i]
            k = word * word_size
            while members != wp.uint32(0):
                if (members & wp.uint32(1)) != wp.uint32(0):
                    if f.neighbour(family, i, k) == j:
                        found = True
                members = members >> wp.uint32(1)
                k += 1
        return found

    @wp.kernel(module=module, enable_backward=False)
    def find_intact_faces(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        triangles: wp.array(dtype=wp.vec3i),
        first: int,
        intact: wp.array(dtype=wp.uint8),
    ):
        """Whether a triangle kept the bonds along its edges; no bond lies along one that is longer than the horizon."""
        t = wp.tid() + first
        a, b, c = triangles[t][0], triangles[t][1], triangles[t][2]
        torn = lost(family, alive, a, b) or lost(family, alive, b, c) or lost(family, alive, c, a)
        intact[t] = wp.uint8(1)
        if torn:
            intact[t] = wp.uint8(0)

    return find_intact_faces
