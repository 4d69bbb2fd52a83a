"""Bond-associated correspondence: one deformation gradient and one stress per bond.

For bond (i,j), D_ij is the part of the family H_i that also lies within the horizon of j, j included.
With c_k = w_ik a_k over k in D_ij:

    K_ij = sum c_k X_ik (x) X_ik,      F_ij = I + [sum c_k U_ik (x) X_ik] K_ij^-1,   U_ik = u_k - u_i.

Variational form (the default): E = h sum_ij W_ij Psi(F_ij), and the family of i pulls its member k with
    a_k t_ik = c_k [ sum over j with k in D_ij of W_ij h P_ij K_ij^-1 ] X_ik.
Published form (BA, eqs. 38 and 43): the force of a bond comes from its own stress alone,
    a_i a_k T_ik = a_i c_k (|D_ik|/|H_i|) (|H_i| + |H_k|)/(2 |H_i|) h P_ik K_ik^-1 X_ik.

On a curved sheet X_ik are projections on the tangent plane of i, and R^-1 K_ij^-1 takes the place of K_ij^-1: see
kernels/kinematics.py. Gradients are then in the frame of i, and forces are rotated back to global axes.

In both forms `bond_force[k, i]` is the force that the family of i exerts on the pair: + on i, - on the member.
The force on a point is then gathered from both ends of its bonds, so momentum is conserved to round-off.

An intersection whose points are (nearly) collinear, det K < DEGENERATE (tr K / 2)^2, determines no deformation
gradient. It stores no energy; its bond still acts through the other intersections that contain it. On an undamaged
lattice the smallest value of det K / (tr K / 2)^2 is 0.42, at the edges.

A damaged intersection is used only while det K >= SAMPLE times its undamaged value. F_ij is a least-squares fit. At a
crack tip no affine motion fits, and F_ij of the few remaining members is noise: two members that move towards each
other can shrink it to a tenth. Its stress and the stiffness 1/det K then exceed those of the sheet a hundredfold. The
published form has no such rule.

`reference_force` and `published_force` are the sums exactly as written here, for any family.
"""

import functools
from dataclasses import dataclass, replace

import warp as wp

from .effects import Kernel, kernel
from .families import WORD, Layout, bit_of, family_functions, lowest_bit, without_lowest_bit
from .kinematics import kinematics
from .numeric import FunctionFactory, PairFactory, constants_of
from .rupture import stiffness_left
from .threads import value_of_lane


@dataclass(frozen=True)
class FamilyMechanics:
    """Warp functions of one configuration; i is a point, j and k are members of its family.

    Attributes:
        gradient_over: (family, i, j, undamaged, first, second, shape, moment) -> the displacement gradient times the
            horizon over D_ij (two columns, in the frame of i), K^-1 (zero if degenerate) and the tilt, from sums over
            D_ij.
        visit: (family, field, i, j, undamaged) -> whether the bond is intact and its intersection determines a
            gradient; the gradient of the field over D_ij (two columns, in the frame of i); K^-1; W_ij divided by the
            reference area and without the factor `family_scale`; the tilt of D_ij, zero on a flat sheet.
        visit_earlier: Like `visit`, for the displacement at a time `back` before now; its arguments are (family,
            displacement, velocity, back, i, j, undamaged).
        family_scale: (family, i, total) -> factor on its weights, whose sum is `total`; 1 in the variational form.
    """

    gradient_over: wp.Function
    visit: wp.Function
    visit_earlier: wp.Function
    family_scale: wp.Function


