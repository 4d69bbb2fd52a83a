"""The bond law of the papers on a sheet and a device; kernels/papers/bonds.py has its kernels."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..context import Context
from ..device.fields import Array
from ..device.launches import Stage
from ..families import Families
from ..interfaces import Law
from ..kernels.papers.bonds import BondLaw
from ..laws.family_law import FamilyLaw
from ..statics.fictitious_mass import add_row_sums, fictitious_mass
from ..step import Phase


class BondForces(FamilyLaw):
    """Forces and energies of the bonds of one law.

    Attributes:
        law: The law that a user wrote.
        bonds: Its kernels.
        bond_constants: What the kernels of its forces take as constants; those of the material, or a struct of them.
        stress_unit: Factor on its forces [-], or [Pa] if its kernels give them divided by a stress.
        density_arguments: What the kernel of the energy density takes besides the arguments of every kernel.
        least_modulus: A modulus [Pa], of which dynamic relaxation gives a thousandth to points without bonds.
    """

    stress_unit: float = 1.0
    least_modulus: float = 0.0

    def __init__(
        self,
        law: Law,
        context: Context,
        families: Families,
        inverse: np.ndarray | None,
        weights: np.ndarray,
        bonds: BondLaw,
    ) -> None:
        """Copy families and weights to the device, see `FamilyLaw`."""
        super().__init__(law, context, families, inverse, weights)
        self.bonds, self.has_energy = bonds, bonds.energy is not None
        self.earlier_energy, self.represented = bonds.energy, bonds.represented
        self.has_own_density = bonds.density is not None
        self.bond_constants: Any = self.constants
        self.density_arguments: dict[str, Any] = {}

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of a phase; at frames also that of the energy density."""
        super().add(phase, stage)
        if phase is Phase.FRAME and self.bonds.density is not None:
            self.add_launch(
                stage, self.bonds.density, self.context.state.displacement, out=self.own_density,
                **self.density_arguments,
            )  # fmt: skip

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the internal force [N] at a displacement [m], both (N,) vec3."""
        given = {"constants": self.bond_constants, "unit_force": self.stress_unit * self.unit_force}
        if self.bonds.pair_force is not None:
            self.add_launch(stage, self.bonds.pair_force, displacement, force=out, **given)
            return
        assert self.bonds.family_force is not None
        self.add_launch(stage, self.bonds.family_force, displacement, bond_force=self.pairs, **given)
        self.add_gather(stage, self.pairs, out)

    def bond_force(self) -> Array:
        """Force of each family on its bonds [N], (members, N) vec3. Raises InputError for a law of pairs."""
        return super().bond_force() if self.bonds.family_force is None else self.pairs


@fictitious_mass.register(BondForces)
def _(law: BondForces, stage: Stage) -> Array | None:
    if law.bonds.row_sums is None:
        return None
    least = 1e-3 * (law.least_modulus * law.thickness)
    return add_row_sums(law, stage, law.bonds.row_sums, least, constants=law.bond_constants)
