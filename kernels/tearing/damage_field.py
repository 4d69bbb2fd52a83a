"""Damage field d (0 to 1) at the points: it reduces the stiffness of families and breaks bonds.

    E = h sum_i A_i g(d_i) Y_i + h sum_i A_i (3 Gc / 8) (d_i / l + l |grad d|_i^2),      g(d) = (1 - d)^2,

with the mean energy density Y_i of the family of i, the area A_i represented by its bonds, the tearing energy Gc and a
length l: model AT1 of Pham, Amor, Marigo and Maurini (Int. J. Damage Mech. 20, 2011), applied to elastomers by Kumar,
Francfort and Lopez-Pamies (J. Mech. Phys. Solids 112, 2018). No damage starts below Y = 3 Gc / (16 l).

g is evaluated at the family's centre point. The force of a softened family with intact bonds is therefore g times that
of the undamaged family, and g appears only where forces are gathered. At a fixed displacement the energy is quadratic
in d:

    d_i = max(d_i earlier, min(1, (2 y_i - 1 + sum_k c_ik d_k) / (2 y_i + sum_k c_ik))),      y_i = 8 l Y_i / (3 Gc),

is one Jacobi sweep, or one Newton step for another g. Chebyshev semi-iteration (Varga, Matrix Iterative Analysis, 1962)
speeds up convergence: the next iterate is the last but one, plus a factor times the difference between the new sweep
and the last but one.
c_ik = 2 l^2 w_ik / A_i follow from the piecewise linear interpolation of d on the triangles:
sum_ik w_ik (d_i - d_k)^2 / 2 is the integral of |grad d|^2. They are symmetric, so the normal derivative of d vanishes
at free edges, and exact for a linear field on any triangulation.

A sheet of lower strength uses the g of Lorentz (Int. J. Fract. 207, 2017), which initially falls faster:

    g(d) = (1 - d)^2 / ((1 - d)^2 + m d (1 + p d)),     m = 3 Gc / (8 l strength),     p = min(1, 1.5 (m - 2) - 0.5).

m = 2 gives the g above. The energy of a tear and the damage profile around it are unchanged. Force kernels get 1 -
sqrt(g) instead of d, so they need only one form of g.

damage_step.py has the kernels, and lists the points at which all this happens.

A bond breaks permanently where d has reached `severed_at` at one of its ends, or at a common member within NEAR
spacings of the line between its ends. No fitted deformation gradient then spans the faces of a tear. `severed_at` is
the damage of two rows of points with a crack between them. Around an initial cut, whose bonds are broken from the
start, no further bonds break before d has grown. A point passed by a tear, with damage near `severed_at` and the
fraction PASSED of its bonds broken, is also severed; otherwise it would remain as a strand between the faces. Ahead of
the end of a cut, where half of the members belong to the cut, the fraction PASSED_END is enough.
"""

import functools
from typing import Any

import warp as wp

from ..families import WORD, Layout, bit_of, family_functions, number_of_bits
from ..numeric import constants_of, numeric
from ..rupture import degradation, energy_over_step, weak_degradation
from ..threads import sum_of_lanes, wait_for_blocks

NEAR = 0.55
# Limits above which a point is severed that a tear has passed, see above.
NEARLY, PASSED, PASSED_END = 0.9, 0.4, 0.25


