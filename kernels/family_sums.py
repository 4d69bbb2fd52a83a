"""Kernels that sum the contributions of families, common to several laws."""

import functools

import warp as wp

from .effects import Kernel, Pointwise, kernel, pointwise
from .families import Layout, family_functions
from .numeric import constants_of
from .rupture import stiffness_left


@functools.cache
def gather_pairs(layout: Layout, softens: bool = True) -> Pointwise:
    """Pointwise stage that sums bond_force [members, points] over both ends of the bonds to the internal force [N].

    If `softens`, each family's force is multiplied by g(damage) here, in a softened layout
    (kernels/tearing/damage_field.py); otherwise `bond_force` already includes it.
    """
    vec3, real = layout.types.vec3, layout.types.real
    f = family_functions(layout)
    Family = f.struct
    left = stiffness_left(layout.bits)

    @wp.struct
    class Gather:
        family: Family
        bond_force: wp.array2d(dtype=vec3)
        damage: wp.array(dtype=real)
        force: wp.array(dtype=vec3)

    @pointwise(Gather, writes=("force",), gathers=("bond_force", "damage"))
    def gather(begin: int, end: int, a: Gather):
        for i in range(begin, end):
            pull = vec3(real(0.0), real(0.0), real(0.0))
            for k in range(a.family.members):
                if f.is_intact(a.family, i, k):
                    m = f.neighbour(a.family, i, k)
                    own = a.bond_force[k, i]
                    others = a.bond_force[f.reverse(a.family, i, k), m]
                    if wp.static(layout.softened and softens):
                        own = left(a.damage[i]) * own
                        others = left(a.damage[m]) * others
                    pull += own - others
            a.force[i] = pull

    return gather


@functools.cache
def energy_of_families(layout: Layout, family_energy: wp.Function) -> Kernel:
    """Kernel that fills `out` [points] with the energy of each family, J.

    Args:
        layout: Layout of the families.
        family_energy: Warp function (family, displacement, velocity, back, constants, i) ->
            energy divided by (thickness x reference area) [J/m^3], for the displacement at a time `back` before now.
    """
    types = layout.types
    real, vec3 = types.real, types.vec3
    Family, Constants = family_functions(layout).struct, constants_of(family_energy)

    @kernel(gathers=("displacement",))
    def strain_energy(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        unit_volume: real,
        first: int,
        out: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        density = family_energy(family, displacement, displacement, real(0.0), constants, i)
        out[i] = wp.float64(unit_volume * density)

    return strain_energy


@functools.cache
def represented_volumes(layout: Layout, represented: wp.Function, stiffened: bool) -> Kernel:
    """Kernel that updates the volume `out` [points] that the intact bonds of damaged families represent, m^3.

    Args:
        layout: Layout of the families.
        represented: Warp function (family, displacement, i) -> represented area over the reference area, times the
            factor on the energy of the family.
        stiffened: Whether `stiffness` [points] is a part of this factor; another is the relative thickness.
    """
    types = layout.types
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family = f.struct

    @kernel(gathers=("displacement",))
    def represented_volume(
        family: Family,
        displacement: wp.array(dtype=vec3),
        unit_volume: real,
        stiffness: wp.array(dtype=real),
        first: int,
        out: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        if not f.is_undamaged(family, i):
            volume = unit_volume * represented(family, displacement, i)
            if wp.static(stiffened):
                volume /= stiffness[i]
            out[i] = wp.float64(volume)

    return represented_volume
