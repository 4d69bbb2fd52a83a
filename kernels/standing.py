"""What all laws of families share: which bonds stand, and the kernels that add up what families give.

`breakable` says whether bonds can break; where they cannot, all that exist stand, and no kernel reads `alive`.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from .families import WORD, family_functions
from .numeric import numeric
from .points import PointFunction


@dataclass(frozen=True)
class StandingBonds:
    """Warp functions; i is a point, k a member of its family.

    Attributes:
        present: (family, alive, i, word) -> bits of the members whose bonds stand.
        is_whole: (family, alive, i) -> whether no bond of i is broken: the tables of the undamaged sheet hold.
        has: (family, alive, i, k) -> whether the bond stands.
    """

    present: Any
    is_whole: Any
    has: Any


@functools.cache
def standing_bonds(layout, bits, breakable, module):
    """Functions of the bonds that stand."""
    f = family_functions(layout, bits, module)
    Family = f.struct
    word_size = WORD

    @wp.func(module=module)
    def present(family: Family, alive: wp.array2d(dtype=wp.uint32), i: int, word: int):
        if wp.static(breakable):
            return alive[word, i]
        else:
            return f.whole(family, i, word)

    @wp.func(module=module)
    def is_whole(family: Family, alive: wp.array2d(dtype=wp.uint32), i: int):
        answer = bool(True)
        if wp.static(breakable):
            for word in range(family.words):
                if alive[word, i] != f.whole(family, i, word):
                    answer = False
        return answer

    @wp.func(module=module)
    def has(family: Family, alive: wp.array2d(dtype=wp.uint32), i: int, k: int):
        word = k // word_size
        return ((present(family, alive, i, word) >> wp.uint32(k - word * word_size)) & wp.uint32(1)) != wp.uint32(0)

    return StandingBonds(present, is_whole, has)


@functools.cache
def gather_pairs(layout, bits, breakable, module):
    """Point function that sums bond_force [members, points], both ends of a bond, to the internal force [points], N."""
    vec3, real = numeric(bits).vec3, numeric(bits).real
    f = family_functions(layout, bits, module)
    Family = f.struct
    has = standing_bonds(layout, bits, breakable, module).has

    @functools.partial(wp.struct, module=module)
    class Gather:
        family: Family
        alive: wp.array2d(dtype=wp.uint32)
        bond_force: wp.array2d(dtype=vec3)
        force: wp.array(dtype=vec3)

    @wp.func(module=module)
    def gather(begin: int, end: int, a: Gather):
        for i in range(begin, end):
            pull = vec3(real(0.0), real(0.0), real(0.0))
            for k in range(a.family.members):
                if has(a.family, a.alive, i, k):
                    m = f.neighbour(a.family, i, k)
                    pull += a.bond_force[k, i] - a.bond_force[f.mate(a.family, i, k), m]
            a.force[i] = pull

    return PointFunction(gather, Gather, "gather")


@functools.cache
def energy_of_families(layout, bits, family_energy, module):
    """Kernel that fills `out` [points] with the energy of each family, J.

    Args:
        layout: "lattice" or "cloud".
        bits: 32 or 64.
        family_energy: Warp function (family, alive, displacement, velocity, back, constants, inverse_horizon, i) ->
            energy over (thickness x reference area), of the displacement a time `back` ago [J/m^3].
        module: Name of the Warp module.
    """
    types = numeric(bits)
    real, vec3, parameters = types.real, types.vec3, types.parameters
    Family = family_functions(layout, bits, module).struct

    @wp.kernel(module=module, enable_backward=False)
    def strain_energy(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        inverse_horizon: real,
        unit_volume: real,
        first: int,
        out: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        density = family_energy(family, alive, displacement, displacement, real(0.0), constants, inverse_horizon, i)
        out[i] = wp.float64(unit_volume * density)

    return strain_energy


@functools.cache
def sums_of_bonds(layout, bits, breakable, Constants, force_of, stiffness_of, module):
    """Kernels `pair_force` and `row_sums` of a law whose bonds pull their two points against each other.

    pair_force sums the internal force [points], N; row_sums the fictitious density of dynamic relaxation [points],
    N/m: the row of the stiffness (HE eqs. 86 to 93), the point's own block included. A point that nothing holds keeps
    the density `least`.

    Args:
        layout: "lattice" or "cloud".
        bits: 32 or 64.
        breakable: Whether bonds can break.
        Constants: Type of the law's constants.
        force_of: Warp function (family, constants, i, k, m, xi, U) -> force of bond k of point i, to point m, over
            `unit_force`, vec3; U is the relative displacement over the horizon.
        stiffness_of: Warp function of the same -> the most that the bond resists, over `unit_stiffness`.
        module: Name of the Warp module.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3
    f = family_functions(layout, bits, module)
    Family = f.struct
    bonds = standing_bonds(layout, bits, breakable, module)
    word_size = WORD

    @wp.kernel(module=module, enable_backward=False)
    def pair_force(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        inverse_horizon: real,
        unit_force: real,
        first: int,
        force: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        ui = displacement[i]
        pull = vec3(real(0.0), real(0.0), real(0.0))
        for word in range(family.words):
            members = bonds.present(family, alive, i, word)
            k = word * word_size
            while members != wp.uint32(0):
                if (members & wp.uint32(1)) != wp.uint32(0):
                    m = f.neighbour(family, i, k)
                    U = inverse_horizon * (displacement[m] - ui)
                    pull += force_of(family, constants, i, k, m, f.bond(family, i, k), U)
                members = members >> wp.uint32(1)
                k += 1
        force[i] = unit_force * pull

    @wp.kernel(module=module, enable_backward=False)
    def row_sums(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        inverse_horizon: real,
        unit_stiffness: real,
        least: real,
        first: int,
        density: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        total = real(0.0)
        for k in range(family.members):
            if bonds.has(family, alive, i, k):
                m = f.neighbour(family, i, k)
                U = inverse_horizon * (displacement[m] - displacement[i])
                total += stiffness_of(family, constants, i, k, m, f.bond(family, i, k), U)
        density[i] = wp.max(real(2.0) * unit_stiffness * total, least)

    return pair_force, row_sums