@functools.cache
def field_struct(bits: int) -> Any:
    """Struct of a damage field: first what it does not change.

    spared_mask: Points that are excluded from damage, if there are any.
    members: Members whose bonds may be stretched so far that their points are damaged.
    shortest, longest: Range of their squared stretch in which the energy stays below the limit.
    shifts, x, y, least, most: On a lattice, of up to four members: difference of indices, components [m], and range of
        the squared length [m^2], here with some margin for round-off.
    scale: Factor that turns the energy of a family into y.
    fastest: m of the g in use, see above.
    ahead: Points beyond the end of a cut.
    neighbours, couplings: Neighbours of a point and c_ik, [neighbours, points].
    relaxations: Factors of the sweeps.
    squared_reach: Squared distance from a severed point at which bonds break, in units of horizon^2.
    damage, other: Damage after even and odd sweeps; between steps both are the damage.
    before, driving: Damage before the sweeps, and y, of listed points; -1 where damage cannot change.
    severed_at: Damage at which a point is severed.
    softening: 1 - sqrt(g), where that is not the damage.
    awake, near_damage: Points to look at in every step, and those with damage in their family.
    listed, count, found: The list of points, its length, and those of the lists of all CPU threads.
    arrived: Counter of barriers.
    """
    types = numeric(bits)
    real, four = types.real, types.parameters

    @wp.struct
    class Field:
        spared_mask: wp.array(dtype=wp.uint8)
        members: wp.array(dtype=wp.int32)
        shortest: real
        longest: real
        shifts: wp.vec4i
        x: four
        y: four
        least: four
        most: four
        scale: wp.array(dtype=real)
        fastest: real
        ahead: wp.array(dtype=wp.uint8)
        neighbours: wp.array2d(dtype=wp.int32)
        couplings: wp.array2d(dtype=real)
        relaxations: wp.array(dtype=real)
        squared_reach: wp.array(dtype=real)
        damage: wp.array(dtype=real)
        other: wp.array(dtype=real)
        before: wp.array(dtype=real)
        driving: wp.array(dtype=real)
        severed_at: wp.array(dtype=real)
        softening: wp.array(dtype=real)
        awake: wp.array(dtype=wp.uint8)
        near_damage: wp.array(dtype=wp.uint8)
        listed: wp.array(dtype=wp.int32)
        count: wp.array(dtype=wp.int32)
        found: wp.array(dtype=wp.int32)
        arrived: wp.array(dtype=wp.int32)

    return Field


@wp.struct
class OtherFamilies:
    """The list of families that a kernel of undamaged inner families leaves to another one.

    Bonds may break between the two kernels if the families that lose their first one are added to the list. Without
    arrays there is no list.

    family_class: Class of each family, (N,).
    inner, undamaged: Class of the inner families, and the bits of the bonds of an undamaged one.
    stop: Number of points that the first kernel reaches; later ones list the others themselves.
    points, count: The list and the number of its entries, (1,).
    """

    family_class: wp.array(dtype=wp.int32)
    inner: wp.int32
    undamaged: wp.uint32
    stop: wp.int32
    points: wp.array(dtype=wp.int32)
    count: wp.array(dtype=wp.int32)


