"""Bending: an energy of the curvature of the deformed surface, on triangles with slopes fitted at their corners.

The slope of a point is the gradient G of the displacement there, by the least-squares fit of a quadratic to the points
around it: G_c = sum_j w_cj (u_j - u_c). With the sides e_m of a triangle in the plane of corner c, d_cm = F_c e_m are
the derivatives of the position along them, and

    g_lm = d_lm - d_0m (made symmetric),   r_m = x_m - x_0 - (d_0m + d_mm) / 2,

the second derivative of the position along two sides, and what a straight average of the slopes misses along a side
(likewise along the side from 1 to 2). With the unit normal n of the triangle and its area A in the stress-free sheet,

    E = D A / 2 [nu k_ll k_mm + (1 - nu) k_lm k_lm + STIFFENING sum (n . r)^2 / |e|^4],    k_lm = n . g_lm,

less the values of k and n . r of the stress-free sheet, with indices raised by its metric. See docs/bending.md.
The force is minus the gradient of E, including that of n; kernels/bending/tangent.py has its derivative.

With damage, E of a triangle is multiplied by what is left of its stiffness: the least g = (1 - d)^2 of its corners
(kernels/tearing/damage_field.py), and 0 for good once a bond within the fit of one of them is broken, since a fit
across a tear is no slope. The energy that this takes is summed over each step as kernels/rupture.py says.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..effects import Kernel, kernel
from ..numeric import entry_of, numeric, put_entry

# With this factor the energy of a single row of points is that of the second difference over three adjacent points.
STIFFENING = 4.0
# Steps longer than this are not of interest.
FAR = 1e3
# Rows of what triangles store: the normal, the couples of three corners, what pulls at corners 1 and 2.
NORMAL, COUPLES, PULLS, ROWS = 0, 3, 9, 15


@dataclass(frozen=True)
class TriangleFunctions:
    """Warp functions of a triangle t.

    Attributes:
        plane: (plate, t, corner) -> its sides in the plane of a corner.
        corners_of: (plate, t) -> its points.
        vectors: (first, second, d0, d1, d2) -> the six vectors g and r, from its sides and what the slopes of its
            corners make of them.
        moments_of: (plate, t, strains) -> derivatives of its energy by the six strains.
        added_to_sides: (corners, displacement) -> what it adds to the sides.
        sides_by: (plate, t, first, second) -> its sides, from what a displacement adds to them.
        bent_by: (plate, t, first, second, vectors) -> its state, from what a displacement adds to these.
        bent: (plate, t, displacement, slope) -> its state.
    """

    plane: wp.Function
    corners_of: wp.Function
    vectors: wp.Function
    moments_of: wp.Function
    added_to_sides: wp.Function
    sides_by: wp.Function
    bent_by: wp.Function
    bent: wp.Function


@dataclass(frozen=True)
class BendingKernels:
    """Kernels of one configuration.

    Attributes:
        Plate: Warp struct of the tables.
        keep: Copies a displacement.
        slopes: Gradient of a displacement at each point.
        moments: Gradient of the energy of each triangle by the slopes and sides of its corners.
        turning: Step along a direction that turns or stretches a side of a triangle at a point by its length.
        gather: Adds the triangles' gradients by slopes up at each point, those by positions to the force.
        spread: Adds the force of the slopes to the points that they were fitted to.
        energy: Energy at each point, a third of each of its triangles.
        weaken: Reduces what is left of the stiffness of triangles, and sums the energy lost; None without damage.
        share_lost: Energy lost at each point, a third of each of its triangles; None without damage.
    """

    Plate: Any
    keep: Kernel
    slopes: Kernel
    moments: Kernel
    turning: Kernel
    gather: Kernel
    spread: Kernel
    energy: Kernel
    weaken: Kernel | None = None
    share_lost: Kernel | None = None


@functools.cache
def plate_tables(bits: int) -> Any:
    """Warp struct of the tables of points and triangles."""
    types = numeric(bits)
    real, vec3, vec2, mat22 = types.real, types.vec3, types.vec2, types.mat22

    @wp.struct
    class Plate:
        # Points are of few kinds on a lattice: tables have a column for each kind, so that a step reads few bytes.
        kind: wp.array(dtype=wp.int32)
        counts: wp.array(dtype=wp.vec3i)  # entries of `ring`, of `fitted`, and of `around`
        ring: wp.array2d(dtype=wp.int32)  # steps to the points of a fit
        weights: wp.array2d(dtype=vec2)
        own: wp.array(dtype=vec2)  # sum of the weights
        fitted: wp.array2d(dtype=wp.int32)  # steps to the points whose fit has this one
        fitted_weights: wp.array2d(dtype=vec2)
        around: wp.array2d(dtype=wp.int32)  # 3 x triangle + corner, less 3 x the first triangle of the point
        first_triangle: wp.array(dtype=wp.int32)
        # Triangles are of few kinds, too.
        face_kind: wp.array(dtype=wp.int32)
        first_corner: wp.array(dtype=wp.int32)
        corners: wp.array(dtype=wp.vec3i)  # steps from the first corner
        sides: wp.array2d(dtype=mat22)  # columns: sides 1 and 2 in the plane of a corner, (3, kinds); flat: (1, kinds)
        stiffness: wp.array(dtype=real)  # D times area [J m^2]
        rest_sides: wp.array2d(dtype=vec3)  # only of curved sheets, (2, F)
        rest: wp.array2d(dtype=vec3)  # g and r of the stress-free sheet, (6, F)
        poisson: real
        # Only if bonds can break.
        via: wp.array2d(dtype=wp.int32)  # steps to points whose bonds a fit spans, the first is the point itself
        spans: wp.array2d(dtype=wp.uint32)  # bits of these bonds, (steps x words, kinds)
        left: wp.array(dtype=real)  # of the stiffness of a triangle

    return Plate


@functools.cache
def components(bits: int) -> tuple[wp.Function, ...]:
    """Functions for arrays (rows, N) with a row for each component of a vector or a 3 x 2 matrix.

    A component of all points lies together: a row of threads then reads whole lines of memory.

    Returns:
        (values, i) -> matrix i, whose components are rows 0 to 5; (values, i, matrix), which stores it;
        (values, row, i) -> vector i, whose components begin at a row; (values, row, i, vector), which stores it.
    """
    types = numeric(bits)
    real, vec3, mat32 = types.real, types.vec3, types.mat32
    real_of, put_real = entry_of(real, 2), put_entry(real, 2)

    @wp.func
    def matrix_at(values: wp.array2d(dtype=real), i: int):
        n = values.shape[1]
        return mat32(
            real_of(values, i), real_of(values, n + i), real_of(values, 2 * n + i), real_of(values, 3 * n + i),
            real_of(values, 4 * n + i), real_of(values, 5 * n + i),
        )  # fmt: skip

    @wp.func
    def put_matrix(values: wp.array2d(dtype=real), i: int, value: mat32):
        for c in range(3):
            put_real(values, 2 * c * values.shape[1] + i, value[c, 0])
            put_real(values, (2 * c + 1) * values.shape[1] + i, value[c, 1])

    @wp.func
    def vector_at(values: wp.array2d(dtype=real), row: int, i: int):
        n = values.shape[1]
        return vec3(
            real_of(values, row * n + i), real_of(values, (row + 1) * n + i), real_of(values, (row + 2) * n + i)
        )

    @wp.func
    def put_vector(values: wp.array2d(dtype=real), row: int, i: int, value: vec3):
        for c in range(3):
            put_real(values, (row + c) * values.shape[1] + i, value[c])

    return matrix_at, put_matrix, vector_at, put_vector


@functools.cache
def triangle_functions(bits: int, curved: bool, breakable: bool) -> TriangleFunctions:
    """Functions of triangles; arguments as for `bending`."""
    types = numeric(bits)
    real, vec3, mat22, mat32, vec6 = types.real, types.vec3, types.mat22, types.mat32, types.vec6
    mat63 = wp.types.matrix((6, 3), real)
    half, two = wp.constant(real(0.5)), wp.constant(real(2.0))
    stiffening = wp.constant(real(STIFFENING))
    Plate, matrix_at = plate_tables(bits), components(bits)[0]
    point_of, sides_of = entry_of(vec3, 1), entry_of(mat22, 2)

    @wp.struct
    class Bent:
        first: vec3  # sides
        second: vec3
        normal: vec3
        over: real  # 1 over twice the area
        vectors: mat63
        strain: vec6
        moment: vec6

    @wp.func
    def plane(plate: Plate, t: int, corner: int):
        if wp.static(curved):
            return sides_of(plate.sides, corner * plate.sides.shape[1] + plate.face_kind[t])
        else:
            return sides_of(plate.sides, plate.face_kind[t])

    @wp.func
    def stiffness_of(plate: Plate, t: int):
        if wp.static(breakable):
            return plate.left[t] * plate.stiffness[plate.face_kind[t]]
        else:
            return plate.stiffness[plate.face_kind[t]]

    @wp.func
    def vectors(first: vec3, second: vec3, d0: mat32, d1: mat32, d2: mat32):
        x0, y0 = vec3(d0[0, 0], d0[1, 0], d0[2, 0]), vec3(d0[0, 1], d0[1, 1], d0[2, 1])
        x1, y1 = vec3(d1[0, 0], d1[1, 0], d1[2, 0]), vec3(d1[0, 1], d1[1, 1], d1[2, 1])
        x2, y2 = vec3(d2[0, 0], d2[1, 0], d2[2, 0]), vec3(d2[0, 1], d2[1, 1], d2[2, 1])
        out = mat63()
        out[0] = x1 - x0
        out[1] = y2 - y0
        out[2] = half * (y1 - y0 + x2 - x0)
        out[3] = first - half * (x0 + x1)
        out[4] = second - half * (y0 + y2)
        out[5] = second - first - half * (y1 - x1 + y2 - x2)
        return out

    @wp.func
    def moments_of(plate: Plate, t: int, k: vec6):
        s = plane(plate, t, 0)
        aa = s[0, 0] * s[0, 0] + s[1, 0] * s[1, 0]
        bb = s[0, 1] * s[0, 1] + s[1, 1] * s[1, 1]
        ab = s[0, 0] * s[0, 1] + s[1, 0] * s[1, 1]
        over = real(1.0) / (aa * bb - ab * ab)
        p, q, r = bb * over, aa * over, -ab * over
        size, nu = stiffness_of(plate, t), plate.poisson
        # Mixed components of the curvature.
        kaa, kab = p * k[0] + r * k[2], p * k[2] + r * k[1]
        kba, kbb = r * k[0] + q * k[2], r * k[2] + q * k[1]
        share, trace = real(1.0) - nu, nu * (kaa + kbb)
        cc = aa + bb - two * ab
        return size * vec6(
            trace * p + share * (kaa * p + kab * r),
            trace * q + share * (kba * r + kbb * q),
            two * trace * r + share * (kaa * r + kab * q + kba * p + kbb * r),
            stiffening * k[3] / (aa * aa),
            stiffening * k[4] / (bb * bb),
            stiffening * k[5] / (cc * cc),
        )

    @wp.func
    def corners_of(plate: Plate, t: int):
        start = plate.first_corner[t]
        return plate.corners[plate.face_kind[t]] + wp.vec3i(start, start, start)

    @wp.func
    def added_to_sides(corners: wp.vec3i, displacement: wp.array(dtype=vec3)):
        origin = point_of(displacement, corners[0])
        return point_of(displacement, corners[1]) - origin, point_of(displacement, corners[2]) - origin

    @wp.func
    def changed(plate: Plate, t: int, displacement: wp.array(dtype=vec3), slope: wp.array2d(dtype=real)):
        c = corners_of(plate, t)
        first, second = added_to_sides(c, displacement)
        d0, d1, d2 = (
            matrix_at(slope, c[0]) * plane(plate, t, 0),
            matrix_at(slope, c[1]) * plane(plate, t, 1),
            matrix_at(slope, c[2]) * plane(plate, t, 2),
        )
        return first, second, vectors(first, second, d0, d1, d2)

    @wp.func
    def sides_by(plate: Plate, t: int, first: vec3, second: vec3):
        if wp.static(curved):
            return first + plate.rest_sides[0, t], second + plate.rest_sides[1, t]
        else:
            s, zero = plane(plate, t, 0), real(0.0)
            return first + vec3(s[0, 0], s[1, 0], zero), second + vec3(s[0, 1], s[1, 1], zero)

    @wp.func
    def bent_by(plate: Plate, t: int, first: vec3, second: vec3, given: mat63):
        b = Bent()
        found = given
        here_first, here_second = sides_by(plate, t, first, second)
        b.first = here_first
        b.second = here_second
        product = wp.cross(b.first, b.second)
        b.over = real(1.0) / wp.length(product)
        b.normal = product * b.over
        if wp.static(curved):
            rest = wp.normalize(wp.cross(plate.rest_sides[0, t], plate.rest_sides[1, t]))
            for k in range(6):
                # n . (rest + change) - n_rest . rest, without the difference of two large numbers.
                b.strain[k] = wp.dot(b.normal, found[k]) + wp.dot(b.normal - rest, plate.rest[k, t])
                found[k] = found[k] + plate.rest[k, t]
            b.vectors = found
        else:
            b.vectors = found
            b.strain = found * b.normal
        b.moment = moments_of(plate, t, b.strain)
        return b

    @wp.func
    def bent(plate: Plate, t: int, displacement: wp.array(dtype=vec3), slope: wp.array2d(dtype=real)):
        first, second, found = changed(plate, t, displacement, slope)
        return bent_by(plate, t, first, second, found)

    return TriangleFunctions(plane, corners_of, vectors, moments_of, added_to_sides, sides_by, bent_by, bent)


@functools.cache
def bending(
    bits: int, curved: bool, breakable: bool = False, softened: bool = False, tracked: bool = False
) -> BendingKernels:
    """Kernels of bending.

    Args:
        bits: 32 or 64.
        curved: Whether the sheet has a curvature free of stress, and a plane of its own at each point.
        breakable: Whether bonds can break.
        softened: Whether there is a damage field.
        tracked: Whether to sum the energy lost to damage.
    """
    types = numeric(bits)
    real, vec3, vec2, mat32, vec6 = types.real, types.vec3, types.vec2, types.mat32, types.vec6
    half, far = wp.constant(real(0.5)), wp.constant(real(FAR))
    Plate, of = plate_tables(bits), triangle_functions(bits, curved, breakable)
    plane, bent = of.plane, of.bent
    matrix_at, put_matrix, vector_at, put_vector = components(bits)
    point_of, vec2_of, step_of = entry_of(vec3, 1), entry_of(vec2, 2), entry_of(wp.int32, 2)
    real_of, put_real = entry_of(real, 2), put_entry(real, 2)

    @wp.func
    def couple_at(values: wp.array2d(dtype=real), corner: int, i: int):
        at = (COUPLES + 2 * corner) * values.shape[1] + i
        return vec2(real_of(values, at), real_of(values, at + values.shape[1]))

    @wp.func
    def put_couples(plate: Plate, t: int, normal: vec3, m: vec6, values: wp.array2d(dtype=real)):
        """Store a normal, and the derivatives of the energy by the slopes of the corners, over the normal."""
        put_vector(values, NORMAL, t, normal)
        c0 = plane(plate, t, 0) * vec2(-m[0] - half * (m[2] + m[3]), -m[1] - half * (m[2] + m[4]))
        c1 = plane(plate, t, 1) * vec2(m[0] + half * (m[5] - m[3]), half * (m[2] - m[5]))
        c2 = plane(plate, t, 2) * vec2(half * (m[2] + m[5]), m[1] - half * (m[4] + m[5]))
        n = values.shape[1]
        for c in range(2):
            put_real(values, (COUPLES + c) * n + t, c0[c])
            put_real(values, (COUPLES + 2 + c) * n + t, c1[c])
            put_real(values, (COUPLES + 4 + c) * n + t, c2[c])

    @kernel()
    def keep(displacement: wp.array(dtype=vec3), first: int, kept: wp.array(dtype=vec3)):
        i = wp.tid() + first
        kept[i] = displacement[i]

    @kernel(gathers=("displacement",))
    def slopes(plate: Plate, displacement: wp.array(dtype=vec3), first: int, slope: wp.array2d(dtype=real)):
        i = wp.tid() + first
        here, kind = displacement[i], plate.kind[i]
        total = mat32()
        for k in range(plate.counts[kind][0]):
            at = k * plate.ring.shape[1] + kind
            there = point_of(displacement, i + step_of(plate.ring, at))
            total += wp.outer(there - here, vec2_of(plate.weights, at))
        put_matrix(slope, i, total)

    @kernel(per="face", fast_math=bits == 32)
    def moments(
        plate: Plate,
        displacement: wp.array(dtype=vec3),
        slope: wp.array2d(dtype=real),
        first: int,
        pulls: wp.array2d(dtype=real),
    ):
        t = wp.tid() + first
        b = bent(plate, t, displacement, slope)
        m = b.moment
        along = wp.transpose(b.vectors) * m
        turn = (along - b.normal * wp.dot(b.normal, along)) * b.over
        put_couples(plate, t, b.normal, m, pulls)
        put_vector(pulls, PULLS, t, b.normal * (m[3] - m[5]) + wp.cross(b.second, turn))
        put_vector(pulls, PULLS + 3, t, b.normal * (m[4] + m[5]) + wp.cross(turn, b.first))

    @wp.func
    def steps_of(side: vec3, change: vec3):
        """Length of a side over that of a change, at most FAR."""
        length = wp.length(side)
        return length / wp.max(wp.length(change), length / far)

    @kernel(gathers=("displacement", "direction"))
    def turning(
        plate: Plate,
        displacement: wp.array(dtype=vec3),
        direction: wp.array(dtype=vec3),
        of_law: wp.array(dtype=real),
        first: int,
        longest: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        shortest, kind = real(far), plate.kind[i]
        if of_law:
            shortest = of_law[i]
        for k in range(plate.counts[kind][2]):
            t = plate.first_triangle[i] + step_of(plate.around, k * plate.around.shape[1] + kind) / 3
            corners = of.corners_of(plate, t)
            first_change, second_change = of.added_to_sides(corners, direction)
            u, v = of.added_to_sides(corners, displacement)
            first_side, second_side = of.sides_by(plate, t, u, v)
            shortest = wp.min(shortest, steps_of(first_side, first_change))
            shortest = wp.min(shortest, steps_of(second_side, second_change))
        longest[i] = shortest

    @wp.func
    def pulled(values: wp.array2d(dtype=real), corner: int, t: int):
        if corner == 0:
            return -vector_at(values, PULLS, t) - vector_at(values, PULLS + 3, t)
        else:
            return vector_at(values, PULLS + 3 * (corner - 1), t)

    @kernel(gathers=("pulls",))
    def gather(
        plate: Plate,
        pulls: wp.array2d(dtype=real),
        sign: real,
        first: int,
        moment: wp.array2d(dtype=real),
        force: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        total, push, kind = mat32(), vec3(), plate.kind[i]
        for k in range(plate.counts[kind][2]):
            place = step_of(plate.around, k * plate.around.shape[1] + kind)
            t, corner = plate.first_triangle[i] + place / 3, place % 3
            total += wp.outer(vector_at(pulls, NORMAL, t), couple_at(pulls, corner, t))
            push += pulled(pulls, corner, t)
        put_matrix(moment, i, total)
        force[i] = force[i] + sign * push

    @kernel(gathers=("moment",))
    def spread(plate: Plate, moment: wp.array2d(dtype=real), sign: real, first: int, force: wp.array(dtype=vec3)):
        i = wp.tid() + first
        kind = plate.kind[i]
        total = -matrix_at(moment, i) * plate.own[kind]
        for k in range(plate.counts[kind][1]):
            at = k * plate.fitted.shape[1] + kind
            total += matrix_at(moment, i + step_of(plate.fitted, at)) * vec2_of(plate.fitted_weights, at)
        force[i] = force[i] + sign * total

    @kernel(gathers=("displacement", "slope"))
    def energy(
        plate: Plate,
        displacement: wp.array(dtype=vec3),
        slope: wp.array2d(dtype=real),
        first: int,
        out: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        total, kind = wp.float64(0.0), plate.kind[i]
        for k in range(plate.counts[kind][2]):
            place = plate.around[k, kind]
            b = bent(plate, plate.first_triangle[i] + place // 3, displacement, slope)
            total += wp.float64(wp.dot(b.strain, b.moment))
        out[i] = total / wp.float64(6.0)

    weaken, share_lost = damage_of_bending(bits, curved, softened, tracked) if breakable else (None, None)
    return BendingKernels(
        Plate, keep, slopes, moments, turning, gather, spread, energy, weaken, share_lost,
    )  # fmt: skip


@functools.cache
def damage_of_bending(bits: int, curved: bool, softened: bool, tracked: bool) -> tuple[Kernel, Kernel | None]:
    """Kernels `weaken` and, if `tracked`, `share_lost`; arguments as for `bending`."""
    types = numeric(bits)
    real, vec3, mat32 = types.real, types.vec3, types.mat32
    half = wp.constant(real(0.5))
    Plate, of = plate_tables(bits), triangle_functions(bits, curved, True)
    plane, corners_of, vectors, bent_by = of.plane, of.corners_of, of.vectors, of.bent_by

    @wp.func
    def earlier(displacement: wp.array(dtype=vec3), velocity: wp.array(dtype=vec3), back: real, i: int):
        return displacement[i] - back * velocity[i]

    @wp.func
    def earlier_slope(
        plate: Plate, displacement: wp.array(dtype=vec3), velocity: wp.array(dtype=vec3), back: real, i: int
    ):
        here, kind, total = earlier(displacement, velocity, back, i), plate.kind[i], mat32()
        for k in range(plate.counts[kind][0]):
            there = earlier(displacement, velocity, back, i + plate.ring[k, kind])
            total += wp.outer(there - here, plate.weights[k, kind])
        return total

    @wp.func
    def energy_of_step(
        plate: Plate, t: int, displacement: wp.array(dtype=vec3), velocity: wp.array(dtype=vec3), dt: real
    ):
        """2 E(half a step ago) - E(now) / 2 - E(one step ago) / 2."""
        c, total = corners_of(plate, t), real(0.0)
        for half_steps in range(wp.int32(3)):
            back = half * real(half_steps) * dt
            origin = earlier(displacement, velocity, back, c[0])
            first = earlier(displacement, velocity, back, c[1]) - origin
            second = earlier(displacement, velocity, back, c[2]) - origin
            d0 = earlier_slope(plate, displacement, velocity, back, c[0]) * plane(plate, t, 0)
            d1 = earlier_slope(plate, displacement, velocity, back, c[1]) * plane(plate, t, 1)
            d2 = earlier_slope(plate, displacement, velocity, back, c[2]) * plane(plate, t, 2)
            b = bent_by(plate, t, first, second, vectors(first, second, d0, d1, d2))
            total += wp.where(half_steps == 1, real(2.0), -half) * half * wp.dot(b.strain, b.moment)
        return total

    @kernel(per="face")
    def weaken(
        plate: Plate,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        intact: wp.array2d(dtype=wp.uint32),
        damage: wp.array(dtype=real),
        first: int,
        left: wp.array(dtype=real),
        lost: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        before = left[t]
        if before <= real(0.0):
            return
        c = corners_of(plate, t)
        now = before
        for corner in range(wp.int32(3)):
            i = c[corner]
            kind = plate.kind[i]
            if wp.static(softened):
                now = wp.min(now, (real(1.0) - damage[i]) * (real(1.0) - damage[i]))
            for k in range(plate.spans.shape[0]):
                word = k % intact.shape[0]
                needed = plate.spans[k, kind]
                if needed != wp.uint32(0):
                    if (intact[word, i + plate.via[k // intact.shape[0], kind]] & needed) != needed:
                        now = real(0.0)
        if now < before:
            if wp.static(tracked):
                taken = (real(1.0) - now / before) * energy_of_step(plate, t, displacement, velocity, step[0])
                lost[t] = lost[t] + wp.float64(taken)
            left[t] = now

    @kernel(gathers=("lost",))
    def share_lost(plate: Plate, lost: wp.array(dtype=wp.float64), first: int, out: wp.array(dtype=wp.float64)):
        i = wp.tid() + first
        total, kind = wp.float64(0.0), plate.kind[i]
        for k in range(plate.counts[kind][2]):
            place = plate.around[k, kind]
            total += lost[plate.first_triangle[i] + place // 3]
        out[i] = total / wp.float64(3.0)

    return weaken, share_lost if tracked else None
