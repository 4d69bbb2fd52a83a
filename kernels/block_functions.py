"""Warp functions for the kernel in kernels/family_blocks.py, in which a few families share a thread block."""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from .bits import bit_of, lowest_bit, without_lowest_bit
from .bond_associated import family_mechanics
from .entries import entry_of
from .factories import FunctionFactory, constants_of
from .families import WORD, Layout, family_functions
from .kinematics import kinematics

_ADD_PRODUCTS = """
    if (here) {
        for (int a = 0; a < 3; ++a) {
            sums[a] += w[3] * w[a];
            sums[3 + a] += y[0] * w[a];
        }
    }
    return sums;
"""

_ADD_PARTS = """
    if (here) {
        for (int a = 0; a < 4; ++a) sums[a] += part[a];
        for (int a = 0; a < 2; ++a) sums[4 + a] += rest[a];
    }
    return sums;
"""

_ADD_PRODUCTS_AND_SHAPES = """
    if (here) {
        for (int a = 0; a < 3; ++a) {
            sums[a] += w[3] * w[a];
            sums[3 + a] += y[0] * w[a];
        }
        sums[6] += w[3] * y[1];
        sums[7] += w[3] * y[2];
        sums[8] += y[0] * y[2];
    }
"""

_OPAQUE = """
#if defined(__CUDA_ARCH__)
    asm("" : "+r"(mask));
#endif
    return mask;
"""


@wp.func_native("WP_TILE_SYNC();")
def synchronize():
    """Barrier for all threads of the block; their writes to shared tiles are then visible."""
    ...


@functools.cache
def putting(kind: Any) -> wp.Function:
    """Function (tile, index, value) that writes an element of type `kind` to a shared tile without a barrier.

    `wp.tile` takes two barriers per tile; with this function one barrier serves all tiles.
    """

    @wp.func_native("tile.data(wp::tile_coord(index)) = value;")
    def put(tile: Any, index: int, value: kind): ...

    return put


@wp.func_native(_OPAQUE)
def opaque(mask: wp.uint32) -> wp.uint32:
    """Return the mask unchanged, but opaque to the compiler, which would otherwise recompute it for each bit."""
    ...


def _products_and_shapes(bits: int) -> str:
    """C++ code that adds nine products to `sums`.

    In float32 on a GPU it is PTX with predicates, which is faster than the branch around the sums that the compiler
    would emit. Operands: %0 to %8 are the sums, %9 is the condition, %10 to %16 are U, w[3] and y.
    """
    if bits == 64:
        return f"{_ADD_PRODUCTS_AND_SHAPES}return sums;"
    first, second = "%13", "%14"
    factors = [*((first, f"%{10 + a}") for a in range(3)), *((second, f"%{10 + a}") for a in range(3))]
    factors += [(first, "%15"), (first, "%16"), (second, "%16")]
    lines = [f"@p fma.rn.f32 %{at}, {one}, {other}, %{at};" for at, (one, other) in enumerate(factors)]
    text = " ".join(["{ .reg .pred p; setp.ne.u32 p, %9, 0;", *lines, "}"])
    results = ", ".join(f'"+f"(sums[{at}])' for at in range(9))
    read = ", ".join(f'"f"({value})' for value in ("w[0]", "w[1]", "w[2]", "w[3]", "y[0]", "y[1]", "y[2]"))
    return f"""
#if defined(__CUDA_ARCH__)
    asm("{text}" : {results} : "r"(here), {read});
#else
    {_ADD_PRODUCTS_AND_SHAPES}
#endif
    return sums;
"""


@dataclass(frozen=True)
class BlockFunctions:
    """Warp functions of one configuration.

    Attributes:
        by_missing: Whether the shape tensor of a damaged intersection is computed by subtracting its missing members,
            which are few.
        arrive: Data of a bond before its thread reads the results of other threads.
        missing_shapes: Parts of the shape tensors of intersections that broken bonds have removed.
        answer: A_ik of a bond and the initial guess for the next stress, from the sums over D_ik.
        compact: Whether shape tensors are also summed instead of read from tables, as on a compact cloud.
        Arm: Type of the second part of a member's data that threads exchange: (c_k X_k2, 1 / c_k) or X_k. The first
            part is (U_k, c_k X_k1).
        vec6: Type of the sums of two vectors.
        Sums: Type of the sums over an intersection: c_k X_k1 U_k, c_k X_k2 U_k, and K_ij if shape tensors are sums.
        add_products: Adds one member to `Sums` if it is in the intersection.
        add_parts: Adds one bond to the sums of the columns of A if it is in the intersection.
    """

    by_missing: bool
    arrive: wp.Function
    missing_shapes: wp.Function
    answer: wp.Function
    compact: bool
    Arm: Any
    vec6: Any
    Sums: Any
    add_products: wp.Function
    add_parts: wp.Function


