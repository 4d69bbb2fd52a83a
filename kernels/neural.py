"""The neural law and its closed form: the force of a bond from its own stretch and rotation.

NN eqs. 34 to 42: with the family's in-plane det F and thickness stretch C33, and the bond's own stretch lambda and
rotation theta, the family of i pulls its member k with

    a_i a_k T_ik = h a_i c_k mu |X| (2 / tr K_i) T(lambda, theta, C33, det F),   T = (along the bond, across it).

Bond stretch and rotation are measured in the family's tangent plane, turned by the rotation R of F = R U: seen from
there uniform deformation is the symmetric U, as in the training data. (The paper turns the convected vector g1
to E1 instead, which leaves a triangular F; theta then holds shear, which the data do not know.) lambda is the
bond's length in space and the force along it acts in its own direction in space, so that a point which leaves the
surface is pulled back; the force across it acts in the tangent plane.

Closed form. Lambda, theta and det F determine U: in the frame of the bond, with a = lambda cos theta,
b = lambda sin theta, U = [[a, b], [b, (det + b^2)/a]]. With the first Piola stress g (F - C33 F^-T) of the
materials here (g = mu J^-2/3 for the neo-Hookean one)

    T mu = g ( [a^2 - C33 (1 + b^2/det)] / a,   b (1 + C33/det) )      along and across the reference bond.

It has a pole where a bond is turned by 90 degrees from where its family would put it: a is held above LEAST_COSINE
lambda (and its square), which keeps the force finite and pushing the bond back.

Broken bonds leave F and C33 but not tr K, so that the remaining bonds keep their stiffness.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from .families import family_functions
from .nodal import point_family
from .numeric import numeric

LEAST_COSINE = 0.1
# The least stretch that a network is shown: it takes logarithms.
NO_LENGTH = 1e-6


@dataclass(frozen=True)
class NeuralKernels:
    """Kernels of one configuration.

    Attributes:
        direct: Fills bond_force [members, points], N, in one launch; None if Torch stands in between.
        features: Fills features [members x points] with (lambda, theta, C33, det F), those of a bond at rest where
            there is none, and frame [points] with R; None unless Torch stands in between.
        spread: Turns pairs [members x points] of T into bond_force [members, points], N; None likewise.
        gather: Sums bond_force to the internal force [points], N.
        outside: Counts the bonds of each point whose state lies outside a range of principal stretches.
    """

    direct: Any
    features: Any
    spread: Any
    gather: Any
    outside: Any


@functools.cache
def bond_kinematics(layout, bits, membrane, breakable, module):
    """Warp functions `family_frame` and `bond_state`.

    Args:
        layout: "lattice" or "cloud".
        bits: 32 or 64.
        membrane: Factory of (volume_change, shear), see kernels/materials.py.
        breakable: Whether bonds can break.
        module: Name of the Warp module.
    """
    types = numeric(bits)
    real, vec2, vec3, mat22, mat32, parameters = (
        types.real, types.vec2, types.vec3, types.mat22, types.mat32, types.parameters,
    )  # fmt: skip
    f = family_functions(layout, bits, module)
    Family = f.struct
    point = point_family(layout, bits, breakable, module)
    volume_change, _ = membrane(bits)

    @wp.func(module=module)
    def family_frame(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        inverse_horizon: real,
        i: int,
    ):
        """Displacement gradient H, R (zero if degenerate), U - I, U^-1, det F - 1, z = J^2 - 1."""
        G1, G2, inverse, _size = point.gradient(family, alive, displacement, displacement, real(0.0), i)
        H = mat32()
        R = mat32()
        D = mat22()
        V = mat22()
        area = real(0.0)
        z = real(0.0)
        if inverse[0] > real(0.0):
            H1 = inverse_horizon * G1
            H2 = inverse_horizon * G2
            G = point.green(H1, H2)
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

    @wp.func(module=module)
    def bond_state(x: vec2, u: vec3, H: mat32, D: mat22, V: mat22):
        """Excess stretch lambda - 1, sine and 1 - cosine of the rotation, direction in the tangent plane.

        x: Unit vector of the bond. u: Its ends' relative displacement over its length. With Y the bond's image and
        y = R^T Y = U^-1 F^T Y, the difference y - x = U^-1 [ H^T (x, 0) + F^T u - (U - I) x ] is of the order of
        the strain, as is each of its terms while the sheet has not turned.
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

    return family_frame, bond_state


