"""Bonds that are cut at given times."""

import functools

import warp as wp

from ..effects import Kernel, kernel
from ..families import WORD, Layout, bit_of, family_functions
from ..numeric import constants_of
from ..rupture import energy_over_step, stiffness_left


@functools.cache
def cut_bonds(layout: Layout, earlier_energy: wp.Function | None) -> Kernel:
    """Kernel that breaks bonds of listed points from given times on.

    `times` [members, listed points] are those of the bonds of `points` [s], infinite for bonds that stay.
    `earlier_energy` is the law's function of the energy of a family at an earlier time, to sum the released energy, of
    which the damage of the point leaves a share; None if it is not tracked.
    """
    types = layout.types
    real, vec3 = types.real, types.vec3
    Family, word_size = family_functions(layout).struct, WORD
    Constants = types.parameters if earlier_energy is None else constants_of(earlier_energy)
    tracked, softened = earlier_energy is not None, layout.softened
    energy_of_step = energy_over_step(layout, earlier_energy) if earlier_energy is not None else None
    left = stiffness_left(layout.bits)

    @kernel(per="list", gathers=("displacement", "velocity"), writes=("family.intact",))
    def cut_bonds(
        family: Family,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        constants: Constants,
        unit_volume: real,
        damage: wp.array(dtype=real),
        points: wp.array(dtype=wp.int32),
        times: wp.array2d(dtype=wp.float64),
        time: wp.array(dtype=wp.float64),
        first: int,
        released: wp.array(dtype=wp.float64),
    ):
        n = wp.tid() + first
        i = points[n]
        now = time[0]
        due = bool(False)
        for k in range(family.members):
            if times[k, n] <= now and bit_of(family.intact[k // word_size, i], k % word_size):
                due = True
        if due:
            before = real(0.0)
            if wp.static(tracked):
                before = energy_of_step(family, displacement, velocity, step[0], constants, i)
            for k in range(family.members):
                if times[k, n] <= now:
                    bit = wp.uint32(1) << wp.uint32(k % word_size)
                    family.intact[k // word_size, i] = family.intact[k // word_size, i] & ~bit
            if wp.static(tracked):
                lost = before - energy_of_step(family, displacement, velocity, step[0], constants, i)
                if wp.static(softened):
                    lost *= left(damage[i])
                released[i] = released[i] + wp.float64(unit_volume * lost)

    return cut_bonds
