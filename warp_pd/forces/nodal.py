"""Nodal correspondence: the law that has zero-energy modes, to measure the others by."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..bonds import Families, InfluenceFunction, build_families, family_struct, influence_function, pack
from ..checks import positive
from ..launches import Workspace
from ..materials import Material, padded_constants
from ..sheet import Sheet

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
        padded_constants(self.material)

    def signature(self, layout: str, breakable: bool) -> tuple[Any, ...]:
        """What decides which kernels are compiled."""
        return (layout, "nodal", self.material.functions, breakable)

    def build(self, workspace: Workspace, sheet: Sheet, breakable: bool) -> NodalForce:
        """Families and tables on the device.

        Raises:
            InputError: for a horizon that the sheet does not allow.
        """
        return NodalForce(self, workspace, sheet, breakable)


class PointForce:
    """What laws of whole families keep on the device.

    Attributes:
        families: The families on the host; their intersections are left out.
        struct: The families on the device, with K_i^-1 and 2 / tr K_i of the undamaged sheet in place of K_ij^-1
            and W_ij.
        alive: Bits of the standing bonds, shape (words, N), or None if nothing can break.
        bond_force: What the family of a point does to each of its pairs [N], shape (members, N).
    """

    weights = "point"
    correction = None

    def __init__(
        self,
        owner: str,
        law: Any,
        workspace: Workspace,
        sheet: Sheet,
        breakable: bool,
    ) -> None:
        import warp as wp

        from ..kernels.families import family_functions
        from ..kernels.numeric import numeric

        self.law, self.workspace, self.owner = law, workspace, owner
        self.types = numeric(workspace.bits)
        self.families = _without_intersections(build_families(sheet, law.horizon, law.influence))
        inverse, share = _shapes(self.families)
        functions = family_functions(self.families.layout, workspace.bits, workspace.module)
        self.struct = family_struct(self.families, functions, self.types, workspace, owner, inverse, share)
        self.alive = None
        if breakable:
            standing = self.families.rows_of_points(pack(self.families.exists)).T
            self.alive = workspace.array("alive", "CriticalStretch", wp.uint32, standing)
        self.bond_force = workspace.array(
            "bond_force", owner, self.types.vec3, shape=(self.families.members, sheet.size)
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

    def family_arguments(self, displacement: Any) -> dict[str, Any]:
        """Arguments that all launches of a law share."""
        return {
            "family": self.struct,
            "alive": self.alive,
            "displacement": displacement,
            "inverse_horizon": self.inverse_horizon,
        }

    def add_gather(self, stage: str, gather: Any, force: Any) -> None:
        """Add the launch that sums the bonds of each point to its force [N]."""
        self.workspace.launch(
            stage, self.owner, gather, self.points,
            family=self.struct, alive=self.alive, bond_force=self.bond_force, force=force,
        )  # fmt: skip


class NodalForce(PointForce):
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
        self.add_gather(stage, self.kernels.gather, force)

    def add_energy(self, stage: str, displacement: Any, out: Any) -> None:
        """Add the launch that fills `out`, (N,) float64, with the energy of each family [J]."""
        self.workspace.launch(
            stage, self.owner, self.kernels.strain_energy, self.points,
            **self.family_arguments(displacement), constants=self.constants, unit_volume=self.unit_volume, out=out,
        )  # fmt: skip


def _without_intersections(families: Families) -> Families:
    """The families without the masks of D_ij, which no law of whole families reads."""
    return replace(families, common=np.zeros((0,) * families.common.ndim, np.uint32))


def _shapes(families: Families) -> tuple[np.ndarray, np.ndarray]:
    """K_i^-1 of every row (11, 12, 22; zero where degenerate), shape (R, 1, 3), and 2 / tr K_i, shape (R, 1)."""
    from ..kernels.bond_associated import DEGENERATE

    bonds = families.bonds if families.bonds.ndim == 3 else families.bonds[None]
    c = np.where(families.exists, families.influence, 0.0) * families.member_areas
    shape = np.stack([(c * bonds[..., p] * bonds[..., q]).sum(axis=1) for p, q in ((0, 0), (0, 1), (1, 1))], axis=-1)
    trace = shape[:, 0] + shape[:, 2]
    determinant = shape[:, 0] * shape[:, 2] - shape[:, 1] ** 2
    usable = determinant > DEGENERATE * (0.5 * trace) ** 2
    inverse = np.stack([shape[:, 2], -shape[:, 1], shape[:, 0]], axis=-1) / np.where(usable, determinant, 1.0)[:, None]
    return np.where(usable[:, None], inverse, 0.0)[:, None], (2.0 / trace)[:, None]
