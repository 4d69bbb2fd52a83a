"""Strain of a deformation gradient and inverse of a shape tensor.

On a curved sheet the members of an intersection lie above and below the tangent plane of their point: in its frame, at
(xi_k, z_k). The reference configuration then has the gradient F0 = sum c_k X_k (x) xi_k K^-1 = (I; g) with the slope
g = K^-1 sum c_k z_k xi_k, and the metric C0 = I + g (x) g. With R = C0^(1/2), the deformation gradient is
F = (sum c_k Y_k (x) xi_k) K^-1 R^-1. In the reference configuration F = O = (I; g) R^-1, whose columns are orthonormal,
so the stress vanishes. A rigid rotation rotates O and an isotropic expansion scales it, both exactly. The displacement
gradient is H = (sum c_k U_k (x) xi_k) K^-1 R^-1, so that F = O + H and C - I = O^T H + H^T O + H^T H.

A slope of angle phi is stored as a tilt vector t in the direction of the slope, of length sqrt(2) sin(phi / 2). This
avoids divisions: R^-1 = I - t (x) t and O = (I - t (x) t; sqrt(2 - |t|^2) t).
"""

import functools
from dataclasses import dataclass

import warp as wp

from .numeric import numeric

# Minimum det K / (tr K / 2)^2 of a shape tensor that determines a deformation gradient; see kernels/bond_associated.py.
DEGENERATE = 0.2
# Minimum det K of what is left of an intersection, divided by the undamaged one; see kernels/bond_associated.py.
SAMPLE = 0.5


@dataclass(frozen=True)
class Kinematics:
    """Warp functions of one precision, on a flat or a curved sheet; a flat one ignores the tilt.

    Attributes:
        green: (H1, H2, tilt) -> C - I, without adding and subtracting one.
        gradient: (H1, H2, tilt) -> columns of F.
        determines_gradient: K (11, 12, 22) -> whether K can be inverted; the only test for degenerate shape tensors.
        inverse_shape: K -> its inverse, or zero where degenerate.
        remaining_inverse: (K, undamaged K^-1) -> inverse of the shape tensor of a damaged intersection, or zero if too
            few members remain to sample the deformation.
        stress_on_members: (H1, H2, S, weight, inverse, tilt) -> columns of W P K^-1 with P = F S, on a curved sheet of
            W P R^-1 K^-1; times c_k X_k they give the force on member k.
        times: (K, v) -> K v of a symmetric tensor K (11, 12, 22) and a vector, vec2.
        columns: (A1, A2, K) -> columns of A K, where A has the columns A1 and A2.
        tilt_of: Slope -> tilt.
        level: (H1, H2, tilt) -> columns of H R^-1; on a flat sheet H itself.
    """

    green: wp.Function
    gradient: wp.Function
    determines_gradient: wp.Function
    inverse_shape: wp.Function
    remaining_inverse: wp.Function
    stress_on_members: wp.Function
    times: wp.Function
    columns: wp.Function
    tilt_of: wp.Function
    level: wp.Function


