"""Energy density and stress of a material at given strains, for what is evaluated on the host."""

import functools

import warp as wp

from .effects import unstaged
from .factories import FunctionFactory, PairFactory, constants_of
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


@functools.cache
def stress_and_volume(functions: PairFactory, volume: FunctionFactory) -> wp.Kernel:
    """Kernel that fills S [Pa] and J^2 - 1 of strains G = C - I [n], in float64."""
    stress, _ = functions(64)
    volume_change = volume(64)
    Constants = constants_of(stress)

    def stress_at(
        strain: wp.array(dtype=wp.mat22d),
        constants: Constants,
        out: wp.array(dtype=wp.mat22d),
        change: wp.array(dtype=wp.float64),
    ):
        i = wp.tid()
        G = strain[i]
        out[i] = stress(G, constants)
        change[i] = volume_change(G, constants)

    return unstaged(stress_at)
