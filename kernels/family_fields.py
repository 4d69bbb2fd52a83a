"""Point fields from one deformation gradient per family; see kernels/principal_fields.py."""

import functools

import warp as wp

from .bits import lowest_bit, without_lowest_bit
from .effects import Kernel, kernel
from .factories import FunctionFactory, PairFactory, constants_of
from .families import WORD, Layout, family_functions
from .kinematics import kinematics
from .principal_fields import WRITTEN, Wanted, field_arrays, image_of, showing, tensors


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
