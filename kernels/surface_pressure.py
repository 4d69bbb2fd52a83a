"""Force of a pressure on the triangles of a sheet, gathered by each point.

A pressure p on a triangle with the corners x_a, x_b, x_c, counter-clockwise seen from outside, pushes each of them with

    f = p/6 (x_b - x_a) x (x_c - x_a),

the pressure times the derivative of the volume below the triangle. Net force and torque on a closed surface then
vanish, and the resultant on an open one is that on any other surface with the same edge.

A rectangle is cut along both diagonals, each for half of the pressure, as one alone would load its ends more. With its
corners a, b, c, d in order, and sides from a,

    f_a = p/12 (b x c + c x d + b x d).

A triangle is one whose corners c and d coincide.
"""

import functools

import warp as wp

from .effects import Kernel, Pointwise, kernel, pointwise
from .families import Layout, family_functions
from .numeric import numeric
from .rupture import lost_bond, stiffness_left

# What multiplies the force: nothing, a schedule, or the pressure that an enclosed volume finds (kernels/gas).
CONSTANT, SCHEDULED, ENCLOSED = "constant", "scheduled", "enclosed"


@functools.cache
def pressed_part(layout: Layout) -> wp.Function:
    """Function (family, i, whole, corners) -> which of the triangles i b c, i c d, i b d no crack cuts, 1 or 0 each.

    `whole` is whether i has lost no bond. A crack cuts a triangle if a bond along one of its sides is broken.
    """
    f, lost = family_functions(layout), lost_bond(layout)
    Family, vec3, real = f.struct, layout.types.vec3, layout.types.real

    @wp.func
    def pressed(family: Family, i: int, whole: bool, corners: wp.vec3i):
        b, c, d = corners[0], corners[1], corners[2]
        on = vec3(real(1.0), real(1.0), real(1.0))
        sound = whole and f.is_undamaged(family, b) and f.is_undamaged(family, c) and f.is_undamaged(family, d)
        if not sound:
            if lost(family, i, b) or lost(family, b, c) or lost(family, c, i):
                on[0] = real(0.0)
            if lost(family, i, c) or lost(family, c, d) or lost(family, d, i):
                on[1] = real(0.0)
            if lost(family, i, b) or lost(family, b, d) or lost(family, d, i):
                on[2] = real(0.0)
        return on

    return pressed


@functools.cache
def surface_pressure(
    bits: int, source: str, weighted: bool, torn: Layout | None, softened: bool
) -> tuple[Pointwise, Kernel]:
    """Pointwise stage that adds the force of a pressure, and a kernel that adds its derivative along a direction.

    Entries begins[i] to begins[i + 1] - 1 of `corners` are the other corners of the triangles and rectangles of point
    i. `unit` is the pressure, or the factor on that of `enclosed`, over 12. With `torn`, the layout of families whose
    bonds can break, triangles cut by a crack carry no pressure; a damage field (`softened`) reduces that on its points
    as it reduces their stiffness. `weighted`: the force on each point is multiplied by `weights`.
    """
    types, left = numeric(bits), stiffness_left(bits)
    real, vec3 = types.real, types.vec3
    f = family_functions(torn or Layout("lattice", bits))
    Family, breaks = f.struct, torn is not None
    pressed = pressed_part(torn or Layout("lattice", bits))

    @wp.struct
    class SurfacePressure:
        begins: wp.array(dtype=wp.int32)
        corners: wp.array(dtype=wp.vec3i)
        positions: wp.array(dtype=wp.vec3d)
        weights: wp.array(dtype=real)
        family: Family
        damage: wp.array(dtype=real)
        displacement: wp.array(dtype=vec3)
        unit: wp.float64
        enclosed: wp.array(dtype=wp.float64)
        factors: wp.array(dtype=vec3)
        schedule: wp.int32
        external: wp.array(dtype=vec3)

    @wp.func
    def of_point(weights: wp.array(dtype=real), damage: wp.array(dtype=real), i: int, force: vec3):
        if wp.static(weighted):
            force = weights[i] * force
        if wp.static(softened):
            force = left(damage[i]) * force
        return force

    @wp.func
    def level(unit: wp.float64, pressure: wp.array(dtype=wp.float64), factors: wp.array(dtype=vec3), schedule: int):
        if wp.static(source == ENCLOSED):
            return real(unit * pressure[0])
        elif wp.static(source == SCHEDULED):
            return real(unit) * factors[schedule][0]
        else:
            return real(unit)

    @pointwise(SurfacePressure, writes=("external",), gathers=("displacement", "positions", "family.intact"))
    def add_surface_pressure(begin: int, end: int, a: SurfacePressure):
        p = level(a.unit, a.enclosed, a.factors, a.schedule)
        for i in range(begin, end):
            total = vec3(real(0.0), real(0.0), real(0.0))
            X = a.positions[i]
            u = a.displacement[i]
            whole = bool(True)
            if wp.static(breaks):
                whole = f.is_undamaged(a.family, i)
            for entry in range(a.begins[i], a.begins[i + 1]):
                others = a.corners[entry]
                b = vec3(a.positions[others[0]] - X) + (a.displacement[others[0]] - u)
                c = vec3(a.positions[others[1]] - X) + (a.displacement[others[1]] - u)
                d = vec3(a.positions[others[2]] - X) + (a.displacement[others[2]] - u)
                if wp.static(breaks):
                    on = pressed(a.family, i, whole, others)
                    total += on[0] * wp.cross(b, c) + on[1] * wp.cross(c, d) + on[2] * wp.cross(b, d)
                else:
                    total += wp.cross(b - d, c) + wp.cross(b, d)
            a.external[i] = a.external[i] + p * of_point(a.weights, a.damage, i, total)

    @kernel(gathers=("a.displacement", "a.positions", "a.family.intact", "direction"))
    def add_surface_tangent(
        a: SurfacePressure, direction: wp.array(dtype=vec3), first: int, change: wp.array(dtype=vec3)
    ):
        i = wp.tid() + first
        area = vec3(real(0.0), real(0.0), real(0.0))
        turn = vec3(real(0.0), real(0.0), real(0.0))
        X = a.positions[i]
        u = a.displacement[i]
        whole = bool(True)
        if wp.static(breaks):
            whole = f.is_undamaged(a.family, i)
        for entry in range(a.begins[i], a.begins[i + 1]):
            others = a.corners[entry]
            b = vec3(a.positions[others[0]] - X) + (a.displacement[others[0]] - u)
            c = vec3(a.positions[others[1]] - X) + (a.displacement[others[1]] - u)
            d = vec3(a.positions[others[2]] - X) + (a.displacement[others[2]] - u)
            db = direction[others[0]] - direction[i]
            dc = direction[others[1]] - direction[i]
            dd = direction[others[2]] - direction[i]
            on = vec3(real(1.0), real(1.0), real(1.0))
            if wp.static(breaks):
                on = pressed(a.family, i, whole, others)
            area += on[0] * wp.cross(b, c) + on[1] * wp.cross(c, d) + on[2] * wp.cross(b, d)
            turn += on[0] * (wp.cross(db, c) + wp.cross(b, dc))
            turn += on[1] * (wp.cross(dc, d) + wp.cross(c, dd))
            turn += on[2] * (wp.cross(db, d) + wp.cross(b, dd))
        total = level(a.unit, a.enclosed, a.factors, a.schedule) * turn
        if wp.static(source == ENCLOSED):
            total += real(a.unit * a.enclosed[2]) * area
        change[i] = change[i] + of_point(a.weights, a.damage, i, total)

    return add_surface_pressure, add_surface_tangent