@functools.cache
def family_mechanics(layout: Layout, form: str) -> FamilyMechanics:
    """Warp functions of the law for any material; `form` is "variational" or "published"."""
    types, bits = layout.types, layout.bits
    real, vec2, vec3 = types.real, types.vec2, types.vec3
    f = family_functions(layout)
    Family = f.struct
    published = form == "published"
    word_size = WORD
    motion = kinematics(bits, layout.curved)
    curved = layout.curved

    @wp.func
    def gradient_over(
        family: Family, i: int, j: int, undamaged: bool, first: vec3, second: vec3, shape: vec3, moment: vec2
    ):
        inverse = f.shape(family, i, j)
        tilt = f.tilt(family, i, j)
        if not undamaged:
            if wp.static(published):
                inverse = motion.inverse_shape(shape)
            else:
                inverse = motion.remaining_inverse(shape, inverse)
            if wp.static(curved):
                tilt = motion.tilt_of(motion.times(inverse, moment))
        G1, G2 = motion.columns(first, second, inverse)
        H1, H2 = motion.level(f.to_frame(family, i, G1), f.to_frame(family, i, G2), tilt)
        return H1, H2, inverse, tilt

    @wp.func
    def family_scale(family: Family, i: int, total: real):
        """Factor that makes the weights of a family sum to the area of its point, in the published form."""
        if wp.static(published):
            scale = real(0.0)
            if total > real(0.0):
                scale = f.area(family, i) / total
            return scale
        else:
            return real(1.0)

    def declare_visit(name, earlier):
        @wp.func(name=name)
        def visit(
            family: Family,
            displacement: wp.array(dtype=vec3),
            velocity: wp.array(dtype=vec3),
            back: real,
            i: int,
            j: int,
            undamaged: bool,
        ):
            there = bool(False)
            H1 = vec3(real(0.0), real(0.0), real(0.0))
            H2 = vec3(real(0.0), real(0.0), real(0.0))
            inverse = vec3(real(0.0), real(0.0), real(0.0))
            weight = real(0.0)
            tilt = vec2(real(0.0), real(0.0))
            if f.is_intact(family, i, j):
                ui = displacement[i]
                first = vec3(real(0.0), real(0.0), real(0.0))
                second = vec3(real(0.0), real(0.0), real(0.0))
                shape = vec3(real(0.0), real(0.0), real(0.0))
                size = real(0.0)
                moment = vec2(real(0.0), real(0.0))
                for word in range(family.words):
                    members = f.common(family, i, j, word) & f.intact_members(family, i, word)
                    while members != wp.uint32(0):
                        k = word * word_size + lowest_bit(members)
                        members = without_lowest_bit(members)
                        m = f.neighbour(family, i, k)
                        a = f.area(family, m)
                        xi = f.bond(family, i, k)
                        cxi = f.influence(family, i, k) * a * xi
                        stretch = displacement[m] - ui
                        if wp.static(earlier):
                            stretch -= back * (velocity[m] - velocity[i])
                        first += cxi[0] * stretch
                        second += cxi[1] * stretch
                        if not undamaged:
                            shape += vec3(cxi[0] * xi[0], cxi[0] * xi[1], cxi[1] * xi[1])
                            size += a
                            if wp.static(curved):
                                moment += f.rise(family, i, k) * cxi
                G1, G2, inverse, tilt = gradient_over(family, i, j, undamaged, first, second, shape, moment)
                if inverse[0] > real(0.0):
                    there = True
                    H1 = family.inverse_horizon * G1
                    H2 = family.inverse_horizon * G2
                    weight = f.weight(family, i, j)
                    if wp.static(published):
                        if not undamaged:
                            weight = size
            return there, H1, H2, inverse, weight, tilt

        return visit

    visit_now, visit_earlier = declare_visit("visit_now", False), declare_visit("visit_earlier", True)

    @wp.func
    def visit(
        family: Family,
        field: wp.array(dtype=vec3),
        i: int,
        j: int,
        undamaged: bool,
    ):
        return visit_now(family, field, field, real(0.0), i, j, undamaged)

    return FamilyMechanics(gradient_over, visit, visit_earlier, family_scale)


@functools.cache
def forces_on_members(layout: Layout) -> tuple[wp.Function, wp.Function]:
    """Functions that sum the force of a family on its members, in the variational form.

    Returns:
        (family, i, j, A1, A2, bond_force) adds (A1, A2) X_k for all k in D_ij; (family, i, scale, bond_force)
        multiplies each sum by `scale` times c_k, and rotates it from the frame of i to global axes.
    """
    real, vec3 = layout.types.real, layout.types.vec3
    f = family_functions(layout)
    Family, word_size = f.struct, WORD

    @wp.func
    def add_to_members(
        family: Family,
        i: int,
        j: int,
        A1: vec3,
        A2: vec3,
        bond_force: wp.array2d(dtype=vec3),
    ):
        for word in range(family.words):
            members = f.common(family, i, j, word) & f.intact_members(family, i, word)
            while members != wp.uint32(0):
                k = word * word_size + lowest_bit(members)
                members = without_lowest_bit(members)
                xi = f.bond(family, i, k)
                bond_force[k, i] = bond_force[k, i] + xi[0] * A1 + xi[1] * A2

    @wp.func
    def finish_forces(family: Family, i: int, scale: real, bond_force: wp.array2d(dtype=vec3)):
        for k in range(family.members):
            if f.is_intact(family, i, k):
                c = f.influence(family, i, k) * f.area(family, f.neighbour(family, i, k))
                bond_force[k, i] = f.from_frame(family, i, scale * c * bond_force[k, i])

    return add_to_members, finish_forces


