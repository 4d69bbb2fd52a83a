"""External forces on points: dead loads and follower pressure."""

import functools

import warp as wp

from .families import WORD, family_functions
from .kinematics import DEGENERATE
from .numeric import numeric
from .points import PointFunction


@functools.cache
def constant_loads(bits, present, module):
    """Point function that starts the external force from the loads that never change, or from zero."""
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @functools.partial(wp.struct, module=module)
    class BeginLoads:
        constant: wp.array(dtype=vec3)
        external: wp.array(dtype=vec3)

    @wp.func(module=module)
    def begin_loads(begin: int, end: int, a: BeginLoads):
        for i in range(begin, end):
            if wp.static(present):
                a.external[i] = a.constant[i]
            else:
                a.external[i] = vec3(real(0.0), real(0.0), real(0.0))

    return PointFunction(begin_loads, BeginLoads, "begin_loads")


@functools.cache
def dead_load(bits, module):
    """Kernel that adds a force on some points, times a schedule."""
    types = numeric(bits)
    vec3 = types.vec3

    @wp.kernel(module=module, enable_backward=False)
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
def surface_vector(layout, bits, breakable, module):
    """Warp function of F e1 x F e2, with F of the whole family of a point: normal times area ratio (Nanson).

    It is zero where the remaining family determines no F. The loop over members has no branches: a thread of a GPU
    has the loads of several of them under way at once.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3
    f = family_functions(layout, bits, module)
    Family = f.struct
    word_size = WORD
    degenerate = DEGENERATE

    @wp.func(module=module)
    def surface(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        inverse_horizon: real,
        i: int,
    ):
        ui = displacement[i]
        G1 = vec3(real(0.0), real(0.0), real(0.0))
        G2 = vec3(real(0.0), real(0.0), real(0.0))
        shape = vec3(real(0.0), real(0.0), real(0.0))
        for word in range(family.words):
            standing = f.whole(family, i, word)
            if wp.static(breakable):
                standing = alive[word, i]
            first = word * word_size
            for k in range(first, wp.min(first + word_size, family.members)):
                there = ((standing >> wp.uint32(k - first)) & wp.uint32(1)) != wp.uint32(0)
                m = wp.where(there, f.neighbour(family, i, k), i)
                xi = f.bond(family, i, k)
                c = wp.where(there, f.influence(family, i, k) * f.area(family, m), real(0.0))
                stretch = displacement[m] - ui
                G1 += (c * xi[0]) * stretch
                G2 += (c * xi[1]) * stretch
                shape += c * vec3(xi[0] * xi[0], xi[0] * xi[1], xi[1] * xi[1])
        determinant = shape[0] * shape[2] - shape[1] * shape[1]
        half_trace = real(0.5) * (shape[0] + shape[2])
        answer = vec3(real(0.0), real(0.0), real(0.0))
        if determinant > real(degenerate) * half_trace * half_trace:
            scale = inverse_horizon / determinant
            F1 = scale * (shape[2] * G1 - shape[1] * G2) + vec3(real(1.0), real(0.0), real(0.0))
            F2 = scale * (shape[0] * G2 - shape[1] * G1) + vec3(real(0.0), real(1.0), real(0.0))
            answer = wp.cross(F1, F2)
        return answer

    return surface


@functools.cache
def follower_pressure(layout, bits, breakable, scheduled, module):
    """Point function that adds p a_i (F e1 x F e2), with F of the whole family of the point.

    A point whose remaining family determines no F takes no pressure.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3
    f = family_functions(layout, bits, module)
    Family = f.struct
    surface = surface_vector(layout, bits, breakable, module)

    @functools.partial(wp.struct, module=module)
    class FollowerPressure:
        family: Family
        alive: wp.array2d(dtype=wp.uint32)
        displacement: wp.array(dtype=vec3)
        inverse_horizon: real
        unit_pressure: real
        factors: wp.array(dtype=vec3)
        schedule: int
        external: wp.array(dtype=vec3)

    @wp.func(module=module)
    def add_follower_pressure(begin: int, end: int, a: FollowerPressure):
        for i in range(begin, end):
            p = a.unit_pressure * f.area(a.family, i)
            if wp.static(scheduled):
                p = p * a.factors[a.schedule][0]
            a.external[i] = a.external[i] + p * surface(a.family, a.alive, a.displacement, a.inverse_horizon, i)

    return PointFunction(add_follower_pressure, FollowerPressure, "add_follower_pressure", looks_around=True)
