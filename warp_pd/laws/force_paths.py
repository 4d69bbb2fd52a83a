"""Force paths of the bond-associated law (ways to compute the force), and their selection.

All compute the sums of kernels/bond_associated.py. The reference path applies to every law and sheet. On a CPU a kernel
sums rows of small tables. Those of a GPU are in fast/force_paths.py.
"""

from __future__ import annotations

import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..device.fields import Array
from ..device.launches import Stage
from ..kernels.effects import Kernel
from ..kernels.families import WORD, Layout
from ..kernels.family_rows import family_rows
from ..kernels.family_sums import energy_of_families
from ..kernels.numeric import FunctionFactory, PairFactory
from ..materials import Material, capabilities
from . import FORCE_PATHS
from .family_law import FamilyLaw

# Largest family whose rows a CPU sums; larger ones compile slowly.
ROWS_MEMBERS = 256


def force_path(law: BondAssociatedLaw, inverse: np.ndarray, weights: np.ndarray) -> Reference:
    """The first of the law's paths that applies (the reference always does); arguments as for `Reference.of`."""
    kinds = law.paths() if law.fast and law.weights != "published" else (Reference,)
    return next(path for kind in kinds if (path := kind.of(law, inverse, weights)) is not None)


def paths_on(device: wp.Device) -> Sequence[type[Reference]]:
    """The paths on a device, in the order in which they are tried."""
    if not has_shared_memory(device):
        return RowSums, Reference
    return (*(path for paths in FORCE_PATHS for path in paths()), Reference)


def has_shared_memory(device: wp.Device) -> bool:
    """Whether thread blocks of the device have shared memory."""
    return bool(device.is_cuda)


# Arguments that only viscous laws give to the kernels that fill the pairs.
NOT_VISCOUS: dict[str, Any] = dict.fromkeys(("step", "terms", "viscous_work", "damage", "state"))


class Reference:
    """The reference path: the sums exactly as written, for any law, sheet and device; base class of all paths.

    Attributes:
        name: Name of the path in the plan.
        other_families: As `BuiltLaw.other_families`.
        response: Response of a viscous law (kernels/bond_associated.py), or None.
    """

    name: ClassVar[str] = "reference"
    other_families: Any | None = None

    def __init__(self, law: BondAssociatedLaw, response: FunctionFactory | None = None) -> None:
        # The law has the path: without a circle its arrays are free as soon as nobody has the law.
        self.law: BondAssociatedLaw = weakref.proxy(law)
        self.response = response

    @classmethod
    def of(cls, law: BondAssociatedLaw, inverse: np.ndarray, weights: np.ndarray) -> Reference | None:
        """The path of a law on its sheet and device, or None if it does not apply; this one always does.

        Args:
            law: The law.
            inverse: K^-1 by row, shape (R, n, 3).
            weights: W divided by the reference area by row, shape (R, n).
        """
        return cls(law)

    def add_undamaged(self, stage: Stage, displacement: Array, force: Array) -> None:
        """Add the launch of undamaged families, of a path that has a kernel for them, at a displacement [m]."""

    def add_others(self, stage: Stage, displacement: Array, force: Array) -> None:
        """Add the launches of all other families, which complete the internal force [N], (N,) vec3."""
        self.add_pairs(stage, displacement, NOT_VISCOUS)
        self.law.add_gather(stage, self.law.pairs, force)

    def add_pairs(self, stage: Stage, displacement: Array, viscous: Mapping[str, Any]) -> None:
        """Add the launch that fills the forces of each family on its pairs [N]; `viscous` as NOT_VISCOUS."""
        from ..kernels.bond_associated import published_force, reference_force

        law = self.law
        layout, material, form = law.key
        kernel, given = reference_force(layout, material, self.response), viscous
        if form == "published":
            kernel, given = published_force(layout, material), {"own": law.own_point}
        law.add_launch(stage, kernel, displacement, unit=law.unit_force, bond_force=law.pairs, **given)

    def add_energy(self, stage: Stage, displacement: Array, energies: Array) -> None:
        """Add the launch of the energy of each family [J], (N,) float64, at a displacement [m], (N,) vec3."""
        law = self.law
        assert law.earlier_energy is not None
        kernel = energy_of_families(law.layout, law.earlier_energy)
        law.add_launch(stage, kernel, displacement, unit_volume=law.unit_volume, out=energies)


class RowSums(Reference):
    """The CPU path: sums over the rows of small tables."""

    name: ClassVar[str] = "rows"

    def _kernel(self, energetic: bool) -> Kernel:
        """Kernel of family_rows."""
        layout, material, _ = self.law.key
        near, words = capabilities(self.law.material).near, -(-self.law.families.members // WORD)
        return family_rows(layout, material, near, words, energetic, None if energetic else self.response)

    @staticmethod
    def applies(law: BondAssociatedLaw) -> bool:
        """Whether the path applies to a law on its sheet and device."""
        return not has_shared_memory(law.context.device) and law.families.members <= ROWS_MEMBERS

    @classmethod
    def of(cls, law: BondAssociatedLaw, inverse: np.ndarray, weights: np.ndarray) -> Reference | None:
        """The path on a CPU unless families are too large; see `Reference.of`."""
        return cls(law) if cls.applies(law) else None

    def add_pairs(self, stage: Stage, displacement: Array, viscous: Mapping[str, Any]) -> None:
        """Add the launch that fills the forces of each family on its pairs [N]; `viscous` as NOT_VISCOUS."""
        law, kernel = self.law, self._kernel(False)
        law.add_launch(stage, kernel, displacement, unit=law.unit_force, bond_force=law.pairs, energies=None, **viscous)

    def add_energy(self, stage: Stage, displacement: Array, energies: Array) -> None:
        """Add the launch of the energy of each family."""
        law = self.law
        law.add_launch(
            stage, self._kernel(True), displacement, unit=law.unit_volume, bond_force=None, energies=energies,
            **NOT_VISCOUS,
        )  # fmt: skip


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
