"""What the tangent and the fast kernels need to know of the bond-associated law on a device."""

from __future__ import annotations

from typing import Any, Protocol

from ..device.context import Context
from ..device.fields import Array
from ..device.launches import Stage
from ..families import Families
from ..kernels.bond_associated import BondAssociatedKernels
from ..kernels.factories import PairFactory
from ..kernels.pointwise import Pointwise
from ..materials import Material

# Layout, precision, functions of the material, what becomes of broken bonds (None: nothing breaks), form.
Key = tuple[str, int, PairFactory, str | None, str]


class BondAssociatedLaw(Protocol):
    """The law on one sheet and device, see laws/bond_associated.py and laws/family_law.py."""

    owner: str
    weights: str
    key: Key
    kernels: BondAssociatedKernels
    context: Context
    families: Families
    struct: Any
    intact: Array | None
    constants: Any
    points: int
    lattice_columns: int
    inverse_horizon: float
    unit_volume: float

    @property
    def material(self) -> Material:
        """The material."""
        ...

    @property
    def fast(self) -> bool:
        """Whether the fast kernels are wanted."""
        ...

    @property
    def pairs(self) -> Array:
        """What the family of a point does to each of its pairs [N], (members, N) vec3."""
        ...

    def family_arguments(self, displacement: Array) -> dict[str, Any]:
        """Arguments that all launches of a law share."""
        ...

    def add_reference_force(self, stage: Stage, displacement: Array, inner: int = -1) -> None:
        """Add the launch that fills `pairs`, but for undamaged families of the class `inner`."""
        ...

    def add_gather(self, stage: Stage, gather: Pointwise, bond_force: Array, force: Array) -> None:
        """Add the pointwise stage that sums the pairs of each point [N] to its force [N]."""
        ...
