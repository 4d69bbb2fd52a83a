"""What the tangent and the force paths of the bond-associated law know of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..device.fields import Array
from ..kernels.families import Layout
from ..kernels.numeric import FunctionFactory, PairFactory
from ..materials import Material
from .family_law import FamilyLaw


@dataclass(frozen=True)
class ResponseInStep:
    """Stress and moduli at the end of a time step, of a law with internal variables.

    Attributes:
        response: Factory of (G, constants, i, j, members, terms, state) -> S, T.
        terms: Constants of the terms in this step.
        state: Internal variables.
    """

    response: FunctionFactory
    terms: Array
    state: Array


# Layout, functions of the material, form.
Key = tuple[Layout, PairFactory, str]


class BondAssociatedLaw(FamilyLaw):
    """The law on one sheet and device (base class).

    Attributes:
        weights: The weights in use, "published", "plain" or "corrected".
        layout: Layout of its families.
        key: What determines its kernels.
        material: The material.
        fast: Whether to use a faster path than the reference where one applies.
        lattice_columns: Columns of the lattice, 0 on other sheets.
        response_in_step: What its tangent takes instead of the material's response; None without internal variables.
        steps_implicitly: Whether it is prepared for implicit steps.
        own_point: How much of the area of a point counts in its own family, in the published form: 0 or 1.
    """

    layout: Layout
    key: Key
    material: Material
    fast: bool
    lattice_columns: int
    response_in_step: ResponseInStep | None = None
    steps_implicitly: bool = False
    own_point: float = 0.0

    def paths(self) -> Sequence[Any]:
        """Types of the force paths that may be taken, in the order in which they are tried; the reference last."""
        raise NotImplementedError