@functools.cache
def driving(layout: Layout, driving_energy: wp.Function, partial_energy: wp.Function | None, lanes: int) -> wp.Function:
    """Function of a thread that fills `driving` and `before` at listed points; it severs those that a tear has passed.

    Args:
        layout: Layout of the families.
        driving_energy: Warp function of the part of a family's energy that drives damage, at an earlier time.
        partial_energy: Warp function of what a thread adds to it, if several threads share a family.
        lanes: Number of these threads, or 1.
    """
    types = layout.types
    real, vec3, Constants = types.real, types.vec3, constants_of(driving_energy)
    f = family_functions(layout)
    Family, Field = f.struct, field_struct(layout.bits)
    sum_lanes = sum_of_lanes(layout.bits)

    @wp.func
    def fraction_broken(family: Family, i: int):
        """Fraction of the bonds of a point that are broken."""
        broken = wp.int32(0)
        members = wp.int32(0)
        for word in range(family.words):
            initial = f.initial(family, i, word)
            members += number_of_bits(initial)
            broken += number_of_bits(initial & ~family.intact[word, i])
        return real(broken) / real(wp.max(members, 1))

    @wp.func
    def drive_points(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        a: Field,
        thread: int,
        end: int,
        stride: int,
    ):
        """`stride`: number of families that threads work on at once."""
        lane = thread % wp.static(lanes)
        for n in range(thread // wp.static(lanes), end, stride):
            i = a.listed[n]
            stored = real(0.0)
            if wp.static(lanes > 1):
                part = partial_energy(family, displacement, constants, i, lane, wp.static(lanes))
                stored = sum_lanes(part, wp.static(lanes))
            else:
                stored = driving_energy(family, displacement, displacement, real(0.0), constants, i)
            if lane == 0:
                y = a.scale[i] * stored
                a.driving[i] = wp.where(y * a.fastest > real(1.0) or a.awake[i] != wp.uint8(0), y, real(-1.0))
                a.before[i] = a.damage[i]
                if a.damage[i] < a.severed_at[i] and a.damage[i] > real(NEARLY) * a.severed_at[i]:
                    enough = wp.where(a.ahead[i] != wp.uint8(0), real(PASSED_END), real(PASSED))
                    if fraction_broken(family, i) >= enough:
                        a.severed_at[i] = a.damage[i]

    return drive_points


@functools.cache
def sweeping(layout: Layout, weak: bool, near: int) -> wp.Function:
    """Function of a thread that sweeps over listed points, with so many neighbours (`near`) in the tables of couplings.

    `weak`: the strength is less than 3 Gc / (16 l).
    """
    real, Field = layout.types.real, field_struct(layout.bits)
    _, fall, curvature = (weak_degradation if weak else degradation)(layout.bits)
    Indices = wp.types.vector(length=near, dtype=wp.int32)
    Couplings = wp.types.vector(length=near, dtype=real)

    @wp.func
    def couplings_of(a: Field, i: int):
        m, c = Indices(), Couplings()
        for k in range(wp.static(near)):
            m[k] = a.neighbours[k, i]
            c[k] = a.couplings[k, i]
        return m, c

    @wp.func
    def swept(
        source: wp.array(dtype=real),
        m: Indices,
        c: Couplings,
        y: real,
        d: real,
        earlier: real,
        least: real,
        fastest: real,
        relaxation: real,
    ):
        """Damage of a point after a sweep, from that of the last sweep and of the one before."""
        if y < real(0.0):
            return d
        above = fall(d, fastest) * y - real(1.0)
        below = curvature(d, fastest) * y
        for k in range(wp.static(near)):
            above += c[k] * (source[m[k]] - d)
            below += c[k]
        # A factor of 1 must leave no trace of the earlier damage.
        return wp.clamp(relaxation * (d + above / below) + (real(1.0) - relaxation) * earlier, least, real(1.0))

    @wp.func
    def sweep_rest(
        a: Field,
        relaxation: real,
        thread: int,
        end: int,
        stride: int,
        source: wp.array(dtype=real),
        target: wp.array(dtype=real),
    ):
        """Sweep over all but the first point of a thread; on entry `target` has the last damage but one."""
        for n in range(thread + stride, end, stride):
            j = a.listed[n]
            m, c = couplings_of(a, j)
            target[j] = swept(source, m, c, a.driving[j], source[j], target[j], a.before[j], a.fastest, relaxation)

    @wp.func
    def sweep_points(a: Field, sweep_begin: int, sweep_end: int, thread: int, end: int, stride: int, blocks: int):
        """All threads of the first `blocks` blocks call it, which wait for each other between sweeps."""
        # What a thread needs of its first point stays in its registers.
        i = a.listed[wp.min(thread, end - 1)]
        m, c = couplings_of(a, i)
        y, least = a.driving[i], a.before[i]
        even = sweep_begin % 2 == 0
        now = wp.where(even, a.damage[i], a.other[i])
        earlier = wp.where(even, a.other[i], a.damage[i])
        for number in range(sweep_begin, sweep_end):
            if number > sweep_begin:
                wait_for_blocks(a.arrived, blocks)
            relaxation = a.relaxations[number]
            new = now
            if number % 2 == 0:
                new = swept(a.damage, m, c, y, now, earlier, least, a.fastest, relaxation)
                if thread < end:
                    a.other[i] = new
                sweep_rest(a, relaxation, thread, end, stride, a.damage, a.other)
            else:
                new = swept(a.other, m, c, y, now, earlier, least, a.fastest, relaxation)
                if thread < end:
                    a.damage[i] = new
                sweep_rest(a, relaxation, thread, end, stride, a.other, a.damage)
            earlier = now
            now = new

    return sweep_points


@functools.cache
def finishing(layout: Layout, spared: bool, tracked: bool, weak: bool, earlier_energy: wp.Function) -> wp.Function:
    """Function of a thread that breaks bonds of listed points and wakes the neighbours of new damage.

    Args:
        layout: Layout of the families.
        spared: Whether some points are excluded from damage.
        tracked: Whether to sum the released energy.
        weak: Whether the strength is less than 3 Gc / (16 l).
        earlier_energy: Warp function of the force law's energy of a family at an earlier time.
    """
    types = layout.types
    real, vec3, Constants = types.real, types.vec3, constants_of(earlier_energy)
    f = family_functions(layout)
    Family, Field, word_size = f.struct, field_struct(layout.bits), WORD
    left = (weak_degradation if weak else degradation)(layout.bits)[0]
    energy_of_step = energy_over_step(layout, earlier_energy)

    @wp.func
    def off_line(family: Family, i: int, k: int, other: int):
        """Squared distance of a member from bond k, in units of horizon^2; large if it lies beyond an end.

        Only members nearer to both ends than the ends are to each other count, so both ends of a bond agree.
        """
        X = f.chord(family, i, k)
        Z = f.chord(family, i, other)
        along = wp.dot(X, Z)
        there = wp.dot(X, X)
        squared = wp.dot(Z, Z)
        between = squared < there and squared < real(2.0) * along
        return wp.where(between, squared - along * along / there, real(1.0e9))

    # Called twice, and not inlined, for faster compilation.
    @wp.func(inline=False)
    def bonds_left(
        family: Family,
        damage: wp.array(dtype=real),
        severed_at: wp.array(dtype=real),
        spared_mask: wp.array(dtype=wp.uint8),
        squared_reach: wp.array(dtype=real),
        i: int,
        word: int,
    ):
        """Bits of the bonds of one word that stay intact."""
        kept = family.intact[word, i]
        begin = word * word_size
        for k in range(begin, wp.min(begin + word_size, family.members)):
            if bit_of(family.intact[word, i], k - begin):
                m = f.neighbour(family, i, k)
                breaks = damage[i] >= severed_at[i] or damage[m] >= severed_at[m]
                for other in range(family.members):
                    if bit_of(f.initial(family, i, other // word_size), other % word_size):
                        p = f.neighbour(family, i, other)
                        if damage[p] >= severed_at[p]:
                            breaks = breaks or off_line(family, i, k, other) < squared_reach[p]
                if wp.static(spared):
                    breaks = breaks and spared_mask[m] == wp.uint8(0)
                if breaks:
                    kept = kept & ~(wp.uint32(1) << wp.uint32(k - begin))
        return kept

    @wp.func
    def near_severed(family: Family, damage: wp.array(dtype=real), severed_at: wp.array(dtype=real), i: int):
        """Whether the point or any member of its undamaged family is severed; most points need no further check."""
        found = damage[i] >= severed_at[i]
        for word in range(family.words):
            members = f.initial(family, i, word)
            begin = word * word_size
            for k in range(begin, wp.min(begin + word_size, family.members)):
                m = wp.where(bit_of(members, k - begin), f.neighbour(family, i, k), i)
                found = found or damage[m] >= severed_at[m]
        return found

    @wp.func
    def finish_points(
        family: Family,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        constants: Constants,
        unit_volume: real,
        a: Field,
        thread: int,
        end: int,
        stride: int,
        others: OtherFamilies,
        released: wp.array(dtype=wp.float64),
    ):
        for n in range(thread, end, stride):
            i = a.listed[n]
            if a.damage[i] > real(0.0) and a.before[i] == real(0.0):
                a.awake[i] = wp.uint8(1)
                for k in range(a.neighbours.shape[0]):
                    a.awake[a.neighbours[k, i]] = wp.uint8(1)
                a.near_damage[i] = wp.uint8(1)
                for k in range(family.members):
                    if bit_of(f.initial(family, i, k // word_size), k % word_size):
                        a.near_damage[f.neighbour(family, i, k)] = wp.uint8(1)
            if wp.static(weak):
                a.softening[i] = real(1.0) - wp.sqrt(left(a.damage[i], a.fastest))
            grows = a.damage[i] > a.before[i]
            breaks = bool(False)
            if near_severed(family, a.damage, a.severed_at, i):
                for word in range(family.words):
                    kept = bonds_left(family, a.damage, a.severed_at, a.spared_mask, a.squared_reach, i, word)
                    breaks = breaks or kept != family.intact[word, i]
            # One loop before and after bonds break, as the compiler spells out what stands twice.
            lost = real(0.0)
            for after in range(wp.where(breaks, 2, 1)):
                if after == 1:
                    if i < others.stop:
                        # The kernel of undamaged families has taken it for one.
                        if others.family_class[i] == others.inner and family.intact[0, i] == others.undamaged:
                            others.points[wp.atomic_add(others.count, 0, 1)] = i
                    for word in range(family.words):
                        family.intact[word, i] = bonds_left(
                            family, a.damage, a.severed_at, a.spared_mask, a.squared_reach, i, word
                        )
                if wp.static(tracked):
                    if breaks or grows:
                        stored = energy_of_step(family, displacement, velocity, step[0], constants, i)
                        now = left(a.damage[i], a.fastest)
                        if after == 1:
                            lost -= now * stored
                        elif breaks:
                            lost = left(a.before[i], a.fastest) * stored
                        else:
                            lost = (left(a.before[i], a.fastest) - now) * stored
            if wp.static(tracked):
                released[i] = released[i] + wp.float64(unit_volume * lost)

    return finish_points
