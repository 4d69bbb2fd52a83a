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

# Code that adds one member to the sums of each bond of a thread if it is in the intersection of that bond.
_ADD_PRODUCTS = """
    constexpr int bonds = sizeof(sums.data) / sizeof(sums.data[0]);
    for (int b = 0; b < bonds; ++b) {
        auto& sum = sums.data[b];
        if (common.data[b][word] & bit) {
            for (int a = 0; a < 3; ++a) {
                sum[a] += w[3] * w[a];
                sum[3 + a] += y[0] * w[a];
            }
        }
    }
    return sums;
"""

_ADD_PARTS = """
    constexpr int bonds = sizeof(parts.data) / sizeof(parts.data[0]);
    for (int b = 0; b < bonds; ++b) {
        auto& sum = parts.data[b];
        if (common.data[b][word] & bit) {
            for (int a = 0; a < 4; ++a) sum[a] += part[a];
            for (int a = 0; a < 2; ++a) sum[4 + a] += rest[a];
        }
    }
    return parts;
"""

_ADD_PRODUCTS_AND_SHAPES = """
        if (common.data[b][word] & bit) {
            for (int a = 0; a < 3; ++a) {
                sum[a] += w[3] * w[a];
                sum[3 + a] += y[0] * w[a];
            }
            sum[6] += w[3] * y[1];
            sum[7] += w[3] * y[2];
            sum[8] += y[0] * y[2];
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
    first, second = "%13", "%14"
    factors = [*((first, f"%{10 + a}") for a in range(3)), *((second, f"%{10 + a}") for a in range(3))]
    factors += [(first, "%15"), (first, "%16"), (second, "%16")]
    lines = [f"@p fma.rn.f32 %{at}, {one}, {other}, %{at};" for at, (one, other) in enumerate(factors)]
    text = " ".join(["{ .reg .pred p; setp.ne.u32 p, %9, 0;", *lines, "}"])
    results = ", ".join(f'"+f"(sum[{at}])' for at in range(9))
    read = ", ".join(f'"f"({value})' for value in ("w[0]", "w[1]", "w[2]", "w[3]", "y[0]", "y[1]", "y[2]"))
    predicated = f"""
#if defined(__CUDA_ARCH__)
        asm("{text}" : {results} : "r"(common.data[b][word] & bit), {read});
#else
{_ADD_PRODUCTS_AND_SHAPES}
#endif
"""
    return f"""
    constexpr int bonds = sizeof(sums.data) / sizeof(sums.data[0]);
    for (int b = 0; b < bonds; ++b) {{
        auto& sum = sums.data[b];
{predicated if bits == 32 else _ADD_PRODUCTS_AND_SHAPES}
    }}
    return sums;
