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

import warp as wp

from .effects import Kernel, kernel
from .factories import PairFactory
from .families import Layout, family_functions
from .neural_functions import closed_form, neural_functions
from .neural_network import Layers, network_function


@dataclass(frozen=True)
class NeuralKernels:
    """Kernels of one configuration.

    Attributes:
        direct: Fills bond_force [members, points], N, in one launch; None if Torch evaluates the network.
        features: Fills features [members x points] with (lambda, theta, C33, det F), undeformed values where no bond
            exists, and frame [points] with R; None unless Torch evaluates the network.
        spread: Turns pairs [members x points] of T into bond_force [members, points], N; None unless Torch evaluates
            the network.
        outside: Counts the bonds of each point whose state lies outside a range of principal stretches.
    """

    direct: Kernel | None
    features: Kernel | None
    spread: Kernel | None
    outside: Kernel | None


@functools.cache
def neural(
    layout: Layout,
    membrane: PairFactory,
    corrected: bool,
    torch: bool,
    layers: Layers | None,
    counted: bool,
) -> NeuralKernels:
    """Kernels of the law.

    Args:
        layout: Layout of the families.
        membrane: Factory of (volume_change, shear), see kernels/materials.py.
        corrected: Whether the tables hold a corrected weight of each bond, in place of 2 / tr K of each family.
        torch: Whether Torch evaluates the network.
        layers: Weights and biases of the network that the kernel evaluates, see `network_function`; None for Torch and
            for the closed form.
        counted: Whether to count the bonds outside a range of stretches.
    """
    types, bits = layout.types, layout.bits
    real, vec2, vec3, mat32, parameters = types.real, types.vec2, types.vec3, types.mat32, types.parameters
    f = family_functions(layout)
    law = neural_functions(layout, membrane, corrected)
    Family = f.struct
    exact, fused = closed_form(bits, membrane), layers is not None
    network = network_function(bits, layers) if layers is not None else None

    @kernel(gathers=("displacement",), name="fused_force" if fused else None, fast_math=fused and bits == 32)
    def closed_form_force(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        unit_force: real,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
    ):
        i = wp.tid() + first
        H, R, D, V, area, z = law.family_frame(family, displacement, constants, i)
        scale = law.family_scale(family, V, unit_force, i)
        for k in range(family.members):
            force = vec3(real(0.0), real(0.0), real(0.0))
            if f.is_intact(family, i, k) and scale > real(0.0):
                if wp.static(fused):
                    x, u, weight, direction, row = law.bond_seen(family, displacement, H, D, V, area, z, i, k)
                    o = network(law.logarithms(row))
                    T = vec2(o[0], row[1] * o[1])
                else:
                    x, u, weight = law.bond_vectors(family, displacement, i, k)
                    excess, sine, versine, direction = law.bond_motion(x, u, H, D, V)
                    T = exact(excess, sine, versine, area, z, constants)
                force = scale * weight * law.pull(x, u, direction, R, T)
            bond_force[k, i] = force

    @kernel(gathers=("displacement",))
    def features(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        points: int,
        first: int,
        features: wp.array(dtype=parameters),
        frame: wp.array(dtype=mat32),
    ):
        i = wp.tid() + first
        H, R, D, V, area, z = law.family_frame(family, displacement, constants, i)
        frame[i] = R
        for k in range(family.members):
            row = parameters(real(1.0), real(0.0), real(1.0), real(1.0))
            if f.is_intact(family, i, k) and V[0, 0] != real(0.0):
                _x, _u, _weight, _direction, row = law.bond_seen(family, displacement, H, D, V, area, z, i, k)
            features[k * points + i] = row

    @kernel(gathers=("displacement",))
    def spread(
        family: Family,
        displacement: wp.array(dtype=vec3),
        frame: wp.array(dtype=mat32),
        pairs: wp.array(dtype=vec2),
        unit_force: real,
        points: int,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
    ):
        i = wp.tid() + first
        R = frame[i]
        scale = unit_force
        if not wp.static(corrected):
            scale = unit_force * f.area(family, i) * f.weight(family, i, 0)
        # A family that determines no frame carries no force.
        if wp.ddot(R, R) == real(0.0):
            scale = real(0.0)
        for k in range(family.members):
            force = vec3(real(0.0), real(0.0), real(0.0))
            if f.is_intact(family, i, k) and scale > real(0.0):
                x, u, weight = law.bond_vectors(family, displacement, i, k)
                direction = wp.transpose(R) * vec3(x[0] + u[0], x[1] + u[1], u[2])
                force = scale * weight * law.pull(x, u, wp.normalize(direction), R, pairs[k * points + i])
            bond_force[k, i] = force

    @kernel(gathers=("displacement",))
    def outside(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        least: real,
        most: real,
        first: int,
        out: wp.array(dtype=wp.int32),
    ):
        """Counts the bonds whose U has a principal stretch below `least` or above `most`."""
        i = wp.tid() + first
        H, _R, D, V, area, _z = law.family_frame(family, displacement, constants, i)
        det = real(1.0) + area
        found = wp.int32(0)
        for k in range(family.members):
            if f.is_intact(family, i, k) and V[0, 0] != real(0.0):
                x, u, _weight = law.bond_vectors(family, displacement, i, k)
                excess, sine, versine, _direction = law.bond_motion(x, u, H, D, V)
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

    return NeuralKernels(
        direct=None if torch else closed_form_force,
        features=features if torch else None,
        spread=spread if torch else None,
        outside=outside if counted else None,
    )
