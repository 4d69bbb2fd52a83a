"""Stress and moduli of viscous laws at the end of an implicit step, with internal variables relaxed before.

Both laws are then elastic within the step: their trial terms and states (warp_pd/visco/in_step.py) hold what has
relaxed by its end, and only the stress of what is strained in it depends on C.
"""

import functools

import warp as wp

from ..effects import Kernel, kernel
from ..factories import FunctionFactory, PairFactory, constants_of
from ..incompressible import incompressible, named, yeoh
from ..materials import invariants
from ..numeric import numeric
from .maxwell import ElasticNetwork, maxwell
from .visco import prony_response, relaxation_factors


@functools.cache
def maxwell_moduli(network: ElasticNetwork) -> FunctionFactory:
    """Factory of (G, constants, i, j, members, branches, state) -> S, T, without a tension field.

    S has the branches' mu_p M_p and -Q C33 C^-1 with Q = sum mu_p M_p33, which alone depends on C.
    """

    def response_of(bits):
        types = numeric(bits)
        real, vec4, vec6, mat22 = types.real, types.parameters, types.vec6, types.mat22
        assert network.response is not None
        respond, response = maxwell(network, bits).respond, network.response(bits)
        Constants = constants_of(network.functions(bits)[0])
        area_change = invariants(bits)[0]

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
            S, _strain = respond(G, constants, i, j, members, real(0.0), branches, state)
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
            return S, T + q * vec6(
                slope * y * y,
                slope * x * y - real(0.5),
                -real(2.0) * slope * y * z,
                slope * x * x,
                -real(2.0) * slope * x * z,
                real(1.0) + real(4.0) * slope * z * z,
            )

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
