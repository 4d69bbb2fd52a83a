"""The visco-hyperelastic bond law as published (VE eqs. 46 to 75): a Yeoh bond force and viscous stretches.

With J = I1 - 2 = (2 / m) sum_k w_k (|Y|^2 - |X|^2) V_k over the family of a point, w = (horizon / |X|)^2 and m =
sum w |X|^2 V (eqs. 39 and 41), the family of i pulls its bond k with the force density

    t = (4 w / m) [ (c10 + 2 c20 J) |Y| + |X| sum_p (c10_p + 2 c20_p J) gamma_p ]  along Y,

where gamma is the part of the stretch |Y| / |X| that has not relaxed. The two-dimensional Yeoh energy has no pressure
term, so t does not vanish in the undeformed sheet: 4 c10 w |X| / m. A broken bond adds nothing to J or to the force.

At a trial displacement the force responds with the instantaneous stiffness, as in kernels/visco/visco.py. `strain`
[members, points] stores |Y| / |X| - 1 of the last step, `viscous_stretch` [terms * members, points] stores gamma_p.
The table `weight` is 4 w a_i a_k / sum_k w xi^2 a_k.
"""

import functools
from typing import Any

import warp as wp

from ..effects import kernel
from ..families import Layout, family_functions
from ..kinematics import kinematics
from ..point_fields import gradient_of_family
from ..visco.visco import relaxation_factors
from .bonds import BondLaw, bond_functions, forces_of_families


@functools.cache
def visco_bonds(layout: Layout, terms: bool) -> tuple[BondLaw, Any]:
    """The law, with or without Prony terms, and the Warp struct of what its force depends on."""
    types, bits = layout.types, layout.bits
    real, vec3, parameters = types.real, types.vec3, types.parameters
    f = family_functions(layout)
    Family = f.struct
    Vectors: Any = wp.array(dtype=vec3)
    bond = bond_functions(layout)
    strain_of, image = bond.strain, bond.image
    retained = relaxation_factors(bits)
    motion, gradient_of = kinematics(bits), gradient_of_family(layout)

    @wp.func
    def excess(family: Family, displacement: Vectors, velocity: Vectors, back: real, i: int):
        """I1 - 2 at a time `back` before now; |Y|^2 - |X|^2 = |X|^2 s (2 + s)."""
        total = real(0.0)
        for k in range(family.members):
            if f.is_intact(family, i, k):
                m = f.neighbour(family, i, k)
                xi = f.bond(family, i, k)
                U = displacement[m] - displacement[i] - back * (velocity[m] - velocity[i])
                s = strain_of(xi, family.inverse_horizon * U)
                total += f.weight(family, i, k) * wp.length_sq(xi) * s * (real(2.0) + s)
        return real(0.5) * total / f.area(family, i)

    @wp.struct
    class Constants:
        yeoh: parameters
        prony: wp.array(dtype=parameters)
        strain: wp.array2d(dtype=real)
        viscous_stretch: wp.array2d(dtype=real)

    @wp.func
    def state_of(family: Family, displacement: Vectors, constants: Constants, unit_force: real, i: int):
        """J of the family, its modulus, the unit of force."""
        J = excess(family, displacement, displacement, real(0.0), i)
        return vec3(J, constants.yeoh[0] + real(2.0) * constants.yeoh[1] * J, unit_force)

    @wp.func
    def force_of(family: Family, displacement: Vectors, constants: Constants, state: vec3, i: int, k: int):
        xi = f.bond(family, i, k)
        U = family.inverse_horizon * (displacement[f.neighbour(family, i, k)] - displacement[i])
        factor = state[1]
        if wp.static(terms):
            # |X| / |Y| turns the viscous stretch into a factor on Y.
            s = strain_of(xi, U)
            for p in range(constants.prony.shape[0]):
                gamma = constants.viscous_stretch[p * family.members + k, i] + (s - constants.strain[k, i])
                term = constants.prony[p]
                factor += (term[0] + real(2.0) * term[1] * state[0]) * gamma / (real(1.0) + s)
        return (state[2] * f.weight(family, i, k) * factor) * image(xi, U)

    @kernel(gathers=("displacement",))
    def update(
        family: Family,
        displacement: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        prony: wp.array(dtype=parameters),
        first: int,
        strain: wp.array2d(dtype=real),
        viscous_stretch: wp.array2d(dtype=real),
    ):
        i = wp.tid() + first
        dt = step[0]
        for k in range(family.members):
            if f.is_intact(family, i, k):
                xi = f.bond(family, i, k)
                s = strain_of(xi, family.inverse_horizon * (displacement[f.neighbour(family, i, k)] - displacement[i]))
                change = s - strain[k, i]
                stretch = real(1.0) + s
                squared = stretch * stretch
                rate = wp.abs(change) / dt * wp.sqrt(real(4.0) * squared + real(2.0) / (squared * squared))
                for p in range(prony.shape[0]):
                    term = prony[p]
                    x = dt / term[2]
                    if term[3] != real(0.0):
                        x *= wp.pow(rate, term[3])
                    row = p * family.members + k
                    gamma = viscous_stretch[row, i]
                    kept = retained(x)
                    viscous_stretch[row, i] = gamma - x * kept * gamma + kept * change
                strain[k, i] = s

    @wp.func
    def earlier_energy(
        family: Family, displacement: Vectors, velocity: Vectors, back: real, constants: parameters, i: int
    ):
        """Energy c10 J + c20 J^2 of family i at a time `back` before now, over (thickness x reference area) [J/m^3]."""
        J = excess(family, displacement, velocity, back, i)
        return f.area(family, i) * J * (constants[0] + constants[1] * J)

    @kernel(gathers=("displacement",))
    def density(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        first: int,
        out: wp.array(dtype=wp.float64),
    ):
        """Energy density, with the I1 of a uniform state in place of what the bonds of the family find of it."""
        i = wp.tid() + first
        J = excess(family, displacement, displacement, real(0.0), i)
        known, _size, A1, A2, tilt = gradient_of(family, displacement, i)
        if known:
            G = motion.green(A1, A2, tilt)
            found = real(0.0)
            for k in range(family.members):
                if f.is_intact(family, i, k):
                    xi = f.bond(family, i, k)
                    found += f.weight(family, i, k) * wp.dot(xi, G * xi)
            J += G[0, 0] + G[1, 1] - real(0.5) * found / f.area(family, i)
        out[i] = wp.float64(J * (constants[0] + constants[1] * J))

    force = forces_of_families(layout, state_of, force_of)
    if terms:
        return BondLaw(family_force=force, update=update), Constants
    return BondLaw(family_force=force, energy=earlier_energy, density=density), Constants
