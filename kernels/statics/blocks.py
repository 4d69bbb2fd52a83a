"""Blocks of 3 x 3 of a stored stiffness: that of an intersection, and the inverse of a point's own."""

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
