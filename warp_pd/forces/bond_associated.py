"""The bond-associated correspondence law, as published and in its variational form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..bonds import Families, InfluenceFunction, build_families, family_struct, influence_function
from ..checks import InputError, one_of, positive
from ..launches import Workspace
from ..materials import Material, padded_constants
from ..sheet import Sheet

WEIGHTS = ("auto", "published", "plain", "corrected")
BROKEN = ("redistribute", "drop")


@dataclass(frozen=True)
class BondAssociated:
    """Bond-associated correspondence: one deformation gradient and one stress a bond.

    Attributes:
        material: Any hyperelastic material.
        horizon: Horizon over the spacing of the sheet [-].
        weights: How the bonds share the area of their point:
            "published": not at all; the force of a bond comes from its own stress alone, with volume
                fractions (BA eqs. 38 and 43). It has no energy and misses uniform stress by about 1 %.
            "plain": in proportion to |D_ij|; conserves energy, exact for uniform stress inside the sheet.
            "corrected": the nearest weights for which uniform stress is in equilibrium up to the edges too.
            "auto": "plain" once anything can break, "corrected" otherwise.
        influence: Influence function of r = |X| / horizon: "linear" 1 - r, "inverse" 1/r, "inverse_square"
            1/r^2, or a function of an array.
        broken: What becomes of the area of broken bonds: "redistribute" gives it to the remaining ones of
            the point, "drop" loses it.
    """

    material: Material
    horizon: float = 2.015
    weights: str = "auto"
    influence: str | InfluenceFunction = "linear"
    broken: str = "redistribute"

    def __post_init__(self) -> None:
        positive("horizon", self.horizon)
        one_of("weights", self.weights, WEIGHTS)
        one_of("broken", self.broken, BROKEN)
        influence_function(self.influence)
        padded_constants(self.material)

    def resolved_weights(self, breakable: bool) -> str:
        """The weights that "auto" stands for."""
        if self.weights != "auto":
            return self.weights
        return "plain" if breakable else "corrected"

    def signature(self, layout: str, breakable: bool) -> tuple[Any, ...]:
        """What decides which kernels are compiled."""
        form = "published" if self.weights == "published" else "variational"
        return (layout, self.material.functions, self.broken if breakable else None, form)

    def build(self, workspace: Workspace, sheet: Sheet, breakable: bool) -> BondAssociatedForce:
        """Families and tables on the device.

        Raises:
            InputError: for a horizon that the sheet or the weights do not allow.
        """
        return BondAssociatedForce(self, workspace, sheet, breakable)


class BondAssociatedForce:
    """The law on one sheet and device.

    Attributes:
        families: The families on the host.
        struct: The families on the device.
        alive: Bits of the standing bonds, shape (words, N), or None if nothing can break.
        weights: The weights in use, "published", "plain" or "corrected".
        correction: Report of the corrected weights, or None.
    """

    def __init__(self, law: BondAssociated, workspace: Workspace, sheet: Sheet, breakable: bool) -> None:
        import warp as wp

        from ..kernels.bond_associated import bond_associated
        from ..kernels.families import family_functions
        from ..kernels.numeric import numeric

        self.law, self.workspace, self.owner = law, workspace, "BondAssociated"
        self.weights = law.resolved_weights(breakable)
        self.types = numeric(workspace.bits)
        self.families, inverse, weights, self.correction = tables(law, sheet, self.weights)
        layout = self.families.layout
        self.functions = family_functions(layout, workspace.bits, workspace.module)
        self.struct = family_struct(
            self.families, self.functions, self.types, workspace, self.owner, inverse, weights
        )
        law_key = law.signature(layout, breakable)
        self.kernels = bond_associated(layout, workspace.bits, *law_key[1:], workspace.module)
        self.alive = None
        if breakable:
            from ..bonds import pack

            standing = self.families.rows_of_points(pack(self.families.exists)).T
            self.alive = workspace.array("alive", "CriticalStretch", wp.uint32, standing)
        self.bond_force = workspace.array(
            "bond_force", self.owner, self.types.vec3, shape=(self.families.members, sheet.size)
        )
        self.thickness = sheet.thickness
        self.points = sheet.size
        self.constants = self.types.parameters(*padded_constants(law.material))

    @property
    def inverse_horizon(self) -> float:
        """1 / horizon [1/m]."""
        return 1.0 / self.families.horizon

    @property
    def unit_volume(self) -> float:
        """Thickness times reference area [m^3]."""
        return self.thickness * self.families.reference_area

    def add_force(self, stage: str, displacement: Any, force: Any) -> None:
        """Add the launches that turn a displacement [m] into the internal force [N], both (N,) vec3."""
        self.workspace.launch(
            stage,
            self.owner,
            self.kernels.family_force,
            self.points,
            family=self.struct,
            alive=self.alive,
            displacement=displacement,
            constants=self.constants,
            inverse_horizon=self.inverse_horizon,
            unit_force=self.unit_volume * self.inverse_horizon,
            bond_force=self.bond_force,
        )
        self.workspace.launch(
            stage,
            self.owner,
            self.kernels.gather,
            self.points,
            family=self.struct,
            alive=self.alive,
            bond_force=self.bond_force,
            force=force,
        )

    def add_energy(self, stage: str, displacement: Any, out: Any) -> None:
        """Add the launch that fills `out`, (N,) float64, with the energy of each family [J]."""
        self.workspace.launch(
            stage,
            self.owner,
            self.kernels.strain_energy,
            self.points,
            family=self.struct,
            alive=self.alive,
            displacement=displacement,
            constants=self.constants,
            inverse_horizon=self.inverse_horizon,
            unit_volume=self.unit_volume,
            out=out,
        )


def tables(
    law: BondAssociated, sheet: Sheet, weights: str
) -> tuple[Families, np.ndarray, np.ndarray, Any]:
    """Families, K^-1 (R, n, 3), weights over the reference area (R, n), report of the correction or None."""
    families = build_families(sheet, law.horizon, law.influence)
    inverse, size = families.inverse_shapes()
    if weights == "published":
        return families, inverse, size, None
    total = size.sum(axis=1, keepdims=True)
    plain = families.areas[:, None] * size / np.where(total > 0.0, total, 1.0)
    if weights == "plain":
        return families, inverse, plain, None
    raise InputError("weights = 'corrected': not built yet")
