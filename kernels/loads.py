"""External force of loads, and of follower pressure, which follows normal and area of the deformed surface."""

import functools

import warp as wp

from .effects import Kernel, Pointwise, kernel, pointwise
from .families import WORD, Layout, bit_of, family_functions, lowest_bit, without_lowest_bit
from .kinematics import kinematics
from .numeric import numeric
from .rupture import stiffness_left


@functools.cache
def begin_loads(bits: int, present: bool) -> Pointwise:
    """Pointwise stage that sets the external force to the constant loads, or to zero."""
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @wp.struct
    class BeginLoads:
        constant: wp.array(dtype=vec3)
        external: wp.array(dtype=vec3)

    @pointwise(BeginLoads, writes=("external",))
    def begin_loads(begin: int, end: int, a: BeginLoads):
        for i in range(begin, end):
            if wp.static(present):
                a.external[i] = a.constant[i]
            else:
                a.external[i] = vec3(real(0.0), real(0.0), real(0.0))

    return begin_loads


@functools.cache
def dead_load(bits: int) -> Kernel:
    """Kernel that adds forces on selected points, multiplied by a schedule."""
    vec3 = numeric(bits).vec3

    @kernel(per="list")
    def add_dead_load(
        points: wp.array(dtype=wp.int32),
        force: wp.array(dtype=vec3),
        factors: wp.array(dtype=vec3),
        schedule: int,
        first: int,
        external: wp.array(dtype=vec3),
    ):
        p = wp.tid() + first
        i = points[p]
        external[i] = external[i] + factors[schedule][0] * force[p]

    return add_dead_load


