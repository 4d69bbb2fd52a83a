"""The network of the neural law as a Warp function, see kernels/papers/neural.py."""

import functools
from collections.abc import Sequence
from typing import TypeAlias

import warp as wp

from ..numeric import numeric

Layers: TypeAlias = tuple[tuple[tuple[float, ...], ...], ...]


@functools.cache
def network_function(bits: int, layers: Layers) -> wp.Function:
    """Warp function from inputs to outputs of a network, with the weights as compile-time constants.

    Args:
        bits: 32 or 64.
        layers: Per layer, the columns of the weights followed by the biases, as tuples. The first layer takes the
            inputs; every other layer takes 1 / (1 + exp y) of the previous layer's output y, instead of tanh
            (`warp_pd.papers.neural.networks.Network.sigmoids`).
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
