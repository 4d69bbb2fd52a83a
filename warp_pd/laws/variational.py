"""Interface of the bond-associated law on a device for its tangent and fast kernels."""

from __future__ import annotations

from typing import Any, Protocol

from ..device.fields import Array
from ..device.launches import Stage
from ..families import Families
from ..interfaces import BondBreaking
from ..interfaces.context import Context
from ..kernels.bond_associated import BondAssociatedKernels
from ..kernels.factories import PairFactory
from ..kernels.pointwise import Pointwise
from ..materials import Material

# Layout, precision, functions of the material, treatment of broken bonds (None: bonds cannot break), form.
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
        """Whether to use the fast kernels."""
        ...

    @property
    def pairs(self) -> Array:
        """Force of the family of a point on each of its pairs [N], (members, N) vec3."""
        ...

    def family_arguments(self, displacement: Array) -> dict[str, Any]:
        """Arguments common to all launches of a law."""
        ...

    def add_reference_force(self, stage: Stage, displacement: Array) -> None:
        """Add the launch that fills `pairs`."""
        ...

    def add_reference_energy(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launch that fills `out`, (N,) float64, with the energy of each family [J]."""
        ...

    def add_gather(self, stage: Stage, gather: Pointwise, bond_force: Array, force: Array) -> None:
        """Add the pointwise stage that sums the pairs of each point [N] to its force [N]."""
        ...


class FastForce(Protocol):
    """Fast kernels on one sheet and device."""

    def breaks_bonds(self, breaking: BondBreaking) -> bool:
        """Whether the kernels of the force can break the bonds."""
        ...

    def add_force(self, stage: Stage, displacement: Array, force: Array, breaking: BondBreaking | None) -> None:
        """Add the launches of the internal force [N] at a displacement [m], both (N,) vec3.

        In the stages of `breaking`, for which `breaks_bonds` must be true, bonds break before.
        """
        ...

    def add_energy(self, stage: Stage, displacement: Array, energies: Array) -> None:
        """Add the launch of the energy of each family [J], (N,) float64, at a displacement [m], (N,) vec3."""
        ...
