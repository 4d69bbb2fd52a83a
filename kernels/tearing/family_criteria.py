"""Rupture by means over families: a bond asks for the values at its two ends."""

import functools

import warp as wp

from ..effects import Kernel, kernel
from ..families import Layout, family_functions
from ..numeric import constants_of
from ..rupture import Criterion


@functools.cache
def mean_of_both_ends(layout: Layout) -> Criterion:
    """Criterion: the mean of the `values` at both ends of a bond exceeds the `limit`."""
    real, vec3 = layout.types.real, layout.types.vec3
    Family = family_functions(layout).struct

    @wp.struct
    class MeanOfBothEnds:
        values: wp.array(dtype=real)
        limit: real

    @wp.func
    def exceeds_mean(
        family: Family, displacement: wp.array(dtype=vec3), criterion: MeanOfBothEnds, i: int, k: int, m: int
    ):
        return criterion.values[i] + criterion.values[m] > real(2.0) * criterion.limit

    return Criterion(exceeds_mean, MeanOfBothEnds, gathers=("values",))


@functools.cache
def mean_energy_density(
    layout: Layout, family_energy: wp.Function, represented: wp.Function, stiffened: bool
) -> Kernel:
    """Kernel that fills `out` [points] with the energy of the intact bonds of a family over their volume, J/m^3.

    Args:
        layout: Layout of the families.
        family_energy: As for `energy_of_families` of kernels/family_sums.py.
        represented: Warp function as for `represented_volumes` there. It has the factor of the family on the energy,
            which its quotient has not.
        stiffened: Whether `stiffness` [points] is a part of this factor; another is the relative thickness.
    """
    real, vec3 = layout.types.real, layout.types.vec3
    Family, Constants = family_functions(layout).struct, constants_of(family_energy)

    @kernel(gathers=("displacement",))
    def energy_density(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        stiffness: wp.array(dtype=real),
        first: int,
        out: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        area = represented(family, displacement, i)
        density = real(0.0)
        if area > real(0.0):
            density = family_energy(family, displacement, displacement, real(0.0), constants, i) / area
        if wp.static(stiffened):
            density *= stiffness[i]
        out[i] = density

    return energy_density
