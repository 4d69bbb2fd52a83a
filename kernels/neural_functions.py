"""Warp functions of the neural law: deformation of a family, stretch and rotation of a bond, closed form of its force.

The equations are in kernels/neural.py.
"""

import functools
from dataclasses import dataclass

import warp as wp

from .factories import PairFactory
from .families import Layout, family_functions
from .kinematics import kinematics
from .nodal import point_gradient
from .numeric import numeric

# Smallest cosine of the angle by which a bond has rotated, see kernels/neural.py.
MIN_COSINE = 0.1
# Smallest stretch passed to a network, which takes logarithms.
NO_LENGTH = 1e-6


@dataclass(frozen=True)
class NeuralFunctions:
    """Warp functions that every way to evaluate the neural law uses; i is a point, k a member of its family.

    Attributes:
        family_frame: (family, displacement, constants, i) -> deformation of the family of i:
            displacement gradient H, rotation R, U - I, U^-1, det F - 1, z = J^2 - 1. R and U^-1 are zero if the intact
            bonds determine no gradient.
        bond_motion: (x, u, H, U - I, U^-1) -> excess stretch of the bond, sine and 1 - cosine of its rotation, its
            direction in the tangent plane, vec2.
        bond_vectors: (family, displacement, i, k) -> unit vector x of the undeformed bond, vec2;
            relative displacement u of its ends divided by its length, vec3; its weight.
        bond_seen: (family, displacement, H, U - I, U^-1, det F - 1, z, i, k) -> results of
            `bond_vectors`, direction in the tangent plane, input of a network: (lambda, theta, C33, det F).
        family_scale: (family, U^-1, unit_force, i) -> force of a bond divided by its weight and T; zero if the family
            determines no gradient.
        logarithms: Input of a network -> inputs of its first layer.
        pull: (x, u, direction, R, T) -> T, which is along and across the bond, as a vector in space.
    """

    family_frame: wp.Function
    bond_motion: wp.Function
    bond_vectors: wp.Function
    bond_seen: wp.Function
    family_scale: wp.Function
    logarithms: wp.Function
    pull: wp.Function


@functools.cache
def bond_kinematics(layout: Layout, membrane: PairFactory) -> tuple[wp.Function, wp.Function]:
    """Warp functions `family_frame` and `bond_motion`; `membrane` as in kernels/materials.py."""
    types, bits = layout.types, layout.bits
    real, vec2, vec3, mat22, mat32, parameters = (
        types.real, types.vec2, types.vec3, types.mat22, types.mat32, types.parameters,
    )  # fmt: skip
    f = family_functions(layout)
    Family = f.struct
    gradient, green = point_gradient(layout), kinematics(bits).green
    volume_change, _ = membrane(bits)

    @wp.func
    def family_frame(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        i: int,
    ):
        G1, G2, inverse, _size = gradient(family, displacement, displacement, real(0.0), i)
        H = mat32()
        R = mat32()
        D = mat22()
        V = mat22()
        area = real(0.0)
        z = real(0.0)
        if inverse[0] > real(0.0):
            H1 = family.inverse_horizon * G1
            H2 = family.inverse_horizon * G2
            G = green(H1, H2)
            # det C - 1; the root of det C is det U = det F, and tr U^2 = tr C + 2 det U.
            change = G[0, 0] + G[1, 1] + wp.determinant(G)
            d = wp.sqrt(real(1.0) + change)
            area = change / (real(1.0) + d)
            excess = G[0, 0] + G[1, 1] + real(2.0) * area
            t = wp.sqrt(real(4.0) + excess)
            widening = area - excess / (real(2.0) + t)
            D = mat22(G[0, 0] + widening, G[0, 1], G[0, 1], G[1, 1] + widening) / t
            V = mat22(real(1.0) + D[1, 1], -D[0, 1], -D[0, 1], real(1.0) + D[0, 0]) / d
            for c in range(3):
                H[c, 0] = H1[c]
                H[c, 1] = H2[c]
            F = mat32(
                real(1.0) + H[0, 0], H[0, 1], H[1, 0], real(1.0) + H[1, 1], H[2, 0], H[2, 1]
            )  # fmt: skip
            R = F * V
            z = volume_change(G, constants)
        return H, R, D, V, area, z

    @wp.func
    def bond_motion(x: vec2, u: vec3, H: mat32, D: mat22, V: mat22):
        """Stretch and rotation without the loss of digits of small strains.

        With Y the bond's image and y = R^T Y = U^-1 F^T Y, the difference y - x = U^-1 [ H^T (x, 0) + F^T u -
        (U - I) x ] is of the order of the strain; so is each of its terms, as long as the sheet has not rotated.
        """
        x3 = vec3(x[0], x[1], real(0.0))
        e = V * (wp.transpose(H) * (x3 + u) + vec2(u[0], u[1]) - D * x)
        y = x + e
        squared = real(2.0) * (x[0] * u[0] + x[1] * u[1]) + wp.dot(u, u)
        excess = squared / (real(1.0) + wp.sqrt(wp.max(real(1.0) + squared, real(0.0))))
        length = wp.length(y)
        along = wp.dot(x, y)
        across = x[0] * e[1] - x[1] * e[0]
        sine = real(0.0)
        versine = real(0.0)
        direction = x
        if length > real(0.0):
            direction = y / length
            sine = across / length
            if along > real(0.0):
                versine = sine * sine * length / (length + along)
            else:
                versine = real(1.0) - along / length
        return excess, sine, versine, direction

    return family_frame, bond_motion


