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

from .factories import FunctionFactory
from .numeric import numeric
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
