"""Point fields for frames: principal stretches and stresses, their direction, the wrinkle state, counts of bonds.

A law with a deformation gradient F for every bond outputs means over the intact bonds of a point, weighted with the
law's weights W. The averaged tensors are in the plane of the sheet and unaffected by rotation:

    C = F^T F,      T = U S (Biot),      sigma = U S U / J (Cauchy, rotated back by the rotation of F),      U = C^(1/2)

Principal stretches are the roots of the eigenvalues of the mean of C. Principal values of T are those of the first
Piola stress F S: for an isotropic material both differ only by the rotation (for other materials T is the symmetric
part). For a uniform deformation every bond has the same tensors, and the means are exact also at edges and cracks.

A law with one gradient per point (Nodal) or none (pairwise laws, Neural) outputs that of the family, F = I + [sum c_k
U_k (x) X_k] K^-1 over the intact bonds, with c_k = w_k a_k.

A point whose bonds determine no gradient has no stretch (NaN), carries no stress, and is slack.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from .bond_associated import family_mechanics
from .effects import Kernel, kernel
from .families import WORD, Layout, family_functions, lowest_bit, number_of_bits, without_lowest_bit
from .kinematics import kinematics
from .numeric import FunctionFactory, PairFactory, constants_of, numeric
from .tension_field import SLACK, TAUT, WRINKLED, taut_strain

# A stress counts as zero below this fraction of the larger one, or of the first constant of the material: both are
# noise.
RELATIVE, ABSOLUTE = 1e-3, 1e-6


@dataclass(frozen=True)
class Wanted:
    """The fields that a kernel fills; it computes nothing else. `direction` is that of the largest stretch."""

    stretch: bool = False
    direction: bool = False
    piola: bool = False
    cauchy: bool = False
    state: bool = False


@functools.cache
def field_arrays(bits: int) -> Any:
    """Warp struct with the array of each field; those that are not wanted stay without an array."""
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @wp.struct
    class Fields:
        stretch_1: wp.array(dtype=real)
        stretch_2: wp.array(dtype=real)
        stretch_direction: wp.array(dtype=vec3)
        first_piola_1: wp.array(dtype=real)
        first_piola_2: wp.array(dtype=real)
        cauchy_1: wp.array(dtype=real)
        cauchy_2: wp.array(dtype=real)
        wrinkle_state: wp.array(dtype=wp.int32)

    return Fields


# What a kernel of fields writes, in its argument `fields`.
WRITTEN = tuple(f"fields.{name}" for name in field_arrays(64).vars)


@functools.cache
def tensors(bits: int) -> tuple[wp.Function, wp.Function]:
    """Functions G = C - I -> U, and symmetric tensor -> larger and smaller principal value, angle of the larger."""
    types = numeric(bits)
    real, mat22 = types.real, types.mat22

    @wp.func
    def stretch_of(G: mat22):
        """U = (C + J I) / sqrt(tr C + 2 J), with J = sqrt(det C)."""
        C = G + mat22(real(1.0), real(0.0), real(0.0), real(1.0))
        J = wp.sqrt(wp.max(wp.determinant(C), real(0.0)))
        root = wp.sqrt(C[0, 0] + C[1, 1] + real(2.0) * J)
        return mat22(C[0, 0] + J, C[0, 1], C[1, 0], C[1, 1] + J) / root

    @wp.func
    def principal(T: mat22):
        half = real(0.5) * (T[0, 0] - T[1, 1])
        shear = real(0.5) * (T[0, 1] + T[1, 0])
        mean = real(0.5) * (T[0, 0] + T[1, 1])
        radius = wp.sqrt(half * half + shear * shear)
        return mean + radius, mean - radius, real(0.5) * wp.atan2(shear, half)

    return stretch_of, principal


@functools.cache
def wrinkle_state(width: FunctionFactory | None, bits: int) -> wp.Function:
    """Function (G, larger and smaller principal stress, constants) -> TAUT, WRINKLED or SLACK.

    With a `width` the state follows from tension field theory, otherwise from the signs of the principal stresses.
    """
    types = numeric(bits)
    real, mat22 = types.real, types.mat22
    taut, wrinkled, slack, relative, absolute = TAUT, WRINKLED, SLACK, RELATIVE, ABSOLUTE
    relaxed = width is not None
    strain_state = taut_strain(width, bits)[0] if width is not None else None

    @wp.func
    def state_of(G: mat22, larger: real, smaller: real, constants: Any):
        answer = wp.int32(taut)
        if wp.static(relaxed):
            found, g1, g2, across = strain_state(G, constants)
            noise = wp.max(real(relative) * wp.abs(g1 - g2), real(absolute))
            if found == wp.int32(slack):
                if g2 < -noise:
                    answer = wp.int32(slack)
            elif g2 < across - noise:
                answer = wp.int32(wrinkled)
        else:
            noise = wp.max(
                real(relative) * wp.max(wp.abs(larger), wp.abs(smaller)), real(absolute) * wp.abs(constants[0])
            )
            if smaller < -noise:
                answer = wp.int32(wrinkled)
                if larger <= noise:
                    answer = wp.int32(slack)
        return answer

    return state_of


@functools.cache
def showing(bits: int, wanted: Wanted, width: FunctionFactory | None) -> wp.Function:
    """Function that writes the wanted fields of point i but the direction from means; returns that of the stretch.

    Arguments: (i, whether there is a gradient, C - I, T, sigma, constants, fields).
    """
    types = numeric(bits)
    real, mat22 = types.real, types.mat22
    _, principal = tensors(bits)
    state_of, Fields = wrinkle_state(width, bits), field_arrays(bits)
    slack = SLACK

    @wp.func
    def show(i: int, known: bool, G: mat22, T: mat22, sigma: mat22, constants: Any, fields: Fields):
        g1, g2, angle = principal(G)
        if wp.static(wanted.stretch):
            fields.stretch_1[i] = wp.where(known, wp.sqrt(wp.max(real(1.0) + g1, real(0.0))), real(wp.nan))
            fields.stretch_2[i] = wp.where(known, wp.sqrt(wp.max(real(1.0) + g2, real(0.0))), real(wp.nan))
        p1, p2, _turn = principal(T)
        if wp.static(wanted.piola):
            fields.first_piola_1[i] = p1
            fields.first_piola_2[i] = p2
        if wp.static(wanted.cauchy):
            s1, s2, _turned = principal(sigma)
            fields.cauchy_1[i] = s1
            fields.cauchy_2[i] = s2
        if wp.static(wanted.state):
            fields.wrinkle_state[i] = wp.where(known, state_of(G, p1, p2, constants), wp.int32(slack))
        return angle

    return show


@functools.cache
def image_of(bits: int) -> wp.Function:
    """Function (F1, F2, angle) -> unit vector along the image of the direction at that angle, or NaN if undefined."""
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @wp.func
    def image(F1: vec3, F2: vec3, angle: real):
        d = wp.cos(angle) * F1 + wp.sin(angle) * F2
        size = wp.length(d)
        answer = vec3(real(wp.nan), real(wp.nan), real(wp.nan))
        if size > real(0.0):
            answer = d / size
        return answer

    return image


@functools.cache
def gradient_of_family(layout: Layout) -> wp.Function:
    """Function (family, displacement, i) -> (known, area, A1, A2, tilt) of the intact bonds of a family.

    `known` is whether they determine a gradient, `area` that of the members over the reference area, and A1, A2 and
    tilt are arguments of `green` and `gradient` of `kinematics`.
    """
    types, bits = layout.types, layout.bits
    real, vec2, vec3 = types.real, types.vec2, types.vec3
    f = family_functions(layout)
    Family = f.struct
    motion = kinematics(bits, layout.curved)
    word_size = WORD

    @wp.func
    def gradient(family: Family, displacement: wp.array(dtype=vec3), i: int):
        shape = vec3()
        moment = vec2()
        H1 = vec3()
        H2 = vec3()
        size = real(0.0)
        for word in range(family.words):
            members = f.intact_members(family, i, word)
            while members != wp.uint32(0):
                k = word * word_size + lowest_bit(members)
                members = without_lowest_bit(members)
                m = f.neighbour(family, i, k)
                xi = f.bond(family, i, k)
                size += f.area(family, m)
                cxi = f.influence(family, i, k) * f.area(family, m) * xi
                shape += vec3(cxi[0] * xi[0], cxi[0] * xi[1], cxi[1] * xi[1])
                moment += f.rise(family, i, k) * cxi
                U = f.to_frame(family, i, family.inverse_horizon * (displacement[m] - displacement[i]))
                H1 += cxi[0] * U
                H2 += cxi[1] * U
        inverse = motion.inverse_shape(shape)
        tilt = motion.tilt_of(motion.times(inverse, moment))
        C1, C2 = motion.columns(H1, H2, inverse)
        A1, A2 = motion.level(C1, C2, tilt)
        return inverse[0] > real(0.0), size, A1, A2, tilt

    return gradient


@functools.cache
def point_fields(
    layout: Layout,
    material: PairFactory | None,
    volume: FunctionFactory | None,
    width: FunctionFactory | None,
    wanted: Wanted,
) -> Kernel:
    """Kernel that fills point fields from one deformation gradient per family; arguments as for `bond_fields`.

    Without a `material` it fills stretches only; with one the stress is that of the law `Nodal`.
    """
    types, bits = layout.types, layout.bits
    real, vec3, mat22 = types.real, types.vec3, types.mat22
    f = family_functions(layout)
    Family = f.struct
    motion, gradient_of = kinematics(bits, layout.curved), gradient_of_family(layout)
    stress = material(bits)[0] if material is not None else None
    Constants = types.parameters if stress is None else constants_of(stress)
    stretch_of, _ = tensors(bits)
    show, image, Fields = showing(bits, wanted, width), image_of(bits), field_arrays(bits)
    with_stress = material is not None
    with_cauchy = wanted.cauchy and material is not None
    volume_change = volume(bits) if with_cauchy and volume is not None else None

    @kernel(gathers=("displacement",), writes=WRITTEN)
    def point_fields(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        fields: Fields,
        first: int,
    ):
        i = wp.tid() + first
        known, size, A1, A2, tilt = gradient_of(family, displacement, i)
        G = motion.green(A1, A2, tilt)
        F1, F2 = motion.gradient(A1, A2, tilt)
        biot = mat22()
        cauchy = mat22()
        if wp.static(with_stress):
            if known:
                S = (size / f.family_area(family, i)) * stress(G, constants)
                stretch = stretch_of(G)
                biot = stretch * S
                if wp.static(with_cauchy):
                    J = wp.sqrt(real(1.0) + volume_change(G, constants))
                    cauchy = (stretch * S * stretch) / J
        angle = show(i, known, G, biot, cauchy, constants, fields)
        if wp.static(wanted.direction):
            fields.stretch_direction[i] = f.from_frame(
                family, i, wp.where(known, image(F1, F2, angle), vec3(real(wp.nan), real(wp.nan), real(wp.nan)))
            )

    return point_fields


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
        response: That of a viscous law, as for `kernels.bond_associated.reference_force`; otherwise None.
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