@functools.cache
def closed_form(bits: int, membrane: PairFactory) -> wp.Function:
    """Warp function (excess stretch, sine, 1 - cosine, det F - 1, z, constants) -> T mu along and across the bond."""
    types = numeric(bits)
    real, vec2, parameters = types.real, types.vec2, types.parameters
    _, shear = membrane(bits)
    least = MIN_COSINE

    @wp.func
    def bond_law(excess: real, sine: real, versine: real, area: real, z: real, constants: parameters):
        stretch = real(1.0) + excess
        cosine = real(1.0) - versine
        det = real(1.0) + area
        b = stretch * sine
        alpha = excess - stretch * versine
        # Also for a bond of zero length.
        alpha = wp.max(alpha, real(least) * wp.max(stretch, real(least)) - real(1.0))
        a = real(1.0) + alpha
        # C33 det^2 = 1 + z
        thinning = (z - area * (real(2.0) + area)) / (det * det)
        sheared = b * b / det
        # tr U - 2, for g: the other diagonal entry of U in the frame of the bond is (det + b^2) / a.
        other = (area - alpha + b * b) / a
        trace = alpha * (real(2.0) + alpha) + other * (real(2.0) + other) + real(2.0) * b * b
        g = shear(trace, thinning, z, constants)
        along = g * (alpha * (real(2.0) + alpha) - thinning * (real(1.0) + sheared) - sheared) / a
        across = g * b * (real(1.0) + (real(1.0) + thinning) / det)
        return vec2(along * cosine + across * sine, across * cosine - along * sine)

    return bond_law


@functools.cache
def neural_functions(layout: Layout, membrane: PairFactory, corrected: bool) -> NeuralFunctions:
    """Functions of a configuration; arguments as for `neural`."""
    types = layout.types
    real, vec2, vec3, vec4, mat32, mat22 = (
        types.real, types.vec2, types.vec3, types.parameters, types.mat32, types.mat22,
    )  # fmt: skip
    f = family_functions(layout)
    Family = f.struct
    family_frame, bond_motion = bond_kinematics(layout, membrane)
    no_length = NO_LENGTH

    @wp.func
    def bond_vectors(family: Family, displacement: wp.array(dtype=vec3), i: int, k: int):
        """The weight is 2 W_ik / |X|, with published weights c_k |X|; lengths are divided by the horizon."""
        xi = f.bond(family, i, k)
        length = wp.length(xi)
        m = f.neighbour(family, i, k)
        u = (family.inverse_horizon / length) * (displacement[m] - displacement[i])
        if wp.static(corrected):
            return xi / length, u, real(2.0) * f.weight(family, i, k) / length
        else:
            return xi / length, u, length * f.influence(family, i, k) * f.area(family, m)

    @wp.func
    def pull(x: vec2, u: vec3, direction: vec2, R: mat32, T: vec2):
        Y = vec3(x[0] + u[0], x[1] + u[1], u[2])
        return T[0] * wp.normalize(Y) + T[1] * (R * vec2(-direction[1], direction[0]))

    @wp.func
    def bond_seen(
        family: Family, displacement: wp.array(dtype=vec3), H: mat32, D: mat22, V: mat22,
        area: real, z: real, i: int, k: int,
    ):  # fmt: skip
        x, u, weight = bond_vectors(family, displacement, i, k)
        excess, sine, versine, direction = bond_motion(x, u, H, D, V)
        det = real(1.0) + area
        stretch = wp.max(real(1.0) + excess, real(no_length))
        angle = wp.atan2(sine, real(1.0) - versine)
        return x, u, weight, direction, vec4(stretch, angle, (real(1.0) + z) / (det * det), det)

    @wp.func
    def logarithms(row: vec4):
        """Inputs of the first layer, see `warp_pd.laws.neural.networks.Network`."""
        area = wp.log(row[3])
        return vec4(wp.log(row[0]), row[1] * row[1], area, wp.log(row[2]) + real(2.0) * area)

    @wp.func
    def family_scale(family: Family, V: mat22, unit_force: real, i: int):
        if V[0, 0] == real(0.0):
            return real(0.0)
        if wp.static(corrected):
            return unit_force
        else:
            return unit_force * f.area(family, i) * f.weight(family, i, 0)

    return NeuralFunctions(family_frame, bond_motion, bond_vectors, bond_seen, family_scale, logarithms, pull)
