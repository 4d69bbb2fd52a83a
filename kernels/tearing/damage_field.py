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

from ..damage import degradation
from ..families import WORD, Layout, bit_of, family_functions, number_of_bits
from ..numeric import constants_of, numeric
from ..rupture import energy_over_step
from ..threads import sum_of_lanes, wait_for_blocks

NEAR = 0.55
# Limits above which a point is severed that a tear has passed, see above.
NEARLY, PASSED, PASSED_END = 0.9, 0.4, 0.25


@functools.cache
def field_tables(bits: int) -> Any:
    """Struct of what a damage field does not change.

    spared_mask: Points that are excluded from damage, if there are any.
    members: Members whose bonds may be stretched so far that their points are damaged.
    shortest, longest: Range of their squared stretch in which the energy stays below the limit.
    shifts, x, y, least, most: On a lattice, of up to four members: difference of indices, components [m], and range of
        the squared length [m^2], here with some margin for round-off.
    scale: Factor that turns the energy of a family into y.
    fastest: m of the g in use, see kernels/tearing/damage_field.py.
    ahead: Points beyond the end of a cut.
    neighbours, couplings: Neighbours of a point and c_ik, [neighbours, points].
    relaxations: Factors of the sweeps.
    squared_reach: Squared distance from a severed point at which bonds break, in units of horizon^2.
    """
    types = numeric(bits)
    real, four = types.real, types.parameters

    @wp.struct
    class FieldTables:
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

    return FieldTables


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
    """Function `drive_points` of a thread: what `drive` does; arguments as for `damage_field`."""
    types = layout.types
    real, vec3, Constants = types.real, types.vec3, constants_of(driving_energy)
    f = family_functions(layout)
    Family, Tables = f.struct, field_tables(layout.bits)
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
        tables: Tables,
        awake: wp.array(dtype=wp.uint8),
        damage: wp.array(dtype=real),
        listed: wp.array(dtype=wp.int32),
        thread: int,
        end: int,
        stride: int,
        severed_at: wp.array(dtype=real),
        driving: wp.array(dtype=real),
        before: wp.array(dtype=real),
    ):
        """`stride`: number of families that threads work on at once."""
        lane = thread % wp.static(lanes)
        for n in range(thread // wp.static(lanes), end, stride):
            i = listed[n]
            stored = real(0.0)
            if wp.static(lanes > 1):
                part = partial_energy(family, displacement, constants, i, lane, wp.static(lanes))
                stored = sum_lanes(part, wp.static(lanes))
            else:
                stored = driving_energy(family, displacement, displacement, real(0.0), constants, i)
            if lane == 0:
                y = tables.scale[i] * stored
                driving[i] = wp.where(y * tables.fastest > real(1.0) or awake[i] != wp.uint8(0), y, real(-1.0))
                before[i] = damage[i]
                if damage[i] < severed_at[i] and damage[i] > real(NEARLY) * severed_at[i]:
                    enough = wp.where(tables.ahead[i] != wp.uint8(0), real(PASSED_END), real(PASSED))
                    if fraction_broken(family, i) >= enough:
                        severed_at[i] = damage[i]

    return drive_points


@functools.cache
def sweeping(layout: Layout, weak: bool, near: int) -> wp.Function:
    """Function `sweep_points` of a thread: what `sweep` does; arguments as for `damage_field`."""
    real, Tables = layout.types.real, field_tables(layout.bits)
    _, fall, curvature = degradation(layout.bits, weak)
    Indices = wp.types.vector(length=near, dtype=wp.int32)
    Couplings = wp.types.vector(length=near, dtype=real)

    @wp.func
    def couplings_of(tables: Tables, i: int):
        m, c = Indices(), Couplings()
        for k in range(wp.static(near)):
            m[k] = tables.neighbours[k, i]
            c[k] = tables.couplings[k, i]
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
    def sweep_once(
        tables: Tables,
        driving: wp.array(dtype=real),
        before: wp.array(dtype=real),
        relaxation: real,
        listed: wp.array(dtype=wp.int32),
        thread: int,
        end: int,
        stride: int,
        source: wp.array(dtype=real),
        target: wp.array(dtype=real),
        i: int,
        m: Indices,
        c: Couplings,
        y: real,
        now: real,
        earlier: real,
        least: real,
    ):
        """Sweep over the points of a thread; on entry `target` holds the damage of the last sweep but one.

        What belongs to its first point, i, is given. The result is the damage there.
        """
        new = swept(source, m, c, y, now, earlier, least, tables.fastest, relaxation)
        if thread < end:
            target[i] = new
        for n in range(thread + stride, end, stride):
            j = listed[n]
            near_j, couplings_j = couplings_of(tables, j)
            target[j] = swept(
                source, near_j, couplings_j, driving[j], source[j], target[j], before[j], tables.fastest, relaxation
            )
        return new

    @wp.func
    def sweep_points(
        tables: Tables,
        driving: wp.array(dtype=real),
        before: wp.array(dtype=real),
        sweep_begin: int,
        sweep_end: int,
        listed: wp.array(dtype=wp.int32),
        thread: int,
        end: int,
        stride: int,
        blocks: int,
        damage: wp.array(dtype=real),
        other: wp.array(dtype=real),
        arrived: wp.array(dtype=wp.int32),
    ):
        """All threads of the first `blocks` blocks call it, which wait for each other between sweeps."""
        # What a thread needs of its first point stays in its registers.
        i = listed[wp.min(thread, end - 1)]
        m, c = couplings_of(tables, i)
        y, least = driving[i], before[i]
        even = sweep_begin % 2 == 0
        now = wp.where(even, damage[i], other[i])
        earlier = wp.where(even, other[i], damage[i])
        for number in range(sweep_begin, sweep_end):
            if number > sweep_begin:
                wait_for_blocks(arrived, blocks)
            relaxation = tables.relaxations[number]
            new = now
            if number % 2 == 0:
                new = sweep_once(
                    tables, driving, before, relaxation, listed, thread, end, stride,
                    damage, other, i, m, c, y, now, earlier, least,
                )  # fmt: skip
            else:
                new = sweep_once(
                    tables, driving, before, relaxation, listed, thread, end, stride,
                    other, damage, i, m, c, y, now, earlier, least,
                )  # fmt: skip
            earlier = now
            now = new

    return sweep_points


@functools.cache
def finishing(layout: Layout, spared: bool, tracked: bool, weak: bool, earlier_energy: wp.Function) -> wp.Function:
    """Function `finish_points` of a thread: what `finish` does; arguments as for `damage_field`."""
    types = layout.types
    real, vec3, Constants = types.real, types.vec3, constants_of(earlier_energy)
    f = family_functions(layout)
    Family, Tables, word_size = f.struct, field_tables(layout.bits), WORD
    left = degradation(layout.bits, weak)[0]
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
        tables: Tables,
        severed_at: wp.array(dtype=real),
        damage: wp.array(dtype=real),
        before: wp.array(dtype=real),
        listed: wp.array(dtype=wp.int32),
        thread: int,
        end: int,
        stride: int,
        others: OtherFamilies,
        awake: wp.array(dtype=wp.uint8),
        near_damage: wp.array(dtype=wp.uint8),
        softening: wp.array(dtype=real),
        released: wp.array(dtype=wp.float64),
    ):
        for n in range(thread, end, stride):
            i = listed[n]
            if damage[i] > real(0.0) and before[i] == real(0.0):
                awake[i] = wp.uint8(1)
                for k in range(tables.neighbours.shape[0]):
                    awake[tables.neighbours[k, i]] = wp.uint8(1)
                near_damage[i] = wp.uint8(1)
                for k in range(family.members):
                    if bit_of(f.initial(family, i, k // word_size), k % word_size):
                        near_damage[f.neighbour(family, i, k)] = wp.uint8(1)
            if wp.static(weak):
                softening[i] = real(1.0) - wp.sqrt(left(damage[i], tables.fastest))
            grows = damage[i] > before[i]
            breaks = bool(False)
            if near_severed(family, damage, severed_at, i):
                for word in range(family.words):
                    kept = bonds_left(family, damage, severed_at, tables.spared_mask, tables.squared_reach, i, word)
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
                            family, damage, severed_at, tables.spared_mask, tables.squared_reach, i, word
                        )
                if wp.static(tracked):
                    if breaks or grows:
                        stored = energy_of_step(family, displacement, velocity, step[0], constants, i)
                        now = left(damage[i], tables.fastest)
                        if after == 1:
                            lost -= now * stored
                        elif breaks:
                            lost = left(before[i], tables.fastest) * stored
                        else:
                            lost = (left(before[i], tables.fastest) - now) * stored
            if wp.static(tracked):
                released[i] = released[i] + wp.float64(unit_volume * lost)

    return finish_points