"""


@dataclass(frozen=True)
class BlockFunctions:
    """Warp functions of one configuration.

    Attributes:
        by_missing: Whether the shape tensor of a damaged intersection is computed by subtracting its missing members,
            which are few.
        compact: Whether shape tensors are also summed instead of read from tables, as on a compact cloud.
        arrive: Data of a bond before its thread reads the results of other threads.
        missing_shape: Part of the shape tensor of an intersection that broken bonds have removed.
        answer: A_ik of a bond and the initial guess for the next stress, from the sums over D_ik.
        Words: Type of the bits of members.
        Masks: Type of the bits of D_ik of each bond of a thread (first index).
        Arm: Type of the second part of a member's data that threads exchange: (c_k X_k2, 1 / c_k) or X_k. The first
            part is (U_k, c_k X_k1).
        Sums: Type of the sums over the intersection of each bond of a thread (first index): c_k X_k1 U_k, c_k X_k2 U_k,
            and K_ij if shape tensors are sums.
        Parts: Type of the sums of the two columns of A over the intersection of each bond of a thread (first index).
        add_products: Adds one member to the `Sums` of the bonds in whose intersection it is.
        add_parts: The same for A of one bond and `Parts`.
    """

    by_missing: bool
    compact: bool
    arrive: wp.Function
    missing_shape: wp.Function
    answer: wp.Function
    Words: Any
    Masks: Any
    Arm: Any
    Sums: Any
    Parts: Any
    add_products: wp.Function
    add_parts: wp.Function


@functools.cache
def block_functions(layout: Layout, near: FunctionFactory, members: int, bonds: int) -> BlockFunctions:
    """The functions, for the arguments of `block_force`; `bonds` is the number of bonds of a thread."""
    types, bits = layout.types, layout.bits
    real, vec2, vec3 = types.real, types.vec2, types.vec3
    f = family_functions(layout)
    Family = f.struct
    law = family_mechanics(layout, "variational")
    green, damaged_inverse = law.green, law.damaged_inverse
    tilt_of, level = kinematics(bits).tilt_of, kinematics(bits).level
    inverse_shape = kinematics(bits).inverse_shape
    stress_near, stress_on_members = near(bits), law.stress_on_members
    Constants = constants_of(stress_near)
    curved = layout.curved
    compact = layout.compact != ""
    by_missing = not (curved or compact)
    n, word_size, words = members, WORD, -(-members // WORD)
    Words = wp.types.vector(length=words, dtype=wp.uint32)
    Masks = wp.types.matrix(shape=(bonds, words), dtype=wp.uint32)
    vec4 = wp.types.vector(length=4, dtype=real)
    Arm = vec4 if compact else vec2
    vector_of, moment_of = entry_of(vec3, 1), entry_of(vec3, 2, wp.uint32)

    @wp.func
    def arrive(
        family: Family,
        present: Words,
        moments: wp.array2d(dtype=vec3),
        displacement: wp.array(dtype=vec3),
        i: int,
        k: int,
    ):
        """Data of a bond: (U_k, c_k X_k) in two parts, bits of D_ik, undamaged K_ik^-1, W_ik.

        `present` has the bits of the intact members. On a curved sheet U_k is in the frame of the point. There are no
        branches, so loads do not wait for each other; values read for nonexistent members are discarded.
        """
        member = wp.min(k, wp.static(n - 1))
        m = wp.clamp(f.neighbour(family, i, member), 0, displacement.shape[0] - 1)
        X = vec2(real(0.0), real(0.0))
        if wp.static(compact):
            X = f.bond(family, i, member)
            c = f.influence(family, i, member) * f.area(family, m)
            moment = vec3(c * X[0], c * X[1], real(0.0))
        else:
            moment = moment_of(moments, f.entry(family, i, member))
        stretch = f.to_frame(
            family, i, family.inverse_horizon * (vector_of(displacement, m) - vector_of(displacement, i))
        )
        inverse = vec3(real(0.0), real(0.0), real(0.0))
        if wp.static(not compact):
            inverse = f.shape(family, i, member)
        weight = f.weight(family, i, member)
        mask = present[0]
        for word in range(1, wp.static(words)):
            mask = wp.where(member // word_size == word, present[word], mask)
        intact_here = wp.where(k < wp.static(n), bit_of(mask, member & wp.static(word_size - 1)), bool(False))
        none = vec3(real(0.0), real(0.0), real(0.0))
        moment = wp.where(intact_here, moment, none)
        common = Words()
        for word in range(wp.static(words)):
            together = f.common(family, i, member, wp.static(word)) & present[word]
            common[word] = wp.where(intact_here, together, wp.uint32(0))
        exchanged = vec4(stretch[0], stretch[1], stretch[2], moment[0])
        arm = Arm()
        arm[0] = moment[1]
        if wp.static(compact):
            arm[1] = X[0]
            arm[2] = X[1]
        elif wp.static(layout.breakable):
            arm[1] = moment[2]
        return exchanged, arm, common, inverse, weight

    @wp.func
    def shape_of(family: Family, moments: wp.array2d(dtype=vec3), i: int, k: int):
        """c_k X_k (x) X_k (11, 12, 22)."""
        m = moment_of(moments, f.entry(family, i, k))
        return m[2] * vec3(m[0] * m[0], m[0] * m[1], m[1] * m[1])

    @wp.func
    def missing_shape(
        family: Family,
        moments: wp.array2d(dtype=vec3),
        i: int,
        k: int,
    ):
        """Sum of c_m X_m (x) X_m over the missing members of D_ik."""
        shape = vec3(real(0.0), real(0.0), real(0.0))
        for word in range(wp.static(words)):
            missing = f.initial(family, i, word) & ~f.intact_members(family, i, word)
            missing = missing & f.common(family, i, wp.min(k, wp.static(n - 1)), word)
            while missing != wp.uint32(0):
                at = lowest_bit(missing)
                missing = without_lowest_bit(missing)
                shape += shape_of(family, moments, i, wp.static(word * word_size) + at)
        return shape

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
        members. There is no branch for broken and nonexistent bonds, whose A no thread reads, nor for intersections
        that determine no gradient: with K^-1 = 0 their A vanishes.
        """
        member = wp.min(k, wp.static(n - 1))
        tilt = f.tilt(family, i, member)
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
        H1 = G1 * inverse[0] + G2 * inverse[1]
        H2 = G1 * inverse[1] + G2 * inverse[2]
        if wp.static(curved):
            H1, H2 = level(H1, H2, tilt)
        S, next_guess = stress_near(green(H1, H2, tilt), f.of_bond(family, i, member, constants), guess)
        A1, A2 = stress_on_members(H1, H2, S, table_weight, inverse, tilt)
        return A1, A2, next_guess

    Sums = wp.types.matrix(shape=(bonds, 9 if compact else 6), dtype=real)
    Parts = wp.types.matrix(shape=(bonds, 6), dtype=real)

    @wp.func_native(_products_and_shapes(bits) if compact else _ADD_PRODUCTS)
    def add_products(sums: Sums, common: Masks, word: int, bit: wp.uint32, w: vec4, y: Arm) -> Sums:
        """Add a member, given by its `word` and `bit`, to c_k X_k1 U_k and c_k X_k2 U_k of intersections it is in."""
        ...

    @wp.func_native(_ADD_PARTS)
    def add_parts(parts: Parts, common: Masks, word: int, bit: wp.uint32, part: vec4, rest: vec2) -> Parts:
        """Add the columns of A of a bond, given by its `word` and `bit`, to the sums of intersections it is in."""
        ...

    return BlockFunctions(
        by_missing, compact, arrive, missing_shape, answer, Words, Masks, Arm, Sums, Parts,
        add_products, add_parts,
    )  # fmt: skip