@functools.cache
def closed_form(bits, membrane):
    """Warp function (excess stretch, sine, 1 - cosine, det F - 1, z, constants) -> T mu along and across the bond."""
    types = numeric(bits)
    real, vec2, parameters = types.real, types.vec2, types.parameters
    _, shear = membrane(bits)
    least = LEAST_COSINE

    @wp.func
    def bond_law(excess: real, sine: real, versine: real, area: real, z: real, constants: parameters):
        stretch = real(1.0) + excess
        cosine = real(1.0) - versine
        det = real(1.0) + area
        b = stretch * sine
        alpha = excess - stretch * versine
        # For a bond of no length, too.
        alpha = wp.max(alpha, real(least) * wp.max(stretch, real(least)) - real(1.0))
        a = real(1.0) + alpha
        # C33 det^2 = 1 + z
        thinning = (z - area * (real(2.0) + area)) / (det * det)
        share = b * b / det
        # tr U - 2, for g: the other diagonal entry of U in the frame of the bond is (det + b^2) / a.
        other = (area - alpha + b * b) / a
        trace = alpha * (real(2.0) + alpha) + other * (real(2.0) + other) + real(2.0) * b * b
        g = shear(trace, thinning, z, constants)
        along = g * (alpha * (real(2.0) + alpha) - thinning * (real(1.0) + share) - share) / a
        across = g * b * (real(1.0) + (real(1.0) + thinning) / det)
        return vec2(along * cosine + across * sine, across * cosine - along * sine)

    return bond_law


@functools.cache
def network_function(bits, layers, module):
    """Warp function from the inputs to the outputs of a network, whose weights are numbers in its code.

    Args:
        bits: 32 or 64.
        layers: Columns of the weights of each layer and then its biases, as tuples. The first layer takes the inputs,
            every other one 1 / (1 + exp y) of what the one before gives, in place of tanh
            (`warp_pd.forces.network.Network.sigmoids`).
        module: Name of the Warp module.
    """
    types = numeric(bits)
    real, vec4 = types.real, types.parameters

    @wp.func(module=module)
    def entered(inputs: vec4):
        return inputs

    def bent(below, width):
        @wp.func(module=module)
        def sigmoids(inputs: vec4):
            y = below(inputs)
            for a in range(wp.static(width)):
                y[wp.static(a)] = real(1.0) / (real(1.0) + wp.exp(y[wp.static(a)]))
            return y

        return sigmoids

    def layer_on(below, columns, bias):
        vector = wp.types.vector(length=len(bias), dtype=real)
        start, columns = vector(*bias), [vector(*column) for column in columns]

        @wp.func(module=module)
        def layer(inputs: vec4):
            x = below(inputs)
            y = wp.static(start)
            for a in range(wp.static(len(columns))):
                y += x[wp.static(a)] * wp.static(columns[a])
            return y

        return layer

    found = None
    for *columns, bias in layers:
        found = layer_on(bent(found, len(columns)) if found else entered, columns, bias)
    return found