@functools.cache
def energy_of_intersections(layout: Layout, form: str, density: wp.Function) -> wp.Function:
    """Warp function of the energy of a family, as for `energy_of_families`.

    `density` is a Warp function (family, constants, i, j, C - I) -> energy density of an intersection [J/m^3].
    """
    types = layout.types
    real, vec3 = types.real, types.vec3
    f, law = family_functions(layout), family_mechanics(layout, form)
    green = kinematics(layout.bits, layout.curved).green
    Family, Constants = f.struct, constants_of(density)

    @wp.func
    def earlier_energy(
        family: Family,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        back: real,
        constants: Constants,
        i: int,
    ):
        """Energy of the family of i at a time `back` before now, over (thickness x reference area) [J/m^3]."""
        undamaged = f.is_undamaged(family, i)
        stored = real(0.0)
        total = real(0.0)
        for j in range(family.members):
            there, H1, H2, _inverse, weight, tilt = law.visit_earlier(
                family, displacement, velocity, back, i, j, undamaged
            )
            if there:
                stored += weight * density(family, constants, i, j, green(H1, H2, tilt))
                total += weight
        return stored * law.family_scale(family, i, total)

    return earlier_energy


@functools.cache
def represented_area(layout: Layout) -> wp.Function:
    """Function (family, displacement, i) -> area of the intact bonds of a family that store energy, over the reference.

    It includes the factor on the energy, and is that of the variational form.
    """
    real, vec3 = layout.types.real, layout.types.vec3
    f, law = family_functions(layout), family_mechanics(layout, "variational")
    Family = f.struct

    @wp.func
    def represented(family: Family, displacement: wp.array(dtype=vec3), i: int):
        undamaged = f.is_undamaged(family, i)
        total = real(0.0)
        for j in range(family.members):
            there, _H1, _H2, _inverse, weight, _tilt = law.visit(family, displacement, i, j, undamaged)
            if there:
                total += weight
        return total

    return represented


@functools.cache
def family_energy(layout: Layout, material: PairFactory, form: str) -> wp.Function:
    """Warp function of the energy of a family, as for `energy_of_families`; `material`: factory of (stress, energy)."""
    f, mat22, energy = family_functions(layout), layout.types.mat22, material(layout.bits)[1]
    Family, Constants = f.struct, constants_of(energy)

    @wp.func
    def density(family: Family, constants: Constants, i: int, j: int, G: mat22):
        return energy(G, f.of_bond(family, i, j, constants))

    return energy_of_intersections(layout, form, density)


