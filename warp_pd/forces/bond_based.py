"""The bond-based force law: bonds that pull along themselves, by a pairwise law of their strain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..bonds import Families, build_families
from ..checks import InputError, one_of, positive
from ..launches import Workspace
from ..materials import PairwiseMaterial, check_material
from ..sheet import Sheet
from .family_force import FamilyForce

# g of c_i = g E / sum_j |X_ij| V_j (IM eq. 4): 4/(1 - nu) with nu = 1/3 in plane stress, and 2 along a line.
STIFFNESS = {"plane stress": 6.0, "line": 2.0}
FIELDS = ("principal_stress", "wrinkle_level")


@dataclass(frozen=True)
class BondBased:
    """Bond-based peridynamics: f = c s n, with the micro-modulus c of each point from its own family (IM eq. 4).

    Plane stress has Poisson's ratio 1/3, as all bond-based laws. A bond takes the mean of the micro-moduli of its
    two points: then forces come in pairs and have an energy, which Newton's method asks for. (The paper writes c
    for a bond without saying whose; its stiffness is symmetric only if both ends have the same.) Under uniform
    isotropic strain the energy is exact at every point, edges included; under other strains it is that of the
    lattice: see tests/test_bond_based.py.

    A sheet at rest resists in its plane alone. Plane problems hold all displacements across it:
    `Fixed(range(sheet.size), "z")`.

    Attributes:
        material: A pairwise material, such as Bimodular.
        horizon: Horizon over the spacing of the sheet [-], 1 or more.
        state: "plane stress", or "line" for a sheet of one row of points.
    """

    material: PairwiseMaterial
    horizon: float = 3.0
    state: str = "plane stress"

    weights = "pairwise"
    has_energy = True
    has_tangent = True

    def __post_init__(self) -> None:
        positive("horizon", self.horizon)
        one_of("state", self.state, STIFFNESS)
        check_material(self.material, "pairwise")

    def signature(self, layout: str, breakable: bool) -> tuple[Any, ...]:
        """What decides which kernels are compiled."""
        return (layout, self.material.pairwise, breakable)

    def build(self, workspace: Workspace, sheet: Sheet, breakable: bool) -> BondBasedForce:
        """Families and tables on the device.

        Raises:
            InputError: for a state that the sheet does not have, or a horizon that it does not allow.
        """
        return BondBasedForce(self, workspace, sheet, breakable)


class BondBasedForce(FamilyForce):
    """The law on one sheet and device."""

    weights = "pairwise"
    has_energy = True

    def __init__(self, law: BondBased, workspace: Workspace, sheet: Sheet, breakable: bool) -> None:
        from ..kernels.bond_based import bond_based

        line = sheet.lattice is not None and sheet.lattice.rows == 1
        if line != (law.state == "line"):
            raise InputError(
                f"state = {law.state!r} on a sheet {'of one row of points' if line else 'in the plane'}: "
                f"allowed is {'line' if line else 'plane stress'!r}"
            )
        families = build_families(sheet, law.horizon, "inverse", intersections=False)
        weights = families.stiffened(_bond_weights(families, STIFFNESS[law.state]))
        super().__init__("BondBased", law, workspace, sheet, breakable, families, None, weights)
        self.kernels = bond_based(families.layout, workspace.bits, law.material.pairwise, breakable, workspace.module)

    def add_force(self, stage: str, displacement: Any, force: Any) -> None:
        """Add the launch that turns a displacement [m] into the internal force [N], both (N,) vec3."""
        self.workspace.launch(
            stage, self.owner, self.kernels.pair_force, self.points,
            **self.family_arguments(displacement), constants=self.constants,
            unit_force=self.unit_volume * self.inverse_horizon, force=force,
        )  # fmt: skip

    def add_density(self, stage: str, displacement: Any, density: Any) -> None:
        """Add the launch that fills `density`, (N,), with the sums of the rows of the stiffness [N/m]."""
        scale = max(self.law.material.constants) * self.thickness
        self.workspace.launch(
            stage, self.owner, self.kernels.row_sums, self.points,
            **self.family_arguments(displacement), constants=self.constants,
            unit_stiffness=self.unit_volume * self.inverse_horizon**2, least=1e-3 * scale, density=density,
        )  # fmt: skip

    def add_fields(self, stage: str, displacement: Any, names: Sequence[str]) -> dict[str, Any]:
        """Add arrays and launches of further fields at the points; the arrays by name.

        Args:
            stage: Where to add the launches.
            displacement: [m], (N,) vec3.
            names: "principal_stress": largest and smallest principal virial stress [Pa] and the angle of the
                largest to the x axis [rad], (N,) vec3; "wrinkle_level": share of compressed bonds [-], (N,).

        Raises:
            InputError: for another name.
        """
        import warp as wp

        arrays = {}
        for name in names:
            one_of("fields", name, FIELDS)
            stress = name == "principal_stress"
            array = self.workspace.array(name, "fields", self.types.vec3 if stress else wp.float32, shape=self.points)
            extra = {"constants": self.constants} if stress else {}
            self.workspace.launch(
                stage, "fields", getattr(self.kernels, name), self.points,
                **self.family_arguments(displacement), **extra, out=array,
            )  # fmt: skip
            arrays[name] = array
        return arrays


def _bond_weights(families: Families, stiffness: float) -> np.ndarray:
    """W_ik = (g/2) a_i a_k |xi_ik| / sum_k |xi_ik| a_k by row, areas over the reference area, shape (R, n)."""
    length = np.where(families.exists, np.linalg.norm(families.bonds, axis=-1), 0.0)
    share = length * families.member_areas
    return 0.5 * stiffness * families.areas[:, None] * share / share.sum(axis=1, keepdims=True)
