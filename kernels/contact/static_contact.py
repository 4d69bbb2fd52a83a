"""Contact with a rigid body in static equilibrium by an augmented Lagrangian.

A point with area A, at the signed distance g from a body with the normal n there, gets the force A p n with the
pressure p = max(0, q - k g). The multiplier q is the pressure at the last equilibrium; the stiffness k is arbitrary.
Equilibrium is found repeatedly with q = p until g is small, so that q alone keeps the point on the surface. Newton's
method for max(0, q - k g) is a primal-dual active set method (Hintermueller, Ito and Kunisch, SIAM J. Optim. 13, 2003;
multipliers as in Alart and Curnier, Comput. Meth. Appl. Mech. Eng. 92, 1991).
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..effects import Kernel, kernel
from ..numeric import numeric
from .body_search import freedom, ignores, placed_at
from .distances import BodyShape

# Change of the normal within half a spacing above which the surface counts as an edge; the sign of the stiffness of an
# edge is unreliable.
EDGE = wp.constant(wp.float64(0.25))


@dataclass(frozen=True)
class StaticContactKernels:
    """Static contact kernels for one shape of body; their argument `a` is a `struct`.

    Attributes:
        struct: Struct type with the constants of the body and the arrays of the sheet.
        press: Adds the contact forces to the forces on the points.
        show: Computes the force of the multiplier on each point [N] and its moment about the centre of the body [N m].
        linearise: Computes the derivative of the force on a point with respect to its displacement [N/m].
        differ: Computes by how much the stiffness along the normal is another than in the blocks, over that of a point
            that touches [-].
        settle: Updates the multipliers to the current pressures and computes their changes [Pa].
    """

    struct: Any
    press: Kernel
    show: Kernel
    linearise: Kernel
    differ: Kernel
    settle: Kernel


@functools.cache
def static_contact(bits: int, distance: wp.Function, curved: bool, held: bool, partly: bool) -> StaticContactKernels:
    """Kernels of contact in equilibrium.

    Args:
        bits: 32 or 64.
        distance: Signed distance of the shape, see kernels/contact/distances.py.
        curved: Whether the reference positions have a z.
        held: Whether any component is held; points without a free component ignore the body.
        partly: Whether any point has held and free components. The supports take the force in held components.
    """
    types = numeric(bits)
    real, vec3, mat33 = types.real, types.vec3, types.mat33
    placed = placed_at(bits, curved)

    @wp.struct
    class StaticContact:
        reference: wp.array(dtype=vec3 if curved else types.vec2)
        origin: wp.vec3d
        areas: wp.array(dtype=real)
        held_mask: wp.array(dtype=wp.uint8)
        multiplier: wp.array(dtype=wp.float64)
        body: BodyShape
        place: wp.array(dtype=wp.vec3d)
        rotation: wp.array(dtype=wp.quatd)
        stiffness: wp.array(dtype=wp.float64)
        reach: wp.float64
        around: wp.float64

    @wp.func
    def surface(x: wp.vec3d, a: StaticContact):
        """Normal and signed distance [m] in the frame of the sheet."""
        q = a.rotation[0]
        found = distance(wp.quat_rotate_inv(q, x - a.place[0]), a.reach, a.body)
        return wp.quat_rotate(q, wp.vec3d(found[0], found[1], found[2])), found[3]

    @wp.func
    def pressed(i: int, u: vec3, a: StaticContact):
        """Position [m], normal and pressure [Pa] of a point."""
        x = placed(a.origin, a.reference[i], u)
        n, gap = surface(x, a)
        p = wp.max(wp.float64(0.0), a.multiplier[i] - a.stiffness[0] * gap)
        if wp.static(held and not partly):
            if a.held_mask[i] != wp.uint8(0):
                p = wp.float64(0.0)
        if wp.static(partly):
            if ignores(a.held_mask[i]) or freedom(a.held_mask[i], n) == wp.float64(0.0):
                p = wp.float64(0.0)
        return x, n, p

    @kernel()
    def press_out(displacement: wp.array(dtype=vec3), a: StaticContact, first: int, out: wp.array(dtype=vec3)):
        i = wp.tid() + first
        _x, n, p = pressed(i, displacement[i], a)
        out[i] = out[i] + vec3(wp.float64(a.areas[i]) * p * n)

    @kernel()
    def show_multiplier(
        displacement: wp.array(dtype=vec3),
        a: StaticContact,
        first: int,
        force: wp.array(dtype=vec3),
        turn: wp.array(dtype=vec3),
    ):
        """The pressure p would count the last round twice: its multiplier holds the gap that k g adds again."""
        i = wp.tid() + first
        x = placed(a.origin, a.reference[i], displacement[i])
        n, _gap = surface(x, a)
        push = wp.float64(a.areas[i]) * a.multiplier[i] * n
        force[i] = vec3(push)
        turn[i] = vec3(wp.cross(x - a.place[0], push))

    @kernel()
    def linearise_contact(
        displacement: wp.array(dtype=vec3), a: StaticContact, first: int, blocks: wp.array(dtype=mat33)
    ):
        """The curvature comes from normals half a spacing apart, because a mesh has none at its corners."""
        i = wp.tid() + first
        x, n, p = pressed(i, displacement[i], a)
        found = wp.mat33d()
        if p > wp.float64(0.0):
            area = wp.float64(a.areas[i])
            turned = wp.mat33d()
            for c in range(3):
                apart = wp.vec3d()
                apart[c] = a.around
                ahead, _gap = surface(x + apart, a)
                behind, _other = surface(x - apart, a)
                column = (ahead - behind) / (wp.float64(2.0) * a.around)
                if wp.length(ahead - behind) > wp.static(EDGE):
                    column = wp.vec3d()
                for r in range(3):
                    turned[r, c] = column[r]
            turned = wp.float64(0.5) * (turned + wp.transpose(turned))
            found = (area * p) * turned - (area * a.stiffness[0]) * wp.outer(n, n)
        block = mat33()
        for r in range(3):
            for c in range(3):
                block[r, c] = real(found[r, c])
        blocks[i] = block

    @kernel()
    def differ_from_blocks(
        displacement: wp.array(dtype=vec3),
        a: StaticContact,
        blocks: wp.array(dtype=mat33),
        first: int,
        off: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        _x, n, p = pressed(i, displacement[i], a)
        along, stiffness = vec3(n), wp.float64(a.areas[i]) * a.stiffness[0]
        resists = wp.where(p > wp.float64(0.0), stiffness, wp.float64(0.0))
        off[i] = wp.abs(resists + wp.float64(wp.dot(along, blocks[i] * along))) / stiffness

    @kernel()
    def settle_contact(
        displacement: wp.array(dtype=vec3),
        a: StaticContact,
        first: int,
        multiplier: wp.array(dtype=wp.float64),
        change: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        _x, _n, p = pressed(i, displacement[i], a)
        change[i] = p - a.multiplier[i]
        multiplier[i] = p

    return StaticContactKernels(
        StaticContact, press_out, show_multiplier, linearise_contact, differ_from_blocks, settle_contact
    )
