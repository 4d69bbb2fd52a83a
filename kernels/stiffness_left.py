"""What damage leaves of the stiffness of a family, see kernels/damage_field.py."""

import functools

import warp as wp

from .numeric import numeric


@functools.cache
def stiffness_left(bits: int) -> wp.Function:
    """Function d -> g(d) = (1 - d)^2."""
    real = numeric(bits).real

    @wp.func
    def stiffness_left(damage: real):
        return (real(1.0) - damage) * (real(1.0) - damage)

    return stiffness_left
