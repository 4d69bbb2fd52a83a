"""Stresses of all Prony terms of one intersection, for a time step or for a trial displacement.

The law is that of kernels/visco.py. All terms have Yeoh's stress, S_p = 2 (c10 + 2 c20 (I1 - 3)) (I - C33 C^-1), so
they share the tensor I - C33 C^-1, which is computed once before and once after the step.
"""

import functools

import warp as wp

from .materials import invariants
from .numeric import numeric
from .visco import relaxation_factors


@functools.cache
def relaxing_stress(bits: int, advances: bool) -> wp.Function:
    """Function (G, i, j, members, step, prony, strain, overstress) -> sum of all H_p [Pa], power of their means.

    The power is sum_p (H_p before + H_p after) : (G - G before) [Pa], four times the viscous work of the step. At a
    trial displacement (`advances` is False) the state is not changed and the terms respond elastically.
    """
    types = numeric(bits)
    real, vec3, mat22, parameters = types.real, types.vec3, types.mat22, types.parameters
    area_change, _, plane_stress = invariants(bits)
    retained = relaxation_factors(bits)

    @wp.func
    def unit_stress(G: mat22, slope: real, d: real):
        """I1 - 3, and 2 (I - C33 C^-1) as 11, 22, 12; slope = 1 / det C, d = det C - 1."""
        t = G[0, 0] + G[1, 1]
        M = plane_stress(G, slope, -slope * d, real(2.0))
        return slope * (t * d - wp.determinant(G)), vec3(M[0, 0], M[1, 1], M[0, 1])

    @wp.func
    def relaxing(
        G: mat22,
        i: int,
        j: int,
        members: int,
        step: wp.array(dtype=real),
        prony: wp.array(dtype=parameters),
        strain: wp.array2d(dtype=vec3),
        overstress: wp.array2d(dtype=vec3),
    ):
        before = strain[j, i]
        old = mat22(before[0], before[2], before[2], before[1])
        d = area_change(G)
        d_old = area_change(old)
        slope = real(1.0) / (real(1.0) + d)
        slope_old = real(1.0) / (real(1.0) + d_old)
        x, M = unit_stress(G, slope, d)
        x_old, M_old = unit_stress(old, slope_old, d_old)
        total = vec3(real(0.0), real(0.0), real(0.0))
        mean = vec3(real(0.0), real(0.0), real(0.0))
        change = vec3(G[0, 0] - before[0], G[1, 1] - before[1], G[0, 1] - before[2])
        for p in range(prony.shape[0]):
            term = prony[p]
            row = p * members + j
            H = overstress[row, i]
            more = real(2.0) * term[1]
            jump = (term[0] + more * x) * M - (term[0] + more * x_old) * M_old
            if wp.static(advances):
                dt = step[0]
                y = dt / term[2]
                if term[3] != real(0.0):
                    thinning = (d - d_old) * slope * slope_old
                    squared = change[0] * change[0] + change[1] * change[1] + real(2.0) * change[2] * change[2]
                    y *= wp.pow(wp.sqrt(squared + thinning * thinning) / dt, term[3])
                k = retained(y)
                after = H - (y * k) * H + k * jump
                overstress[row, i] = after
                mean += H + after
                total += after
            else:
                total += H + jump
        if wp.static(advances):
            strain[j, i] = vec3(G[0, 0], G[1, 1], G[0, 1])
        return total, mean[0] * change[0] + mean[1] * change[1] + real(2.0) * mean[2] * change[2]

    return relaxing
