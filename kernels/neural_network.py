"""The network of the neural law inside a kernel."""

import functools
from collections.abc import Sequence
from typing import TypeAlias

import warp as wp

from .effects import Kernel, kernel
from .neural_functions import NeuralFunctions
from .numeric import numeric

Layers: TypeAlias = tuple[tuple[tuple[float, ...], ...], ...]


@functools.cache
def network_function(bits: int, layers: Layers) -> wp.Function:
    """Warp function from inputs to outputs of a network, with the weights as compile-time constants.

    Args:
        bits: 32 or 64.
        layers: Per layer, the columns of the weights followed by the biases, as tuples. The first layer takes the
            inputs; every other layer takes 1 / (1 + exp y) of the previous layer's output y, instead of tanh
            (`warp_pd.laws.neural.networks.Network.sigmoids`).
    """
    types = numeric(bits)
    real, vec4 = types.real, types.parameters

    @wp.func
    def entered(inputs: vec4):
        return inputs

    def bent(below: wp.Function, width: int) -> wp.Function:
        @wp.func
        def sigmoids(inputs: vec4):
            y = below(inputs)
            for a in range(wp.static(width)):
                y[wp.static(a)] = real(1.0) / (real(1.0) + wp.exp(y[wp.static(a)]))
            return y

        return sigmoids

    def layer_on(below: wp.Function, columns: Sequence[Sequence[float]], bias: Sequence[float]) -> wp.Function:
        vector = wp.types.vector(length=len(bias), dtype=real)
        start, weights = vector(*bias), [vector(*column) for column in columns]

        @wp.func
        def layer(inputs: vec4):
            x = below(inputs)
            y = wp.static(start)
            for a in range(wp.static(len(weights))):
                y += x[wp.static(a)] * wp.static(weights[a])
            return y

        return layer

    found = entered
    for depth, (*columns, bias) in enumerate(layers):
        found = layer_on(bent(found, len(columns)) if depth else found, columns, bias)
    return found


def fused_force(bits: int, layers: Layers, law: NeuralFunctions) -> Kernel:
    """Kernel of the neural law that evaluates the network of `network_function` bond by bond."""
    types = numeric(bits)
    real, vec2, vec3, parameters = types.real, types.vec2, types.vec3, types.parameters
    evaluate = network_function(bits, layers)
    Family = law.struct

    @kernel(gathers=("displacement",), fast_math=bits == 32)
    def fused_force(
        family: Family,
        intact: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        constants: parameters,
        inverse_horizon: real,
        unit_force: real,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
    ):
        i = wp.tid() + first
        H, R, D, V, area, z = law.family_frame(family, intact, displacement, constants, inverse_horizon, i)
        scale = law.family_scale(family, V, unit_force, i)
        for k in range(family.members):
            force = vec3(real(0.0), real(0.0), real(0.0))
            if law.is_intact(family, intact, i, k) and scale > real(0.0):
                x, u, weight, direction, row = law.bond_seen(
                    family, displacement, inverse_horizon, H, D, V, area, z, i, k
                )
                o = evaluate(law.logarithms(row))
                force = scale * weight * law.pull(x, u, direction, R, vec2(o[0], row[1] * o[1]))
            bond_force[k, i] = force

    return fused_force