@functools.cache
def partial_energy(layout: Layout, material: PairFactory) -> wp.Function:
    """Warp function of what every n-th member adds to the energy of a family of the variational form.

    So several threads of a GPU, at most a warp, can share a family. `material` is a factory of (stress, energy).
    """
    types = layout.types
    real, vec2, vec3 = types.real, types.vec2, types.vec3
    f, law = family_functions(layout), family_mechanics(layout, "variational")
    green = kinematics(layout.bits, layout.curved).green
    Family, word_size = f.struct, WORD
    of_lane = value_of_lane(layout.bits)
    _, energy = material(layout.bits)
    Constants = constants_of(energy)

    @wp.func
    def partial_energy(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        i: int,
        lane: int,
        lanes: int,
    ):
        """Sum of W_ij w_ij over the members j = lane, lane + lanes, ...; members are read once for all threads."""
        undamaged = f.is_undamaged(family, i)
        last = family.members - 1
        stored = real(0.0)
        for block in range(0, family.members, lanes):
            j = wp.min(block + lane, last)
            first = vec3(real(0.0), real(0.0), real(0.0))
            second = vec3(real(0.0), real(0.0), real(0.0))
            shape = vec3(real(0.0), real(0.0), real(0.0))
            moment = vec2(real(0.0), real(0.0))
            for begin in range(0, family.members, lanes):
                k = wp.min(begin + lane, last)
                m = wp.where(f.is_intact(family, i, k), f.neighbour(family, i, k), i)
                xi = f.bond(family, i, k)
                c = f.influence(family, i, k) * f.area(family, m)
                stretch = displacement[m] - displacement[i]
                rise = f.rise(family, i, k)
                word = begin // word_size
                members = f.common(family, i, j, word) & f.intact_members(family, i, word)
                for n in range(wp.min(lanes, family.members - begin)):
                    # All threads of the family take part, whatever their own intersection.
                    U = vec3(
                        of_lane(stretch[0], n, lanes), of_lane(stretch[1], n, lanes), of_lane(stretch[2], n, lanes)
                    )
                    X = vec2(of_lane(xi[0], n, lanes), of_lane(xi[1], n, lanes))
                    weight = of_lane(c, n, lanes)
                    height = rise
                    if wp.static(layout.curved):
                        height = of_lane(rise, n, lanes)
                    if bit_of(members, begin + n - word * word_size):
                        cX = weight * X
                        first += cX[0] * U
                        second += cX[1] * U
                        shape += vec3(cX[0] * X[0], cX[0] * X[1], cX[1] * X[1])
                        if wp.static(layout.curved):
                            moment += height * cX
            if block + lane < family.members and f.is_intact(family, i, j):
                G1, G2, inverse, tilt = law.gradient_over(family, i, j, undamaged, first, second, shape, moment)
                if inverse[0] > real(0.0):
                    strain = green(family.inverse_horizon * G1, family.inverse_horizon * G2, tilt)
                    weight = f.weight(family, i, j)
                    stored += weight * energy(strain, f.of_bond(family, i, j, constants))
        return stored

    return partial_energy


@functools.cache
def reference_force(layout: Layout, material: PairFactory, response: FunctionFactory | None = None) -> Kernel:
    """Reference kernel that fills bond_force [members, points] with the forces of each family, in the variational form.

    `unit` is the thickness times the reference area over the horizon. Arguments of a viscous law alone are otherwise
    None.

    Args:
        layout: Layout of the families.
        material: Factory of (stress, energy).
        response: Of a viscous law, factory of (G, constants, i, j, members, step, terms, state) -> S after a step, work
            or loss [J/m^3], see kernels/visco/visco.py and kernels/visco/maxwell.py. The kernel then advances the
            state by a step and adds to viscous_work [points], J; with a step of zero the state does not change.
    """
    if response is None:
        # The damage of a point then changes nothing here: sheets with and without a damage field share a kernel.
        layout = replace(layout, softened=False)
    types, bits = layout.types, layout.bits
    real, vec3, vec4 = types.real, types.vec3, types.parameters
    f = family_functions(layout)
    Family = f.struct
    stress, _ = material(bits)
    Constants = constants_of(stress)
    law, motion = family_mechanics(layout, "variational"), kinematics(bits, layout.curved)
    add_to_members, finish_forces = forces_on_members(layout)
    viscous = response is not None
    advance, left = response(bits) if response is not None else None, stiffness_left(bits)

    @kernel(gathers=("displacement",), name="viscous_force" if viscous else "variational_force")
    def variational_force(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        unit: real,
        step: wp.array(dtype=real),
        terms: wp.array(dtype=vec4),
        damage: wp.array(dtype=real),
        first: int,
        bond_force: wp.array2d(dtype=vec3),
        viscous_work: wp.array(dtype=wp.float64),
        state: wp.array2d(dtype=vec4),
    ):
        i = wp.tid() + first
        for k in range(family.members):
            bond_force[k, i] = vec3(real(0.0), real(0.0), real(0.0))
        undamaged = f.is_undamaged(family, i)
        work = wp.float64(0.0)
        for j in range(family.members):
            there, H1, H2, inverse, weight, tilt = law.visit(family, displacement, i, j, undamaged)
            if there:
                G = motion.green(H1, H2, tilt)
                if wp.static(viscous):
                    S, more = advance(G, constants, i, j, family.members, step[0], terms, state)
                    work += wp.float64(weight * more)
                else:
                    S = stress(G, f.of_bond(family, i, j, constants))
                A1, A2 = motion.stress_on_members(H1, H2, S, weight, inverse, tilt)
                add_to_members(family, i, j, A1, A2, bond_force)
        finish_forces(family, i, unit, bond_force)
        if wp.static(viscous):
            if wp.static(layout.softened):
                work *= wp.float64(left(damage[i]))
            if step[0] > real(0.0):
                viscous_work[i] = viscous_work[i] + wp.float64(unit / family.inverse_horizon) * work

    return variational_force


