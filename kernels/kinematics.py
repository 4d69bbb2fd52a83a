"""From a deformation gradient to its strain, and from a shape tensor to its inverse."""

import functools

import warp as wp

from .numeric import numeric

# Least det K / (tr K / 2)^2 of a shape tensor that determines a deformation gradient; see kernels/bond_associated.py.
DEGENERATE = 0.2


@functools.cache
def kinematics(bits):
    """Warp functions `green` and `inverse_shape`."""
    types = numeric(bits)
    real, vec3, mat22 = types.real, types.vec3, types.mat22
    degenerate = DEGENERATE

    @wp.func
    def green(H1: vec3, H2: vec3):
        """C - I of the gradient with columns H1, H2, without adding and taking away one."""
        shear = H1[1] + H2[0] + wp.dot(H1, H2)
        return mat22(real(2.0) * H1[0] + wp.dot(H1, H1), shear, shear, real(2.0) * H2[1] + wp.dot(H2, H2))

    @wp.func
    def inverse_shape(shape: vec3):
        """Inverse of the symmetric tensor (11, 12, 22), or zero where it is degenerate."""
        determinant = shape[0] * shape[2] - shape[1] * shape[1]
        half_trace = real(0.5) * (shape[0] + shape[2])
        if determinant > real(degenerate) * half_trace * half_trace:
            return vec3(shape[2] / determinant, -shape[1] / determinant, shape[0] / determinant)
        else:
            return vec3(real(0.0), real(0.0), real(0.0))

    return green, inverse_shape
