"""Base class of force laws on families."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, show
from ..device.fields import Array
from ..device.launches import Stage
from ..families import Families, notes_on_folds, pack
from ..geometry.sheet import Sheet
from ..interfaces import BuiltLaw, Columns, History, Law
from ..kernels.effects import Kernel
from ..kernels.family_sums import energy_of_families, gather_pairs, represented_volumes
from ..materials import Material, capabilities, padded_constants
from ..step import Phase
from .point_fields import GROUPS, ShownFields, factors, grouped, offered, refuse_other
from .weight_tables import family_struct, notes_on_areas, notes_on_balance

DENSITY = "strain_energy_density"


def require_one_material(sheet: Sheet, what: str) -> None:
    """Check that a sheet has uniform material and thickness, for features (`what`) that need it."""
    if sheet.stiffness is not None:
        raise InputError(f"sheet.stiffness: expected a uniform sheet with {what}")
    if sheet.factors is not None:
        raise InputError(f"sheet.thickness = {show(sheet.thickness)}: expected one number with {what}")


def refuse_partition(law: Law) -> None:
    """Raise the error for a law that does not support several processes."""
    raise InputError(
        f"force = {type(law).__name__}: not supported on several processes; expected BondAssociated or Visco"
    )


def whole_sheet(law: Law, context: Context) -> Sheet:
    """The sheet, for laws that need the whole sheet in one process.

    Raises:
        InputError: if the sheet is divided among several processes.
    """
    if context.partition is not None:
        refuse_partition(law)
    return context.sheet


class FamilyLaw(BuiltLaw):
    """A law on one sheet and device: its families, the intact bonds, its constants.

    Attributes:
        owner: Name of the law in the plan.
        context: Context with the arrays and stages.
        depends_on_time: Whether the force depends on more than the current displacement.
        thickness: Mean thickness of the sheet [m]; a varying thickness is included in the weights.
        unit_volume: Thickness times the reference area [m^3], the unit of energies divided by a stress.
        unit_force: The same over the horizon [m^2], that of forces.
        unit_stiffness: The same over the squared horizon [m], that of stiffnesses.
        offered_fields: Additional point fields that the law offers for frames, besides those of all laws.
        represented: Warp function of the area that the intact bonds of a family represent, see
            kernels/family_sums.py; None if it is the area of the point whatever breaks.
        has_own_density: Whether the law fills `own_density`; otherwise it is the energy over that area.
        shown_stress: Material for the stress fields of frames, or None if the law has none.
        shown: Point fields requested for frames, or None.
        damage: Damage of the points that softens their families, (N,), or None.
        takes_curved: Whether the law supports curved sheets.
        takes_graded: Whether it supports sheets of graded spacing.
        takes_tension_field: Whether its material may be a TensionField.
        takes_regions: Whether its material may be a ByRegion or have values by point.
        divides: Whether it supports several processes.
    """

    owner: str
    correction: dict[str, float] | None = None
    earlier_energy: wp.Function | None = None
    driving_energy: wp.Function | None = None
    partial_energy: wp.Function | None = None
    needs_finest: str = "force: expected BondAssociated"
    slack_frequency: float | None = None
    slack_force: float = 0.0
    depends_on_time: bool = False
    offered_fields: Sequence[str] = ()
    represented: wp.Function | None = None
    has_own_density: bool = False
    shown_stress: Material | None = None
    shown: ShownFields | None = None
    damage: Array | None = None
    near_damage: Array | None = None
    takes_curved: bool = False
    takes_graded: bool = False
    takes_tension_field: bool = False
    takes_regions: bool = False
    point_values: Array | None = None
    divides: bool = False

    def __init__(
        self,
        law: Law,
        context: Context,
        families: Families,
        inverse: np.ndarray | None,
        weights: np.ndarray,
    ) -> None:
        """Copy the families, K^-1 (R, n, 3) unless None, and weights (R, n) by row to the device.

        Raises:
            InputError: for a curved or graded sheet that the law does not support.
        """
        self.owner = type(law).__name__
        for given, taken, expected in (
            (context.sheet.frames, self.takes_curved, "BondAssociated, Visco or BondBased on a curved sheet"),
            (context.sheet.spacings, self.takes_graded, "BondAssociated or Visco on a sheet of graded spacing"),
        ):
            if given is not None and not taken:
                raise InputError(f"force = {self.owner}: expected {expected}")
        if context.partition is not None and not self.divides:
            refuse_partition(law)
        self.label, self.context, self.families = f"force = {self.owner}", context, families
        self.horizon_ratio = law.horizon
        self.struct = family_struct(families, context, self.owner, inverse, weights)
        self.intact: Array | None = None
        if context.layout.breakable:
            bits = families.rows_of_points(pack(families.exists)).T
            self.intact = context.array("intact_bonds", "rupture", wp.uint32, bits, per="bond", restart=True, halo=True)
            self.struct.intact = self.intact
        self.thickness = context.whole.mean_thickness
        self.points = context.sheet.size
        known = capabilities(law.material)
        varies = {"by_point": known.by_point, "remembers": known.remembers, "regions (ByRegion)": known.regions or None}
        for name in [name for name, value in varies.items() if value is not None and not self.takes_regions]:
            raise InputError(f"force = {self.owner}: expected a material without {name}, or the force BondAssociated")
        self.lock, self.goes_slack, self._notes = known.lock, known.goes_slack, known.notes
        self.slack_stiffness = known.slack_stiffness
        constants = padded_constants(law.material)
        self.constants = context.types.constants(len(constants))(*constants)
        self.inverse_horizon = 1.0 / families.horizon
        self.unit_volume = self.thickness * families.reference_area
        self.unit_force = self.unit_volume * self.inverse_horizon
        self.unit_stiffness = self.unit_volume * self.inverse_horizon**2

    @property
    def energy_constants(self) -> Any:
        """What its `earlier_energy` takes as constants."""
        return self.constants

    @functools.cached_property
    def pairs(self) -> Array:
        """Force of each family on its pairs [N], (members, N) vec3, allocated on first use."""
        shape = (self.families.members, self.points)
        return self.context.array(
            "bond_force", self.owner, self.context.types.vec3, shape=shape, per="bond", intermediate=True
        )

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes of the material on its constants, on unbalanced points of corrected weights, on areas and on folds."""
        whole = self.context.whole
        balance = notes_on_balance(self.correction, whole, self.horizon_ratio)
        areas = notes_on_areas(self.weights, whole)
        folds = [] if whole.frames is None else notes_on_folds(whole)
        return [*self._notes, *balance, *areas, *folds]

    @functools.cached_property
    def strain_energy(self) -> Array | None:
        """Energy of each family at the last frame [J], (N,) float64; None for a law without an energy."""
        if not self.has_energy:
            return None
        own = self.has_own_density
        return self.context.array(
            "strain_energy", self.owner, wp.float64, shape=self.points, output="" if own else DENSITY,
            volume=None if own else self._represented_volume,
        )  # fmt: skip

    @functools.cached_property
    def own_density(self) -> Array:
        """Strain energy density at the last frame [J/m^3], (N,) float64, of a law that has its own."""
        return self.context.array(DENSITY, self.owner, wp.float64, shape=self.points, output=DENSITY)

    @functools.cached_property
    def _represented_volume(self) -> Array | np.ndarray:
        """Volume that the intact bonds of each family represent at the last frame [m^3], (N,) float64.

        On the host where it stays as it is and one process has the whole sheet.
        """
        volumes = np.asarray(self.represented_areas() * self.context.sheet.thickness, float)
        if (self.intact is None or self.represented is None) and self.context.partition is None:
            return volumes
        return self.context.array("represented_volume", self.owner, wp.float64, volumes)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of the internal force in a step, and of the strain energy at frames."""
        state = self.context.state
        if phase is Phase.INTERNAL_FORCE:
            self.add_force(stage, state.displacement, state.force)
        elif phase is Phase.FRAME and self.strain_energy is not None:
            self.add_energy(stage, state.displacement, self.strain_energy)
            self._add_softened(stage, self.strain_energy)
            if self.intact is not None and self.represented is not None:
                stiffness = factors(self.context)
                kernel = represented_volumes(self.context.layout, self.represented, stiffness is not None)
                stage.launch(
                    self.owner, kernel, self.points, family=self.struct, displacement=state.displacement,
                    unit_volume=self.unit_volume, stiffness=stiffness,
                    out=self._represented_volume,
                )  # fmt: skip
        if phase is Phase.FRAME and self.shown is not None:
            self.add_shown(stage, self.shown)
            for stress in self.shown.stresses():
                self._add_softened(stage, stress)

    def _add_softened(self, stage: Stage, values: Array) -> None:
        """Add the launch that reduces a value of each family by the damage of its point, if there is a damage field."""
        if self.damage is not None:
            from ..kernels.rupture import soften

            kernel = soften(self.context.bits, values.dtype)
            stage.launch(self.owner, kernel, self.points, damage=self.damage, values=values)

    def add_shown(self, stage: Stage, shown: ShownFields) -> None:
        """Add the launches that fill the point fields shown in frames, by default from each family's gradient."""
        shown.add_principal(stage, shown.of_family(self.shown_stress))
        shown.add_counts(stage)

    def columns(self) -> Columns:
        """The strain energy."""
        return Columns(stored={} if self.strain_energy is None else {"strain": self.strain_energy})

    def add_launch(self, stage: Stage, kernel: Kernel, displacement: Array, **more: Any) -> None:
        """Add a launch on all points, with the arguments common to all kernels of the law."""
        given = {"family": self.struct, "displacement": displacement, "constants": self.constants, **more}
        stage.launch(self.owner, kernel, self.points, **given)

    def add_gather(self, stage: Stage, bond_force: Array, force: Array, softens: bool = True) -> None:
        """Add the pointwise stage that sums the pairs of each point [N], (members, N), to its force [N].

        `softens`: the damage of points reduces the force of their families here.
        """
        stage.pointwise(
            self.owner, gather_pairs(self.context.layout, softens), self.points, family=self.struct,
            bond_force=bond_force, damage=self.damage, force=force,
        )  # fmt: skip

    def soften(self, damage: Array, near: Array) -> None:
        """Reduce the stiffness of each family by the damage of its point, (N,); see kernels/tearing/damage_field.py.

        Raises:
            InputError: by default, because the law has no energy to reduce.
        """
        raise InputError(f"damage = TearingEnergy: expected BondAssociated, Visco, Nodal or Neural, got {self.owner}")

    def represented_areas(self) -> np.ndarray:
        """Area represented by the bonds of each point of the undamaged sheet [m^2], shape (N,)."""
        return self.context.sheet.areas

    def _summed(self, weights: np.ndarray) -> np.ndarray:
        """Sum of the weights of each point [m^2], shape (N,), without factors on the energy, from those by row."""
        areas = self.families.rows_of_points(weights.sum(axis=1)) * self.families.reference_area
        scaled = self.families.factors
        return np.asarray(areas if scaled is None else areas / self.families.rows_of_points(scaled))

    def add_energy(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launch that fills `out`, (N,) float64, with the energy of each family [J]."""
        assert self.earlier_energy is not None
        kernel, constants = energy_of_families(self.context.layout, self.earlier_energy), self.energy_constants
        self.add_launch(stage, kernel, displacement, constants=constants, unit_volume=self.unit_volume, out=out)

    def bond_force(self) -> Array:
        """Force of each family on its pairs [N], (members, N) vec3. Raises InputError if the law does not store it."""
        raise InputError(
            f"damage = CriticalEnergy with {self.owner}: expected Visco, ViscoBondBased, Nodal, Neural, or "
            f"BondAssociated with fast = False and weights that conserve energy"
        )

    def energy_density(self, stretch: np.ndarray, across: Any = 1.0) -> np.ndarray:
        """Energy density [J/m^3] at a stretch and a transverse stretch, by default 1 (pure shear).

        Raises:
            InputError: if the law has none.
        """
        raise InputError(f"damage = TearingEnergy: expected BondAssociated, Visco, Nodal or Neural, got {self.owner}")

    def fingerprint(self) -> str:
        """A hash of some values of the influence function."""
        families = self.families
        influence = families.influence
        if influence.ndim == 2 and families.family_class is not None:
            influence = influence[families.family_class[:64]]
        return hashlib.sha1(np.ascontiguousarray(influence[:64]).tobytes()).hexdigest()[:12]

    def request_fields(self, names: Sequence[str]) -> None:
        """Add fields of the law to the frames, see laws/point_fields.py.

        Raises:
            InputError: for names that the law does not offer.
        """
        wanted = grouped(names)
        shown = [stored.field.output for stored in self.context.fields.shown()]
        refuse_other(wanted, self.field_names(), self.owner, shown)
        wanted = [name for name in wanted if name not in self.offered_fields and not set(GROUPS[name]) <= set(shown)]
        if wanted:
            self.shown = ShownFields(self.context, self, wanted)

    def field_names(self) -> tuple[str, ...]:
        """Names of all fields that the law offers."""
        return (*self.offered_fields, *offered(self.context, self.shown_stress))

    def likely_cause(self, safety: float) -> str:
        """The likely cause if a run diverged, and a safety of the step to try."""
        if self.lock is not None:
            return f"the Gent lock Jm = {self.lock:g} was reached, or the sheet stiffened faster than the step shrank"
        if not self.has_energy:
            return "the law has no potential and can add energy; try damping or the law bond_associated"
        stiffened, smaller = "the sheet stiffened faster than the step was reduced", f"a safety of {safety:.2g}"
        if self.intact is None:
            return f"{stiffened}; try {smaller}"
        if self.takes_tension_field and not self.goes_slack:
            # Torn edges collapse in plane where a real sheet wrinkles: within steps, their stiffness rises many times.
            return f"{stiffened}, as compressed torn edges do; try a TensionField material or {smaller}"
        return f"{stiffened}, as torn edges do; try {smaller}"