@functools.cache
def neural(layout, bits, membrane, breakable, evaluation, layers, counted, module, fused_module):
    """Kernels of the law.

    Args:
        layout: "lattice" or "cloud".
        bits: 32 or 64.
        membrane: Factory of (volume_change, shear), see kernels/materials.py.
        breakable: Whether bonds can break.
        evaluation: "torch", "fused" or "closed_form".
        layers: Numbers of the network, see `network_function`, for "fused", else None.
        counted: Whether there is a range that bonds can leave.
        module: Name of the Warp module.
        fused_module: Name of the Warp module of the kernel that evaluates a network.
    """
    types = numeric(bits)
    real, vec2, vec3, vec4, mat32, mat22, parameters = (
        types.real, types.vec2, types.vec3, types.parameters, types.mat32, types.mat22, types.parameters,
    )  # fmt: skip
    f = family_functions(layout, bits, module)
    Family = f.struct
    point = point_family(layout, bits, breakable, module)
    family_frame, bond_state = bond_kinematics(layout, bits, membrane, breakable, module)
    exact = closed_form(bits, membrane)
    no_length = NO_LENGTH

    @wp.func(module=module)
    def bond_vectors(family: Family, displacement: wp.array(dtype=vec3), inverse_horizon: real, i: int, k: int):
        """Unit vector of the bond, relative displacement over its length, c_k |X| / horizon."""
        xi = f.bond(family, i, k)
        length = wp.length(xi)
        m = f.neighbour(family, i, k)
        u = (inverse_horizon / length) * (displacement[m] - displacement[i])
        return xi / length, u, length * f.influence(family, i, k) * f.area(family, m)

    @wp.func(module=module)
    def pull(x: vec2, u: vec3, direction: vec2, R: mat32, T: vec2):
        """The pair T in space: along the bond, and across it in the tangent plane."""
        Y = vec3(x[0] + u[0], x[1] + u[1], u[2])
        return T[0] * wp.normalize(Y) + T[1] * (R * vec2(-direction[1], direction[0]))

    @wp.func(module=module)
    def bond_seen(
        family: Family, displacement: wp.array(dtype=vec3), inverse_horizon: real, H: mat32, D: mat22, V: mat22,
        area: real, z: real, i: int, k: int,
    ):  # fmt: skip
        """`bond_vectors`, direction in the tangent plane, and what a network sees: (lambda, theta, C33, det F)."""
        x, u, share = bond_vectors(family, displacement, inverse_horizon, i, k)
        excess, sine, versine, direction = bond_state(x, u, H, D, V)
        det = real(1.0) + area
        stretch = wp.max(real(1.0) + excess, real(no_length))
        angle = wp.atan2(sine, real(1.0) - versine)
        return x, u, share, direction, vec4(stretch, angle, (real(1.0) + z) / (det * det), det)

    @wp.func(module=module)
    def logarithms(row: vec4):
        """Inputs of the layers, see `warp_pd.forces.network.Network`."""
        area = wp.log(row[3])
        return vec4(wp.log(row[0]), row[1] * row[1], area, wp.log(row[2]) + real(2.0) * area)

    @wp.func(module=module)
    def family_scale(family: Family, V: mat22, unit_force: real, i: int):
        """Force per T c_k |X| / horizon; zero for a family that determines no frame."""
        if V[0, 0] == real(0.0):
            return real(0.0)
        return unit_force * f.area(family, i) * f.weight(family, i, 0)

    @wp.kernel(module=module, enable_backward=False)
    def closed_form_force(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        inverse_horizon: real,
        unit_force: real,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
    ):
        i = wp.tid() + first
        H, R, D, V, area, z = family_frame(family, alive, displacement, constants, inverse_horizon, i)
        scale = family_scale(family, V, unit_force, i)
        for k in range(family.members):
            force = vec3(real(0.0), real(0.0), real(0.0))
            if point.has(family, alive, i, k) and scale > real(0.0):
                x, u, share = bond_vectors(family, displacement, inverse_horizon, i, k)
                excess, sine, versine, direction = bond_state(x, u, H, D, V)
                T = exact(excess, sine, versine, area, z, constants)
                force = scale * share * pull(x, u, direction, R, T)
            bond_force[k, i] = force

    @wp.kernel(module=module, enable_backward=False)
    def features(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        inverse_horizon: real,
        points: int,
        first: int,
        features: wp.array(dtype=vec4),
        frame: wp.array(dtype=mat32),
    ):
        i = wp.tid() + first
        H, R, D, V, area, z = family_frame(family, alive, displacement, constants, inverse_horizon, i)
        frame[i] = R
        for k in range(family.members):
            row = vec4(real(1.0), real(0.0), real(1.0), real(1.0))
            if point.has(family, alive, i, k) and V[0, 0] != real(0.0):
                _x, _u, _share, _direction, row = bond_seen(
                    family, displacement, inverse_horizon, H, D, V, area, z, i, k
                )
            features[k * points + i] = row

    @wp.kernel(module=module, enable_backward=False)
    def spread(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        frame: wp.array(dtype=mat32),
        pairs: wp.array(dtype=vec2),
        inverse_horizon: real,
        unit_force: real,
        points: int,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
    ):
        i = wp.tid() + first
        R = frame[i]
        scale = unit_force * f.area(family, i) * f.weight(family, i, 0)
        # A family that determines no frame carries nothing.
        if wp.ddot(R, R) == real(0.0):
            scale = real(0.0)
        for k in range(family.members):
            force = vec3(real(0.0), real(0.0), real(0.0))
            if point.has(family, alive, i, k) and scale > real(0.0):
                x, u, share = bond_vectors(family, displacement, inverse_horizon, i, k)
                direction = wp.transpose(R) * vec3(x[0] + u[0], x[1] + u[1], u[2])
                force = scale * share * pull(x, u, wp.normalize(direction), R, pairs[k * points + i])
            bond_force[k, i] = force

    @wp.kernel(module=module, enable_backward=False)
    def outside(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        inverse_horizon: real,
        least: real,
        most: real,
        first: int,
        out: wp.array(dtype=wp.int32),
    ):
        """Bonds whose U has a principal stretch below `least` or above `most`."""
        i = wp.tid() + first
        H, _R, D, V, area, _z = family_frame(family, alive, displacement, constants, inverse_horizon, i)
        det = real(1.0) + area
        found = wp.int32(0)
        for k in range(family.members):
            if point.has(family, alive, i, k) and V[0, 0] != real(0.0):
                x, u, _share = bond_vectors(family, displacement, inverse_horizon, i, k)
                excess, sine, versine, _direction = bond_state(x, u, H, D, V)
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

    torch = evaluation == "torch"
    direct = closed_form_force
    if torch:
        direct = None
    elif evaluation == "fused":
        parts = (f, point, family_frame, bond_seen, family_scale, logarithms, pull)
        direct = fused(bits, layers, *parts, module, fused_module)
    return NeuralKernels(
        direct=direct,
        features=features if torch else None,
        spread=spread if torch else None,
        gather=point.gather,
        outside=outside if counted else None,
    )


