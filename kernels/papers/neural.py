"""The neural law and its closed form: the force of a bond from its own stretch and rotation.

NN eqs. 34 to 42: with the family's in-plane det F and thickness stretch C33, and the bond's own stretch lambda and
rotation theta, the family of i pulls its member k with

    a_i a_k T_ik = h a_i c_k mu |X| (2 / tr K_i) T(lambda, theta, C33, det F),   T = (along the bond, across it).

Bond stretch and rotation are measured in the family's tangent plane, rotated by R of F = R U. In that frame a uniform
deformation is the symmetric U, as in the training data. (The paper rotates the convected vector g1 to E1 instead, which
gives a triangular F; theta then contains shear, unlike the training data.) lambda is the bond's stretch in space, and
the force along the bond acts along its direction in space, so a point that leaves the surface is pulled back. The force
across the bond acts in the tangent plane.

Closed form. Lambda, theta and det F determine U: in the frame of the bond, with a = lambda cos theta,
b = lambda sin theta, U = [[a, b], [b, (det + b^2)/a]]. With the first Piola stress g (F - C33 F^-T) of the
materials here (g = mu J^-2/3 for the neo-Hookean one)

    T mu = g ( [a^2 - C33 (1 + b^2/det)] / a,   b (1 + C33/det) )      along and across the reference bond.

It has a pole where a bond is rotated by 90 degrees from the direction given by its family. a is kept above MIN_COSINE
lambda (and its square), so that the force remains finite and pushes the bond back.

Broken bonds are removed from F and C33 but not from tr K, so that the intact bonds keep their stiffness.

With `corrected` weights, h W_ik 2 / |X| replaces h a_i c_k |X| 2 / tr K_i. The published force has W_ik = a_i c_k |X|^2
/ tr K_i, which balances a uniform stress only in the interior of a lattice (warp_pd/families/weights).
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..effects import Kernel, kernel
from ..families import Layout, family_functions
from ..kinematics import kinematics
from ..numeric import FunctionFactory, PairFactory, constants_of, numeric
from .bonds import forces_of_families
from .neural_network import Layers, network_function
from .nodal import point_gradient

# Smallest cosine of the angle by which a bond has rotated.
MIN_COSINE = 0.1
# Smallest stretch passed to a network, which takes logarithms.
NO_LENGTH = 1e-6


@dataclass(frozen=True)
class NeuralLaw:
    """Kernels of the law.

    Attributes:
        force: Forces of families, as of `forces_of_families`, in one launch.
        features: Fills features [members x points] with (lambda, theta, C33, det F), undeformed values where no bond
            exists, and frame [points] with R, for a network that Torch evaluates.
        Evaluated: Warp struct of the constants of `evaluated_force`: frame, and pairs [members x points] of T.
        evaluated_force: Forces of families from what Torch has evaluated.
        outside: Counts the bonds of each point whose state lies outside a range of principal stretches.
    """

    force: Kernel
    features: Kernel
    Evaluated: Any
    evaluated_force: Kernel
    outside: Kernel


@functools.cache
def bond_kinematics(
    layout: Layout, functions: PairFactory, volume: FunctionFactory
) -> tuple[Any, wp.Function, wp.Function]:
    """Struct `Frame`, functions `family_frame` and `bond_motion`; `functions` and `volume` as in kernels/materials.py.

    Frame: displacement gradient H of a family, rotation R, D = U - I, V = U^-1, area = det F - 1, z = J^2 - 1, and the
        scale of its forces. R and V are zero if the intact bonds determine no gradient.
    family_frame: (family, displacement, constants, i) -> Frame with a scale of zero.
    bond_motion: (x, u, frame) -> excess stretch of the bond, sine and 1 - cosine of its rotation, its direction in the
        tangent plane, vec2; x and u as of `bond_vectors`.
    """
    types, bits = layout.types, layout.bits
    real, vec2, vec3, mat22, mat32 = types.real, types.vec2, types.vec3, types.mat22, types.mat32
    f = family_functions(layout)
    Family = f.struct
    Vectors: Any = wp.array(dtype=vec3)
    gradient, green = point_gradient(layout), kinematics(bits).green
    volume_change = volume(bits)
    Constants = constants_of(functions(bits)[0])

    @wp.struct
    class Frame:
        H: mat32
        R: mat32
        D: mat22
        V: mat22
        area: real
        z: real
        scale: real

    @wp.func
    def family_frame(family: Family, displacement: Vectors, constants: Constants, i: int):
        G1, G2, inverse, _size = gradient(family, displacement, displacement, real(0.0), i)
        frame = Frame()
        if inverse[0] > real(0.0):
            H1 = family.inverse_horizon * G1
            H2 = family.inverse_horizon * G2
            G = green(H1, H2, vec2())
            # det C - 1; the root of det C is det U = det F, and tr U^2 = tr C + 2 det U.
            change = G[0, 0] + G[1, 1] + wp.determinant(G)
            d = wp.sqrt(real(1.0) + change)
            area = change / (real(1.0) + d)
            excess = G[0, 0] + G[1, 1] + real(2.0) * area
            t = wp.sqrt(real(4.0) + excess)
            widening = area - excess / (real(2.0) + t)
            D = mat22(G[0, 0] + widening, G[0, 1], G[0, 1], G[1, 1] + widening) / t
            V = mat22(real(1.0) + D[1, 1], -D[0, 1], -D[0, 1], real(1.0) + D[0, 0]) / d
            H = mat32(H1[0], H2[0], H1[1], H2[1], H1[2], H2[2])
            F = mat32(
                real(1.0) + H[0, 0], H[0, 1], H[1, 0], real(1.0) + H[1, 1], H[2, 0], H[2, 1]
            )  # fmt: skip
            frame.H = H
            frame.R = F * V
            frame.D = D
            frame.V = V
            frame.area = area
            frame.z = volume_change(G, constants)
        return frame

    @wp.func
    def bond_motion(x: vec2, u: vec3, frame: Frame):
        """Stretch and rotation without the loss of digits of small strains.

        With Y the bond's image and y = R^T Y = U^-1 F^T Y, the difference y - x = U^-1 [ H^T (x, 0) + F^T u -
        (U - I) x ] is of the order of the strain; so is each of its terms, as long as the sheet has not rotated.
        """
        x3 = vec3(x[0], x[1], real(0.0))
        e = frame.V * (wp.transpose(frame.H) * (x3 + u) + vec2(u[0], u[1]) - frame.D * x)
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

    return Frame, family_frame, bond_motion


@functools.cache
def own_stretch(bits: int) -> wp.Function:
    """Warp function (excess stretch, sine, 1 - cosine, det F - 1) -> U - I of the bond, in its own frame."""
    types = numeric(bits)
    real, mat22 = types.real, types.mat22
    least = MIN_COSINE

    @wp.func
    def stretch_tensor(excess: real, sine: real, versine: real, area: real):
        stretch = real(1.0) + excess
        b = stretch * sine
        alpha = excess - stretch * versine
        # Also for a bond of zero length.
        alpha = wp.max(alpha, real(least) * wp.max(stretch, real(least)) - real(1.0))
        # U22 = (det + b^2) / U11
        return mat22(alpha, b, b, (area - alpha + b * b) / (real(1.0) + alpha))

    return stretch_tensor


@functools.cache
def closed_form(membrane: PairFactory) -> FunctionFactory:
    """Factory of the law of a bond with the C33 of its family; `membrane` as in kernels/materials.py.

    Its Warp functions take (excess stretch, sine, 1 - cosine, det F - 1, z, constants) and return T mu along and
    across the bond.
    """

    @functools.cache
    def bond_law(bits: int) -> wp.Function:
        types = numeric(bits)
        real, vec2, parameters = types.real, types.vec2, types.parameters
        _, shear = membrane(bits)
        stretch_tensor = own_stretch(bits)

        @wp.func
        def force(excess: real, sine: real, versine: real, area: real, z: real, constants: parameters):
            D = stretch_tensor(excess, sine, versine, area)
            alpha, b, other = D[0, 0], D[0, 1], D[1, 1]
            cosine = real(1.0) - versine
            det = real(1.0) + area
            a = real(1.0) + alpha
            # C33 det^2 = 1 + z
            thinning = (z - area * (real(2.0) + area)) / (det * det)
            sheared = b * b / det
            trace = alpha * (real(2.0) + alpha) + other * (real(2.0) + other) + real(2.0) * b * b
            g = shear(trace, thinning, z, constants)
            along = g * (alpha * (real(2.0) + alpha) - thinning * (real(1.0) + sheared) - sheared) / a
            across = g * b * (real(1.0) + (real(1.0) + thinning) / det)
            return vec2(along * cosine + across * sine, across * cosine - along * sine)

        return force

    return bond_law


@functools.cache
def closed_form_of_stress(functions: PairFactory) -> FunctionFactory:
    """The same for any material: its stress S at the U of the bond gives T mu = U S x. C33 is that of the bond too."""

    @functools.cache
    def bond_law(bits: int) -> wp.Function:
        types = numeric(bits)
        real, vec2 = types.real, types.vec2
        stress, _ = functions(bits)
        stretch_tensor = own_stretch(bits)
        Constants = constants_of(stress)

        @wp.func
        def force(excess: real, sine: real, versine: real, area: real, z: real, constants: Constants):
            D = stretch_tensor(excess, sine, versine, area)
            S = stress(real(2.0) * D + D * D, constants)
            cosine = real(1.0) - versine
            along = (real(1.0) + D[0, 0]) * S[0, 0] + D[0, 1] * S[1, 0]
            across = D[0, 1] * S[0, 0] + (real(1.0) + D[1, 1]) * S[1, 0]
            return vec2(along * cosine + across * sine, across * cosine - along * sine)

        return force

    return bond_law


@functools.cache
def neural(
    layout: Layout,
    functions: PairFactory,
    volume: FunctionFactory,
    law: FunctionFactory,
    corrected: bool,
    layers: Layers | None,
) -> NeuralLaw:
    """The law.

    Args:
        layout: Layout of the families.
        functions: Factory of stress and energy of the material, see kernels/materials.py.
        volume: Factory of its volume change.
        law: Factory of the closed form, which is used where no network is: see `closed_form`.
        corrected: Whether the tables hold a corrected weight of each bond, in place of 2 / tr K of each family.
        layers: Weights and biases of the network that the kernel evaluates, see `network_function`; None for Torch and
            for the closed form.
    """
    types, bits = layout.types, layout.bits
    real, vec2, vec3, mat32, parameters = types.real, types.vec2, types.vec3, types.mat32, types.parameters
    f = family_functions(layout)
    Family = f.struct
    Vectors: Any = wp.array(dtype=vec3)
    Frame, family_frame, bond_motion = bond_kinematics(layout, functions, volume)
    Constants = constants_of(functions(bits)[0])
    no_length = NO_LENGTH
    exact, fused = law(bits), layers is not None
    network = network_function(bits, layers) if layers is not None else None

    @wp.func
    def bond_vectors(family: Family, displacement: Vectors, i: int, k: int):
        """Unit vector x of the undeformed bond; displacement u of its ends over its length; weight.

        The weight is 2 W_ik / |X|, with published weights c_k |X|; lengths are divided by the horizon.
        """
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
        """T, which is along and across the bond, as a vector in space."""
        Y = vec3(x[0] + u[0], x[1] + u[1], u[2])
        return T[0] * wp.normalize(Y) + T[1] * (R * vec2(-direction[1], direction[0]))

    @wp.func
    def seen(excess: real, sine: real, versine: real, frame: Frame):
        """Inputs of a network: lambda, theta, C33, det F."""
        det = real(1.0) + frame.area
        stretch = wp.max(real(1.0) + excess, real(no_length))
        angle = wp.atan2(sine, real(1.0) - versine)
        return parameters(stretch, angle, (real(1.0) + frame.z) / (det * det), det)

    @wp.func
    def logarithms(row: parameters):
        """Inputs of the first layer, see `warp_pd.papers.neural.networks.Network`."""
        area = wp.log(row[3])
        return parameters(wp.log(row[0]), row[1] * row[1], area, wp.log(row[2]) + real(2.0) * area)

    @wp.func
    def scale_of(family: Family, unit_force: real, i: int):
        """Force of a bond divided by its weight and T."""
        if wp.static(corrected):
            return unit_force
        else:
            return unit_force * f.area(family, i) * f.weight(family, i, 0)

    @wp.func
    def state_of(family: Family, displacement: Vectors, constants: Constants, unit_force: real, i: int):
        frame = family_frame(family, displacement, constants, i)
        if frame.V[0, 0] != real(0.0):
            frame.scale = scale_of(family, unit_force, i)
        return frame

    @wp.func
    def force_of(family: Family, displacement: Vectors, constants: Constants, frame: Frame, i: int, k: int):
        force = vec3(real(0.0), real(0.0), real(0.0))
        if frame.scale > real(0.0):
            x, u, weight = bond_vectors(family, displacement, i, k)
            excess, sine, versine, direction = bond_motion(x, u, frame)
            if wp.static(fused):
                row = seen(excess, sine, versine, frame)
                o = network(logarithms(row))
                T = vec2(o[0], row[1] * o[1])
            else:
                T = exact(excess, sine, versine, frame.area, frame.z, constants)
            force = frame.scale * weight * pull(x, u, direction, frame.R, T)
        return force

    @kernel(gathers=("displacement",))
    def features(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        points: int,
        first: int,
        features: wp.array(dtype=parameters),
        frame: wp.array(dtype=mat32),
    ):
        i = wp.tid() + first
        own = family_frame(family, displacement, constants, i)
        frame[i] = own.R
        for k in range(family.members):
            row = parameters(real(1.0), real(0.0), real(1.0), real(1.0))
            if f.is_intact(family, i, k) and own.V[0, 0] != real(0.0):
                x, u, _weight = bond_vectors(family, displacement, i, k)
                excess, sine, versine, _direction = bond_motion(x, u, own)
                row = seen(excess, sine, versine, own)
            features[k * points + i] = row

    @wp.struct
    class Evaluated:
        points: int
        frame: wp.array(dtype=mat32)
        pairs: wp.array(dtype=vec2)

    @wp.func
    def evaluated_state(family: Family, displacement: Vectors, constants: Evaluated, unit_force: real, i: int):
        """Of the frame, only its rotation and scale. A family that determines no frame carries no force."""
        frame = Frame()
        frame.R = constants.frame[i]
        if wp.ddot(frame.R, frame.R) != real(0.0):
            frame.scale = scale_of(family, unit_force, i)
        return frame

    @wp.func
    def evaluated_force(family: Family, displacement: Vectors, constants: Evaluated, frame: Frame, i: int, k: int):
        force = vec3(real(0.0), real(0.0), real(0.0))
        if frame.scale > real(0.0):
            x, u, weight = bond_vectors(family, displacement, i, k)
            direction = wp.transpose(frame.R) * vec3(x[0] + u[0], x[1] + u[1], u[2])
            T = constants.pairs[k * constants.points + i]
            force = frame.scale * weight * pull(x, u, wp.normalize(direction), frame.R, T)
        return force

    @kernel(gathers=("displacement",))
    def outside(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        least: real,
        most: real,
        first: int,
        out: wp.array(dtype=wp.int32),
    ):
        """Counts the bonds whose U has a principal stretch below `least` or above `most`."""
        i = wp.tid() + first
        frame = family_frame(family, displacement, constants, i)
        det = real(1.0) + frame.area
        found = wp.int32(0)
        for k in range(family.members):
            if f.is_intact(family, i, k) and frame.V[0, 0] != real(0.0):
                x, u, _weight = bond_vectors(family, displacement, i, k)
                excess, sine, versine, _direction = bond_motion(x, u, frame)
                a = (real(1.0) + excess) * (real(1.0) - versine)
                b = (real(1.0) + excess) * sine
                inside = bool(False)
                if a > real(0.0):
                    # Both zeros of s^2 - tr U s + det U lie within [least, most].
                    t = a + (det + b * b) / a
                    inside = (
                        t >= real(2.0) * least
                        and t <= real(2.0) * most
                        and least * (least - t) + det >= real(0.0)
                        and most * (most - t) + det >= real(0.0)
                    )
                if not inside:
                    found += 1
        out[i] = found

    return NeuralLaw(
        force=forces_of_families(layout, state_of, force_of, fast_math=fused and bits == 32),
        features=features,
        Evaluated=Evaluated,
        evaluated_force=forces_of_families(layout, evaluated_state, evaluated_force),
        outside=outside,
    )
