"""Stress and moduli of viscous laws at the end of an implicit step, with internal variables relaxed before.

Both laws are then elastic within the step: their trial terms and states (warp_pd/visco/law.py) hold what has
relaxed by its end, and only the stress of what is strained in it depends on C.
"""

import functools

import warp as wp

from ..effects import Kernel, kernel
from ..incompressible import incompressible, yeoh
from ..materials import invariants, named
from ..numeric import FunctionFactory, PairFactory, constants_of, numeric
from .maxwell import ElasticNetwork, maxwell
from .visco import prony_response, relaxation_factors

# Change of a strain component for differences of a wrinkled sheet's stress, by precision.
DIFFERENCE = {32: 3e-3, 64: 1e-6}


@functools.cache
def maxwell_moduli(network: ElasticNetwork) -> FunctionFactory:
    """Factory of (G, constants, i, j, members, branches, state) -> S, T.

    S of a taut sheet has the branches' mu_p M_p and -Q C33 C^-1 with Q = sum mu_p M_p33, which alone depends on C.
    Where it wrinkles the moduli are differences of its stress, and zero where it is slack.
    """

    def response_of(bits):
        types = numeric(bits)
        real, vec4, vec6, mat22 = types.real, types.parameters, types.vec6, types.mat22
        assert network.response is not None
        respond, response = maxwell(network, bits).respond, network.response(bits)
        Constants = constants_of(network.functions(bits)[0])
        area_change = invariants(bits)[0]
        wrinkles, h = network.width is not None, DIFFERENCE[bits]

        @wp.func
        def change_of(
            G: mat22,
            D: mat22,
            constants: Constants,
            i: int,
            j: int,
            members: int,
            branches: wp.array(dtype=vec4),
            state: wp.array2d(dtype=vec4),
        ):
            """Change of the stress by D, over its size."""
            ahead, _a = respond(G + real(h) * D, constants, i, j, members, real(0.0), branches, state)
            back, _b = respond(G - real(h) * D, constants, i, j, members, real(0.0), branches, state)
            return (real(0.5) / real(h)) * (ahead - back)

        @wp.func
        def respond_in_step(
            G: mat22,
            constants: Constants,
            i: int,
            j: int,
            members: int,
            branches: wp.array(dtype=vec4),
            state: wp.array2d(dtype=vec4),
        ):
            S, strain = respond(G, constants, i, j, members, real(0.0), branches, state)
            _S, T = response(G, constants)
            Q = real(0.0)
            for p in range(branches.shape[0]):
                Q += branches[p][0] * (real(1.0) + state[p * members + j, i][3])
            # Derivatives of (S11, S22, 2 S12) = Q (-C22, -C11, 2 C12) / det C^2.
            slope = real(1.0) / (real(1.0) + area_change(G))
            q = real(2.0) * Q * slope * slope
            x = real(1.0) + G[0, 0]
            y = real(1.0) + G[1, 1]
            z = G[0, 1]
            T += q * vec6(
                slope * y * y,
                slope * x * y - real(0.5),
                -real(2.0) * slope * y * z,
                slope * x * x,
                -real(2.0) * slope * x * z,
                real(1.0) + real(4.0) * slope * z * z,
            )
            if wp.static(wrinkles):
                moved = strain - G
                if wp.ddot(moved, moved) > real(0.0):
                    one, nothing = real(1.0), real(0.0)
                    X = change_of(G, mat22(one, nothing, nothing, nothing), constants, i, j, members, branches, state)
                    Y = change_of(G, mat22(nothing, nothing, nothing, one), constants, i, j, members, branches, state)
                    Z = change_of(G, mat22(nothing, one, one, nothing), constants, i, j, members, branches, state)
                    T = vec6(
                        X[0, 0],
                        real(0.5) * (X[1, 1] + Y[0, 0]),
                        real(0.5) * (real(2.0) * X[0, 1] + Z[0, 0]),
                        Y[1, 1],
                        real(0.5) * (real(2.0) * Y[0, 1] + Z[1, 1]),
                        real(2.0) * Z[0, 1],
                    )
            return S, T

        return respond_in_step

    return named(response_of, network.functions, "maxwell_moduli")


@functools.cache
def prony_moduli(material: PairFactory, response: FunctionFactory) -> FunctionFactory:
    """Factory of (G, constants, i, j, members, prony, state) -> S, T, from the material's stress and moduli."""

    def response_of(bits):
        types = numeric(bits)
        real, vec4, mat22 = types.real, types.parameters, types.mat22
        advance, elastic = prony_response(material)(bits), response(bits)
        term = incompressible(yeoh).response(bits)
        Constants = constants_of(material(bits)[0])

        @wp.func
        def respond_in_step(
            G: mat22,
            constants: Constants,
            i: int,
            j: int,
            members: int,
            prony: wp.array(dtype=vec4),
            state: wp.array2d(dtype=vec4),
        ):
            # A step of zero leaves the state as it is.
            S, _work = advance(G, constants, i, j, members, real(0.0), prony, state)
            _S, T = elastic(G, constants)
            for p in range(prony.shape[0]):
                _H, more = term(G, vec4(prony[p][0], prony[p][1], real(0.0), real(0.0)))
                T += more
            return S, T

        return respond_in_step

    return named(response_of, material, "prony_moduli")


@functools.cache
def relaxed(bits: int) -> Kernel:
    """Kernel that fills `relaxed` with the Prony state after a step at constant strain."""
    types = numeric(bits)
    real, vec4 = types.real, types.parameters
    retained = relaxation_factors(bits)

    @kernel()
    def relax(
        step: wp.array(dtype=real),
        prony: wp.array(dtype=vec4),
        state: wp.array2d(dtype=vec4),
        members: int,
        first: int,
        relaxed: wp.array2d(dtype=vec4),
    ):
        i = wp.tid() + first
        for p in range(prony.shape[0]):
            x = step[0] / prony[p][2]
            kept = real(1.0) - x * retained(x)
            for j in range(members):
                relaxed[p * members + j, i] = kept * state[p * members + j, i]
        for j in range(members):
            last = prony.shape[0] * members + j
            relaxed[last, i] = state[last, i]

    return relax
