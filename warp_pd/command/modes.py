"""Natural modes: small free vibrations about the current state of a sheet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
import warp as wp

from ..device.checks import InputError, count, of_kind, show
from ..statics.tangent import Tangent, tangent_of

if TYPE_CHECKING:
    from ..run.built import Built

OWNER = "natural modes"
# Shift of the spectrum over the largest squared frequency: far below any mode, so that rigid motions do no harm.
SHIFT = 1e-9

_tangents: WeakKeyDictionary[Built, Tangent] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class Modes:
    """Natural modes, lowest frequency first.

    Attributes:
        frequencies: Frequencies [Hz], shape (K,); 0 for motions without stiffness.
        shapes: Displacement of each mode, shape (K, N, 3), normalised so that the sum of m u^2 over all points is 1 kg
            m^2.
    """

    frequencies: np.ndarray
    shapes: np.ndarray


def natural_modes(built: Built, number: int = 6, components: str = "xyz") -> Modes:
    """The lowest modes of small vibrations about the current state, with held components at rest.

    The stiffness is factorised on the host, which is practical for sheets of up to some ten thousand points.

    Args:
        built: A simulation with a force law that Newton's method can solve.
        number: Number of modes K.
        components: Components that move, letters out of "xyz"; "z" finds the transverse modes of a flat sheet, which
            are uncoupled from the others.

    Raises:
        InputError: for a law without a tangent, displacement-dependent loads, or more modes than the sheet has.
    """
    from scipy import sparse
    from scipy.sparse.linalg import eigsh

    from ..run.built import Built

    of_kind("built", built, Built)
    count("number", number, 1)
    if not isinstance(components, str) or not components or set(components) - set("xyz"):
        raise InputError(f"components = {show(components)}: expected distinct letters from 'xyz'")
    if built.external.following:
        raise InputError(
            f"natural_modes: {built.external.following[0].label} depends on the displacement; expected only loads that "
            "do not"
        )
    matrix, free = _stiffness(built)
    moves = np.flatnonzero(np.isin(free % 3, ["xyz".index(c) for c in components]))
    if number >= len(moves):
        raise InputError(f"number = {number!r}: expected 1 to {len(moves) - 1}, fewer than components that move")
    kept = free[moves]
    root = np.sqrt(np.repeat(built.to_numpy(built.state.mass), 3)[kept])
    scaled = sparse.diags(1.0 / root) @ matrix.tocsr()[moves][:, moves] @ sparse.diags(1.0 / root)
    shift = -SHIFT * float(abs(scaled.diagonal()).max())
    start = np.random.default_rng(0).normal(size=len(kept))
    squares, vectors = eigsh(scaled.tocsc(), k=number, sigma=shift, v0=start)
    order = np.argsort(squares)
    shapes = np.zeros((number, 3 * built.context.sheet.size))
    shapes[:, kept] = (vectors / root[:, None]).T[order]
    frequencies = np.sqrt(np.maximum(squares[order], 0.0)) / (2.0 * np.pi)
    return Modes(frequencies, shapes.reshape(number, -1, 3))


def _stiffness(built: Built) -> tuple[Any, np.ndarray]:
    """Sparse stiffness matrix of the free components at the current state [N/m], and their indices among all 3 N."""
    context = built.context
    if built not in _tangents:
        tangent = tangent_of(built.law, context, True)
        if not tangent.symmetric:
            raise InputError(f"{built.law.label}: its tangent is not symmetric; expected a law with an energy")
        stage = context.stage(OWNER, "whenever natural modes are asked for")
        tension = context.array("no_tension", OWNER, context.types.real, shape=1, per="once")
        tangent.add_linearise(stage, context.state.displacement, tension)
        _tangents[built] = tangent
    context.run(OWNER)
    wp.synchronize_device(context.device)
    found = _tangents[built].sparse()
    return found.matrix(), np.flatnonzero(found.free)
