"""Joints: points of a sheet that stick to triangles, with a traction that breaks.

A pair is a point p and the place on a triangle with the weights b_k, and the gap g along the unit normal n of the
triangle, where p lies at the start. Its separation and its energy are

    s = x_p - sum_k b_k x_k - g n,     E = (1 - d) K A |s|^2 / 2,

with the stiffness K [N/m^3], the area A of p and the damage d. The forces are minus the gradient of E, including that
of n, so every pair conserves momentum and angular momentum.

d follows the bilinear law for mixed modes of Camanho and Davila (NASA/TM-2002-211737, 2002). With the fraction B of
shear in |s|^2, that across the mean of the normals of both sheets (a joint that is pressed together opens by 0), damage
begins at s0 and is complete at sf:

    1 / (K s0)^2 = (1 - B) / peel strength^2 + B / shear strength^2,
    2 / (K s0 sf) = (1 - B) / peel energy + B / shear energy,      d = sf (|s| - s0) / (|s| (sf - s0)),

and never decreases. A change of d from one separation to another releases K A s_before s_after (change of d) / 2, which
at a constant B is exact for any two of them. Everything is computed in float64, since pieces lie side by side in the
reference state and their displacements nearly cancel.

`weld` ties pairs of points by a stiff spring in all directions.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..effects import Kernel, kernel
from ..numeric import numeric


@dataclass(frozen=True)
class JointKernels:
    """Kernels of one precision.

    Attributes:
        Pairs: Warp struct of arrays, one entry per pair.
        damage: Damage of each pair, and the energy that it releases, stored at its point.
        pull: Force at each pair's place; the moment due to the gap is given as forces on corners 1 and 2.
        add: Adds all pair forces to the joined points.
        energy: Energy of each pair, stored at its point.
    """

    Pairs: Any
    damage: Kernel
    pull: Kernel
    add: Kernel
    energy: Kernel


@functools.cache
def joint(bits: int, breaks: bool) -> JointKernels:
    """Kernels of a joint.

    Args:
        bits: 32 or 64.
        breaks: Whether it can break.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3

    @wp.struct
    class Pairs:
        points: wp.array(dtype=wp.int32)
        corners: wp.array(dtype=wp.vec3i)
        weights: wp.array(dtype=wp.vec3d)
        own: wp.array(dtype=wp.vec3i)  # a triangle that p is a corner of, and 1 or -1 if its normal counts
        alike: wp.array(dtype=wp.float64)
        gap: wp.array(dtype=wp.float64)
        area: wp.array(dtype=wp.float64)
        limits: wp.array(dtype=wp.vec4d)  # 1 / strength^2 in peel and shear, 1 / energy in peel and shear
        reference: wp.array(dtype=wp.vec3d)  # of all points
        stiffness: wp.float64

    @wp.func
    def place(pairs: Pairs, displacement: wp.array(dtype=vec3), i: int):
        u = displacement[i]
        return pairs.reference[i] + wp.vec3d(u)

    @wp.func
    def sides(pairs: Pairs, displacement: wp.array(dtype=vec3), corners: wp.vec3i):
        x = place(pairs, displacement, corners[0])
        return place(pairs, displacement, corners[1]) - x, place(pairs, displacement, corners[2]) - x

    @wp.func
    def separation(pairs: Pairs, displacement: wp.array(dtype=vec3), p: int, normal: wp.vec3d):
        s = place(pairs, displacement, pairs.points[p]) - pairs.gap[p] * normal
        for k in range(3):
            s -= pairs.weights[p][k] * place(pairs, displacement, pairs.corners[p][k])
        return s

    @wp.func
    def left(damage: wp.array(dtype=real), i: int):
        stays = wp.float64(1.0)
        if wp.static(breaks):
            stays -= wp.float64(damage[i])
        return stays

    @kernel(per="list")
    def joint_damage(
        pairs: Pairs,
        displacement: wp.array(dtype=vec3),
        first: int,
        damage: wp.array(dtype=real),
        released: wp.array(dtype=wp.float64),
    ):
        p = wp.tid() + first
        i = pairs.points[p]
        side, other = sides(pairs, displacement, pairs.corners[p])
        normal = wp.normalize(wp.cross(side, other))
        s = separation(pairs, displacement, p, normal)
        side, other = sides(pairs, displacement, pairs.own[p])
        mean = normal + pairs.alike[p] * wp.normalize(wp.cross(side, other))
        if wp.length(mean) > wp.float64(0.01):
            normal = wp.normalize(mean)
        opening = wp.dot(s, normal)
        whole = wp.dot(s, s)
        shear = wp.max(whole - opening * opening, wp.float64(0.0))
        # Without a gap nothing says which side is which: both ways open the joint.
        if pairs.gap[p] * opening < wp.float64(0.0):
            opening = wp.float64(0.0)
        squared = opening * opening + shear
        if squared > wp.float64(0.0):
            share = shear / squared
            limits, stiffness = pairs.limits[p], pairs.stiffness
            one = wp.float64(1.0)
            begin = one / (stiffness * wp.sqrt((one - share) * limits[0] + share * limits[1]))
            end = wp.float64(2.0) / (((one - share) * limits[2] + share * limits[3]) * stiffness * begin)
            reached = wp.min(wp.sqrt(squared), end)
            old = wp.float64(damage[i])
            if reached > begin:
                new = wp.float64(real(end * (reached - begin) / (reached * (end - begin))))
                if new > old:
                    before = end * begin / (end - old * (end - begin))
                    freed = wp.float64(0.5) * stiffness * pairs.area[p] * before * reached * (new - old)
                    if released:
                        released[i] = released[i] + freed * (whole / squared)
                    damage[i] = real(new)

    @kernel(per="list")
    def joint_pull(
        pairs: Pairs,
        displacement: wp.array(dtype=vec3),
        damage: wp.array(dtype=real),
        first: int,
        pull: wp.array(dtype=wp.vec3d),
        turn_first: wp.array(dtype=wp.vec3d),
        turn_second: wp.array(dtype=wp.vec3d),
    ):
        p = wp.tid() + first
        side, other = sides(pairs, displacement, pairs.corners[p])
        product = wp.cross(side, other)
        normal = wp.normalize(product)
        s = separation(pairs, displacement, p, normal)
        size = left(damage, pairs.points[p]) * pairs.stiffness * pairs.area[p]
        pull[p] = size * s
        # Derivative of s . n by the corners 1 and 2.
        along = (size * pairs.gap[p] / wp.length(product)) * (s - wp.dot(s, normal) * normal)
        turn_first[p] = wp.cross(other, along)
        turn_second[p] = wp.cross(along, side)

    @kernel(per="list")
    def add_joint(
        pairs: Pairs,
        pull: wp.array(dtype=wp.vec3d),
        turn_first: wp.array(dtype=wp.vec3d),
        turn_second: wp.array(dtype=wp.vec3d),
        joined: wp.array(dtype=wp.int32),
        begins: wp.array(dtype=wp.int32),
        entries: wp.array(dtype=wp.vec2i),
        first: int,
        force: wp.array(dtype=vec3),
    ):
        t = wp.tid() + first
        total = wp.vec3d()
        for k in range(begins[t], begins[t + 1]):
            p, corner = entries[k][0], entries[k][1]
            if corner < 0:
                total -= pull[p]
            else:
                total += pairs.weights[p][corner] * pull[p]
                if corner == 0:
                    total -= turn_first[p] + turn_second[p]
                elif corner == 1:
                    total += turn_first[p]
                else:
                    total += turn_second[p]
        i = joined[t]
        force[i] = force[i] + vec3(total)

    @kernel(per="list")
    def joint_energy(
        pairs: Pairs,
        displacement: wp.array(dtype=vec3),
        damage: wp.array(dtype=real),
        first: int,
        energy: wp.array(dtype=wp.float64),
    ):
        p = wp.tid() + first
        side, other = sides(pairs, displacement, pairs.corners[p])
        s = separation(pairs, displacement, p, wp.normalize(wp.cross(side, other)))
        i = pairs.points[p]
        energy[i] = wp.float64(0.5) * left(damage, i) * pairs.stiffness * pairs.area[p] * wp.dot(s, s)

    return JointKernels(Pairs, joint_damage, joint_pull, add_joint, joint_energy)


@functools.cache
def weld(bits: int) -> Kernel:
    """Kernel that adds the force of each point's spring to `out` [points], N.

    `partner` is the other point of a pair, -1 for none, `apart` [points] the way to it before any displacement [m].
    """
    real, vec3 = numeric(bits).real, numeric(bits).vec3

    @kernel(gathers=("moved",))
    def add_weld(
        partner: wp.array(dtype=wp.int32),
        stiffness: real,
        apart: wp.array(dtype=vec3),
        moved: wp.array(dtype=vec3),
        first: int,
        out: wp.array(dtype=vec3),
    ):
        i = wp.tid() + first
        m = partner[i]
        if m >= 0:
            out[i] = out[i] + stiffness * (apart[i] + moved[m] - moved[i])

    return add_weld
