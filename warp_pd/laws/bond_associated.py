"""The bond-associated correspondence law, as published and in its variational form."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from ..device.checks import InputError, one_of, positive
from ..device.fields import Array
from ..device.launches import Stage
from ..families import InfluenceFunction, influence_function
from ..interfaces import BondBreaking, BuiltLaw, Tangent
from ..interfaces.context import Context
from ..kernels.bond_associated import bond_associated
from ..kernels.effects import Kernel
from ..kernels.reference_force import reference_force
from ..kernels.relaxation import row_sums
from ..materials import Material, capabilities, check_material, energy_density
from .bond_associated_tangent import BondAssociatedTangent
from .family_law import FamilyLaw, require_one_material
from .fast_path import fast_path, has_blocks
from .point_fields import ShownFields, factors
from .variational import FastForce, Key
from .weight_tables import MAX_CORRECTED, law_tables

WEIGHTS = ("auto", "published", "plain", "corrected")
BROKEN = ("redistribute", "drop")
NO_PRONY = {"prony": None, "strain": None, "overstress": None}


@dataclass(frozen=True)
class BondAssociated:
    """Bond-associated correspondence: one deformation gradient and one stress per bond.

    Attributes:
        material: Any hyperelastic material.
        horizon: Horizon in spacings of the sheet [-].
        weights: How the area of a point is distributed over its bonds:
            "published": not at all; the force of a bond comes from its own stress alone, with volume
                fractions (BA eqs. 38 and 43). It has no energy and misses uniform stress by about 1 %.
            "plain": in proportion to |D_ij|; conserves energy, exact for uniform stress inside the sheet.
            "corrected": the nearest weights for which uniform stress is in equilibrium also at the edges.
            "auto": "plain" if bonds can break or at horizons above 4.5, "corrected" otherwise; on graded sheets,
                where plain weights are out of balance, also if bonds can break.
            With rupture, "corrected" applies as long as the family of a point is undamaged; `broken` sets the
            weights of a damaged family.
        influence: Influence function of r = |X| / horizon: "linear" 1 - r, "inverse" 1/r, "inverse_square"
            1/r^2, or a function of an array.
        broken: What happens to the area of broken bonds. "drop" removes it: the stable step does not decrease
            when bonds break. "redistribute" gives it to the intact bonds of the point: the opening of a crack is
            less overestimated (7.0 against 8.6 % above the exact opening, 12 spacings half length, horizon 3.15),
            but the step is up to a third shorter, and breaking can add energy: the energy of a torn strip always
            balanced within 1 % at a `safety` of 0.02, at 0.05 and 0.1 not always.
        fast: Whether the force uses the fast kernels where available; they agree with the reference kernels to
            round-off. The reference kernels are there to be read and compared with.
    """

    material: Material
    horizon: float = 2.015
    weights: str = "auto"
    influence: str | InfluenceFunction = "linear"
    broken: str = "drop"
    fast: bool = True

    has_tangent: ClassVar[bool] = True

    @property
    def softens(self) -> bool:
        """Whether its bonds can lose their weight gradually."""
        return self.form == "variational" and self.broken == "drop"

    @property
    def compact(self) -> str:
        """Name of the influence function, "table" if it has none, if the law has fast kernels for a cloud on a GPU."""
        if not has_blocks(self):
            return ""
        return self.influence if isinstance(self.influence, str) else "table"

    def __post_init__(self) -> None:
        positive("horizon", self.horizon)
        one_of("weights", self.weights, WEIGHTS)
        one_of("broken", self.broken, BROKEN)
        one_of("fast", self.fast, (True, False))
        influence_function(self.influence)
        check_material(self.material, "functions")

    def resolved_weights(self, breakable: bool, graded: bool = False) -> str:
        """The weights with "auto" resolved.

        Args:
            breakable: Whether bonds can break.
            graded: Whether the spacing of the sheet varies.
        """
        if self.weights != "auto":
            return self.weights
        return "plain" if (breakable and not graded) or self.horizon > MAX_CORRECTED else "corrected"

    @property
    def form(self) -> str:
        """Form of the kernels: "published" or "variational"."""
        return "published" if self.weights == "published" else "variational"

    def build(self, context: Context) -> BuiltLaw:
        """Families and tables on the device.

        Raises:
            InputError: for a horizon that the sheet or the weights do not allow.
        """
        return BondAssociatedForce(self, context)


class BondAssociatedForce(FamilyLaw):
    """The law on one sheet and device.

    Attributes:
        weights: The weights in use, "published", "plain" or "corrected".
        key: Everything that decides its kernels: layout, precision, material functions, `broken` or None, form.
        fast_path: Its fast kernels, or None.
    """

    has_energy = True
    coarsens = True
    takes_curved = True
    takes_graded = True
    takes_tension_field = True
    divides = True

    def __init__(self, law: BondAssociated, context: Context) -> None:
        breakable, sheet = context.features.breakable, context.sheet
        self.law, self.weights = law, law.resolved_weights(breakable, sheet.spacings is not None)
        self.material, self.fast = law.material, law.fast
        self.shown_stress = law.material
        broken = law.broken if breakable else None
        if self.weights == "published" and context.partition is not None:
            raise InputError("weights = 'published': several processes cannot yet run them; expected 'plain'")
        if self.weights == "published" or broken == "redistribute":
            # Their kernels compute the weights themselves.
            require_one_material(sheet, f"weights {self.weights!r} and broken {law.broken!r}")
        families, inverse, weights, self.correction = law_tables(context, law.horizon, law.influence, self.weights)
        super().__init__(law, context, families, inverse, weights)
        self.lattice_columns = sheet.lattice.columns if sheet.lattice is not None else 0
        self.key: Key = (context.layout, context.bits, law.material.functions, broken, law.form)
        self.kernels = bond_associated(*self.key, context.module)
        self.earlier_energy = self.kernels.earlier_energy
        self._breaking: BondBreaking | None = None
        self.fast_path: FastForce | None = self.fast_kernels(inverse, weights)

    def fast_kernels(self, inverse: np.ndarray, weights: np.ndarray) -> FastForce | None:
        """The fast kernels, from K^-1 and weights by row, or None."""
        return fast_path(self, inverse, weights)

    @functools.cached_property
    def pairs(self) -> Array:
        """Array of `bond_force`, allocated on first use."""
        shape = (self.families.members, self.points)
        return self.context.array(
            "bond_force", self.owner, self.context.types.vec3, shape=shape, per="bond"
        )  # fmt: skip

    def bond_force(self) -> Array:
        """Force of the family of a point on each of its pairs [N], (members, N) vec3.

        Raises:
            InputError: with the fast kernels, which store only parts of it, or published weights, which have no energy.
        """
        if self.fast or self.weights == "published":
            return super().bond_force()
        return self.pairs

    def break_with_force(self, breaking: BondBreaking) -> bool:
        """Whether the kernels of the force break bonds.

        They do not where the energy is tracked: several processes have a launch of its own for it, and the same bits.
        """
        features = self.context.features
        able = self.context.partition is None and not features.gradual and not features.tracked
        found = able and self.fast_path is not None and self.fast_path.breaks_bonds(breaking)
        if found:
            self._breaking = breaking
        return found

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the internal force [N] at a displacement [m], both (N,) vec3."""
        if self.fast_path is not None:
            self.fast_path.add_force(stage, displacement, out, self._breaking)
            return
        self.add_reference_force(stage, displacement)
        self.add_gather(stage, self.kernels.gather, self.pairs, out)

    def add_reference_force(self, stage: Stage, displacement: Array) -> None:
        """Add the launch that fills `pairs`."""
        kernel = reference_force(*self.key, self.context.module)
        stage.launch(
            self.owner, kernel, self.points, **self.family_arguments(displacement), constants=self.constants,
            unit_force=self.unit_volume * self.inverse_horizon, bond_force=self.pairs,
        )  # fmt: skip

    def add_energy(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launch that fills `out`, (N,) float64, with the energy of each family [J]."""
        if self.fast_path is not None:
            self.fast_path.add_energy(stage, displacement, out)
        else:
            self.add_reference_energy(stage, displacement, out)

    def add_reference_energy(self, stage: Stage, displacement: Array, out: Array) -> None:
        """The same with the reference kernel."""
        super().add_energy(stage, displacement, out)

    def energy_kernel(self) -> Kernel:
        """Kernel of the energy of each family."""
        return self.kernels.strain_energy

    def add_shown(self, stage: Stage, shown: ShownFields) -> None:
        """Add the launches that fill the fields of frames, means over the bonds of a point."""
        kernel = shown.of_bonds(self.key, self.material, bool(self.shown_internal))
        shown.add_principal(stage, kernel, factors=factors(self.context), **{**NO_PRONY, **self.shown_internal})
        shown.add_counts(stage)

    @property
    def shown_internal(self) -> dict[str, Any]:
        """Internal variables that the stress depends on, for the fields of frames."""
        return {}

    def energy_density(self, stretch: np.ndarray) -> np.ndarray:
        """Energy density of the material in pure shear [J/m^3]."""
        return energy_density(self.material, stretch, 1.0, self.context.device)

    def fictitious_mass(self, stage: Stage) -> Array | None:
        """Add the launches that fill an array with the sums of the rows of the stiffness [N/m].

        Returns None for a material without `response`.
        """
        material, context = self.material, self.context
        response = capabilities(material).response
        if response is None:
            return None
        layout, bits, functions, broken, form = self.key
        rows, total = row_sums(layout, bits, functions, response, broken, form, context.module)
        density = context.array("fictitious_mass", "Relaxation", context.types.real, shape=self.points)
        own = context.array("own_row", "Relaxation", context.types.real, shape=self.points)
        stage.launch(
            "Relaxation", rows, self.points,
            **self.family_arguments(context.state.displacement), constants=self.constants,
            unit_stiffness=self.unit_volume * self.inverse_horizon**2, row=self.pairs, own=own,
        )  # fmt: skip
        stage.launch(
            "Relaxation", total, self.points, family=self.struct, intact=self.intact, row=self.pairs, own=own,
            least=1e-3 * material.constants[0] * self.thickness, density=density,
        )  # fmt: skip
        return density

    def tangent(self, context: Context, geometric: bool) -> Tangent:
        """The tangent for Newton's method.

        Raises:
            InputError: for weights without an energy, a material without `response`, or a tangent without the tension.
        """
        if self.weights == "published":
            raise InputError(
                "weights = 'published': expected 'plain' or 'corrected', which have an energy, with the solver Newton; "
                "or use the solver Relaxation"
            )
        if not geometric:
            raise InputError("stiffness = 'constant': expected 'tangent'; only the law BondBased has 'constant'")
        return BondAssociatedTangent(self, context)

    def on_coarser(self, context: Context, horizon: float) -> BuiltLaw | None:
        """The law with plain weights, which need no correction."""
        return BondAssociatedForce(replace(self.law, weights="plain", horizon=horizon), context)

    def likely_cause(self) -> str:
        """The likely cause if a run diverged."""
        if self.weights == "published" and self.lock is None:
            return "the published weights do not conserve energy and can add it once bonds break; try weights 'plain'"
        return super().likely_cause()
