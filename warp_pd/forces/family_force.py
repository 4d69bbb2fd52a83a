"""What all force laws of families keep on a device."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..bonds import Families, family_struct, pack
from ..checks import InputError
from ..launches import Workspace
from ..materials import padded_constants
from ..sheet import Sheet


def require_one_material(sheet: Sheet, what: str) -> None:
    """Check that a sheet is of one material, for what knows no other.

    Raises:
        InputError: if it is not.
    """
    if sheet.stiffness is not None:
        raise InputError(f"sheet.stiffness: allowed with {what} is a sheet of one material")


class FamilyForce:
    """A law on one sheet and device: its families, the bonds that stand, its constants.

    Attributes:
        owner: Name of the law, on the list of arrays and launches.
        law: The law.
        families: The families on the host.
        struct: The families on the device.
        alive: Bits of the standing bonds, shape (words, N), or None if nothing can break.
        constants: Constants of the material.
        kernels: Kernels of the law.
        correction: Report of corrected weights, or None.
        internal: Internal variables by name, arrays that a restart file keeps; none for elastic laws.
    """

    kernels: Any
    correction: dict[str, float] | None = None

    def __init__(
        self,
        owner: str,
        law: Any,
        workspace: Workspace,
        sheet: Sheet,
        breakable: bool,
        families: Families,
        inverse: np.ndarray | None,
        weights: np.ndarray,
    ) -> None:
        import warp as wp

        from ..kernels.families import family_functions
        from ..kernels.numeric import numeric

        self.owner, self.law, self.workspace, self.families = owner, law, workspace, families
        self.internal: dict[str, Any] = {}
        self.types = numeric(workspace.bits)
        functions = family_functions(families.layout, workspace.bits, workspace.module)
        self.struct = family_struct(families, functions, self.types, workspace, owner, inverse, weights)
        self.alive: Any = None
        if breakable:
            standing = families.rows_of_points(pack(families.exists)).T
            self.alive = workspace.array("alive", "CriticalStretch", wp.uint32, standing)
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

    def add_update(self, stage: str, displacement: Any, step: Any) -> None:
        """Nothing: an elastic law has no state."""

    def add_start(self, stage: str, displacement: Any) -> None:
        """Nothing: an elastic law has no state."""

    def start(self) -> None:
        """Nothing: an elastic law has no state."""

    def add_gather(self, stage: str, bond_force: Any, force: Any) -> None:
        """Add the launch that sums the pairs of each point [N], shape (members, N), to its force [N]."""
        self.workspace.point(
            stage, self.owner, self.kernels.gather, self.points,
            family=self.struct, alive=self.alive, bond_force=bond_force, force=force,
        )  # fmt: skip

    def add_energy(self, stage: str, displacement: Any, out: Any) -> None:
        """Add the launch that fills `out`, (N,) float64, with the energy of each family [J], if the law has one."""
        self.workspace.launch(
            stage, self.owner, self.kernels.strain_energy, self.points,
            **self.family_arguments(displacement), constants=self.constants, unit_volume=self.unit_volume, out=out,
        )  # fmt: skip
