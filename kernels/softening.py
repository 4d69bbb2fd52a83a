"""Softening: bonds that lose their weight gradually as they stretch, for good.

A crack whose bonds break at once rests after every spacing until its energy release rate has risen by up to a half:
lattice trapping. How far it must rise depends on the direction of the crack in the grid. A bond that loses its weight
over a range of stretches spreads the tip over several spacings, and the crack no longer notices the grid.

The share of its weight that a bond has left is a factor on its energy and on its part in every fit of a deformation
gradient (kernels/families.py). For fixed shares the force is minus the gradient of the energy. Both ends of a bond
compute the same share from the same data.

The energy that softening takes is that of half a step back, up to which the force of the bond as it was did work
(kernels/rupture.py). A bond gives up its energy in small parts, so that no further terms are needed.
"""

import functools

import warp as wp

from .bits import bit_of
from .bond_state import bond_state
from .effects import Kernel, kernel
from .families import WORD, family_functions
from .numeric import numeric
from .rupture import reference_and_deformed

# The share falls in steps of at least this size, so that a bond does not change in every time step.
STEP = 1.0 / 64.0


@functools.cache
def softening(layout: str, bits: int, spared: bool, earlier_energy: wp.Function | None, module: str) -> Kernel:
    """Kernel `soften_bonds`.

    The share of a bond falls linearly from 1 at the stretch `full_below` to 0 at the stretch `none_above`. The
    elongation of a bond shorter than the spacing, as irregular clouds have, counts over the spacing.

    Args:
        layout: "lattice with shares" or "cloud with shares".
        bits: 32 or 64.
        spared: Whether the bonds of some points never soften.
        earlier_energy: Warp function of the force law's energy of a family a moment ago, to sum the energy released by
            softening, per point; None if it is not tracked.
        module: Name of the Warp module.
    """
    types = numeric(bits)
    real, vec3, parameters = types.real, types.vec3, types.parameters
    f = family_functions(layout, bits, module)
    Family = f.struct
    bond_vectors = reference_and_deformed(layout, bits, module)
    tracked = earlier_energy is not None
    is_undamaged = bond_state(layout, bits, True, module).is_undamaged
    word_size, share_step = WORD, STEP

    @wp.func(module=module)
    def present(shares: wp.array2d(dtype=real), intact: wp.array2d(dtype=wp.uint32), i: int, k: int):
        """The share of bond k; most bonds have their full weight, and their bit says so."""
        word = k // word_size
        share = real(1.0)
        if not bit_of(intact[word, i], k - word * word_size):
            share = shares[k, i]
        return share

    @wp.func(module=module)
    def softened(
        family: Family,
        share: real,
        displacement: wp.array(dtype=vec3),
        full_below: real,
        none_above: real,
        spacing: real,
        horizon: real,
        spared_mask: wp.array(dtype=wp.uint8),
        i: int,
        k: int,
    ):
        """The share of bond k after this step, of its present one."""
        answer = share
        if share > real(0.0):
            m = f.neighbour(family, i, k)
            free = bool(True)
            if wp.static(spared):
                free = spared_mask[i] == wp.uint8(0) and spared_mask[m] == wp.uint8(0)
            if free:
                X, Y = bond_vectors(family, displacement, horizon, i, k, m)
                length = wp.length(X)
                stretch = real(1.0) + (wp.length(Y) - length) / wp.max(length, spacing)
                left = wp.clamp((none_above - stretch) / (none_above - full_below), real(0.0), real(1.0))
                if left <= share - real(share_step) or left == real(0.0):
                    answer = left
        return answer

    @wp.func(module=module)
    def may_soften(
        family: Family,
        intact: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        full_below: real,
        spacing: real,
        horizon: real,
        i: int,
    ):
        """Whether any bond may soften: not if all have their full weight and are short. Most families end here."""
        answer = not is_undamaged(family, intact, i)
        if not answer:
            for k in range(family.members):
                there = bit_of(intact[k // word_size, i], k % word_size)
                m = wp.where(there, f.neighbour(family, i, k), i)
                X, Y = bond_vectors(family, displacement, horizon, i, k, m)
                length = wp.length(X)
                limit = length + (full_below - real(1.0)) * wp.max(length, spacing)
                answer = answer or wp.dot(Y, Y) > limit * limit
        return answer

    @kernel(module, gathers=("displacement", "velocity"))
    def soften_bonds(
        family: Family,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        full_below: real,
        none_above: real,
        spacing: real,
        horizon: real,
        spared_mask: wp.array(dtype=wp.uint8),
        constants: parameters,
        inverse_horizon: real,
        unit_volume: real,
        first: int,
        intact: wp.array2d(dtype=wp.uint32),
        shares: wp.array2d(dtype=real),
        released: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        softens = bool(False)
        if may_soften(family, intact, displacement, full_below, spacing, horizon, i):
            for k in range(family.members):
                share = present(shares, intact, i, k)
                left = softened(
                    family, share, displacement, full_below, none_above, spacing, horizon, spared_mask, i, k
                )
                if left < share:
                    softens = True
        if softens:
            before = real(0.0)
            back = real(0.5) * step[0]
            if wp.static(tracked):
                before = earlier_energy(family, intact, displacement, velocity, back, constants, inverse_horizon, i)
            for k in range(family.members):
                share = present(shares, intact, i, k)
                left = softened(
                    family, share, displacement, full_below, none_above, spacing, horizon, spared_mask, i, k
                )
                if left < share:
                    shares[k, i] = left
                    word = k // word_size
                    others = ~(wp.uint32(1) << wp.uint32(k - word * word_size))
                    intact[word, i] = intact[word, i] & others
                    if left == real(0.0):
                        intact[family.words + word, i] = intact[family.words + word, i] & others
            if wp.static(tracked):
                after = earlier_energy(family, intact, displacement, velocity, back, constants, inverse_horizon, i)
                released[i] = released[i] + wp.float64(unit_volume * (before - after))

    return soften_bonds