@functools.cache
def block_functions(layout: Layout, near: FunctionFactory, members: int) -> BlockFunctions:
    """The functions, for the arguments of `block_force`."""
    types, bits = layout.types, layout.bits
    real, vec2, vec3 = types.real, types.vec2, types.vec3
    f = family_functions(layout)
    Family = f.struct
    law = family_mechanics(layout, "variational")
    intact_members, is_intact = law.intact_members, law.is_intact
    green, damaged_inverse = law.green, law.damaged_inverse
    tilt_of, level = kinematics(bits).tilt_of, kinematics(bits).level
    inverse_shape = kinematics(bits).inverse_shape
    stress_near, stress_on_members = near(bits), law.stress_on_members
    Constants = constants_of(stress_near)
    by_row, curved = layout.kind != "cloud", layout.curved
    compact = layout.compact != ""
    by_missing = not (curved or compact)
    n, word_size, words = members, WORD, -(-members // WORD)
    Words = wp.types.vector(length=words, dtype=wp.uint32)
    vec4 = wp.types.vector(length=4, dtype=real)
    Arm = vec4 if compact else vec2
    vector_of, moment_of = entry_of(vec3, 1), entry_of(vec3, 2)

    @wp.func
    def arrive(
        family: Family,
        intact: wp.array2d(dtype=wp.uint32),
        moments: wp.array2d(dtype=vec3),
        displacement: wp.array(dtype=vec3),
        inverse_horizon: real,
        i: int,
        k: int,
        here: bool,
    ):
        """Data of a bond: intact or not, (U_k, c_k X_k) in two parts, bits of D_ik, undamaged K_ik^-1, W_ik.

        On a curved sheet U_k is in the frame of the point. There are no branches, so loads do not wait for each other;
        values read for nonexistent members are discarded.
        """
        member = wp.min(k, wp.static(n - 1))
        row = i
        if wp.static(by_row):
            row = family.family_class[i]
        m = wp.clamp(f.neighbour(family, i, member), 0, displacement.shape[0] - 1)
        X = vec2(real(0.0), real(0.0))
        if wp.static(compact):
            X = f.bond(family, i, member)
            c = f.influence(family, i, member) * f.area(family, m)
            moment = vec3(c * X[0], c * X[1], real(0.0))
        else:
            if wp.static(by_row):
                moment = moment_of(moments, member * moments.shape[1] + row)
            else:
                moment = moments[member, row]
        stretch = f.to_frame(family, i, inverse_horizon * (vector_of(displacement, m) - vector_of(displacement, i)))
        inverse = vec3(real(0.0), real(0.0), real(0.0))
        if wp.static(not compact):
            inverse = f.shape(family, i, member)
        weight = f.weight(family, i, member)
        intact_here = here and k < wp.static(n) and is_intact(family, intact, i, member)
        none = vec3(real(0.0), real(0.0), real(0.0))
        moment = wp.where(intact_here, moment, none)
        stretch = wp.where(intact_here, stretch, none)
        common = Words()
        for word in range(wp.static(words)):
            together = f.common(family, i, member, wp.static(word)) & intact_members(family, intact, i, wp.static(word))
            common[word] = wp.where(intact_here, together, wp.uint32(0))
        exchanged = vec4(stretch[0], stretch[1], stretch[2], moment[0])
        arm = Arm()
        arm[0] = moment[1]
        if wp.static(compact):
            arm[1] = X[0]
            arm[2] = X[1]
        else:
            arm[1] = moment[2]
        return intact_here, exchanged, arm, common, inverse, weight

    @wp.func
    def shape_of(family: Family, moments: wp.array2d(dtype=vec3), i: int, k: int):
        """c_k X_k (x) X_k (11, 12, 22)."""
        row = i
        if wp.static(by_row):
            row = family.family_class[i]
        m = moments[k, row]
        return m[2] * vec3(m[0] * m[0], m[0] * m[1], m[1] * m[1])

    @wp.func
    def missing_shapes(
        family: Family,
        intact: wp.array2d(dtype=wp.uint32),
        moments: wp.array2d(dtype=vec3),
        i: int,
        k: int,
        far_k: int,
    ):
        """Sums of c_m X_m (x) X_m over the missing members of D_ik and of the intersection of the far bond."""
        near_shape = vec3(real(0.0), real(0.0), real(0.0))
        far_shape = vec3(real(0.0), real(0.0), real(0.0))
        for word in range(wp.static(words)):
            missing = f.initial(family, i, word) & ~intact_members(family, intact, i, word)
            near_bits = f.common(family, i, wp.min(k, wp.static(n - 1)), word)
            far_bits = f.common(family, i, wp.min(far_k, wp.static(n - 1)), word)
            while missing != wp.uint32(0):
                at = lowest_bit(missing)
                missing = without_lowest_bit(missing)
                part = shape_of(family, moments, i, wp.static(word * word_size) + at)
                near_shape += wp.where(bit_of(near_bits, at), real(1.0), real(0.0)) * part
                far_shape += wp.where(bit_of(far_bits, at), real(1.0), real(0.0)) * part
        return near_shape, far_shape

    @wp.func
    def without_missing(missing: vec3, undamaged_inverse: vec3):
        """Inverse of a shape tensor minus `missing`, or zero where `damaged_inverse` would be zero."""
        inverse = undamaged_inverse
        if missing[0] + missing[2] > real(0.0) and inverse[0] > real(0.0):
            det = inverse[0] * inverse[2] - inverse[1] * inverse[1]
            whole = vec3(inverse[2] / det, -inverse[1] / det, inverse[0] / det)
            inverse, _size = damaged_inverse(whole - missing, undamaged_inverse, real(0.0))
        return inverse

    @wp.func
    def answer(
        family: Family,
        constants: Constants,
        i: int,
        k: int,
        intact_here: bool,
        undamaged: bool,
        inverse: vec3,
        table_weight: real,
        shape: vec3,
        rises: vec2,
        G1: vec3,
        G2: vec3,
        guess: real,
    ):
        """A_ik of a bond and the initial guess for the next stress, from the sums over D_ik.

        `shape` and `rises` are used for damaged families only; if `by_missing`, `shape` is the sum over the lost
        members.
        """
        A1 = vec3(real(0.0), real(0.0), real(0.0))
        A2 = vec3(real(0.0), real(0.0), real(0.0))
        next_guess = guess
        if intact_here:
            tilt = f.tilt(family, i, k)
            undamaged_inverse = inverse
            if wp.static(compact):
                inverse = inverse_shape(shape)
            if wp.static(layout.breakable):
                if not undamaged:
                    if wp.static(by_missing):
                        inverse = without_missing(shape, undamaged_inverse)
                    else:
                        inverse, _size = damaged_inverse(shape, undamaged_inverse, real(0.0))
                    if wp.static(curved):
                        slope = vec2(
                            inverse[0] * rises[0] + inverse[1] * rises[1], inverse[1] * rises[0] + inverse[2] * rises[1]
                        )
                        tilt = tilt_of(slope)
            if inverse[0] > real(0.0):
                H1 = G1 * inverse[0] + G2 * inverse[1]
                H2 = G1 * inverse[1] + G2 * inverse[2]
                if wp.static(curved):
                    H1, H2 = level(H1, H2, tilt)
                S, found = stress_near(green(H1, H2, tilt), f.of_bond(family, i, k, constants), guess)
                next_guess = found
                A1, A2 = stress_on_members(H1, H2, S, table_weight, inverse, tilt)
        return A1, A2, next_guess

    vec6 = wp.types.vector(length=6, dtype=real)

    Sums = wp.types.vector(length=9 if compact else 6, dtype=real)

    @wp.func_native(_products_and_shapes(bits) if compact else _ADD_PRODUCTS)
    def add_products(sums: Sums, here: wp.uint32, w: vec4, y: Arm) -> Sums:
        """Add one member to the sums of c_k X_k1 U_k and c_k X_k2 U_k if it is in the intersection."""
        ...

    @wp.func_native(_ADD_PARTS)
    def add_parts(sums: vec6, here: wp.uint32, part: vec4, rest: vec2) -> vec6:
        """Add one bond to the sums of the columns of A if it is in the intersection."""
        ...

    return BlockFunctions(by_missing, arrive, missing_shapes, answer, compact, Arm, vec6, Sums, add_products, add_parts)
