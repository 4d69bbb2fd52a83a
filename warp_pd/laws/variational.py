"""Interface of the built bond-associated law for its tangent and its force paths."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import warp as wp

from ..device.fields import Array
from ..device.launches import Stage
from ..families import Families
from ..interfaces.context import Context
from ..kernels.effects import Kernel
from ..kernels.factories import PairFactory
from ..kernels.families import Layout
from ..materials import Material

# Layout, functions of the material, form.
Key = tuple[Layout, PairFactory, str]


class BondAssociatedLaw(Protocol):
    """The built law, see laws/bond_associated.py and laws/family_law.py."""

    owner: str
    weights: str
    layout: Layout
    key: Key
    earlier_energy: wp.Function | None
    context: Context
    families: Families
    struct: Any
    intact: Array | None
    constants: Any
    points: int
    thickness: float
    lattice_columns: int
    inverse_horizon: float
    unit_volume: float
    unit_force: float
    unit_stiffness: float
    damage: Array | None
    goes_slack: bool
    near_damage: Array | None

    @property
    def paths(self) -> Sequence[Any]:
        """Types of its force paths (laws/force_paths.py), in the order in which they are tried; the reference last."""
        ...

    @property
    def material(self) -> Material:
        """The material."""
        ...

    @property
    def fast(self) -> bool:
        """Whether to use a faster path than the reference where one applies."""
        ...

    @property
    def pairs(self) -> Array:
        """Force of each family on its pairs [N], (members, N) vec3."""
        ...

    def family_arguments(self, displacement: Array) -> dict[str, Any]:
        """Arguments common to all launches of the law."""
        ...

    def add_launch(self, stage: Stage, kernel: Kernel, displacement: Array, **more: Any) -> None:
        """Add a launch on all points, with the arguments common to all kernels of the law."""
        ...

    def add_gather(self, stage: Stage, bond_force: Array, force: Array, softens: bool = True) -> None:
        """Add the pointwise stage that sums the pairs of each point [N] to its force [N]."""
        ...
