"""Empirical boundary force: bonds push edge points back to the local plane (BA eq. 45).

    T_ij = w_ij A (Y_ij . d_i) n,     force on i from the pair:  V_i V_j (T_ij - T_ji),

with d_i the unit normal of F e1 x F e2, F of the complete family of i, and d_i = 0 for points without the force.
"normal" takes n = d_i; "printed" takes n = Y_ij / |Y_ij|. Since Y_ji = -Y_ij, the second term of the pair changes
sign, and both ends compute the same number with opposite signs: momentum is conserved to round-off.
"""

import functools

import warp as wp

from ..effects import Kernel, kernel
from ..families import WORD, Layout, family_functions, lowest_bit, without_lowest_bit
from ..loads import surface_vector


@functools.cache
def boundary_force(layout: Layout, form: str) -> tuple[Kernel, Kernel]:
    """Kernels `edge_normals` and `add_boundary_force`.

    If bonds cannot break, there is one thread per entry of `points`, and other points are left alone. If bonds can
    break, there is one thread per point, since a crack may reach any point; `points` is then None.
    """
    types = layout.types
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family = f.struct
    surface = surface_vector(layout)
    printed = form == "printed"
    word_size = WORD

    @kernel(gathers=("displacement",), per="point" if layout.breakable else "list")
    def edge_normals(
        family: Family,
        displacement: wp.array(dtype=vec3),
        points: wp.array(dtype=wp.int32),
        marked: wp.array(dtype=wp.uint8),
        first: int,
        normals: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        carries = bool(True)
        if wp.static(layout.breakable):
            carries = marked[i] != wp.uint8(0) or not f.is_undamaged(family, i)
        else:
            i = points[i]
        normal = vec3(real(0.0), real(0.0), real(0.0))
        if carries:
            normal = wp.normalize(surface(family, displacement, i))
        normals[i] = normal

    @kernel(gathers=("displacement", "normals"), per="point" if layout.breakable else "list")
    def add_boundary_force(
        family: Family,
        displacement: wp.array(dtype=vec3),
        normals: wp.array(dtype=vec3),
        points: wp.array(dtype=wp.int32),
        unit_force: real,
        first: int,
        external: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        if wp.static(not layout.breakable):
            i = points[i]
        ui = displacement[i]
        own = normals[i]
        total = vec3(real(0.0), real(0.0), real(0.0))
        for word in range(family.words):
            members = f.intact_members(family, i, word)
            while members != wp.uint32(0):
                k = word * word_size + lowest_bit(members)
                members = without_lowest_bit(members)
                m = f.neighbour(family, i, k)
                other = normals[m]
                X = family.horizon * f.bond(family, i, k)
                U = displacement[m] - ui
                Y = vec3(X[0] + U[0], X[1] + U[1], U[2])
                c = f.area(family, i) * f.area(family, m) * f.influence(family, i, k)
                if wp.static(printed):
                    total += c * (wp.dot(Y, own) - wp.dot(Y, other)) * wp.normalize(Y)
                else:
                    total += c * (wp.dot(Y, own) * own + wp.dot(Y, other) * other)
        external[i] = external[i] + unit_force * total

    return edge_normals, add_boundary_force
