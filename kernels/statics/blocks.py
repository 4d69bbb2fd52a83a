"""Blocks of 3 x 3 of a stored stiffness: of an intersection, of two members, the inverse of a point's own, products."""

import functools

import warp as wp

from ..numeric import numeric

# Lower bound on the eigenvalues of a diagonal block, divided by its largest one.
MIN_STIFFNESS = 1e-6
# Determinant over the cube of the trace, by precision, from which a positive definite block is inverted as it is.
REGULAR = {64: MIN_STIFFNESS, 32: 1e-4}


@functools.cache
def columns_of_gradient(bits: int) -> wp.Function:
    """Function F -> its two columns."""
    types = numeric(bits)
    vec3, mat32 = types.vec3, types.mat32

    @wp.func
    def columns_of(F: mat32):
        return vec3(F[0, 0], F[1, 0], F[2, 0]), vec3(F[0, 1], F[1, 1], F[2, 1])

    return columns_of


@functools.cache
def block_functions(bits: int) -> tuple[wp.Function, wp.Function]:
    """Warp functions `block_of`, the stiffness of an intersection, and `inverse_of`, of a 3x3 block."""
    types = numeric(bits)
    real, vec2, vec3, vec6, mat32, mat33 = types.real, types.vec2, types.vec3, types.vec6, types.mat32, types.mat33
    min_stiffness, regular_from = MIN_STIFFNESS, REGULAR[bits]
    columns_of = columns_of_gradient(bits)

    @wp.func
    def strained(F: mat32, g: vec2):
        """Twice the derivative of the strain (11, 22, 2 x 12) by a point that contributes v (x) g to dF."""
        F1, F2 = columns_of(F)
        return real(2.0) * g[0] * F1, real(2.0) * g[1] * F2, g[1] * F1 + g[0] * F2

    @wp.func
    def block_of(F: mat32, S: vec3, T: vec6, g: vec2, h: vec2):
        """Force along g when a point moves that contributes v (x) h to dF."""
        a1, a2, a3 = strained(F, g)
        b1, b2, b3 = strained(F, h)
        t1 = T[0] * b1 + T[1] * b2 + T[2] * b3
        t2 = T[1] * b1 + T[3] * b2 + T[4] * b3
        t3 = T[2] * b1 + T[4] * b2 + T[5] * b3
        tension = S[0] * g[0] * h[0] + S[1] * (g[0] * h[1] + g[1] * h[0]) + S[2] * g[1] * h[1]
        return (
            tension * wp.identity(n=3, dtype=real)
            + real(0.5) * (wp.outer(a1, t1) + wp.outer(a2, t2) + wp.outer(a3, t3))
        )  # fmt: skip

    @wp.func
    def clamped_inverse(block: mat33):
        """Inverse of |block| with eigenvalues kept away from zero."""
        Q, values = wp.eig3(block)
        largest = wp.max(wp.max(wp.abs(values[0]), wp.abs(values[1])), wp.abs(values[2]))
        scaled = Q
        for c in range(3):
            value = wp.max(wp.abs(values[c]), real(min_stiffness) * largest)
            for d in range(3):
                if value > real(0.0):
                    scaled[d, c] = Q[d, c] / value
                else:
                    scaled[d, c] = real(0.0)
        return scaled * wp.transpose(Q)

    @wp.func
    def inverse_of(block: mat33, mask: wp.uint8):
        """Inverse of |block| on the free components, with eigenvalues kept away from zero."""
        largest = wp.max(wp.max(block[0, 0], block[1, 1]), block[2, 2])
        reduced = block
        for c in range(3):
            if (wp.int32(mask) & (1 << c)) != 0:
                for d in range(3):
                    reduced[c, d] = real(0.0)
                    reduced[d, c] = real(0.0)
                reduced[c, c] = largest
        # No eigenvalue of a positive definite block is smaller than its determinant over the square of its trace.
        determinant, trace = wp.determinant(reduced), reduced[0, 0] + reduced[1, 1] + reduced[2, 2]
        minor = reduced[0, 0] * reduced[1, 1] - reduced[0, 1] * reduced[1, 0]
        regular = real(regular_from) * trace * trace * trace
        result = mat33()
        if reduced[0, 0] > real(0.0) and minor > real(0.0) and determinant > regular:
            result = wp.inverse(reduced)
        else:
            result = clamped_inverse(reduced)
        for c in range(3):
            if (wp.int32(mask) & (1 << c)) != 0:
                for d in range(3):
                    result[c, d] = real(0.0)
                    result[d, c] = real(0.0)
        return result

    return block_of, inverse_of