@functools.cache
def kinematics(bits: int, curved: bool = False) -> Kinematics:
    """Make the functions in one precision, 32 or 64 bits, for flat or curved sheets."""
    types = numeric(bits)
    real, vec2, vec3, mat22 = types.real, types.vec2, types.vec3, types.mat22
    degenerate, sample = DEGENERATE, SAMPLE

    @wp.func
    def determines_gradient(shape: vec3):
        """Whether the points behind a shape tensor (11, 12, 22) are far enough from collinear."""
        half_trace = real(0.5) * (shape[0] + shape[2])
        return shape[0] * shape[2] - shape[1] * shape[1] > real(degenerate) * half_trace * half_trace

    @wp.func
    def inverse_shape(shape: vec3):
        """Inverse of the symmetric tensor (11, 12, 22), or zero where it is degenerate."""
        determinant = shape[0] * shape[2] - shape[1] * shape[1]
        if determines_gradient(shape):
            return vec3(shape[2] / determinant, -shape[1] / determinant, shape[0] / determinant)
        else:
            return vec3(real(0.0), real(0.0), real(0.0))

    @wp.func
    def remaining_inverse(shape: vec3, undamaged: vec3):
        """Inverse of the tensor (11, 12, 22), or zero if its determinant is less than SAMPLE of the undamaged one."""
        determinant = shape[0] * shape[2] - shape[1] * shape[1]
        if determinant * (undamaged[0] * undamaged[2] - undamaged[1] * undamaged[1]) >= real(sample):
            return vec3(shape[2] / determinant, -shape[1] / determinant, shape[0] / determinant)
        else:
            return vec3(real(0.0), real(0.0), real(0.0))

    @wp.func
    def times(K: vec3, v: vec2):
        return vec2(K[0] * v[0] + K[1] * v[1], K[1] * v[0] + K[2] * v[1])

    @wp.func
    def columns(A1: vec3, A2: vec3, K: vec3):
        return A1 * K[0] + A2 * K[1], A1 * K[1] + A2 * K[2]

    @wp.func
    def tilt_of(slope: vec2):
        """Tilt of a slope g = tan(phi): g / sqrt(s (1 + s)) with s = 1 / cos(phi)."""
        s = wp.sqrt(real(1.0) + wp.dot(slope, slope))
        return slope / wp.sqrt(s * (real(1.0) + s))

    level, green, gradient = curved_strain(bits) if curved else flat_strain(bits)

    @wp.func
    def stress_on_members(H1: vec3, H2: vec3, S: mat22, weight: real, inverse: vec3, tilt: vec2):
        F1, F2 = gradient(H1, H2, tilt)
        P1, P2 = weight * (S[0, 0] * F1 + S[1, 0] * F2), weight * (S[0, 1] * F1 + S[1, 1] * F2)
        R1, R2 = level(P1, P2, tilt)
        return columns(R1, R2, inverse)

    return Kinematics(
        green, gradient, determines_gradient, inverse_shape, remaining_inverse, stress_on_members, times, columns,
        tilt_of, level,
    )  # fmt: skip


def flat_strain(bits: int) -> tuple[wp.Function, wp.Function, wp.Function]:
    """Functions `level`, `green` and `gradient` of a flat sheet."""
    types = numeric(bits)
    real, vec2, vec3, mat22 = types.real, types.vec2, types.vec3, types.mat22

    @wp.func
    def level(H1: vec3, H2: vec3, tilt: vec2):
        return H1, H2

    @wp.func
    def green(H1: vec3, H2: vec3, tilt: vec2):
        shear = H1[1] + H2[0] + wp.dot(H1, H2)
        return mat22(real(2.0) * H1[0] + wp.dot(H1, H1), shear, shear, real(2.0) * H2[1] + wp.dot(H2, H2))

    @wp.func
    def gradient(H1: vec3, H2: vec3, tilt: vec2):
        return vec3(real(1.0) + H1[0], H1[1], H1[2]), vec3(H2[0], real(1.0) + H2[1], H2[2])

    return level, green, gradient


def curved_strain(bits: int) -> tuple[wp.Function, wp.Function, wp.Function]:
    """Functions `level`, `green` and `gradient` of a curved sheet."""
    types = numeric(bits)
    real, vec2, vec3, mat22 = types.real, types.vec2, types.vec3, types.mat22

    @wp.func
    def level(H1: vec3, H2: vec3, tilt: vec2):
        along = tilt[0] * H1 + tilt[1] * H2
        return H1 - tilt[0] * along, H2 - tilt[1] * along

    @wp.func
    def rest(tilt: vec2):
        """Columns of O."""
        rise = wp.sqrt(real(2.0) - wp.dot(tilt, tilt))
        shear = -tilt[0] * tilt[1]
        return (
            vec3(real(1.0) - tilt[0] * tilt[0], shear, rise * tilt[0]),
            vec3(shear, real(1.0) - tilt[1] * tilt[1], rise * tilt[1]),
        )

    @wp.func
    def green(H1: vec3, H2: vec3, tilt: vec2):
        O1, O2 = rest(tilt)
        shear = wp.dot(O1, H2) + wp.dot(O2, H1) + wp.dot(H1, H2)
        return mat22(
            real(2.0) * wp.dot(O1, H1) + wp.dot(H1, H1), shear, shear, real(2.0) * wp.dot(O2, H2) + wp.dot(H2, H2)
        )

    @wp.func
    def gradient(H1: vec3, H2: vec3, tilt: vec2):
        O1, O2 = rest(tilt)
        return O1 + H1, O2 + H2

    return level, green, gradient
