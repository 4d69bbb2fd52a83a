"""The bond law of the papers: the force of a bond from Warp functions that each law gives (`BondLaw`).

There are two kinds. In a law of pairs (IM, HE) the two points of a bond pull each other with one force, which
`sums_of_bonds` sums at both ends and stores nowhere. In a law of families (VE, the nodal law, NN) the family of a point
pulls its bonds by something that they share, such as the invariant of VE or the stress of the nodal law.
`forces_of_families` stores these forces, and `gather_pairs` (kernels/family_sums.py) sums them over both ends.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..effects import Kernel, kernel
from ..families import WORD, Layout, family_functions, lowest_bit, without_lowest_bit
from ..numeric import constants_of


@dataclass(frozen=True)
class BondLaw:
    """Functions and kernels of a law; None where it has no such thing.

    Attributes:
        pair_force: Kernel of a law of pairs, see `sums_of_bonds`.
        family_force: Kernel of a law of families, see `forces_of_families`.
        energy: Warp function of the energy of a family, as for `energy_of_families`.
        density: Kernel of the strain energy density [points], J/m^3, if it is not the energy over the area.
        represented: Warp function of the represented area, as for `represented_volumes`.
        row_sums: Kernel of the fictitious density of dynamic relaxation [points], N/m.
        update: Kernel that advances the internal variables to the end of a step.
    """

    pair_force: Kernel | None = None
    family_force: Kernel | None = None
    energy: wp.Function | None = None
    density: Kernel | None = None
    represented: wp.Function | None = None
    row_sums: Kernel | None = None
    update: Kernel | None = None


@dataclass(frozen=True)
class BondFunctions:
    """Warp functions of one bond.

    Attributes:
        strain: (xi, U) -> |Y|/|X| - 1.
        image: (xi, U) -> Y divided by the horizon.
        growth: (xi, U) -> |Y|^2 - |X|^2, divided by the square of the horizon.
        chord: Type of xi: vec2, on a curved sheet vec3.
    """

    strain: wp.Function
    image: wp.Function
    growth: wp.Function
    chord: Any


@functools.cache
def bond_functions(layout: Layout) -> BondFunctions:
    """Functions of one bond; on a curved sheet xi is the chord in space."""
    types = layout.types
    real, vec3 = types.real, types.vec3
    curved = layout.curved
    Chord = vec3 if curved else types.vec2

    @wp.func
    def image(xi: Chord, U: vec3):
        """Y divided by the horizon."""
        if wp.static(curved):
            return xi + U
        else:
            return vec3(xi[0] + U[0], xi[1] + U[1], U[2])

    @wp.func
    def growth(xi: Chord, U: vec3):
        """|Y|^2 - |X|^2, divided by the square of the horizon."""
        if wp.static(curved):
            return real(2.0) * wp.dot(xi, U) + wp.dot(U, U)
        else:
            return real(2.0) * (xi[0] * U[0] + xi[1] * U[1]) + wp.dot(U, U)

    @wp.func
    def strain(xi: Chord, U: vec3):
        """|Y|/|X| - 1 from the displacement, without adding and subtracting one."""
        length = wp.length(xi)
        return growth(xi, U) / (length * (length + wp.length(image(xi, U))))

    return BondFunctions(strain, image, growth, Chord)


@functools.cache
def sums_of_bonds(
    layout: Layout, Constants: Any, force_of: wp.Function, stiffness_of: wp.Function
) -> tuple[Kernel, Kernel]:
    """Kernels `pair_force` and `row_sums` of a law whose bonds pull their two points towards each other.

    pair_force sums the internal force [points], N. row_sums sums the fictitious density of dynamic relaxation
    [points], N/m: the row of the stiffness (HE eqs. 86 to 93), the diagonal block of the point included. A point
    without stiffness keeps the density `least`.

    Args:
        layout: Layout of the families.
        Constants: Type of the law's constants.
        force_of: Warp function (family, constants, i, k, m, xi, U) -> force of bond k of point i, to point m, divided
            by `unit_force`, vec3; U is the relative displacement divided by the horizon.
        stiffness_of: Warp function of the same arguments -> largest stiffness of the bond, divided by
            `unit_stiffness`.
    """
    types = layout.types
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family = f.struct
    word_size = WORD

    @kernel(gathers=("displacement", "constants.factors"))
    def pair_force(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        unit_force: real,
        first: int,
        force: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        ui = displacement[i]
        pull = vec3(real(0.0), real(0.0), real(0.0))
        for word in range(family.words):
            members = f.intact_members(family, i, word)
            while members != wp.uint32(0):
                k = word * word_size + lowest_bit(members)
                members = without_lowest_bit(members)
                m = f.neighbour(family, i, k)
                U = family.inverse_horizon * (displacement[m] - ui)
                pull += force_of(family, constants, i, k, m, f.chord(family, i, k), U)
        force[i] = unit_force * pull

    @kernel(gathers=("displacement", "constants.factors"))
    def row_sums(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        unit_stiffness: real,
        least: real,
        first: int,
        density: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        total = real(0.0)
        for k in range(family.members):
            if f.is_intact(family, i, k):
                m = f.neighbour(family, i, k)
                U = family.inverse_horizon * (displacement[m] - displacement[i])
                total += stiffness_of(family, constants, i, k, m, f.chord(family, i, k), U)
        density[i] = wp.max(real(2.0) * unit_stiffness * total, least)

    return pair_force, row_sums


@functools.cache
def forces_of_families(layout: Layout, state_of: wp.Function, force_of: wp.Function, fast_math: bool = False) -> Kernel:
    """Kernel that fills bond_force [members, points] with the forces of each family on its bonds, N.

    Args:
        layout: Layout of the families.
        state_of: Warp function (family, displacement, constants, unit_force, i) -> what the bonds of family i share.
        force_of: Warp function (family, displacement, constants, state, i, k) -> force of family i on its bond k [N].
        fast_math: Whether a GPU may use approximate functions, see `kernel`.
    """
    types = layout.types
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family, Constants = f.struct, constants_of(state_of)

    @kernel(gathers=("displacement",), fast_math=fast_math)
    def family_force(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        unit_force: real,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
    ):
        i = wp.tid() + first
        state = state_of(family, displacement, constants, unit_force, i)
        for k in range(family.members):
            force = vec3(real(0.0), real(0.0), real(0.0))
            if f.is_intact(family, i, k):
                force = force_of(family, displacement, constants, state, i, k)
            bond_force[k, i] = force

    return family_force
