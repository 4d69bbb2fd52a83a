"""Reference kernels of the bond-associated laws for any family: the sums exactly as in kernels/bond_associated.py."""

import functools
from dataclasses import replace

import warp as wp

from .bond_associated import family_mechanics
from .effects import Kernel, kernel
from .factories import FunctionFactory, PairFactory, constants_of
from .families import Layout, family_functions
from .kinematics import kinematics
from .stiffness_left import stiffness_left


@functools.cache
def reference_force(layout: Layout, material: PairFactory, response: FunctionFactory | None = None) -> Kernel:
    """Reference kernel that fills bond_force [members, points] with the forces of each family, in the variational form.

    `unit` is the thickness times the reference area over the horizon. Arguments of a viscous law alone are otherwise
    None.

    Args:
        layout: Layout of the families.
        material: Factory of (stress, energy).
        response: Of a viscous law, factory of (G, constants, i, j, members, step, terms, state) -> S after a step, work
            or loss [J/m^3], see kernels/visco/visco.py and kernels/visco/maxwell.py. The kernel then advances the
            state by a step and adds to viscous_work [points], J; with a step of zero the state does not change.
    """
    if response is None:
        # The damage of a point then changes nothing here: sheets with and without a damage field share a kernel.
        layout = replace(layout, softened=False)
    types, bits = layout.types, layout.bits
    real, vec3, vec4 = types.real, types.vec3, types.parameters
    f = family_functions(layout)
    Family = f.struct
    stress, _ = material(bits)
    Constants = constants_of(stress)
    law, motion = family_mechanics(layout, "variational"), kinematics(bits, layout.curved)
    viscous = response is not None
    advance, left = response(bits) if response is not None else None, stiffness_left(bits)

    @kernel(gathers=("displacement",), name="viscous_force" if viscous else "variational_force")
    def variational_force(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        unit: real,
        step: wp.array(dtype=real),
        terms: wp.array(dtype=vec4),
        damage: wp.array(dtype=real),
        first: int,
        bond_force: wp.array2d(dtype=vec3),
        viscous_work: wp.array(dtype=wp.float64),
        state: wp.array2d(dtype=vec4),
    ):
        i = wp.tid() + first
        for k in range(family.members):
            bond_force[k, i] = vec3(real(0.0), real(0.0), real(0.0))
        undamaged = f.is_undamaged(family, i)
        work = wp.float64(0.0)
        for j in range(family.members):
            there, H1, H2, inverse, weight, tilt = law.visit(family, displacement, i, j, undamaged)
            if there:
                G = motion.green(H1, H2, tilt)
                if wp.static(viscous):
                    S, more = advance(G, constants, i, j, family.members, step[0], terms, state)
                    work += wp.float64(weight * more)
                else:
                    S = stress(G, f.of_bond(family, i, j, constants))
                A1, A2 = motion.stress_on_members(H1, H2, S, weight, inverse, tilt)
                law.add_to_members(family, i, j, A1, A2, bond_force)
        law.finish_forces(family, i, unit, bond_force)
        if wp.static(viscous):
            if wp.static(layout.softened):
                work *= wp.float64(left(damage[i]))
            if step[0] > real(0.0):
                viscous_work[i] = viscous_work[i] + wp.float64(unit / family.inverse_horizon) * work

    return variational_force


@functools.cache
def published_force(layout: Layout, material: PairFactory) -> Kernel:
    """Reference kernel that fills bond_force [members, points] with the forces of each family, in the published form.

    Its arguments are those of `reference_force` without those of viscous laws, and `own`: how much of the area of a
    point counts in its own family, 0 or 1 (BA eq. 39 does not say).
    """
    types, bits = layout.types, layout.bits
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family = f.struct
    stress, _ = material(bits)
    Constants = constants_of(stress)
    law, motion = family_mechanics(layout, "published"), kinematics(bits, layout.curved)

    @wp.func
    def present_area(family: Family, i: int, own: real):
        """|H_i| of the intact bonds, divided by the reference area."""
        if f.is_undamaged(family, i):
            return f.family_area(family, i) + own * f.area(family, i)
        size = own * f.area(family, i)
        for k in range(family.members):
            if f.is_intact(family, i, k):
                size += f.area(family, f.neighbour(family, i, k))
        return size

    @kernel(gathers=("displacement", "family.intact"))
    def published_force(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        unit: real,
        own: real,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
    ):
        i = wp.tid() + first
        undamaged = f.is_undamaged(family, i)
        own_area = present_area(family, i, own)
        for j in range(family.members):
            force = vec3(real(0.0), real(0.0), real(0.0))
            there, H1, H2, inverse, size, tilt = law.visit(family, displacement, i, j, undamaged)
            if there:
                S = stress(motion.green(H1, H2, tilt), constants)
                A1, A2 = motion.stress_on_members(H1, H2, S, real(1.0), inverse, tilt)
                xi = f.bond(family, i, j)
                m = f.neighbour(family, i, j)
                intact_fraction = (size + own * f.area(family, i)) / own_area
                pair = (own_area + present_area(family, m, own)) / (real(2.0) * own_area)
                c = f.area(family, i) * f.influence(family, i, j) * f.area(family, m)
                force = unit * intact_fraction * pair * c * (xi[0] * A1 + xi[1] * A2)
            bond_force[j, i] = f.from_frame(family, i, force)

    return published_force
