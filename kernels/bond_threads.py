"""The variational bond-associated force with a thread a bond, for sheets too small to fill a GPU.

A step of a small sheet takes as long as its slowest thread. Here no thread sees more than one intersection:

    bond_stress     A_ij = W_ij P_ij K_ij^-1 of each bond, two columns
    member_force    t_ik = c_k [ sum over j with k in D_ij of A_ij ] X_ik of each pair

k belongs to D_ij where j belongs to D_ik, so both sums run over the members of one intersection. Threads side by
side share the bond and differ in the point: they read neighbouring words and, on a lattice, do the same. Broken
bonds are dropped: a family that shares out their area would have to know all its intersections.
"""

import functools

import warp as wp

from .bond_associated import bond_associated
from .families import WORD, family_functions
from .kinematics import kinematics
from .numeric import numeric


@functools.cache
def bond_threads(layout, bits, material, near, module, fast_module, breakable):
    """Kernels `bond_stress` and `member_force`.

    Args:
        layout: "lattice" or "cloud".
        bits: 32 or 64.
        material: Factory of (stress, energy), called with `bits`.
        near: Factory of stress_near, called with `bits`.
        module: Name of the Warp module of the law.
        fast_module: Name of the Warp module of these kernels.
        breakable: None or "drop".
    """
    types = numeric(bits)
    real, vec3, parameters = types.real, types.vec3, types.parameters
    f = family_functions(layout, bits, module)
    Family = f.struct
    law = bond_associated(layout, bits, material, breakable, "variational", module).mechanics
    present, is_whole, has, intersection = law.present, law.is_whole, law.has, law.intersection
    green, area_weight = law.green, law.area_weight
    stress_near, stress_on_members = near(bits), kinematics(bits).stress_on_members
    word_size = WORD

    @wp.kernel(module=fast_module, enable_backward=False)
    def bond_stress(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        inverse_horizon: real,
        first: int,
        stress: wp.array3d(dtype=vec3),
    ):
        points = displacement.shape[0]
        j = (wp.tid() + first) // points
        i = wp.tid() + first - j * points
        A1 = vec3(real(0.0), real(0.0), real(0.0))
        A2 = vec3(real(0.0), real(0.0), real(0.0))
        if has(family, alive, i, j):
            whole = is_whole(family, alive, i)
            G1, G2, inverse, size = intersection(family, alive, displacement, displacement, real(0.0), i, j, whole)
            if inverse[0] > real(0.0):
                H1 = inverse_horizon * G1
                H2 = inverse_horizon * G2
                S, _guess = stress_near(green(H1, H2), constants, real(0.0))
                weight = area_weight(family, i, j, whole, size)
                A1, A2 = stress_on_members(H1, H2, S, weight, inverse)
        stress[0, j, i] = A1
        stress[1, j, i] = A2

    @wp.kernel(module=fast_module, enable_backward=False)
    def member_force(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        stress: wp.array3d(dtype=vec3),
        unit_force: real,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
    ):
        points = bond_force.shape[1]
        k = (wp.tid() + first) // points
        i = wp.tid() + first - k * points
        force = vec3(real(0.0), real(0.0), real(0.0))
        if has(family, alive, i, k):
            A1 = vec3(real(0.0), real(0.0), real(0.0))
            A2 = vec3(real(0.0), real(0.0), real(0.0))
            for word in range(family.words):
                members = f.common(family, i, k, word) & present(family, alive, i, word)
                j = word * word_size
                while members != wp.uint32(0):
                    if (members & wp.uint32(1)) != wp.uint32(0):
                        A1 += stress[0, j, i]
                        A2 += stress[1, j, i]
                    members = members >> wp.uint32(1)
                    j += 1
            xi = f.bond(family, i, k)
            c = unit_force * f.influence(family, i, k) * f.area(family, f.neighbour(family, i, k))
            force = c * (xi[0] * A1 + xi[1] * A2)
        bond_force[k, i] = force

    return bond_stress, member_force
