"""The bond-based force law, whose forces along the bonds follow a pairwise law of the bond strain, and its material."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, not_negative, one_of, positive
from ..device.fields import Array
from ..device.launches import Stage
from ..families import Families, build_families
from ..geometry.sheet import Sheet
from ..interfaces import BuiltLaw
from ..kernels.effects import Kernel
from ..kernels.papers.bond_based import bond_based, pull_of_bond
from ..kernels.papers.bonds_once import bonds_once
from ..kernels.rupture import NEARLY, SCREENED
from ..laws.family_law import whole_sheet
from ..laws.point_fields import factors
from ..materials import PairwiseMaterial, capabilities, check_material
from ..statics.tangent import Tangent, tangent_of
from ..step import Phase
from .bond_based_tangent import BondBasedTangent
from .bond_law import BondForces
from .inner_directions import inner_directions

if TYPE_CHECKING:
    from ..kernels.numeric import PairwiseFactory

# g of c_i = g E / sum_j |X_ij| V_j (IM eq. 4): 4/(1 - nu) with nu = 1/3 in plane stress, and 2 along a line.
STIFFNESS = {"plane stress": 6.0, "line": 2.0}
FIELDS = ("principal_stress", "wrinkle_level")
MICROMODULI = ("published", "corrected")


@dataclass(frozen=True)
class Bimodular:
    """Pairwise material with different moduli for stretched and compressed bonds. Source: IM, section 4.

    A compressive modulus of zero models a wrinkling membrane.

    Attributes:
        tension: Young's modulus E+ of stretched bonds [Pa].
        compression: Young's modulus E- of compressed bonds [Pa], at least 0; by default E+.

    Raises:
        InputError: if E+ is not positive, or E- is negative.
    """

    tension: float
    compression: float | None = None

    def __post_init__(self) -> None:
        positive("tension", self.tension)
        if self.compression is not None:
            not_negative("compression", self.compression)

    @property
    def constants(self) -> tuple[float, ...]:
        """(E+, E-)."""
        return (self.tension, self.tension if self.compression is None else self.compression)

    @property
    def shear_modulus(self) -> float:
        """That of an incompressible material in tension, E+ / 3 [Pa]."""
        return self.tension / 3.0

    @property
    def goes_slack(self) -> bool:
        """Whether compressed bonds carry no force."""
        return self.compression == 0.0

    @property
    def one_modulus(self) -> bool:
        """Whether compressed bonds are as stiff as stretched ones."""
        return self.compression is None or self.compression == self.tension

    @property
    def pairwise(self) -> PairwiseFactory:
        """See `kernels.papers.bond_based.bimodular`."""
        from ..kernels.papers.bond_based import bimodular

        return bimodular


@dataclass(frozen=True)
class BondBased:
    """Bond-based peridynamics: f = c s n, with one micro-modulus c per point, computed from its family (IM eq. 4).

    In plane stress Poisson's ratio is 1/3, as in all bond-based laws. A bond uses the mean micro-modulus of its two
    points, so forces are pairwise and have an energy, which Newton's method needs. (The paper does not say to which
    point c belongs; its stiffness is symmetric only if both ends have the same c.) Under uniform isotropic strain the
    energy is exact at every point, including edges. Under other strains it is that of the lattice, and the edges are
    too stiff: see tests/papers/test_bond_based.py. Corrected micro-moduli balance every uniform strain up to the edges
    of a rectangle: see papers/micromoduli.py.

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


class BondBasedForce(BondForces):
    """The law on one sheet and device."""

    weights = "pairwise"
    takes_curved = True
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
        pairwise, stiffened = law.material.pairwise, context.sheet.stiffness is not None
        bonds, self._fields = bond_based(context.layout, pairwise, stiffened)
        super().__init__(law, context, families, None, weights, bonds)
        inner = inner_directions(context, self.owner, families, weights)
        self.density_arguments = {
            "unit": 0.5 * STIFFNESS[law.state], "factors": factors(context),
            "directions": inner.directions, "shares": inner.shares,
        }  # fmt: skip
        # Weights are W_ik = (g/2) times the area that a bond represents.
        self._areas = 2.0 / STIFFNESS[law.state] * self._summed(weights)
        # Gershgorin's bound: the fictitious mass is twice the row sum of the bonds' stiffness, of the stiffer sign.
        self.slack_frequency = None if capabilities(law.material).one_modulus else 1.0
        self.least_modulus = max(law.material.constants)
        self.once: tuple[Kernel, Kernel] | None = None
        self._screened: Stage | None = None
        # On a GPU the bytes of the forces would cost more than bonds that are computed twice.
        if law.fast and context.layout.kind == "lattice" and not context.device.is_cuda:
            pull = pull_of_bond(context.layout, pairwise)
            self.once = bonds_once(context.bits, families.members, context.layout.breakable, pull)
        self._shown: dict[str, Array] = {}

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of a phase; at frames also those of the requested fields."""
        super().add(phase, stage)
        for name, array in self._shown.items() if phase is Phase.FRAME else ():
            given = {"family": self.struct, "displacement": self.context.state.displacement, "out": array}
            if name == "principal_stress":
                given |= {"constants": self.constants, **self.density_arguments}
            stage.launch(self.owner, self._fields[name], self.points, **given)

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the internal force [N] at a displacement [m], both (N,) vec3."""
        if self.once is None:
            super().add_force(stage, displacement, out)
            return
        if self._screened is not stage:
            self._add_forces_ahead(stage, displacement)
        stage.launch(self.owner, self.once[1], self.points, **self._tables(), unit_force=self.unit_force, force=out)

    @functools.cached_property
    def _ahead(self) -> Array:
        """Force of each bond to a later point [N], (N, members / 2) vec3, allocated on first use."""
        shape = (self.points, self.families.members // 2)
        return self.context.array("forces_ahead", self.owner, self.context.types.vec3, shape=shape)

    def _tables(self) -> dict[str, Any]:
        """Arguments common to the kernels that compute each bond once."""
        s = self.struct
        return {
            "shift": s.stencil_shift, "family_class": s.family_class, "initial": s.class_initial,
            "intact": self.intact, "ahead": self._ahead,
        }  # fmt: skip

    def _add_forces_ahead(
        self, stage: Stage, displacement: Array, nearly: float = 1.0, exceeding: Array | None = None
    ) -> None:
        """Add the launch that fills `_ahead`, and flags blocks with a squared stretch above `nearly` in `exceeding`."""
        assert self.once is not None
        stage.launch(
            self.owner, self.once[0], -(-self.points // SCREENED), **self._tables(), bond=self.struct.stencil_bond,
            weight=self.struct.class_weight, displacement=displacement, constants=self.constants,
            inverse_horizon=self.inverse_horizon, nearly=nearly, exceeding=exceeding,
        )  # fmt: skip

    def screen_with_force(self, stage: Stage, squared_stretch: float, exceeding: Array) -> bool:
        """Add the launch that computes each bond force once and flags blocks in which bonds may break.

        It runs before bonds break; the later sum of the forces skips bonds that broke in between. Arguments and result
        are those of `BuiltLaw.screen_with_force`.
        """
        if self.once is None:
            return False
        self._screened = stage
        self._add_forces_ahead(stage, self.context.state.displacement, NEARLY * squared_stretch, exceeding)
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
