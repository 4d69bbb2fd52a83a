"""Rupture: bonds that exceed a criterion break permanently.

Both ends of a bond compute the same number from the same data, so their bits agree without communication.

By the trapezoidal rule of central differences, the force of a breaking bond does work until half a step before now. The
energy D that a family loses is therefore summed as 2 D(half a step ago) - D(now) / 2 - D(one step ago) / 2. For D
quadratic in the motion, this is exactly the loss of the discrete energy.

The damage of a point is the fraction of its family that is lost; a damage field reduces stiffness by g (`degradation`).
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from .effects import Kernel, kernel
from .families import WORD, Layout, bit_of, family_functions, lowest_bit, without_lowest_bit
from .numeric import constants_of, numeric

# Points of a block that is screened together.
SCREENED = 128
# Bonds above this fraction of the squared critical stretch are checked one by one, whatever the rounding.
NEARLY = 0.9999


@dataclass(frozen=True)
class Criterion:
    """The criterion by which a bond breaks.

    Attributes:
        exceeds: Warp function (family, displacement, criterion, i, k, m) -> whether bond k of point i, to
            point m, exceeds the criterion. Both ends of a bond must give the same result.
        struct: Warp struct of its constants and arrays.
        gathers: Arrays of the struct that it reads at points other than i.
    """

    exceeds: wp.Function
    struct: Any
    gathers: tuple[str, ...] = ()


@functools.cache
def reference_and_deformed(layout: Layout) -> wp.Function:
    """Function (family, displacement, i, k, m) -> X and Y of bond k of point i, to point m [m].

    X is a vec2, on a curved sheet the chord (vec3). It is bitwise equal to minus that of the reverse bond.
    """
    vec3 = layout.types.vec3
    f = family_functions(layout)
    Family, curved = f.struct, layout.curved

    @wp.func
    def bond_vectors(family: Family, displacement: wp.array(dtype=vec3), i: int, k: int, m: int):
        X = family.horizon * f.chord(family, i, k)
        U = displacement[m] - displacement[i]
        if wp.static(curved):
            return X, X + U
        else:
            return X, vec3(X[0] + U[0], X[1] + U[1], U[2])

    return bond_vectors


@functools.cache
def critical_stretch(layout: Layout) -> Criterion:
    """Criterion: the stretch |Y|/|X| exceeds its critical value."""
    types = layout.types
    real, vec3 = types.real, types.vec3
    Family = family_functions(layout).struct
    bond_vectors = reference_and_deformed(layout)

    @wp.struct
    class CriticalStretch:
        squared: real

    @wp.func
    def exceeds_stretch(
        family: Family,
        displacement: wp.array(dtype=vec3),
        criterion: CriticalStretch,
        i: int,
        k: int,
        m: int,
    ):
        X, Y = bond_vectors(family, displacement, i, k, m)
        return wp.dot(Y, Y) > criterion.squared * wp.dot(X, X)

    return Criterion(exceeds_stretch, CriticalStretch)


@functools.cache
def screening(layout: Layout, criterion: Criterion) -> Kernel:
    """CPU kernel that flags the blocks of points of a lattice in which a bond ahead of a point exceeds the criterion.

    The second half of a stencil is ahead of the point, so each bond is checked once. In most steps hardly any bond
    breaks; blocks without a flag then cost half as much as in `break_bonds`.
    """
    vec3 = layout.types.vec3
    f = family_functions(layout)
    Family = f.struct
    exceeds, Constants = criterion.exceeds, criterion.struct
    word_size, block = WORD, SCREENED

    @kernel(per="block")
    def screen(
        family: Family,
        displacement: wp.array(dtype=vec3),
        criterion: Constants,
        first: int,
        exceeding: wp.array(dtype=wp.uint8),
    ):
        b = wp.tid() + first
        found = wp.uint8(0)
        half = family.members // 2
        for i in range(b * block, wp.min((b + 1) * block, displacement.shape[0])):
            for word in range(half // word_size, family.words):
                members = family.intact[word, i]
                begin = word * word_size
                for k in range(wp.max(half, begin), wp.min(family.members, begin + word_size)):
                    if bit_of(members, k - begin):
                        if exceeds(family, displacement, criterion, i, k, f.neighbour(family, i, k)):
                            found = wp.uint8(1)
        exceeding[b] = found

    return screen


@functools.cache
def energy_over_step(layout: Layout, earlier_energy: wp.Function) -> wp.Function:
    """Function 2 E(half a step ago) - E(now) / 2 - E(one step ago) / 2 of the energy of a family, see above."""
    types = layout.types
    real, vec3 = types.real, types.vec3
    Family, Constants = family_functions(layout).struct, constants_of(earlier_energy)

    @wp.func
    def energy_of_step(
        family: Family,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        dt: real,
        constants: Constants,
        i: int,
    ):
        energy = real(0.0)
        for half_steps in range(wp.int32(3)):
            back = real(0.5) * real(half_steps) * dt
            part = earlier_energy(family, displacement, velocity, back, constants, i)
            energy += wp.where(half_steps == 1, real(2.0), real(-0.5)) * part
        return energy

    return energy_of_step


@functools.cache
def breaking(
    layout: Layout, criterion: Criterion, spared: bool, screened: bool, earlier_energy: wp.Function | None
) -> Kernel:
    """Kernel `break_bonds`.

    `screened`: `screening` has flagged the blocks in which a bond exceeds the criterion. `earlier_energy` is the law's
    function of the energy of a family at an earlier time, to sum the released energy; None if it is not tracked.
    """
    types = layout.types
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family = f.struct
    Constants = types.parameters if earlier_energy is None else constants_of(earlier_energy)
    exceeds, Limits = criterion.exceeds, criterion.struct
    tracked, block, word_size = earlier_energy is not None, SCREENED, WORD
    energy_of_step = energy_over_step(layout, earlier_energy) if earlier_energy is not None else None

    @wp.func
    def remaining(
        family: Family,
        displacement: wp.array(dtype=vec3),
        criterion: Limits,
        spared_mask: wp.array(dtype=wp.uint8),
        i: int,
        word: int,
        intact_bits: wp.uint32,
    ):
        """The bits of `intact_bits` whose bonds do not exceed the criterion.

        The loop has no branches, so a GPU thread has the loads of several members in flight.
        """
        left = intact_bits
        bit = wp.uint32(1)
        first_member = word * word_size
        for k in range(first_member, wp.min(first_member + word_size, family.members)):
            there = (intact_bits & bit) != wp.uint32(0)
            m = wp.where(there, f.neighbour(family, i, k), i)
            over = exceeds(family, displacement, criterion, i, k, m)
            if wp.static(spared):
                over = over and spared_mask[i] == wp.uint8(0) and spared_mask[m] == wp.uint8(0)
            left = left & ~wp.where(over, bit, wp.uint32(0))
            bit = bit << wp.uint32(1)
        return left

    @kernel(
        gathers=("displacement", "velocity", "exceeding", *(f"criterion.{name}" for name in criterion.gathers)),
        writes=("family.intact",),
    )
    def break_bonds(
        family: Family,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        criterion: Limits,
        spared_mask: wp.array(dtype=wp.uint8),
        constants: Constants,
        unit_volume: real,
        exceeding: wp.array(dtype=wp.uint8),
        first: int,
        released: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        if wp.static(screened):
            # The bonds of a point lie ahead of it and of the members behind it, of which the first is the farthest.
            any_here = bool(False)
            for b in range(wp.max(i + family.stencil_shift[0], 0) // block, i // block + 1):
                if exceeding[b] != wp.uint8(0):
                    any_here = True
            if not any_here:
                return
        breaks = bool(False)
        for word in range(family.words):
            before_bits = family.intact[word, i]
            if remaining(family, displacement, criterion, spared_mask, i, word, before_bits) != before_bits:
                breaks = True
        if breaks:
            before = real(0.0)
            if wp.static(tracked):
                before = energy_of_step(family, displacement, velocity, step[0], constants, i)
            for word in range(family.words):
                family.intact[word, i] = remaining(
                    family, displacement, criterion, spared_mask, i, word, family.intact[word, i]
                )
            if wp.static(tracked):
                after = energy_of_step(family, displacement, velocity, step[0], constants, i)
                released[i] = released[i] + wp.float64(unit_volume * (before - after))

    return break_bonds


@functools.cache
def point_damage(layout: Layout) -> Kernel:
    """Kernel `damage`."""
    real = layout.types.real
    f = family_functions(layout)
    Family = f.struct
    word_size = WORD

    @kernel()
    def damage(family: Family, first: int, out: wp.array(dtype=wp.float32)):
        """Fill `out` with the area of the lost members divided by the area of the initial family."""
        i = wp.tid() + first
        lost = real(0.0)
        for word in range(family.words):
            members = f.initial(family, i, word) & ~family.intact[word, i]
            while members != wp.uint32(0):
                k = word * word_size + lowest_bit(members)
                members = without_lowest_bit(members)
                lost += f.area(family, f.neighbour(family, i, k))
        out[i] = wp.float32(wp.min(lost / f.family_area(family, i), real(1.0)))

    return damage


@functools.cache
def lost_bond(layout: Layout) -> wp.Function:
    """Function (family, i, j) -> whether the family of i has lost its bond to j."""
    f = family_functions(layout)
    Family = f.struct
    word_size = WORD

    @wp.func
    def lost(family: Family, i: int, j: int):
        found = bool(False)
        for word in range(family.words):
            members = f.initial(family, i, word) & ~f.intact_members(family, i, word)
            while members != wp.uint32(0):
                k = word * word_size + lowest_bit(members)
                members = without_lowest_bit(members)
                if f.neighbour(family, i, k) == j:
                    found = True
        return found

    return lost


@functools.cache
def face_damage(layout: Layout) -> Kernel:
    """Kernel `find_intact_faces`."""
    Family, lost = family_functions(layout).struct, lost_bond(layout)

    @kernel(per="face")
    def find_intact_faces(
        family: Family,
        triangles: wp.array(dtype=wp.vec3i),
        first: int,
        intact_faces: wp.array(dtype=wp.uint8),
    ):
        """Mark triangles whose edge bonds are all intact; edges longer than the horizon have no bond."""
        t = wp.tid() + first
        a, b, c = triangles[t][0], triangles[t][1], triangles[t][2]
        torn = lost(family, a, b) or lost(family, b, c) or lost(family, c, a)
        intact_faces[t] = wp.uint8(1)
        if torn:
            intact_faces[t] = wp.uint8(0)

    return find_intact_faces


@functools.cache
def stiffness_left(bits: int) -> wp.Function:
    """Function d -> g(d) = (1 - d)^2."""
    real = numeric(bits).real

    @wp.func
    def stiffness_left(damage: real):
        return (real(1.0) - damage) * (real(1.0) - damage)

    return stiffness_left


@functools.cache
def degradation(bits: int) -> tuple[wp.Function, wp.Function, wp.Function]:
    """Functions of (d, m) that return g, -dg/dd and d²g/dd² for g = (1 - d)^2, where m, -dg/dd at d = 0, is 2."""
    real = numeric(bits).real

    @wp.func
    def left(d: real, m: real):
        return (real(1.0) - d) * (real(1.0) - d)

    @wp.func
    def fall(d: real, m: real):
        return real(2.0) * (real(1.0) - d)

    @wp.func
    def curvature(d: real, m: real):
        return real(2.0)

    return left, fall, curvature


@functools.cache
def weak_degradation(bits: int) -> tuple[wp.Function, wp.Function, wp.Function]:
    """The same for Lorentz's g, which falls faster at first, with any m greater than 2."""
    real = numeric(bits).real

    @wp.func
    def shape(m: real):
        return wp.min(real(1.0), real(1.5) * (m - real(2.0)) - real(0.5))

    @wp.func
    def below(d: real, m: real):
        return (real(1.0) - d) * (real(1.0) - d) + m * d * (real(1.0) + shape(m) * d)

    @wp.func
    def left(d: real, m: real):
        return (real(1.0) - d) * (real(1.0) - d) / below(d, m)

    @wp.func
    def fall(d: real, m: real):
        growth = real(1.0) + real(2.0) * shape(m)
        return m * (real(1.0) - d) * (real(1.0) + growth * d) / (below(d, m) * below(d, m))

    @wp.func
    def curvature(d: real, m: real):
        growth = real(1.0) + real(2.0) * shape(m)
        bottom = below(d, m)
        top = (real(1.0) - d) * (real(1.0) + growth * d)
        top_slope = growth - real(1.0) - real(2.0) * growth * d
        bottom_slope = m * (real(1.0) + real(2.0) * shape(m) * d) - real(2.0) * (real(1.0) - d)
        return m * (real(2.0) * top * bottom_slope - top_slope * bottom) / (bottom * bottom * bottom)

    return left, fall, curvature


@functools.cache
def soften(bits: int, value: Any) -> Kernel:
    """Kernel that reduces a value of each family, such as an energy or a stress, by the damage of its point."""
    real, left = numeric(bits).real, stiffness_left(bits)

    @kernel()
    def soften(damage: wp.array(dtype=real), first: int, values: wp.array(dtype=value)):
        i = wp.tid() + first
        values[i] = value(left(damage[i])) * values[i]

    return soften