@functools.cache
def support_forces(bits: int, loaded: bool) -> Kernel:
    """Kernel that fills `out` with the forces of supports on selected points [N], zero in components that are free.

    They are minus the internal force, and minus the external force if there are loads (`loaded`).
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @kernel(per="list")
    def support_forces(
        points: wp.array(dtype=wp.int32),
        held_mask: wp.array(dtype=wp.uint8),
        force: wp.array(dtype=vec3),
        external: wp.array(dtype=vec3),
        first: int,
        out: wp.array(dtype=vec3),
    ):
        p = wp.tid() + first
        i = points[p]
        pull = -force[i]
        if wp.static(loaded):
            pull -= external[i]
        for c in range(3):
            if (wp.int32(held_mask[i]) & (1 << c)) == 0:
                pull[c] = real(0.0)
        out[p] = pull

    return support_forces


@functools.cache
def scaled_values(bits: int) -> Kernel:
    """Kernel that fills `values` with `unit` times the factor of a schedule."""
    real, vec3 = numeric(bits).real, numeric(bits).vec3

    @kernel()
    def scale_values(
        unit: wp.array(dtype=real),
        factors: wp.array(dtype=vec3),
        schedule: int,
        first: int,
        values: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        values[i] = factors[schedule][0] * unit[i]

    return scale_values


@functools.cache
def surface_vector(layout: Layout) -> wp.Function:
    """Warp function of F e1 x F e2, with F of the complete family of a point: normal times area ratio (Nanson).

    On a curved sheet F = O + H (kernels/kinematics.py); undeformed, the vector is the unit normal. It is zero where the
    intact bonds determine no F. The loop over members has no branches, so a GPU thread has the loads of several members
    in flight.
    """
    types, bits = layout.types, layout.bits
    real, vec2, vec3 = types.real, types.vec2, types.vec3
    f = family_functions(layout)
    Family = f.struct
    word_size, curved, motion = WORD, layout.curved, kinematics(bits, layout.curved)

    @wp.func
    def surface(
        family: Family,
        displacement: wp.array(dtype=vec3),
        i: int,
    ):
        ui = displacement[i]
        G1 = vec3(real(0.0), real(0.0), real(0.0))
        G2 = vec3(real(0.0), real(0.0), real(0.0))
        shape = vec3(real(0.0), real(0.0), real(0.0))
        rises = vec2(real(0.0), real(0.0))
        for word in range(family.words):
            members = f.intact_members(family, i, word)
            first = word * word_size
            for k in range(first, wp.min(first + word_size, family.members)):
                there = bit_of(members, k - first)
                m = wp.where(there, f.neighbour(family, i, k), i)
                xi = f.bond(family, i, k)
                c = wp.where(there, f.influence(family, i, k) * f.area(family, m), real(0.0))
                stretch = displacement[m] - ui
                G1 += (c * xi[0]) * stretch
                G2 += (c * xi[1]) * stretch
                shape += c * vec3(xi[0] * xi[0], xi[0] * xi[1], xi[1] * xi[1])
                if wp.static(curved):
                    rises += (c * f.rise(family, i, k)) * xi
        determinant = shape[0] * shape[2] - shape[1] * shape[1]
        answer = vec3(real(0.0), real(0.0), real(0.0))
        if motion.determines_gradient(shape):
            scale = family.inverse_horizon / determinant
            tilt = vec2(real(0.0), real(0.0))
            if wp.static(curved):
                slope = vec2(shape[2] * rises[0] - shape[1] * rises[1], shape[0] * rises[1] - shape[1] * rises[0])
                tilt = motion.tilt_of(slope / determinant)
            H1, H2 = motion.level(
                f.to_frame(family, i, scale * (shape[2] * G1 - shape[1] * G2)),
                f.to_frame(family, i, scale * (shape[0] * G2 - shape[1] * G1)),
                tilt,
            )
            F1, F2 = motion.gradient(H1, H2, tilt)
            answer = f.from_frame(family, i, wp.cross(F1, F2))
        return answer

    return surface


@functools.cache
def follower_pressure(layout: Layout, scheduled: bool) -> Pointwise:
    """Pointwise stage that adds p a_i (F e1 x F e2), with F of the complete family of the point.

    A point whose intact bonds determine no F gets no force. A damage field reduces the pressure of a point as it does
    the stiffness of its family: F e1 x F e2 of a tear is mostly the area of its opening, on which nothing presses.
    """
    types = layout.types
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family = f.struct
    surface, left = surface_vector(layout), stiffness_left(layout.bits)

    @wp.struct
    class FollowerPressure:
        family: Family
        displacement: wp.array(dtype=vec3)
        damage: wp.array(dtype=real)
        unit_pressure: real
        factors: wp.array(dtype=vec3)
        schedule: int
        external: wp.array(dtype=vec3)

    @pointwise(FollowerPressure, writes=("external",), gathers=("displacement",))
    def add_follower_pressure(begin: int, end: int, a: FollowerPressure):
        for i in range(begin, end):
            p = a.unit_pressure * f.area(a.family, i)
            if wp.static(scheduled):
                p = p * a.factors[a.schedule][0]
            if wp.static(layout.softened):
                p = p * left(a.damage[i])
            a.external[i] = a.external[i] + p * surface(a.family, a.displacement, i)

    return add_follower_pressure


@functools.cache
def follower_pressure_tangent(layout: Layout, scheduled: bool) -> Kernel:
    """Kernel that adds the derivative of the force along a direction, p a_i (dF e1 x F e2 + F e1 x dF e2).

    The tangent is not symmetric: a pressure has a potential only if the edge of the sheet is held, and the normals
    here are averages over families.
    """
    types, bits = layout.types, layout.bits
    real, vec2, vec3 = types.real, types.vec2, types.vec3
    f = family_functions(layout)
    Family, left = f.struct, stiffness_left(bits)
    word_size, curved, motion = WORD, layout.curved, kinematics(bits, layout.curved)

    @kernel(gathers=("displacement", "direction"))
    def add_follower_tangent(
        family: Family,
        displacement: wp.array(dtype=vec3),
        direction: wp.array(dtype=vec3),
        damage: wp.array(dtype=real),
        unit_pressure: real,
        factors: wp.array(dtype=vec3),
        schedule: int,
        first: int,
        change: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        zero = vec3(real(0.0), real(0.0), real(0.0))
        G1 = zero
        G2 = zero
        D1 = zero
        D2 = zero
        shape = zero
        rises = vec2(real(0.0), real(0.0))
        for word in range(family.words):
            members = f.intact_members(family, i, word)
            while members != wp.uint32(0):
                k = word * word_size + lowest_bit(members)
                members = without_lowest_bit(members)
                m = f.neighbour(family, i, k)
                xi = f.bond(family, i, k)
                cxi = f.influence(family, i, k) * f.area(family, m) * xi
                stretch = displacement[m] - displacement[i]
                turn = direction[m] - direction[i]
                if wp.static(curved):
                    rises += f.rise(family, i, k) * cxi
                    stretch = f.to_frame(family, i, stretch)
                    turn = f.to_frame(family, i, turn)
                G1 += cxi[0] * stretch
                G2 += cxi[1] * stretch
                D1 += cxi[0] * turn
                D2 += cxi[1] * turn
                shape += vec3(cxi[0] * xi[0], cxi[0] * xi[1], cxi[1] * xi[1])
        determinant = shape[0] * shape[2] - shape[1] * shape[1]
        if motion.determines_gradient(shape):
            scale = family.inverse_horizon / determinant
            tilt = vec2(real(0.0), real(0.0))
            if wp.static(curved):
                slope = vec2(shape[2] * rises[0] - shape[1] * rises[1], shape[0] * rises[1] - shape[1] * rises[0])
                tilt = motion.tilt_of(slope / determinant)
            H1, H2 = motion.level(
                scale * (shape[2] * G1 - shape[1] * G2), scale * (shape[0] * G2 - shape[1] * G1), tilt
            )
            F1, F2 = motion.gradient(H1, H2, tilt)
            dF1, dF2 = motion.level(
                scale * (shape[2] * D1 - shape[1] * D2), scale * (shape[0] * D2 - shape[1] * D1), tilt
            )
            p = unit_pressure * f.area(family, i)
            if wp.static(scheduled):
                p = p * factors[schedule][0]
            if wp.static(layout.softened):
                p = p * left(damage[i])
            change[i] = change[i] + f.from_frame(family, i, p * (wp.cross(dF1, F2) + wp.cross(F1, dF2)))

    return add_follower_tangent
