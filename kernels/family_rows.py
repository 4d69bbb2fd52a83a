"""The variational bond-associated force of any family on a CPU, as sums over the rows of small tables.

The sums are those of kernels/bond_associated.py, in three passes over a family. A row is the contribution of a member
to every intersection that contains it. A CPU adds a row with vector instructions, and a family's rows fit its
first-level cache:

    row k of the first table     (c_k X_k1 U_k, c_k X_k2 U_k)      summed over D_ij to the gradient of bond j
    row j of the second table    A_ij = W_ij P_ij K_ij^-1          summed over D_ik to the force on member k

The energy needs only the first pass. k belongs to D_ij if j belongs to D_ik, so both sums run over the members of one
intersection. If the intersection has more than half of the family, the sum over the other members is subtracted from
the sum over all. The loops over rows are inlined by hand because a Warp function would copy the table at every call.

The state of viscous laws (kernels/visco/visco.py and kernels/visco/maxwell.py) is updated to the end of a step where
the force needs it, so a step of a viscous law computes each sum only once.
"""

import functools
from dataclasses import replace

import warp as wp

from .effects import Kernel, kernel
from .families import WORD, Layout, family_functions, lowest_bit, number_of_bits, without_lowest_bit
from .kinematics import kinematics
from .numeric import FunctionFactory, PairFactory, constants_of
from .rupture import stiffness_left

# Numbers in a row: the two columns of a gradient, filled up to what a CPU adds at once.
ROW = 8


