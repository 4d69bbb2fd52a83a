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

from .bond_state import bond_state
from .effects import Kernel, kernel
from .families import WORD, Layout, family_functions
from .rupture import elongation, reference_and_deformed, remaining_bonds

# The share falls in steps of at least this size, so that a bond does not change in every time step.
STEP = 1.0 / 64.0


@functools.cache
def softening(layout: Layout, spared: bool, earlier_energy: wp.Function | None) -> Kernel:
    """Kernel `soften_bonds`.

    The share of a bond falls linearly from 1 at the stretch of the criterion `elongation`, which is `begin_at`, to 0
    at the stretch `none_above`. The elongation of a bond shorter than the spacing counts over the spacing in both.

    Args:
        layout: Layout of the families.
        spared: Whether the bonds of some points never soften.
        earlier_energy: Warp function of the force law's energy of a family a moment ago, to sum the energy released by
            softening, per point; None if it is not tracked.
    """
    types = layout.types
    real, vec3, parameters = types.real, types.vec3, types.parameters
    f = family_functions(layout)
    Family = f.struct
    bond_vectors = reference_and_deformed(layout)
    begins = elongation(layout)
    Begin = begins.struct
    remaining = remaining_bonds(layout, begins, spared)
    is_undamaged = bond_state(layout).is_undamaged
    tracked = earlier_energy is not None
    word_size, share_step = WORD, STEP

    @wp.func
    def may_soften(
        family: Family,
        intact: wp.array2d(dtype=wp.uint32),
        displacement: wp.array(dtype=vec3),
        begin_at: Begin,
        horizon: real,
        spared_mask: wp.array(dtype=wp.uint8),
        i: int,
    ):
        """Whether any bond may soften: not if all have their full weight and are short. Most families end here."""
        answer = not is_undamaged(family, intact, i)
        if not answer:
            for word in range(family.words):
                whole = intact[word, i]
                if remaining(family, displacement, begin_at, horizon, spared_mask, i, word, whole) != whole:
                    answer = True
        return answer

    @wp.func
    def softened(
        family: Family,
        shares: wp.array2d(dtype=real),
        displacement: wp.array(dtype=vec3),
        begin_at: Begin,
        none_above: real,
        horizon: real,
        spared_mask: wp.array(dtype=wp.uint8),
        i: int,
        k: int,
    ):
        """The share of bond k after this step."""
        share = shares[k, i]
        if share > real(0.0):
            m = f.neighbour(family, i, k)
            free = bool(True)
            if wp.static(spared):
                free = spared_mask[i] == wp.uint8(0) and spared_mask[m] == wp.uint8(0)
            if free:
                X, Y = bond_vectors(family, displacement, horizon, i, k, m)
                length = wp.length(X)
                stretch = real(1.0) + (wp.length(Y) - length) / wp.max(length, begin_at.spacing)
                left = wp.clamp((none_above - stretch) / (none_above - begin_at.stretch), real(0.0), real(1.0))
                if left <= share - real(share_step) or left == real(0.0):
                    share = left
        return share

    @kernel(gathers=("displacement", "velocity"))
    def soften_bonds(
        family: Family,
        displacement: wp.array(dtype=vec3),
        velocity: wp.array(dtype=vec3),
        step: wp.array(dtype=real),
        begin_at: Begin,
        none_above: real,
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
        if may_soften(family, intact, displacement, begin_at, horizon, spared_mask, i):
            for k in range(family.members):
                left = softened(family, shares, displacement, begin_at, none_above, horizon, spared_mask, i, k)
                if left < shares[k, i]:
                    softens = True
        if softens:
            before = real(0.0)
            back = real(0.5) * step[0]
            if wp.static(tracked):
                before = earlier_energy(family, intact, displacement, velocity, back, constants, inverse_horizon, i)
            for k in range(family.members):
                left = softened(family, shares, displacement, begin_at, none_above, horizon, spared_mask, i, k)
                if left < shares[k, i]:
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