def fused(bits, layers, f, point, family_frame, bond_seen, family_scale, logarithms, pull, module, fused_module):
    """Kernel of the law with the network evaluated one bond after the other."""
    types = numeric(bits)
    real, vec2, vec3, parameters = types.real, types.vec2, types.vec3, types.parameters
    evaluate = network_function(bits, layers, module)
    Family = f.struct

    @wp.kernel(module=fused_module, enable_backward=False)
    def fused_force(
        family: Family,
        alive: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        inverse_horizon: real,
        unit_force: real,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
    ):
        i = wp.tid() + first
        H, R, D, V, area, z = family_frame(family, alive, displacement, constants, inverse_horizon, i)
        scale = family_scale(family, V, unit_force, i)
        for k in range(family.members):
            force = vec3(real(0.0), real(0.0), real(0.0))
            if point.has(family, alive, i, k) and scale > real(0.0):
                x, u, share, direction, row = bond_seen(family, displacement, inverse_horizon, H, D, V, area, z, i, k)
                o = evaluate(logarithms(row))
                force = scale * share * pull(x, u, direction, R, vec2(o[0], row[1] * o[1]))
            bond_force[k, i] = force

    return fused_force


@functools.cache
def training_samples(material, membrane, module):
    """Kernel that turns uniform states and bond directions into rows of training data (NN algorithm 1), float64.

    Args:
        material: Factory of (stress, energy).
        membrane: Factory of (volume_change, shear).
        module: Name of the Warp module.
    """
    types = numeric(64)
    real, vec2, vec3, vec4, mat22 = types.real, types.vec2, types.vec3, types.parameters, types.mat22
    stress, _ = material(64)
    volume_change, _ = membrane(64)

    @wp.kernel(module=module, enable_backward=False)
    def samples(
        states: wp.array(dtype=vec3),
        constants: vec4,
        first: int,
        features: wp.array(dtype=vec4),
        pairs: wp.array(dtype=vec2),
    ):
        """States are (principal stretch 1, principal stretch 2, angle of the bond to direction 1)."""
        i = wp.tid() + first
        s = states[i]
        x = vec2(wp.cos(s[2]), wp.sin(s[2]))
        y = vec2(s[0] * x[0], s[1] * x[1])
        zero = real(0.0)
        G = mat22(s[0] * s[0] - real(1.0), zero, zero, s[1] * s[1] - real(1.0))
        S = stress(G, constants)
        P = vec2(s[0] * S[0, 0] * x[0], s[1] * S[1, 1] * x[1]) / constants[0]
        det = s[0] * s[1]
        c33 = (real(1.0) + volume_change(G, constants)) / (det * det)
        stretch = wp.length(y)
        angle = wp.atan2(x[0] * y[1] - x[1] * y[0], wp.dot(x, y))
        features[i] = vec4(stretch, angle, c33, det)
        pairs[i] = vec2(wp.dot(P, y) / stretch, (P[1] * y[0] - P[0] * y[1]) / stretch)

    return samples
