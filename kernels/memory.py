"""Internal variable of a material: the largest value so far of a function of the strain, by intersection."""

import functools

import warp as wp

from .bond_associated import family_mechanics
from .effects import Kernel, kernel
from .factories import FunctionFactory, PairFactory, constants_of
from .families import Layout, family_functions
from .kinematics import kinematics


@functools.cache
def remembered(layout: Layout, material: PairFactory, value_of: FunctionFactory) -> Kernel:
    """Kernel that raises `largest` [member, point] to `value_of`, (G, constants) -> a number, of each intersection.

    If it remembered the mean of its family instead, its energy would change as the mean grows, without work of a force.
    """
    types = layout.types
    real, vec3 = types.real, types.vec3
    f, law = family_functions(layout), family_mechanics(layout, "variational")
    green = kinematics(layout.bits, layout.curved).green
    Family, Constants, value = f.struct, constants_of(material(layout.bits)[0]), value_of(layout.bits)

    @kernel(gathers=("displacement",))
    def remember(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        first: int,
        largest: wp.array2d(dtype=real),
    ):
        i = wp.tid() + first
        undamaged = f.is_undamaged(family, i)
        for j in range(family.members):
            there, H1, H2, _inverse, _weight, tilt = law.visit(family, displacement, i, j, undamaged)
            if there:
                now = value(green(H1, H2, tilt), f.of_bond(family, i, j, constants))
                largest[j, i] = wp.max(largest[j, i], now)

    return remember
