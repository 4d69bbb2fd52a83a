"""Rupture by energy release rate (VE eqs. 64 to 68): the work of a bond per unit of crack surface that it represents.

Each step adds the work of the force between the two points of a bond, half of it at each point, divided by h dx:

    G = w V_i V_j / (h dx),     w = int t |X| ds,     t the mean of the force densities of the two ends,

and the bond breaks permanently when G exceeds the critical value of one interaction (kernels/rupture.py). Both ends
compute the same number.
"""

import functools

import warp as wp

from ..effects import Kernel, kernel
from ..families import Layout, family_functions
from ..rupture import Criterion


@functools.cache
def energy_release(layout: Layout) -> Kernel:
    """Kernel `add_release`."""
    types = layout.types
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family = f.struct

    @kernel(gathers=("velocity", "bond_force"))
    def add_release(
        family: Family,
        velocity: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        bond_force: wp.array2d(dtype=vec3),
        inverse_surface: real,
        first: int,
        energy_release: wp.array2d(dtype=real),
    ):
        i = wp.tid() + first
        for k in range(family.members):
            if f.is_intact(family, i, k):
                m = f.neighbour(family, i, k)
                pull = bond_force[k, i] - bond_force[f.reverse(family, i, k), m]
                work = real(0.5) * step[0] * wp.dot(pull, velocity[m] - velocity[i])
                energy_release[k, i] = energy_release[k, i] + inverse_surface * work

    return add_release


@functools.cache
def critical_energy(layout: Layout) -> Criterion:
    """Criterion: the energy release of an interaction exceeds its critical value."""
    types = layout.types
    real, vec3 = types.real, types.vec3
    Family = family_functions(layout).struct

    @wp.struct
    class CriticalEnergy:
        energy_release: wp.array2d(dtype=real)
        critical: real

    @wp.func
    def exceeds_energy(
        family: Family,
        displacement: wp.array(dtype=vec3),
        criterion: CriticalEnergy,
        i: int,
        k: int,
        m: int,
    ):
        return criterion.energy_release[k, i] > criterion.critical

    return Criterion(exceeds_energy, CriticalEnergy)
