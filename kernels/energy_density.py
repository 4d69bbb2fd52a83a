"""Energy density of a material at given principal stretches, for rupture criteria evaluated on the host."""

import functools

import warp as wp

from .effects import unstaged
from .factories import PairFactory, constants_of
from .numeric import numeric


@functools.cache
def energy_density(functions: PairFactory) -> wp.Kernel:
    """Kernel that fills `out` [n] with the energy density [J/m^3] of principal stretches [n], in float64."""
    types = numeric(64)
    mat22 = types.mat22
    _, energy = functions(64)
    Constants = constants_of(energy)

    def energy_at(
        first: wp.array(dtype=wp.float64),
        second: wp.array(dtype=wp.float64),
        constants: Constants,
        out: wp.array(dtype=wp.float64),
    ):
        i = wp.tid()
        one = wp.float64(1.0)
        zero = wp.float64(0.0)
        G = mat22((first[i] - one) * (first[i] + one), zero, zero, (second[i] - one) * (second[i] + one))
        out[i] = energy(G, constants)

    return unstaged(energy_at)