@functools.cache
def published_force(layout: Layout, material: PairFactory) -> Kernel:
    """Reference kernel that fills bond_force [members, points] with the forces of each family, in the published form.

    Its arguments are those of `reference_force` without those of viscous laws, and `own`: how much of the area of a
    point counts in its own family, 0 or 1 (BA eq. 39 does not say).
    """
    types, bits = layout.types, layout.bits
    real, vec3 = types.real, types.vec3
    f = family_functions(layout)
    Family = f.struct
    stress, _ = material(bits)
    Constants = constants_of(stress)
    law, motion = family_mechanics(layout, "published"), kinematics(bits, layout.curved)

    @wp.func
    def present_area(family: Family, i: int, own: real):
        """|H_i| of the intact bonds, divided by the reference area."""
        if f.is_undamaged(family, i):
            return f.family_area(family, i) + own * f.area(family, i)
        size = own * f.area(family, i)
        for k in range(family.members):
            if f.is_intact(family, i, k):
                size += f.area(family, f.neighbour(family, i, k))
        return size

    @kernel(gathers=("displacement", "family.intact"))
    def published_force(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        unit: real,
        own: real,
        first: int,
        bond_force: wp.array2d(dtype=vec3),
    ):
        i = wp.tid() + first
        undamaged = f.is_undamaged(family, i)
        own_area = present_area(family, i, own)
        for j in range(family.members):
            force = vec3(real(0.0), real(0.0), real(0.0))
            there, H1, H2, inverse, size, tilt = law.visit(family, displacement, i, j, undamaged)
            if there:
                S = stress(motion.green(H1, H2, tilt), constants)
                A1, A2 = motion.stress_on_members(H1, H2, S, real(1.0), inverse, tilt)
                xi = f.bond(family, i, j)
                m = f.neighbour(family, i, j)
                intact_fraction = (size + own * f.area(family, i)) / own_area
                pair = (own_area + present_area(family, m, own)) / (real(2.0) * own_area)
                c = f.area(family, i) * f.influence(family, i, j) * f.area(family, m)
                force = unit * intact_fraction * pair * c * (xi[0] * A1 + xi[1] * A2)
            bond_force[j, i] = f.from_frame(family, i, force)

    return published_force


@functools.cache
def remembered(layout: Layout, material: PairFactory, value_of: FunctionFactory) -> Kernel:
    """Kernel that raises `largest` [member, point] to `value_of`, (G, constants) -> a number, of each intersection.

    If it remembered the mean of its family instead, its energy would change as the mean grows, without work of a force.
    """
    types = layout.types
    real, vec3 = types.real, types.vec3
    f, law = family_functions(layout), family_mechanics(layout, "variational")
    green = kinematics(layout.bits, layout.curved).green
    Family, Constants, value = f.struct, constants_of(material(layout.bits)[0]), value_of(layout.bits)

    @kernel(gathers=("displacement",))
    def remember(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        first: int,
        largest: wp.array2d(dtype=real),
    ):
        i = wp.tid() + first
        undamaged = f.is_undamaged(family, i)
        for j in range(family.members):
            there, H1, H2, _inverse, _weight, tilt = law.visit(family, displacement, i, j, undamaged)
            if there:
                now = value(green(H1, H2, tilt), f.of_bond(family, i, j, constants))
                largest[j, i] = wp.max(largest[j, i], now)

    return remember