# Numbers in a row of E of bond_associated_tangent.py: 11 and 22 (upper triangles), 12, filled up to what a CPU adds.
ROW = 24
# Adds up rows of one family, and multiplies them with the moments of two members. On a CPU the 8 numbers of a third of
# a row stay together: the compiler would take single numbers apart and join them again in every pass of the loop.
_PAIR_BLOCK = """
    #if defined(__CUDA_ARCH__)
        struct Lanes {{
            {real} v[8] = {{}};
            {real}& operator[](int c) {{ return v[c]; }}
        }};
    #else
        typedef {real} Lanes __attribute__((vector_size(8 * sizeof({real})), aligned(sizeof({real}))));
    #endif
    Lanes sums[3] = {{}};
    const char* rows = (const char*)stiffness.data + (long long)i * stiffness.strides[0];
    for (unsigned left = members; left; left &= left - 1) {{
        #if defined(__CUDA_ARCH__)
            const {real}* row = (const {real}*)(rows + (begin + __ffs((int)left) - 1) * stiffness.strides[1]);
            for (int c = 0; c < 24; ++c) sums[c / 8][c % 8] += row[c];
        #else
            const Lanes* row = (const Lanes*)(rows + (begin + __builtin_ctz(left)) * stiffness.strides[1]);
            for (int c = 0; c < 3; ++c) sums[c] += row[c];
        #endif
    }}
    const {real} a = arm[0] * other[0], b = arm[1] * other[1];
    const {real} both = arm[0] * other[1] + arm[1] * other[0], skew = arm[0] * other[1] - arm[1] * other[0];
    #if defined(__CUDA_ARCH__)
        {real} part[6];
        for (int c = 0; c < 6; ++c) part[c] = a * sums[0][c] + b * sums[1][c] + both * sums[2][c];
    #else
        const Lanes part = a * sums[0] + b * sums[1] + both * sums[2];
    #endif
    const {real} x = skew * sums[0][6], y = skew * sums[0][7], z = skew * sums[1][6];
    {real}* block = ({real}*)(matrix.data + entry);
    block[0] += part[0]; block[1] += part[3] + x; block[2] += part[5] - z;
    block[3] += part[3] - x; block[4] += part[1]; block[5] += part[4] + y;
    block[6] += part[5] + z; block[7] += part[4] - y; block[8] += part[2];
"""


@functools.cache
def pair_adder(bits: int) -> wp.Function:
    """Function (stiffness, i, begin, members, arm, other, matrix, entry): adds the block of two members of a family.

    `members` are bits of one word of the masks of the family of i, which begins with member `begin`; `arm` and `other`
    are the moments of the two.
    """
    types = numeric(bits)
    vec2, mat33 = types.vec2, types.mat33
    Row = wp.types.vector(length=ROW, dtype=types.real)

    @wp.func_native(_PAIR_BLOCK.format(real="double" if bits == 64 else "float"))
    def add_pair(
        stiffness: wp.array2d(dtype=Row), i: int, begin: int, members: wp.uint32, arm: vec2, other: vec2,
        matrix: wp.array(dtype=mat33), entry: int,
    ): ...  # fmt: skip

    return add_pair


# Sum of the blocks of a row times the vectors of their columns. A CPU multiplies four numbers of a block at once.
_ROW_PRODUCT = """
    const {stored}* block = (const {stored}*)(matrix.data + begin);
    #if defined(__CUDA_ARCH__)
        wp::vec_t<3, {real}> sum;
        for (int e = begin; e < end; ++e, block += 9) {{
            const {real}* x = (const {real}*)(vectors.data + columns.data[e]);
            for (int c = 0; c < 9; ++c) sum[c / 3] += block[c] * x[c % 3];
        }}
        return sum;
    #else
        typedef {real} Lanes __attribute__((vector_size(4 * sizeof({real})), aligned(sizeof({real}))));
        typedef {stored} Stored __attribute__((vector_size(4 * sizeof({stored})), aligned(sizeof({stored}))));
        Lanes low = {{}}, high = {{}};
        {real} last = 0;
        for (int e = begin; e < end; ++e, block += 9) {{
            const {real}* x = (const {real}*)(vectors.data + columns.data[e]);
            const Lanes here = {{x[0], x[1], x[2], x[0]}}, next = {{x[1], x[2], x[0], x[1]}};
            low += __builtin_convertvector(*(const Stored*)block, Lanes) * here;
            high += __builtin_convertvector(*(const Stored*)(block + 4), Lanes) * next;
            last += block[8] * x[2];
        }}
        return wp::vec_t<3, {real}>(low[0] + low[1] + low[2], low[3] + high[0] + high[1], high[2] + high[3] + last);
    #endif
"""


@functools.cache
def block_row_product(bits: int, stored: int) -> wp.Function:
    """Function (matrix, columns, vectors, begin, end) -> the sum of its blocks begin to end - 1 times their vectors.

    The blocks are stored with as many bits as `stored`.
    """
    vec3, mat33, name = numeric(bits).vec3, numeric(stored).mat33, {64: "double", 32: "float"}

    @wp.func_native(_ROW_PRODUCT.format(real=name[bits], stored=name[stored]))
    def row_product(
        matrix: wp.array(dtype=mat33), columns: wp.array(dtype=wp.int32), vectors: wp.array(dtype=vec3), begin: int,
        end: int,
    ) -> vec3: ...  # fmt: skip

    return row_product
