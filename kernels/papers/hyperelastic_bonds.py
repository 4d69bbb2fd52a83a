"""Bond-based hyperelastic sheets (HE, chapter 3): forces act along the bonds, with constants set by the loading mode.

With s = |Y|/|X|, n = Y/|Y| and L = (X . Y) / (|X| |Y|), the force density of a bond is (HE eqs. 29, 52, 71)

    f = (4 c0 delta / |X|^2) L^2 t(s) n,     c0 = mu / (2 pi h delta^2),     t(s) = a s - b/s^2 - c/s^3 - d/s^5,

where the loading mode sets a, b, c, d (warp_pd/papers/hyperelastic_bonds.py). With areas divided by a_ref and lengths
by the horizon,

    F_ik = (h a_ref / delta) (W_ik + W_ki)/2 G_ik L^2 mu t(s) / |xi|^2 n,     W_ik = (2/pi) (a_ref / delta^2) a_i a_k,

and F_ki = -F_ik to the last bit. G_ik is the surface correction, an ellipse whose half-axes are the means of the
corrections of both points along x and y (HE eqs. 42 and 43).

t is written in terms of t(1) and e = s - 1, so float32 resolves small strains. The factor L^2 makes the magnitude of
the force depend on the rotation of the bond: the force has no potential and is not objective.
"""

import functools
from typing import Any

import warp as wp

from ..families import Layout, family_functions
from .bonds import BondLaw, bond_functions, sums_of_bonds


@functools.cache
def hyperelastic_bonds(layout: Layout) -> tuple[BondLaw, Any]:
    """The law, and the Warp struct of its constants: those of t, and the surface correction of each point."""
    types = layout.types
    real, vec2, vec3, parameters = types.real, types.vec2, types.vec3, types.parameters
    f = family_functions(layout)
    Family = f.struct
    bond = bond_functions(layout)
    strain, image = bond.strain, bond.image

    @wp.struct
    class Constants:
        tension: parameters
        factors: wp.array(dtype=vec2)

    @wp.func
    def tension(e: real, p: parameters):
        """Traction t [Pa] at the stretch 1 + e, from p = (t(1), b, c, d), without the a that these determine."""
        r = real(1.0) / (real(1.0) + e)
        r2 = r * r
        second = (real(2.0) + e) * r2
        third = (real(3.0) + e * (real(3.0) + e)) * r2 * r
        fifth = (real(5.0) + e * (real(10.0) + e * (real(10.0) + e * (real(5.0) + e)))) * r2 * r2 * r
        return p[0] * (real(1.0) + e) + e * (
            p[1] * (real(1.0) + second) + p[2] * (real(1.0) + third) + p[3] * (real(1.0) + fifth)
        )

    @wp.func
    def slope(e: real, p: parameters):
        """The derivative dt/ds [Pa] at the stretch 1 + e."""
        r = real(1.0) / (real(1.0) + e)
        r3 = r * r * r
        return (
            (p[0] + p[1] + p[2] + p[3]) + real(2.0) * p[1] * r3 + real(3.0) * p[2] * r3 * r + real(5.0) * p[3] * r3 * r3
        )

    @wp.func
    def coefficient(family: Family, constants: Constants, i: int, k: int, m: int, xi: vec2, Y: vec3):
        """(W_ik + W_ki)/2 G_ik L^2 / |xi|^2."""
        squared = wp.length_sq(xi)
        along = xi[0] * Y[0] + xi[1] * Y[1]
        cosine = along * along / (squared * wp.dot(Y, Y))
        weight = real(0.5) * (f.weight(family, i, k) + f.weight(family, m, f.reverse(family, i, k)))
        mean = real(0.5) * (constants.factors[i] + constants.factors[m])
        x = xi[0] / mean[0]
        y = xi[1] / mean[1]
        weight *= wp.sqrt(squared / (x * x + y * y))
        return weight * cosine / squared

    @wp.func
    def force_of(family: Family, constants: Constants, i: int, k: int, m: int, xi: vec2, U: vec3):
        e = strain(xi, U)
        Y = image(xi, U)
        return coefficient(family, constants, i, k, m, xi, Y) * tension(e, constants.tension) * wp.normalize(Y)

    @wp.func
    def stiffness_of(family: Family, constants: Constants, i: int, k: int, m: int, xi: vec2, U: vec3):
        """The larger of the stiffnesses along and across the bond."""
        e = strain(xi, U)
        p = constants.tension
        stiffest = wp.max(wp.abs(slope(e, p)), wp.abs(tension(e, p)) / (real(1.0) + e))
        return coefficient(family, constants, i, k, m, xi, image(xi, U)) / wp.length(xi) * stiffest

    pair_force, row_sums = sums_of_bonds(layout, Constants, force_of, stiffness_of)
    return BondLaw(pair_force=pair_force, row_sums=row_sums), Constants
