"""Slightly compressible materials in plane stress: Newton's iteration finds the thickness stretch.

A material is defined by a few Warp functions, `Equations`. From them `compressible` builds the functions that force
laws, fast paths and tension field theory need (see kernels/materials.py). The stress is S = g (I - C33 C^-1).
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import warp as wp

from .division import division
from .factories import FunctionFactory
from .incompressible import named
from .materials import NEWTON_STEPS, SHRINK, WIDTH_TOLERANCE, MaterialFunctions, invariants, volume
from .numeric import numeric


@dataclass(frozen=True)
class Equations:
    """Warp functions of a material in one precision, with d = J^(2/3) - 1 and z = J^2 - 1.

    Attributes:
        root_change: (tr C - 2, det C - 1, 1 / det C, constants, guess) -> d.
        shear_of: (tr C - 2, C33 - 1, d, constants) -> g [Pa].
        stored: (I1b - 3, z, constants) -> Psi [J/m^3].
        balance: (d, z, C11 - 1, sqrt(C11), constants) -> four numbers for uniaxial tension: a residual that vanishes
            with sigma_33, its derivative by d, and two scales: the iteration ends when its step times the third number
            is small compared with the fourth.
        membrane_shear: (tr C - 2, C33 - 1, z, constants) -> g [Pa], for laws that write the first Piola stress as
            g (F - C33 F^-T).
    """

    root_change: wp.Function
    shear_of: wp.Function
    stored: wp.Function
    balance: wp.Function
    membrane_shear: wp.Function


@functools.cache
def compressible(equations: Callable[[int], Equations], response: FunctionFactory) -> MaterialFunctions:
    """Build all functions of a material from the cached factories of its equations and of its response."""

    def near_of(bits):
        types = numeric(bits)
        real, mat22, parameters = types.real, types.mat22, types.parameters
        area_change, _, plane_stress = invariants(bits)
        root_change, shear_of, volume_of = equations(bits).root_change, equations(bits).shear_of, volume(bits)
        quotient = division(bits)

        @wp.func
        def stress_near(G: mat22, constants: parameters, guess: real):
            area = area_change(G)
            trace = G[0, 0] + G[1, 1]
            slope = quotient(real(1.0), real(1.0) + area)
            d = root_change(trace, area, slope, constants, guess)
            thinning = slope * (volume_of(d) - area)
            return plane_stress(G, slope, thinning, shear_of(trace, thinning, d, constants)), d

        return stress_near

    near = named(near_of, equations, "near")

    def functions_of(bits):
        types = numeric(bits)
        real, mat22, parameters = types.real, types.mat22, types.parameters
        area_change, _, _ = invariants(bits)
        root_change, stored, volume_of = equations(bits).root_change, equations(bits).stored, volume(bits)
        stress_near, quotient = near(bits), division(bits)

        @wp.func
        def stress(G: mat22, constants: parameters):
            S, _ = stress_near(G, constants, real(0.0))
            return S

        @wp.func
        def energy(G: mat22, constants: parameters):
            area = area_change(G)
            trace = G[0, 0] + G[1, 1]
            slope = quotient(real(1.0), real(1.0) + area)
            d = root_change(trace, area, slope, constants, real(0.0))
            z = volume_of(d)
            thinning = slope * (z - area)
            return stored((trace + thinning - real(3.0) * d) / (real(1.0) + d), z, constants)

        return stress, energy

    def change_of(bits):
        types = numeric(bits)
        real, mat22, parameters = types.real, types.mat22, types.parameters
        area_change, _, _ = invariants(bits)
        root_change, volume_of, quotient = equations(bits).root_change, volume(bits), division(bits)

        @wp.func
        def volume_change(G: mat22, constants: parameters):
            area = area_change(G)
            slope = quotient(real(1.0), real(1.0) + area)
            return volume_of(root_change(G[0, 0] + G[1, 1], area, slope, constants, real(0.0)))

        return volume_change

    def width_of(bits):
        types = numeric(bits)
        real, parameters = types.real, types.parameters
        balance, volume_of = equations(bits).balance, volume(bits)
        steps, shrink, tolerance = NEWTON_STEPS, SHRINK, WIDTH_TOLERANCE[bits]

        @wp.func
        def width(g1: real, constants: parameters):
            # C22 = C33 = J / l1.
            s = wp.sqrt(real(1.0) + g1)
            d = real(0.0)
            for _step in range(steps):
                residual, slope, factor, scale = balance(d, volume_of(d), g1, s, constants)
                new = wp.max(d - residual / slope, real(shrink) * (real(1.0) + d) - real(1.0))
                change = wp.abs(new - d)
                d = new
                if change * factor <= real(tolerance) * scale:
                    break
            z = volume_of(d)
            inverse = real(1.0) / s
            return inverse * (z / (real(1.0) + wp.sqrt(real(1.0) + z)) - g1 / (real(1.0) + s))

        return width

    change = named(change_of, equations, "volume")
    return MaterialFunctions(
        named(functions_of, equations, "functions"),
        near,
        response,
        change,
        named(width_of, equations, "width"),
        named(lambda bits: (change(bits), equations(bits).membrane_shear), equations, "membrane"),
    )
