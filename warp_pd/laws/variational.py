"""What the tangent and the force paths of the bond-associated law know of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..kernels.factories import PairFactory
from ..kernels.families import Layout
from ..materials import Material
from .family_law import FamilyLaw

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
    """

    layout: Layout
    key: Key
    material: Material
    fast: bool
    lattice_columns: int

    def paths(self) -> Sequence[Any]:
        """Types of the force paths that may be taken, in the order in which they are tried; the reference last."""
        raise NotImplementedError
