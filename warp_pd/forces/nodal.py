"""Nodal correspondence: the law that has zero-energy modes, to measure the others by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..bonds import Families, InfluenceFunction, build_families, influence_function, inverse_shape, require_diagonals
from ..checks import positive
from ..launches import Workspace
from ..materials import Material, check_material
from ..sheet import Sheet
from .family_force import FamilyForce, require_one_material

if TYPE_CHECKING:
    from ..kernels.nodal import NodalKernels


@dataclass(frozen=True)
class Nodal:
    """Nodal (conventional) correspondence: one deformation gradient and one stress a point (NN eqs. 2 to 5).

    The energy of a point, h a_i Psi(F_i), does not feel a checkerboard nor the place of a point in the middle of its
    family. Take it as a baseline, not for results. A family that lost bonds carries the share that still stands.

    Attributes:
        material: Any hyperelastic material.
        horizon: Horizon over the spacing of the sheet [-].
        influence: Influence function of r = |X| / horizon, as in `BondAssociated`; the paper's is "inverse".
    """

    material: Material
    horizon: float = 3.15
    influence: str | InfluenceFunction = "inverse"

    weights = "point"
    has_energy = True
    has_tangent = False

    def __post_init__(self) -> None:
        positive("horizon", self.horizon)
        influence_function(self.influence)
        check_material(self.material, "functions")

    def signature(self, layout: str, breakable: bool) -> tuple[Any, ...]:
        """What decides which kernels are compiled."""
        return (layout, "nodal", self.material.functions, breakable)

    def build(self, workspace: Workspace, sheet: Sheet, breakable: bool) -> NodalForce:
        """Families and tables on the device.

        Raises:
            InputError: for a horizon that the sheet does not allow.
        """
        return NodalForce(self, workspace, sheet, breakable)


class WholeFamilyForce(FamilyForce):
    """What laws of whole families keep on the device.

    The families have no intersections, and K_i^-1 and 2 / tr K_i of the undamaged sheet in place of K_ij^-1 and W_ij.

    Attributes:
        bond_force: What the family of a point does to each of its pairs [N], shape (members, N).
    """

    weights = "point"

    def __init__(self, owner: str, law: Any, workspace: Workspace, sheet: Sheet, breakable: bool) -> None:
        require_one_material(sheet, f"the law {owner}")
        families = build_families(sheet, law.horizon, law.influence, intersections=False)
        require_diagonals(sheet, law.horizon)
        super().__init__(owner, law, workspace, sheet, breakable, families, *_shapes(families))
        self.bond_force = workspace.array("bond_force", owner, self.types.vec3, shape=(families.members, sheet.size))


class NodalForce(WholeFamilyForce):
    """The nodal law on one sheet and device."""

    has_energy = True

    def __init__(self, law: Nodal, workspace: Workspace, sheet: Sheet, breakable: bool) -> None:
        from ..kernels.nodal import nodal

        super().__init__("Nodal", law, workspace, sheet, breakable)
        self.kernels: NodalKernels = nodal(
            self.families.layout, workspace.bits, law.material.functions, breakable, workspace.module
        )

    def add_force(self, stage: str, displacement: Any, force: Any) -> None:
        """Add the launches that turn a displacement [m] into the internal force [N], both (N,) vec3."""
        self.workspace.launch(
            stage, self.owner, self.kernels.family_force, self.points,
            **self.family_arguments(displacement), constants=self.constants,
            unit_force=self.unit_volume * self.inverse_horizon, bond_force=self.bond_force,
        )  # fmt: skip
        self.add_gather(stage, self.bond_force, force)


def _shapes(families: Families) -> tuple[np.ndarray, np.ndarray]:
    """K_i^-1 of every row (11, 12, 22; zero where degenerate), shape (R, 1, 3), and 2 / tr K_i, shape (R, 1)."""
    bonds = families.bonds if families.bonds.ndim == 3 else families.bonds[None]
    c = families.member_shares
    shape = np.stack([(c * bonds[..., p] * bonds[..., q]).sum(axis=1) for p, q in ((0, 0), (0, 1), (1, 1))], axis=-1)
    inverse, _ = inverse_shape(shape)
    return inverse[:, None], (2.0 / (shape[:, 0] + shape[:, 2]))[:, None]
