"""A rupture criterion: a critical stretch of every point, in which a weak seam tears first.

Use: `Simulation(sheet, force, Explicit(1e-3), loads=pulls, damage=WeakSeam(np.where(seam, 1.2, 3.0)))`.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from warp_pd.device.checks import InputError, numbers
from warp_pd.kernels.families import family_functions
from warp_pd.kernels.rupture import Criterion
from warp_pd.parts import BondCriterion


@functools.cache
def weaker_end(layout):
    """The critical stretch of the weaker end of a bond."""
    real, vec3 = layout.types.real, layout.types.vec3
    f = family_functions(layout)
    Family = f.struct

    @wp.struct
    class WeakerEnd:
        stretch: wp.array(dtype=real)

    @wp.func
    def exceeds(family: Family, displacement: wp.array(dtype=vec3), criterion: WeakerEnd, i: int, k: int, m: int):
        X = family.horizon * f.bond(family, i, k)
        U = displacement[m] - displacement[i]
        Y = vec3(X[0] + U[0], X[1] + U[1], U[2])
        return wp.length(Y) > wp.min(criterion.stretch[i], criterion.stretch[m]) * wp.length(X)

    return Criterion(exceeds, WeakerEnd, gathers=("stretch",))


@dataclass(frozen=True, eq=False)
class WeakSeam(BondCriterion):
    """A bond breaks when its stretch |Y|/|X| passes the critical one of its weaker end; `stretch` has shape (N,)."""

    stretch: Any
    spared: Any = None

    def __post_init__(self):
        if (numbers("WeakSeam.stretch", self.stretch) <= 1.0).any():
            raise InputError(f"WeakSeam.stretch = {self.stretch!r}: expected stretches greater than 1")

    def criterion(self, context, law):
        found = weaker_end(context.layout)
        values = found.struct()
        values.stretch = context.array("critical_stretch", "WeakSeam", context.types.real, self.stretch)
        return found, values
