"""Reference kernel of the bond-associated laws for any family: the sums exactly as in kernels/bond_associated.py."""

import functools

import warp as wp

from .bond_associated import bond_associated
from .effects import Kernel, kernel
from .factories import FunctionFactory, PairFactory, constants_of
from .families import Layout, family_functions
from .stiffness_left import stiffness_left


@functools.cache
def reference_force(layout: Layout, material: PairFactory, form: str) -> Kernel:
    """Reference kernel that fills bond_force [members, points] with the forces of each family, N.

    Arguments as for `bond_associated`.
    """
    types, bits = layout.types, layout.bits
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family = f.struct
    stress, _ = material(bits)
    Constants = constants_of(stress)
    law = bond_associated(layout, material, form).mechanics
    is_undamaged, is_intact, visit = law.is_undamaged, law.is_intact, law.visit
    green, family_scale = law.green, law.family_scale
    add_to_members, finish_forces, stress_on_members = law.add_to_members, law.finish_forces, law.stress_on_members

    if form == "published":

        @wp.func
        def present_area(family: Family, intact: wp.array2d(dtype=wp.uint32), i: int):
            """|H_i| of the intact bonds, divided by the reference area."""
            if is_undamaged(family, intact, i):
                return f.family_area(family, i)
            size = real(0.0)
            for k in range(family.members):
                if is_intact(family, intact, i, k):
                    size += f.area(family, f.neighbour(family, i, k))
            return size

        @kernel(gathers=("displacement", "intact"))
        def published_force(
            family: Family,
            intact: wp.array2d(dtype=wp.uint32),
            displacement: wp.array(dtype=vec3),
            constants: Constants,
            inverse_horizon: real,
            unit_force: real,
            first: int,
            bond_force: wp.array2d(dtype=vec3),
        ):
            i = wp.tid() + first
            undamaged = is_undamaged(family, intact, i)
            own_area = present_area(family, intact, i)
            for j in range(family.members):
                force = vec3(real(0.0), real(0.0), real(0.0))
                there, H1, H2, inverse, size, tilt = visit(
                    family, intact, displacement, inverse_horizon, i, j, undamaged
                )
                if there:
                    S = stress(green(H1, H2, tilt), constants)
                    A1, A2 = stress_on_members(H1, H2, S, real(1.0), inverse, tilt)
                    xi = f.bond(family, i, j)
                    m = f.neighbour(family, i, j)
                    intact_fraction = size / own_area
                    pair = (own_area + present_area(family, intact, m)) / (real(2.0) * own_area)
                    c = f.area(family, i) * f.influence(family, i, j) * f.area(family, m)
                    force = unit_force * intact_fraction * pair * c * (xi[0] * A1 + xi[1] * A2)
                bond_force[j, i] = f.from_frame(family, i, force)

        return published_force

    @kernel(gathers=("displacement",))
    def variational_force(
        family: Family,
        intact: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        inverse_horizon: real,
        unit_force: real,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
    ):
        i = wp.tid() + first
        for k in range(family.members):
            bond_force[k, i] = vec3(real(0.0), real(0.0), real(0.0))
        undamaged = is_undamaged(family, intact, i)
        total = real(0.0)
        for j in range(family.members):
            there, H1, H2, inverse, weight, tilt = visit(family, intact, displacement, inverse_horizon, i, j, undamaged)
            if there:
                S = stress(green(H1, H2, tilt), f.of_bond(family, i, j, constants))
                total += weight
                A1, A2 = stress_on_members(H1, H2, S, weight, inverse, tilt)
                add_to_members(family, intact, i, j, A1, A2, bond_force)
        finish_forces(family, intact, i, unit_force * family_scale(family, i, undamaged, total), bond_force)

    return variational_force


@functools.cache
def viscous_force(layout: Layout, material: PairFactory, response: FunctionFactory) -> Kernel:
    """Reference kernel of a viscous law in the variational form; it advances the law's state by a step.

    With a step of zero the state does not change.

    Args:
        layout: Layout of the families.
        material: Factory of the elastic (stress, energy).
        response: Factory of (G, constants, i, j, members, step, terms, state) -> S after a step, work or loss [J/m^3],
            see kernels/visco.py and kernels/maxwell.py.
    """
    types, bits = layout.types, layout.bits
    real, vec3, vec4 = types.real, types.vec3, types.parameters
    Family = family_functions(layout).struct
    Constants = constants_of(material(bits)[0])
    law = bond_associated(layout, material, "variational").mechanics
    advance, left = response(bits), stiffness_left(bits)

    @kernel(gathers=("displacement",))
    def viscous_force(
        family: Family,
        intact: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        inverse_horizon: real,
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
        undamaged = law.is_undamaged(family, intact, i)
        work = wp.float64(0.0)
        for j in range(family.members):
            there, H1, H2, inverse, weight, tilt = law.visit(
                family, intact, displacement, inverse_horizon, i, j, undamaged
            )
            if there:
                S, more = advance(law.green(H1, H2, tilt), constants, i, j, family.members, step[0], terms, state)
                work += wp.float64(weight * more)
                A1, A2 = law.stress_on_members(H1, H2, S, weight, inverse, tilt)
                law.add_to_members(family, intact, i, j, A1, A2, bond_force)
        law.finish_forces(family, intact, i, unit, bond_force)
        if wp.static(layout.softened):
            work *= wp.float64(left(damage[i]))
        if step[0] > real(0.0):
            viscous_work[i] = viscous_work[i] + wp.float64(unit / inverse_horizon) * work

    return viscous_force
