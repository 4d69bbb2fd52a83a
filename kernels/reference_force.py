"""Reference kernel of the bond-associated laws for any family: the sums exactly as in kernels/bond_associated.py."""

import functools

import warp as wp

from .bond_associated import bond_associated
from .effects import Kernel, kernel
from .factories import PairFactory, constants_of
from .families import Layout, family_functions
from .visco import overstressed


@functools.cache
def reference_force(layout: Layout, material: PairFactory, form: str, viscous: bool = False) -> Kernel:
    """Reference kernel that fills bond_force [members, points] with the forces of each family, N.

    Arguments as for `bond_associated`. With `viscous` the stress has Prony terms, see kernels/visco.py; their kernel
    arguments are otherwise None.
    """
    types, bits = layout.types, layout.bits
    real, vec3, parameters = types.real, types.vec3, types.parameters
    f = family_functions(layout)
    Family = f.struct
    stress, _ = material(bits)
    Constants = constants_of(stress)
    with_overstress = overstressed(bits) if viscous else None
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
            prony: wp.array(dtype=parameters),
            strain: wp.array2d(dtype=vec3),
            overstress: wp.array2d(dtype=vec3),
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

    @kernel(gathers=("displacement",), name="viscous_force" if viscous else "variational_force")
    def variational_force(
        family: Family,
        intact: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        inverse_horizon: real,
        unit_force: real,
        prony: wp.array(dtype=parameters),
        strain: wp.array2d(dtype=vec3),
        overstress: wp.array2d(dtype=vec3),
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
                G = green(H1, H2, tilt)
                S = stress(G, f.of_bond(family, i, j, constants))
                if wp.static(viscous):
                    S = with_overstress(S, G, i, j, family.members, prony, strain, overstress)
                total += weight
                A1, A2 = stress_on_members(H1, H2, S, weight, inverse, tilt)
                add_to_members(family, intact, i, j, A1, A2, bond_force)
        finish_forces(family, intact, i, unit_force * family_scale(family, i, undamaged, total), bond_force)

    return variational_force
