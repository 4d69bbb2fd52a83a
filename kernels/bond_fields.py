"""Point fields of laws with one deformation gradient per bond, and bond counts; see kernels/principal_fields.py."""

import functools

import warp as wp

from .bits import number_of_bits
from .bond_associated import family_mechanics
from .effects import Kernel, kernel
from .factories import FunctionFactory, PairFactory, constants_of
from .families import Layout, family_functions
from .kinematics import kinematics
from .principal_fields import WRITTEN, Wanted, field_arrays, image_of, showing, tensors


@functools.cache
def bond_fields(
    layout: Layout,
    material: PairFactory,
    form: str,
    volume: FunctionFactory | None,
    width: FunctionFactory | None,
    stiffened: bool,
    wanted: Wanted,
    response: FunctionFactory | None = None,
) -> Kernel:
    """Kernel that computes the point fields for a law that has one deformation gradient per bond.

    Args:
        layout: Layout of the families.
        material: Factory of (stress, energy).
        form: "variational" or "published".
        volume: Factory of (G, constants) -> J^2 - 1, needed for the Cauchy stress.
        width: Factory of the width in uniaxial tension, for a material that uses tension field theory; otherwise None.
        stiffened: Whether the moduli are scaled by a factor that varies from point to point.
        wanted: The fields to fill.
        response: That of a viscous law, as for `kernels.reference_force.reference_force`; otherwise None.
    """
    types, bits = layout.types, layout.bits
    real, vec3, mat22, parameters = types.real, types.vec3, types.mat22, types.parameters
    f = family_functions(layout)
    Family = f.struct
    law, motion = family_mechanics(layout, form), kinematics(bits, layout.curved)
    stress, _ = material(bits)
    Constants = constants_of(stress)
    advance = response(bits) if response is not None else None
    stretch_of, _ = tensors(bits)
    show, image, Fields = showing(bits, wanted, width), image_of(bits), field_arrays(bits)
    with_stress = wanted.piola or wanted.cauchy or (wanted.state and width is None)
    volume_change = volume(bits) if wanted.cauchy and volume is not None else None

    @kernel(gathers=("displacement",), writes=WRITTEN)
    def bond_fields(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        factors: wp.array(dtype=real),
        terms: wp.array(dtype=parameters),
        state: wp.array2d(dtype=parameters),
        fields: Fields,
        first: int,
    ):
        i = wp.tid() + first
        undamaged = f.is_undamaged(family, i)
        total = real(0.0)
        mean = mat22()
        biot = mat22()
        cauchy = mat22()
        F1 = vec3()
        F2 = vec3()
        for j in range(family.members):
            there, H1, H2, _inverse, weight, tilt = law.visit(family, displacement, i, j, undamaged)
            if there and weight > real(0.0):
                G = motion.green(H1, H2, tilt)
                total += weight
                mean += weight * G
                if wp.static(wanted.direction):
                    A1, A2 = motion.gradient(H1, H2, tilt)
                    F1 += weight * A1
                    F2 += weight * A2
                if wp.static(with_stress):
                    if wp.static(response is not None):
                        # A step of zero leaves the state as it is.
                        S, _work = advance(G, constants, i, j, family.members, real(0.0), terms, state)
                    else:
                        S = stress(G, f.of_bond(family, i, j, constants))
                    U = stretch_of(G)
                    biot += weight * (U * S)
                    if wp.static(wanted.cauchy):
                        J = wp.sqrt(real(1.0) + volume_change(G, f.of_bond(family, i, j, constants)))
                        cauchy += (weight / J) * (U * S * U)
        scale = real(0.0)
        if total > real(0.0):
            scale = real(1.0) / total
        stiffness = scale
        if wp.static(stiffened):
            stiffness = scale * factors[i]
        angle = show(i, total > real(0.0), scale * mean, stiffness * biot, stiffness * cauchy, constants, fields)
        if wp.static(wanted.direction):
            fields.stretch_direction[i] = f.from_frame(family, i, image(F1, F2, angle))

    return bond_fields


@functools.cache
def bond_counts(layout: Layout) -> Kernel:
    """Kernel that counts the intact and the broken bonds of each point."""
    f = family_functions(layout)
    Family = f.struct

    @kernel()
    def bond_counts(
        family: Family,
        first: int,
        intact_count: wp.array(dtype=wp.int32),
        broken_count: wp.array(dtype=wp.int32),
    ):
        i = wp.tid() + first
        left = wp.int32(0)
        begun = wp.int32(0)
        for word in range(family.words):
            left += number_of_bits(f.intact_members(family, i, word))
            begun += number_of_bits(f.initial(family, i, word))
        intact_count[i] = left
        broken_count[i] = begun - left

    return bond_counts
