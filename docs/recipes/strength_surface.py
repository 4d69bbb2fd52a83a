"""A strength surface: a criterion on means of families that tells uniaxial and equibiaxial strength apart.

It is the linear surface of Kumar, Bourdin, Francfort and Lopez-Pamies (2020): sqrt(J2) + g I1 reaches a limit, with the
invariants of a plane first Piola stress.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from warp_pd.device.checks import InputError, positive
from warp_pd.kernels.families import family_functions
from warp_pd.kernels.rupture import Criterion
from warp_pd.tearing.family_criteria import FamilyCriterion


@functools.cache
def past_the_surface(layout):
    """The mean of sqrt(J2) + slope I1 at both ends of a bond is beyond the limit."""
    real, vec3 = layout.types.real, layout.types.vec3
    Family = family_functions(layout).struct

    @wp.struct
    class Surface:
        first: wp.array(dtype=real)
        second: wp.array(dtype=real)
        slope: real
        limit: real

    @wp.func
    def at(surface: Surface, i: int):
        a, b = surface.first[i], surface.second[i]
        return wp.sqrt((a * a - a * b + b * b) / real(3.0)) + surface.slope * (a + b)

    @wp.func
    def exceeds(family: Family, displacement: wp.array(dtype=vec3), surface: Surface, i: int, k: int, m: int):
        return at(surface, i) + at(surface, m) > real(2.0) * surface.limit

    return Criterion(exceeds, Surface, gathers=("first", "second"))


@dataclass(frozen=True, eq=False)
class StrengthSurface(FamilyCriterion):
    """A bond breaks by its nominal stress: `uniaxial` and `biaxial` are the strengths in these tests [Pa]."""

    uniaxial: float
    biaxial: float
    spared: Any = None

    def __post_init__(self):
        if positive("StrengthSurface.biaxial", self.biaxial) <= 0.5 * positive(
            "StrengthSurface.uniaxial", self.uniaxial
        ):
            raise InputError(f"StrengthSurface.biaxial = {self.biaxial!r}: expected more than half of uniaxial")

    @property
    def reads(self):
        return {"first": "first_piola_1", "second": "first_piola_2"}

    def criterion(self, context, law):
        found = past_the_surface(context.layout)
        values = found.struct()
        values.slope = (self.uniaxial - self.biaxial) / (3.0**0.5 * (2.0 * self.biaxial - self.uniaxial))
        values.limit = (1.0 / 3.0**0.5 + values.slope) * self.uniaxial
        return found, values
