"""Reference kernel of the bond-associated law: the sums as written in kernels/bond_associated.py, for any family."""

import functools

import warp as wp

from .bond_associated import bond_associated
from .effects import Kernel, kernel
from .factories import PairFactory
from .families import Layout, family_functions


@functools.cache
def reference_force(layout: Layout, material: PairFactory, form: str) -> Kernel:
    """Reference kernel that fills bond_force [members, points] with the forces of each family, N.

    It evaluates the sums as written in the formulas above, for any family and form. Arguments as for `bond_associated`.
    """
    types, bits, module = layout.types, layout.bits, layout.module
    real, vec3, parameters = types.real, types.vec3, types.parameters
    f = family_functions(layout)
    Family = f.struct
    stress, _ = material(bits)
    law = bond_associated(layout, material, form).mechanics
    is_undamaged, is_intact, intersection = law.is_undamaged, law.is_intact, law.intersection
    green, area_weight, family_scale = law.green, law.area_weight, law.family_scale
    add_to_members, stress_on_members = law.add_to_members, law.stress_on_members

    if form == "published":

        @wp.func(module=module)
        def present_area(family: Family, intact: wp.array2d(dtype=wp.uint32), i: int):
            """|H_i| of the intact bonds, divided by the reference area."""
            if is_undamaged(family, intact, i):
                return f.family_area(family, i)
            size = real(0.0)
            for k in range(family.members):
                if is_intact(family, intact, i, k):
                    size += f.area(family, f.neighbour(family, i, k))
            return size

        @kernel(module, gathers=("displacement", "intact"))
        def published_force(
            family: Family,
            intact: wp.array2d(dtype=wp.uint32),
            displacement: wp.array(dtype=vec3),
            constants: parameters,
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
                if is_intact(family, intact, i, j):
                    G1, G2, inverse, size, tilt = intersection(
                        family, intact, displacement, displacement, real(0.0), i, j, undamaged
                    )
                    if inverse[0] > real(0.0):
                        H1 = inverse_horizon * G1
                        H2 = inverse_horizon * G2
                        S = stress(green(H1, H2, tilt), constants)
                        A1, A2 = stress_on_members(H1, H2, S, real(1.0), inverse, tilt)
                        xi = f.bond(family, i, j)
                        m = f.neighbour(family, i, j)
                        if undamaged:
                            size = f.weight(family, i, j)
                        share = size / own_area
                        pair = (own_area + present_area(family, intact, m)) / (real(2.0) * own_area)
                        c = f.area(family, i) * f.influence(family, i, j) * f.area(family, m)
                        force = unit_force * share * pair * c * (xi[0] * A1 + xi[1] * A2)
                bond_force[j, i] = f.from_frame(family, i, force)

        return published_force

    @kernel(module, gathers=("displacement",))
    def variational_force(
        family: Family,
        intact: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: parameters,
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
            if is_intact(family, intact, i, j):
                G1, G2, inverse, size, tilt = intersection(
                    family, intact, displacement, displacement, real(0.0), i, j, undamaged
                )
                if inverse[0] > real(0.0):
                    H1 = inverse_horizon * G1
                    H2 = inverse_horizon * G2
                    S = stress(green(H1, H2, tilt), constants)
                    weight = area_weight(family, i, j, undamaged, size)
                    total += weight
                    A1, A2 = stress_on_members(H1, H2, S, weight, inverse, tilt)
                    add_to_members(family, intact, i, j, A1, A2, bond_force)
        scale = unit_force * family_scale(family, i, undamaged, total)
        for k in range(family.members):
            if is_intact(family, intact, i, k):
                c = f.influence(family, i, k) * f.area(family, f.neighbour(family, i, k))
                bond_force[k, i] = f.from_frame(family, i, scale * c * bond_force[k, i])

    return variational_force