@functools.cache
def family_rows(
    layout: Layout, material: PairFactory, near: FunctionFactory | None, words: int, energetic: bool,
    response: FunctionFactory | None = None,
) -> Kernel:  # fmt: skip
    """Kernel that fills bond_force [members, points] with the forces of each family [N], in the variational form.

    `unit` is the thickness times the reference area; for forces it is also divided by the horizon. Unused arguments are
    None.

    Args:
        layout: Layout of the families.
        material: Factory of (stress, energy), called with `bits`.
        near: Factory of stress_near, called with `bits`, or None.
        words: Number of words of a family's masks.
        energetic: Whether it fills energies [points] with the energy of each family [J] instead.
        response: That of a viscous law, as for `kernels.bond_associated.reference_force`. The kernel then also advances
            the state by one step (none if `step` is 0) and adds to viscous_work [points], J: the dissipated energy of
            Maxwell elements, the work of Prony stresses.
    """
    viscous = response is not None
    if not viscous:
        # The damage of a point then changes nothing here: sheets with and without a damage field share a kernel.
        layout = replace(layout, softened=False)
    types, bits = layout.types, layout.bits
    real, vec2, vec3, parameters = types.real, types.vec2, types.vec3, types.parameters
    f = family_functions(layout)
    Family = f.struct
    motion = kinematics(bits, layout.curved)
    (stress, energy), quick = material(bits), near is not None
    stress_near = near(bits) if near is not None else stress
    Constants = constants_of(stress)
    damaged, curved, word_size = layout.breakable, layout.curved, WORD
    advance = response(bits) if response is not None else None
    left_of = stiffness_left(bits)
    # K (11, 12, 22) of a member; on a curved sheet, what it adds to the slope besides. Filled up, as rows are.
    shape_row = ROW if curved else 4
    Row = wp.types.vector(length=ROW, dtype=real)
    Rows = wp.types.matrix(shape=(WORD * words, ROW), dtype=real)
    Shape = wp.types.vector(length=shape_row, dtype=real)
    Shapes = wp.types.matrix(shape=(WORD * words, shape_row), dtype=real)
    Words = wp.types.vector(length=words, dtype=wp.uint32)

    @wp.func
    def summed(family: Family, here: Words, members: int, i: int, j: int):
        """The members of D_ij, or the others if D_ij is more than half of the family; and which of the two it is."""
        chosen = Words()
        count = wp.int32(0)
        for word in range(wp.static(words)):
            chosen[word] = f.common(family, i, j, word) & here[word]
            count += number_of_bits(chosen[word])
        most = 2 * count > members
        if most:
            for word in range(wp.static(words)):
                chosen[word] = here[word] & ~chosen[word]
        return chosen, most

    @wp.func
    def moment(family: Family, i: int, k: int):
        """Return c_k X_k."""
        return f.influence(family, i, k) * f.area(family, f.neighbour(family, i, k)) * f.bond(family, i, k)

    what = "energy" if energetic else "viscous" if viscous else "force"

    @kernel(gathers=("displacement",), name=f"family_rows_{what}")
    def family_rows(
        family: Family,
        displacement: wp.array(dtype=vec3),
        constants: Constants,
        unit: real,
        step: wp.array(dtype=real),
        terms: wp.array(dtype=parameters),
        damage: wp.array(dtype=real),
        first: int,
        bond_force: wp.array2d(dtype=vec3),
        energies: wp.array(dtype=wp.float64),
        viscous_work: wp.array(dtype=wp.float64),
        state: wp.array2d(dtype=parameters),
    ):
        i = wp.tid() + first
        undamaged = f.is_undamaged(family, i)
        here = Words()
        members = wp.int32(0)
        for word in range(wp.static(words)):
            here[word] = f.intact_members(family, i, word)
            members += number_of_bits(here[word])
        if wp.static(not energetic):
            for k in range(family.members):
                bond_force[k, i] = vec3(real(0.0), real(0.0), real(0.0))

        rows = Rows()
        all_rows = Row()
        if wp.static(damaged):
            shapes = Shapes()
            all_shapes = Shape()
        for word in range(wp.static(words)):
            left = here[word]
            while left != wp.uint32(0):
                k = word * word_size + lowest_bit(left)
                left = without_lowest_bit(left)
                arm = moment(family, i, k)
                u = displacement[f.neighbour(family, i, k)] - displacement[i]
                if wp.static(curved):
                    u = f.to_frame(family, i, u)
                row = Row()
                for c in range(3):
                    row[c] = arm[0] * u[c]
                    row[3 + c] = arm[1] * u[c]
                rows[k] = row
                all_rows += row
                if wp.static(damaged):
                    if not undamaged:
                        bond = f.bond(family, i, k)
                        shape = Shape()
                        shape[0] = arm[0] * bond[0]
                        shape[1] = arm[0] * bond[1]
                        shape[2] = arm[1] * bond[1]
                        if wp.static(curved):
                            rise = f.rise(family, i, k)
                            shape[4] = rise * arm[0]
                            shape[5] = rise * arm[1]
                        shapes[k] = shape
                        all_shapes += shape

        if wp.static(not energetic):
            answers = Rows()
            all_answers = Row()
        stored = real(0.0)
        work = wp.float64(0.0)
        guess = real(0.0)
        for word in range(wp.static(words)):
            bonds = here[word]
            while bonds != wp.uint32(0):
                j = word * word_size + lowest_bit(bonds)
                bonds = without_lowest_bit(bonds)
                chosen, most = summed(family, here, members, i, j)
                G = Row()
                for other in range(wp.static(words)):
                    left = chosen[other]
                    while left != wp.uint32(0):
                        G += rows[other * word_size + lowest_bit(left)]
                        left = without_lowest_bit(left)
                if most:
                    G = all_rows - G
                inverse = f.shape(family, i, j)
                tilt = f.tilt(family, i, j)
                if wp.static(damaged):
                    if not undamaged:
                        shape = Shape()
                        for other in range(wp.static(words)):
                            left = chosen[other]
                            while left != wp.uint32(0):
                                shape += shapes[other * word_size + lowest_bit(left)]
                                left = without_lowest_bit(left)
                        if most:
                            shape = all_shapes - shape
                        inverse = motion.remaining_inverse(vec3(shape[0], shape[1], shape[2]), inverse)
                        if wp.static(curved):
                            tilt = motion.tilt_of(motion.times(inverse, vec2(shape[4], shape[5])))
                if inverse[0] > real(0.0):
                    G1 = family.inverse_horizon * vec3(G[0], G[1], G[2])
                    G2 = family.inverse_horizon * vec3(G[3], G[4], G[5])
                    C1, C2 = motion.columns(G1, G2, inverse)
                    H1, H2 = motion.level(C1, C2, tilt)
                    strain_now = motion.green(H1, H2, tilt)
                    weight = f.weight(family, i, j)
                    if wp.static(energetic):
                        stored += weight * energy(strain_now, f.of_bond(family, i, j, constants))
                    else:
                        if wp.static(viscous):
                            S, more = advance(strain_now, constants, i, j, family.members, step[0], terms, state)
                            work += wp.float64(weight * more)
                        elif wp.static(quick):
                            S, guess = stress_near(strain_now, f.of_bond(family, i, j, constants), guess)
                        else:
                            S = stress(strain_now, f.of_bond(family, i, j, constants))
                        A1, A2 = motion.stress_on_members(H1, H2, S, weight, inverse, tilt)
                        answer = Row()
                        for c in range(3):
                            answer[c] = A1[c]
                            answer[3 + c] = A2[c]
                        answers[j] = answer
                        all_answers += answer

        if wp.static(viscous):
            if wp.static(layout.softened):
                work *= wp.float64(left_of(damage[i]))
            if step[0] > real(0.0):
                viscous_work[i] = viscous_work[i] + wp.float64(unit / family.inverse_horizon) * work
        if wp.static(energetic):
            energies[i] = wp.float64(unit * stored)
        else:
            for word in range(wp.static(words)):
                bonds = here[word]
                while bonds != wp.uint32(0):
                    k = word * word_size + lowest_bit(bonds)
                    bonds = without_lowest_bit(bonds)
                    chosen, most = summed(family, here, members, i, k)
                    A = Row()
                    for other in range(wp.static(words)):
                        left = chosen[other]
                        while left != wp.uint32(0):
                            A += answers[other * word_size + lowest_bit(left)]
                            left = without_lowest_bit(left)
                    if most:
                        A = all_answers - A
                    arm = moment(family, i, k)
                    pull = arm[0] * vec3(A[0], A[1], A[2]) + arm[1] * vec3(A[3], A[4], A[5])
                    bond_force[k, i] = f.from_frame(family, i, unit * pull)

    return family_rows
