"""Nodal correspondence: one deformation gradient and one stress per point. It has zero-energy modes.

With c_k = w_ik a_k over the intact bonds of the family H_i (Silling et al., J. Elast. 88, 2007; NN eqs. 2 to 5):

    K_i = sum c_k X_ik (x) X_ik,      F_i = I + [sum c_k U_ik (x) X_ik] K_i^-1,   U_ik = u_k - u_i,
    E = h sum_i a_i s_i Psi(F_i),     a_i a_k T_ik = a_i s_i c_k h P_i K_i^-1 X_ik,

with s_i the fraction of the family's area that is still intact: broken bonds carry no force. The force is minus
the gradient of E. Equal displacements of opposite members do not change F_i, so a checkerboard displacement of a
lattice, or a displacement of the centre of a family, has no energy. These are the zero-energy modes; the law serves as
a comparison for the others.

A family whose points are (nearly) collinear determines no gradient and carries no force, see `bond_associated`.
"""

import functools
from typing import Any

import warp as wp

from ..families import WORD, Layout, family_functions, lowest_bit, without_lowest_bit
from ..kinematics import kinematics
from ..numeric import PairFactory, constants_of
from .bonds import BondLaw, forces_of_families


@functools.cache
def point_gradient(layout: Layout) -> wp.Function:
    """Function (family, displacement, velocity, back, i) of the displacement at a time `back` before now.

    Returns the displacement gradient times horizon (two columns), K^-1 (zero if degenerate), and the intact area over
    the reference area.
    """
    types, bits = layout.types, layout.bits
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family = f.struct
    Vectors: Any = wp.array(dtype=vec3)
    word_size = WORD
    motion = kinematics(bits)

    @wp.func
    def gradient(family: Family, displacement: Vectors, velocity: Vectors, back: real, i: int):
        ui = displacement[i]
        first = vec3(real(0.0), real(0.0), real(0.0))
        second = vec3(real(0.0), real(0.0), real(0.0))
        shape = vec3(real(0.0), real(0.0), real(0.0))
        size = real(0.0)
        for word in range(family.words):
            members = f.intact_members(family, i, word)
            while members != wp.uint32(0):
                k = word * word_size + lowest_bit(members)
                members = without_lowest_bit(members)
                m = f.neighbour(family, i, k)
                a = f.area(family, m)
                xi = f.bond(family, i, k)
                cxi = f.influence(family, i, k) * a * xi
                stretch = displacement[m] - ui - back * (velocity[m] - velocity[i])
                first += cxi[0] * stretch
                second += cxi[1] * stretch
                if wp.static(layout.breakable):
                    shape += vec3(cxi[0] * xi[0], cxi[0] * xi[1], cxi[1] * xi[1])
                    size += a
        inverse = f.shape(family, i, 0)
        if f.is_undamaged(family, i):
            size = f.family_area(family, i)
        else:
            inverse = motion.inverse_shape(shape)
        G1, G2 = motion.columns(first, second, inverse)
        return G1, G2, inverse, size

    return gradient


@functools.cache
def nodal(layout: Layout, material: PairFactory) -> BondLaw:
    """The law; `material` is a factory of (stress, energy)."""
    types, bits = layout.types, layout.bits
    real, vec2, vec3 = types.real, types.vec2, types.vec3
    f = family_functions(layout)
    Family = f.struct
    Vectors: Any = wp.array(dtype=vec3)
    gradient, motion = point_gradient(layout), kinematics(bits)
    stress, energy = material(bits)
    Constants = constants_of(energy)

    @wp.func
    def family_energy(
        family: Family, displacement: Vectors, velocity: Vectors, back: real, constants: Constants, i: int
    ):
        """Energy of the family of i at a time `back` before now, divided by (thickness x reference area) [J/m^3]."""
        G1, G2, inverse, size = gradient(family, displacement, velocity, back, i)
        stored = real(0.0)
        if inverse[0] > real(0.0):
            intact_fraction = size / f.family_area(family, i)
            stored = (
                f.area(family, i)
                * intact_fraction
                * energy(motion.green(family.inverse_horizon * G1, family.inverse_horizon * G2, vec2()), constants)
            )
        return stored

    @wp.func
    def represented(family: Family, displacement: Vectors, i: int):
        _G1, _G2, inverse, size = gradient(family, displacement, displacement, real(0.0), i)
        area = real(0.0)
        if inverse[0] > real(0.0):
            area = f.area(family, i) * size / f.family_area(family, i)
        return area

    @wp.struct
    class Traction:
        first: vec3
        second: vec3

    @wp.func
    def state_of(family: Family, displacement: Vectors, constants: Constants, unit_force: real, i: int):
        """Columns of a_i s_i h P K^-1."""
        G1, G2, inverse, size = gradient(family, displacement, displacement, real(0.0), i)
        state = Traction()
        if inverse[0] > real(0.0):
            H1 = family.inverse_horizon * G1
            H2 = family.inverse_horizon * G2
            S = stress(motion.green(H1, H2, vec2()), constants)
            scale = unit_force * f.area(family, i) * size / f.family_area(family, i)
            A1, A2 = motion.stress_on_members(H1, H2, S, scale, inverse, vec2())
            state.first = A1
            state.second = A2
        return state

    @wp.func
    def force_of(family: Family, displacement: Vectors, constants: Constants, state: Traction, i: int, k: int):
        xi = f.bond(family, i, k)
        c = f.influence(family, i, k) * f.area(family, f.neighbour(family, i, k))
        return c * (xi[0] * state.first + xi[1] * state.second)

    force = forces_of_families(layout, state_of, force_of)
    return BondLaw(family_force=force, energy=family_energy, represented=represented)
