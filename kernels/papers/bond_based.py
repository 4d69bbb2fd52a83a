"""Bond-based force law: bond forces act along the bonds and depend on the bond strain alone (IM, sections 2, 3).

With s = |Y|/|X| - 1, n = Y/|Y| and a pairwise law f(s) [Pa] such as `bimodular`, the energy of point i is

    E_i = h a_ref sum_k W_ik psi(s_ik),     W_ik = (g/2) a_i a_k |xi_ik| / m_i,     m_i = sum_k |xi_ik| a_k,

with areas divided by a_ref and lengths by the horizon; g makes the energy equal to that of the continuum
(warp_pd/papers/bond_based.py). With c_i = g f / (s |X|-weighted volume of the family) as in the paper, W_ik is half of
c_i s^2 |X| V_i V_k / 2. A bond belongs to both its points, so its force uses the mean of their micro-moduli,

    F_ik = (h a_ref / horizon) (W_ik + W_ki) / |xi| f(s) n,     F_ki = -F_ik to the last bit,

and its stiffness (IM eq. 21)

    K_ik = (h a_ref / horizon^2) (W_ik + W_ki) / |xi|^2 [ f'(s) n (x) n + f(s)/(1 + s) (I - n (x) n) ].
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..effects import Kernel, kernel
from ..families import Layout, family_functions
from ..kinematics import kinematics
from ..numeric import PairwiseFactory, numeric
from ..point_fields import gradient_of_family
from .bonds import BondLaw, bond_functions, sums_of_bonds

# Smallest |Y| / horizon to divide by: a bond of zero length has no direction.
TINY = 1e-30


@dataclass(frozen=True)
class BondBasedTangentKernels:
    """Kernels of one configuration.

    Attributes:
        linearise: Fills blocks [members, points] with the stiffness of every bond, N/m, upper triangles.
        product: Change of the force along a direction: minus the stiffness times the direction.
        inverse_blocks: Inverse of the 3x3 diagonal block of the stiffness of each point, without its held
            components.
    """

    linearise: Kernel
    product: Kernel
    inverse_blocks: Kernel


@functools.cache
def bimodular(bits: int) -> tuple[wp.Function, wp.Function, wp.Function]:
    """Bimodular law (IM, section 4): f = E+ s in tension, E- s in compression; constants E+, E-.

    Like every pairwise law it gives functions (force, slope, energy) of (strain, constants), all in Pa: the force f,
    its derivative by the strain, and its integral from 0.
    """
    types = numeric(bits)
    real, parameters = types.real, types.parameters

    @wp.func
    def slope(strain: real, constants: parameters):
        modulus = constants[0]
        if strain < real(0.0):
            modulus = constants[1]
        return modulus

    @wp.func
    def force(strain: real, constants: parameters):
        return slope(strain, constants) * strain

    @wp.func
    def energy(strain: real, constants: parameters):
        return real(0.5) * force(strain, constants) * strain

    return force, slope, energy


@functools.cache
def pull_of_bond(layout: Layout, pairwise: PairwiseFactory) -> wp.Function:
    """Function (constants, W_ik + W_ki, xi, U) -> force of a bond divided by h a_ref / horizon [Pa]."""
    types, bits = layout.types, layout.bits
    real, vec3, parameters = types.real, types.vec3, types.parameters
    bond = bond_functions(layout)
    image, growth, Chord = bond.image, bond.growth, bond.chord
    tension_of, _, _ = pairwise(bits)
    tiny = TINY

    @wp.func
    def pull(constants: parameters, weight: real, xi: Chord, U: vec3):
        Y = image(xi, U)
        length = wp.length(xi)
        stretched = wp.length(Y)
        # On a CPU the cost of a bond is its two divisions and two square roots.
        scale = real(1.0) / (length * wp.max(stretched, real(tiny)))
        s = growth(xi, U) / (length * (length + stretched))
        return (weight * tension_of(s, constants) * scale) * Y

    return pull


@functools.cache
def bond_based(layout: Layout, pairwise: PairwiseFactory, stiffened: bool = False) -> tuple[BondLaw, dict[str, Kernel]]:
    """The law, and the kernels of its own fields by name.

    The fields are "principal_stress", the virial stress [points], Pa: largest, smallest, angle of the largest to the x
    axis [rad]; and "wrinkle_level", the fraction of compressed bonds [points]. `stiffened`: the moduli of fields have a
    factor that varies by point.
    """
    types, bits = layout.types, layout.bits
    real, vec2, vec3, mat22, parameters = types.real, types.vec2, types.vec3, types.mat22, types.parameters
    f = family_functions(layout)
    Family = f.struct
    Vectors: Any = wp.array(dtype=vec3)
    bond = bond_functions(layout)
    strain, image, Chord = bond.strain, bond.image, bond.chord
    tension_of, slope_of, energy_of = pairwise(bits)

    pull = pull_of_bond(layout, pairwise)
    motion, gradient_of = kinematics(bits, layout.curved), gradient_of_family(layout)

    @wp.func
    def force_of(family: Family, constants: parameters, i: int, k: int, m: int, xi: Chord, U: vec3):
        return pull(constants, f.weight(family, i, k) + f.weight(family, m, f.reverse(family, i, k)), xi, U)

    @wp.func
    def stiffness_of(family: Family, constants: parameters, i: int, k: int, m: int, xi: Chord, U: vec3):
        """The larger of the stiffnesses in tension and compression: a slack bond may become taut in the next step."""
        s = wp.abs(strain(xi, U))
        stiffest = wp.max(wp.abs(slope_of(s, constants)), wp.abs(slope_of(-s, constants)))
        weight = f.weight(family, i, k) + f.weight(family, m, f.reverse(family, i, k))
        return weight / wp.length_sq(xi) * stiffest

    @wp.func
    def earlier_energy(
        family: Family, displacement: Vectors, velocity: Vectors, back: real, constants: parameters, i: int
    ):
        """Energy of the family of i at a time `back` before now, divided by (thickness x reference area) [J/m^3]."""
        stored = real(0.0)
        for k in range(family.members):
            if f.is_intact(family, i, k):
                m = f.neighbour(family, i, k)
                U = displacement[m] - displacement[i] - back * (velocity[m] - velocity[i])
                s = strain(f.chord(family, i, k), family.inverse_horizon * U)
                stored += f.weight(family, i, k) * energy_of(s, constants)
        return stored

    @wp.func
    def level(xi: vec2, tilt: vec2):
        """A bond of a tilted family in its own plane."""
        return xi + (wp.dot(tilt, xi) / (real(1.0) - wp.dot(tilt, tilt))) * tilt

    @wp.func
    def stretched_by(G: mat22, n: vec2):
        """Strain of a bond along n in a uniform state."""
        square = n[0] * (G[0, 0] * n[0] + real(2.0) * G[0, 1] * n[1]) + n[1] * G[1, 1] * n[1]
        return square / (real(1.0) + wp.sqrt(wp.max(real(1.0) + square, real(0.0))))

    @kernel(gathers=("displacement",))
    def density(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        unit: real,
        factors: wp.array(dtype=real),
        directions: wp.array(dtype=vec2),
        shares: wp.array(dtype=real),
        first: int,
        out: wp.array(dtype=wp.float64),
    ):
        """Mean over the intact bonds, and what their directions lack of those inside the sheet in a uniform state."""
        i = wp.tid() + first
        known, _size, A1, A2, tilt = gradient_of(family, displacement, i)
        G = motion.green(A1, A2, tilt)
        total = real(0.0)
        stored = real(0.0)
        for k in range(family.members):
            if f.is_intact(family, i, k):
                U = displacement[f.neighbour(family, i, k)] - displacement[i]
                weight = f.weight(family, i, k)
                total += weight
                stored += weight * energy_of(strain(f.chord(family, i, k), family.inverse_horizon * U), constants)
                if known:
                    n = wp.normalize(level(f.bond(family, i, k), tilt))
                    stored -= weight * energy_of(stretched_by(G, n), constants)
        found = real(0.0)
        if total > real(0.0):
            found = stored / total
            if known:
                for d in range(directions.shape[0]):
                    found += shares[d] * energy_of(stretched_by(G, directions[d]), constants)
        found *= unit
        if wp.static(stiffened):
            found *= factors[i]
        out[i] = wp.float64(found)

    @wp.func
    def virial(F1: vec3, F2: vec3, G: mat22, n: vec2, constants: parameters):
        """In-plane part (xx, xy, yy) of the tension of a bond along n in a uniform state times its stretch."""
        s = stretched_by(G, n)
        Y = n[0] * F1 + n[1] * F2
        scale = tension_of(s, constants) / wp.max(real(1.0) + s, real(1.0e-6))
        return scale * vec3(Y[0] * Y[0], Y[0] * Y[1], Y[1] * Y[1])

    @kernel(gathers=("displacement",))
    def principal_stress(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        unit: real,
        factors: wp.array(dtype=real),
        directions: wp.array(dtype=vec2),
        shares: wp.array(dtype=real),
        first: int,
        out: wp.array(dtype=vec3),
    ):
        """Eigenvalues and angle of the in-plane part of sum_k F_ik (x) Y_ik / (2 V_i); directions as in `density`."""
        i = wp.tid() + first
        known, _size, A1, A2, tilt = gradient_of(family, displacement, i)
        G = motion.green(A1, A2, tilt)
        F1, F2 = motion.gradient(A1, A2, tilt)
        total = real(0.0)
        moment = vec3()
        for k in range(family.members):
            if f.is_intact(family, i, k):
                m = f.neighbour(family, i, k)
                xi = f.chord(family, i, k)
                U = family.inverse_horizon * (displacement[m] - displacement[i])
                Y = image(xi, U)
                weight = f.weight(family, i, k) + f.weight(family, m, f.reverse(family, i, k))
                scaled = weight * tension_of(strain(xi, U), constants) / wp.length(xi) * wp.normalize(Y)
                total += weight
                moment += vec3(scaled[0] * Y[0], scaled[0] * Y[1], scaled[1] * Y[1])
                if known:
                    moment -= weight * virial(F1, F2, G, wp.normalize(f.bond(family, i, k)), constants)
        found = vec3()
        if total > real(0.0):
            found = moment / total
            if known:
                for d in range(directions.shape[0]):
                    found += shares[d] * virial(F1, F2, G, directions[d], constants)
        found *= unit
        if wp.static(stiffened):
            found *= factors[i]
        mean = real(0.5) * (found[0] + found[2])
        half = real(0.5) * (found[0] - found[2])
        shear = found[1]
        radius = wp.sqrt(half * half + shear * shear)
        out[i] = vec3(mean + radius, mean - radius, real(0.5) * wp.atan2(shear, half))

    @kernel(gathers=("displacement",))
    def wrinkle_level(
        family: Family,
        displacement: wp.array(dtype=vec3),
        first: int,
        out: wp.array(dtype=wp.float32),
    ):
        i = wp.tid() + first
        compressed = wp.float32(0.0)
        bonds = wp.float32(0.0)
        for k in range(family.members):
            if f.is_intact(family, i, k):
                U = family.inverse_horizon * (displacement[f.neighbour(family, i, k)] - displacement[i])
                bonds += wp.float32(1.0)
                if strain(f.chord(family, i, k), U) < real(0.0):
                    compressed += wp.float32(1.0)
        out[i] = compressed / wp.max(bonds, wp.float32(1.0))

    pair_force, row_sums = sums_of_bonds(layout, parameters, force_of, stiffness_of)
    law = BondLaw(pair_force=pair_force, energy=earlier_energy, density=density, row_sums=row_sums)
    return law, {"principal_stress": principal_stress, "wrinkle_level": wrinkle_level}


@functools.cache
def bond_based_tangent(
    layout: Layout, pairwise: PairwiseFactory, held: bool, geometric: bool
) -> BondBasedTangentKernels:
    """Kernels of the tangent, with the tension of the bonds (`geometric`, IM eq. 21) or without (IM eq. 16)."""
    types, bits = layout.types, layout.bits
    real, vec3, mat33, vec6, parameters = types.real, types.vec3, types.mat33, types.vec6, types.parameters
    f = family_functions(layout)
    Family = f.struct
    bond = bond_functions(layout)
    strain, image = bond.strain, bond.image
    tension_of, slope_of, _energy_of = pairwise(bits)

    @kernel(gathers=("displacement",))
    def linearise(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        unit_stiffness: real,
        tension: wp.array(dtype=real),
        first: int,
        blocks: wp.array2d(dtype=vec6),
    ):
        """Fills `blocks`; `tension` [Pa] adds an isotropic part to every bond: the tangent of a stretched soap film."""
        i = wp.tid() + first
        for k in range(family.members):
            block = vec6()
            if f.is_intact(family, i, k):
                m = f.neighbour(family, i, k)
                xi = f.chord(family, i, k)
                U = family.inverse_horizon * (displacement[m] - displacement[i])
                s = strain(xi, U)
                along = slope_of(s, constants)
                across = real(0.0)
                if wp.static(geometric):
                    across = tension_of(s, constants) / wp.max(real(1.0) + s, real(1.0e-6))
                n = wp.normalize(image(xi, U))
                along -= across
                across += tension[0]
                weight = f.weight(family, i, k) + f.weight(family, m, f.reverse(family, i, k))
                block = (unit_stiffness * weight / wp.length_sq(xi)) * vec6(
                    along * n[0] * n[0] + across,
                    along * n[0] * n[1],
                    along * n[0] * n[2],
                    along * n[1] * n[1] + across,
                    along * n[1] * n[2],
                    along * n[2] * n[2] + across,
                )
            blocks[k, i] = block

    @wp.func
    def full(block: vec6):
        return mat33(
            block[0], block[1], block[2], block[1], block[3], block[4], block[2], block[4], block[5]
        )  # fmt: skip

    @kernel(gathers=("direction",))
    def product(
        family: Family,
        blocks: wp.array2d(dtype=vec6),
        direction: wp.array(dtype=vec3),
        first: int,
        change: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        total = vec3(real(0.0), real(0.0), real(0.0))
        for k in range(family.members):
            if f.is_intact(family, i, k):
                total += full(blocks[k, i]) * (direction[f.neighbour(family, i, k)] - direction[i])
        change[i] = total

    @kernel()
    def inverse_blocks(
        family: Family, blocks: wp.array2d(dtype=vec6), held_mask: wp.array(dtype=wp.uint8), first: int,
        out: wp.array(dtype=mat33),
    ):  # fmt: skip
        i = wp.tid() + first
        block = mat33()
        for k in range(family.members):
            block += full(blocks[k, i])
        if wp.static(held):
            for c in range(3):
                if (wp.int32(held_mask[i]) & (1 << c)) != 0:
                    for d in range(3):
                        block[c, d] = real(0.0)
                        block[d, c] = real(0.0)
                    block[c, c] = real(1.0)
        least = real(1.0e-12) * (wp.abs(block[0, 0]) + wp.abs(block[1, 1]) + wp.abs(block[2, 2]))
        for c in range(3):
            if wp.abs(block[c, c]) <= least:
                block[c, c] = real(1.0)
        result = wp.inverse(block)
        if wp.static(held):
            for c in range(3):
                if (wp.int32(held_mask[i]) & (1 << c)) != 0:
                    result[c, c] = real(0.0)
        out[i] = result

    return BondBasedTangentKernels(linearise, product, inverse_blocks)
