"""The bond-based force law: forces along the bonds that follow a pairwise law of the bond strain."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, one_of, positive
from ..device.fields import Array
from ..device.launches import Stage
from ..families import Families, build_families
from ..geometry.sheet import Sheet
from ..interfaces import BuiltLaw
from ..kernels.effects import Kernel
from ..kernels.papers.bond_based import bond_based, pull_of_bond
from ..kernels.papers.bonds_once import BondsOnce, bonds_once
from ..kernels.rupture import NEARLY
from ..laws.family_law import FamilyLaw, whole_sheet
from ..laws.point_fields import factors
from ..materials import PairwiseMaterial, capabilities, check_material
from ..statics.fictitious_mass import add_row_sums, fictitious_mass
from ..statics.tangent import Tangent
from ..statics.tangent_of import tangent_of
from ..step import Phase
from .bond_based_tangent import BondBasedTangent
from .inner_directions import inner_directions

# g of c_i = g E / sum_j |X_ij| V_j (IM eq. 4): 4/(1 - nu) with nu = 1/3 in plane stress, and 2 along a line.
STIFFNESS = {"plane stress": 6.0, "line": 2.0}
FIELDS = ("principal_stress", "wrinkle_level")
MICROMODULI = ("published", "corrected")


@dataclass(frozen=True)
class BondBased:
    """Bond-based peridynamics: f = c s n, with one micro-modulus c per point, computed from its family (IM eq. 4).

    In plane stress Poisson's ratio is 1/3, as in all bond-based laws. A bond uses the mean micro-modulus of its two
    points, so forces are pairwise and have an energy, which Newton's method needs. (The paper does not say to which
    point c belongs; its stiffness is symmetric only if both ends have the same c.) Under uniform isotropic strain the
    energy is exact at every point, including edges. Under other strains it is that of the lattice, and the edges are
    too stiff: see tests/papers/test_bond_based.py. Corrected micro-moduli balance every uniform strain up to the edges
    of a rectangle: see weights/micromoduli.py.

    An undeformed sheet has only in-plane stiffness. In plane problems, hold all out-of-plane displacements:
    `Fixed(range(sheet.size), "z")`.

    Attributes:
        material: A pairwise material, such as Bimodular.
        horizon: Horizon in spacings of the sheet [-], at least 1.
        state: "plane stress", or "line" for a sheet of one row of points.
        micromoduli: "published" (IM eq. 4), or "corrected" on an uncut rectangle of one material and thickness.
        fast: Whether to compute each lattice bond only once on a CPU; False uses the reference kernel.
    """

    material: PairwiseMaterial
    horizon: float = 3.0
    state: str = "plane stress"
    micromoduli: str = "published"
    fast: bool = True

    weights: ClassVar[str] = "pairwise"
    has_energy: ClassVar[bool] = True
    has_tangent: ClassVar[bool] = True

    def __post_init__(self) -> None:
        positive("horizon", self.horizon)
        one_of("state", self.state, STIFFNESS)
        one_of("micromoduli", self.micromoduli, MICROMODULI)
        check_material(self.material, "pairwise")

    def build(self, context: Context) -> BuiltLaw:
        """Build the law. Raises InputError if the sheet does not fit `state` or does not allow the horizon."""
        return BondBasedForce(self, context)


class BondBasedForce(FamilyLaw):
    """The law on one sheet and device."""

    weights = "pairwise"
    has_energy = True
    takes_curved = True
    has_own_density = True
    offered_fields = FIELDS

    def __init__(self, law: BondBased, context: Context) -> None:
        sheet, self.law = whole_sheet(law, context), law
        line = sheet.lattice is not None and sheet.lattice.rows == 1
        if line != (law.state == "line"):
            raise InputError(
                f"state = {law.state!r} on a sheet {'of one row of points' if line else 'in the plane'}: "
                f"expected {'line' if line else 'plane stress'!r}"
            )
        families = build_families(sheet, law.horizon, "inverse", intersections=False)
        weights = _bond_weights(families, STIFFNESS[law.state])
        if law.micromoduli == "corrected":
            weights = _corrected(families, sheet, weights)
        weights = families.scaled(weights)
        super().__init__(law, context, families, None, weights)
        breakable = context.layout.breakable
        self.kernels = bond_based(context.layout, law.material.pairwise, context.sheet.stiffness is not None)
        self.earlier_energy = self.kernels.earlier_energy
        self._inner = inner_directions(context, self.owner, families, weights)
        # Weights are W_ik = (g/2) times the area that a bond represents.
        self._areas = 2.0 / STIFFNESS[law.state] * self._summed(weights)
        # Gershgorin's bound: the fictitious mass is twice the row sum of the bonds' stiffness, of the stiffer sign.
        self.slack_frequency = None if capabilities(law.material).one_modulus else 1.0
        self.once: BondsOnce | None = None
        self._screened: Stage | None = None
        # On a GPU the bytes of the forces would cost more than bonds that are computed twice.
        if law.fast and context.layout.kind == "lattice" and not context.device.is_cuda:
            members = families.members
            pull = pull_of_bond(context.layout, law.material.pairwise)
            self.once = bonds_once(context.bits, members, breakable, pull)
        self._shown: dict[str, Array] = {}

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of a phase; at frames also those of the requested fields."""
        super().add(phase, stage)
        if phase is Phase.FRAME:
            self._add_field(stage, self.kernels.density, self.own_density)
            for name, array in self._shown.items():
                if name == "principal_stress":
                    self._add_field(stage, self.kernels.principal_stress, array)
                else:
                    stage.launch(
                        self.owner, self.kernels.wrinkle_level, self.points, family=self.struct,
                        displacement=self.context.state.displacement, out=array,
                    )  # fmt: skip

    def _add_field(self, stage: Stage, kernel: Kernel, out: Array) -> None:
        """Add the launch of a field that is exact in uniform states up to the edges."""
        self.add_launch(
            stage, kernel, self.context.state.displacement, unit=0.5 * STIFFNESS[self.law.state],
            factors=factors(self.context), directions=self._inner.directions, shares=self._inner.shares, out=out,
        )  # fmt: skip

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the internal force [N] at a displacement [m], both (N,) vec3."""
        if self.once is not None:
            if self._screened is not stage:
                stage.launch(self.owner, self.once.forces_ahead, self.points, **self._forces_once(displacement))
            stage.launch(
                self.owner, self.once.sum_both_halves, self.points, **self._tables(), intact=self.intact,
                ahead=self._ahead, unit_force=self.unit_force, force=out,
            )  # fmt: skip
            return
        self.add_launch(stage, self.kernels.pair_force, displacement, unit_force=self.unit_force, force=out)

    @functools.cached_property
    def _ahead(self) -> Array:
        """Force of each bond to a later point [N], (N, members / 2) vec3, allocated on first use."""
        shape = (self.points, self.families.members // 2)
        return self.context.array("forces_ahead", self.owner, self.context.types.vec3, shape=shape)

    def _tables(self) -> dict[str, Any]:
        """Arguments common to the kernels that compute each bond once."""
        s = self.struct
        return {"shift": s.stencil_shift, "family_class": s.family_class, "initial": s.class_initial}

    def _forces_once(self, displacement: Array) -> dict[str, Any]:
        """Arguments of the kernels that fill `_ahead`."""
        s = self.struct
        return {
            **self._tables(), "bond": s.stencil_bond, "weight": s.class_weight, "intact": self.intact,
            "displacement": displacement, "constants": self.constants, "inverse_horizon": self.inverse_horizon,
            "ahead": self._ahead,
        }  # fmt: skip

    def screen_with_force(self, stage: Stage, squared_stretch: float, exceeding: Array) -> bool:
        """Add the launch that computes each bond force once and flags blocks in which bonds may break.

        It runs before bonds break; the later sum of the forces skips bonds that broke in between. Arguments and result
        are those of `BuiltLaw.screen_with_force`.
        """
        if self.once is None or self.once.forces_and_screen is None:
            return False
        self._screened = stage
        stage.launch(
            self.owner, self.once.forces_and_screen, len(exceeding),
            **self._forces_once(self.context.state.displacement), nearly=NEARLY * squared_stretch, exceeding=exceeding,
        )  # fmt: skip
        return True

    def represented_areas(self) -> np.ndarray:
        """Area represented by the bonds of each point of the undamaged sheet [m^2], shape (N,)."""
        return self._areas

    @property
    def force_path(self) -> str:
        """Description of the force path: bonds computed once, or from both ends."""
        return "reference" if self.once is None else "each bond once"

    def request_fields(self, names: Sequence[str]) -> None:
        """Add point fields to the frames.

        Args:
            names: "principal_stress": largest and smallest principal virial stress [Pa] and the angle of the
                largest to the x axis [rad], (N,) vec3; "wrinkle_level": fraction of compressed bonds [-], (N,); or a
                field of all laws, see laws/point_fields.py.

        Raises:
            InputError: for any other name, or the principal stress of a curved sheet.
        """
        super().request_fields(names)
        for name in (name for name in FIELDS if name in names):
            if name == "principal_stress" and self.families.frames is not None:
                raise InputError("fields: 'principal_stress': expected a flat sheet, got a curved one")
            dtype = self.context.types.vec3 if name == "principal_stress" else wp.float32
            self._shown[name] = self.context.array(name, self.owner, dtype, shape=self.points, output=name)


def _bond_weights(families: Families, stiffness: float) -> np.ndarray:
    """W_ik = (g/2) a_i a_k |xi_ik| / sum_k |xi_ik| a_k by row, areas divided by the reference area, shape (R, n)."""
    length = np.where(families.exists, families.lengths, 0.0)
    moment = length * families.member_areas
    return np.asarray(0.5 * stiffness * families.areas[:, None] * moment / moment.sum(axis=1, keepdims=True))


def _corrected(families: Families, sheet: Sheet, published: np.ndarray) -> np.ndarray:
    """Weights from corrected micro-moduli, in the format of `_bond_weights`.

    Raises:
        InputError: unless the sheet is an uncut rectangle of uniform material and thickness with at least four rows and
            columns.
    """
    from .micromoduli import balanced_micromoduli

    lattice = sheet.lattice
    if lattice is None or sheet.cuts or sheet.factors is not None or min(lattice.rows, lattice.columns) < 4:
        raise InputError(
            "micromoduli = 'corrected': expected an uncut rectangle of uniform material and thickness with at least "
            "4 x 4 points"
        )
    assert families.steps is not None and families.family_class is not None
    shape = (lattice.rows, lattice.columns)
    cell = lattice.dx * lattice.dy / families.reference_area
    return cell * balanced_micromoduli(
        published / cell, families.family_class.reshape(shape), sheet.areas.reshape(shape) / (lattice.dx * lattice.dy),
        offsets=families.steps, reverse=families.reverses, dx=lattice.dx, dy=lattice.dy,
        stiffness=STIFFNESS["plane stress"],
    )  # fmt: skip


@tangent_of.register
def _(law: BondBasedForce, context: Context, geometric: bool) -> Tangent:
    return BondBasedTangent(law, law.law.material, context, geometric)


@fictitious_mass.register(BondBasedForce)
def _(law: BondBasedForce, stage: Stage) -> Array:
    least = 1e-3 * (max(law.law.material.constants) * law.thickness)
    return add_row_sums(law, stage, law.kernels.row_sums, least)
