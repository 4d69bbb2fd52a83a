"""The bond-associated correspondence law, as published and in its variational form."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, evaluate, numbers, one_of, positive
from ..device.fields import Array
from ..device.launches import Stage
from ..families import InfluenceFunction, influence_function
from ..interfaces import BuiltLaw, Law
from ..kernels.bond_associated import family_energy, partial_energy, represented_area
from ..kernels.numeric import FunctionFactory
from ..materials import Material, capabilities, check_material, largest_energy_density
from ..step import Phase
from .family_law import require_one_material
from .force_paths import BondAssociatedLaw, Reference, force_path, paths_on
from .point_fields import ShownFields, factors
from .weight_tables import MAX_CORRECTED, law_tables

WEIGHTS = ("auto", "published", "plain", "corrected")


@dataclass(frozen=True)
class BondAssociated:
    """Bond-associated correspondence: one deformation gradient and one stress per bond.

    Attributes:
        material: Any hyperelastic material.
        horizon: Horizon in spacings of the sheet [-].
        weights: How the area of a point is distributed over its bonds:
            "published": not distributed; the force of a bond comes from its own stress, with volume fractions (BA eqs.
                38 and 43). The force has no energy, and the error for uniform stress is about 1 %.
            "plain": in proportion to |D_ij|. It conserves energy and is exact for uniform stress inside the sheet.
            "corrected": the weights closest to "plain" for which uniform stress is in equilibrium at the edges, too.
            "auto": "corrected", but "plain" at horizons above 4.5, and beside a criterion that asks each bond by
                itself, such as CriticalStretch, on sheets that are not graded and whose material is not a TensionField:
                nothing else holds the free edges of a TensionField, which closes like a curtain with plain weights.
            With rupture, "corrected" applies while the family of a point is undamaged; the area of broken bonds is
            lost.
        influence: Influence function of r = |X| / horizon: "linear" 1 - r, "inverse" 1/r, "inverse_square"
            1/r^2, or a function of an array.
        fast: Whether to use faster kernels where available. They agree with the reference kernels, which exist for
            reading and comparison, to round-off.
        own_point: Whether the areas of families and intersections in the published form have that of their own point
            (keyword only); BA eq. 39 does not say.
    """

    material: Material
    horizon: float = 2.015
    weights: str = "auto"
    influence: str | InfluenceFunction = "linear"
    fast: bool = True
    own_point: bool = field(default=False, kw_only=True)

    has_tangent: ClassVar[bool] = True

    def __post_init__(self) -> None:
        positive("horizon", self.horizon)
        one_of("weights", self.weights, WEIGHTS)
        if one_of("own_point", self.own_point, (True, False)) and self.weights != "published":
            raise InputError(f"own_point = True: expected weights 'published', got {self.weights!r}")
        one_of("fast", self.fast, (True, False))
        influence_function(self.influence)
        check_material(self.material, "functions")

    def resolved_weights(self, at_once: bool, graded: bool = False) -> str:
        """The weights with "auto" resolved; `at_once`: bonds break, each by itself, without softening before."""
        if self.weights != "auto":
            return self.weights
        needed = graded or capabilities(self.material).goes_slack
        return "plain" if (at_once and not needed) or self.horizon > MAX_CORRECTED else "corrected"

    @property
    def form(self) -> str:
        """Form of the kernels: "published" or "variational"."""
        return "published" if self.weights == "published" else "variational"

    def build(self, context: Context) -> BuiltLaw:
        """Build the law. Raises InputError if the sheet or the weights do not allow the horizon."""
        return BondAssociatedForce(self, context)


def with_weights_of_intact_sheets(force: Law) -> Law:
    """The law with the weights that "auto" means without rupture."""
    if not isinstance(force, BondAssociated) or force.weights != "auto":
        return force
    return replace(force, weights=force.resolved_weights(False))


class BondAssociatedForce(BondAssociatedLaw):
    """The law on one sheet and device.

    Attributes:
        path: The force path in use.
        response: Response of a viscous law (kernels/bond_associated.py), or None.
        terms: Its constants.
        state: Its internal variables.
    """

    has_energy = True
    needs_finest = ""
    takes_curved = True
    takes_graded = True
    takes_tension_field = True
    takes_regions = True
    divides = True
    response: FunctionFactory | None = None
    terms: Array | None = None
    state: Array | None = None
    remembered: FunctionFactory | None = None

    def __init__(self, law: BondAssociated, context: Context) -> None:
        sheet, self.layout = context.sheet, context.layout
        at_once = self.layout.breakable and not self.layout.softened
        self.law, self.weights = law, law.resolved_weights(at_once, sheet.spacings is not None)
        self.own_point = float(law.own_point)
        self.material, self.fast = law.material, law.fast
        self.shown_stress = law.material
        if self.weights == "published":
            if context.partition is not None:
                raise InputError("weights = 'published': not supported on several processes; expected 'plain'")
            # Their kernels compute the weights themselves.
            require_one_material(sheet, "weights 'published'")
        known = capabilities(law.material)
        regions = known.regions
        self.remembered = known.remembers
        settings = law.horizon, law.influence, self.weights
        if regions:
            from .region_tables import region_tables

            families, inverse, weights, self.correction = region_tables(context, regions, *settings)
        else:
            families, inverse, weights, self.correction = law_tables(context, *settings)
        super().__init__(law, context, families, inverse, weights)
        self._areas = sheet.areas if self.weights == "published" else self._summed(weights)
        if self.layout.by_point or self.layout.remembers:
            self._put_values(0.0 if known.by_point is None else known.by_point)
        self.lattice_columns = sheet.lattice.columns if sheet.lattice is not None else 0
        self.key = (self.layout, law.material.functions, law.form)
        self.path = force_path(self, inverse, weights)
        self.other_families = self.path.other_families

    @functools.cached_property
    def earlier_energy(self) -> wp.Function | None:  # type: ignore[override]
        """Warp function of the energy of a family at an earlier time."""
        return family_energy(*self.key)

    @functools.cached_property
    def partial_energy(self) -> wp.Function | None:  # type: ignore[override]
        """Warp function of what every n-th member adds to it."""
        return partial_energy(self.layout, self.material.functions)

    @functools.cached_property
    def represented(self) -> wp.Function | None:  # type: ignore[override]
        """Warp function of the area that the intact bonds of a family represent."""
        return None if self.weights == "published" else represented_area(self.layout)

    def _put_values(self, values: Any) -> None:
        """Put the values by point of the material's last constant on the device, or start its internal variable there.

        Raises:
            InputError: for a sheet that is not a cloud, several processes, or anything but one finite number a point.
        """
        context, sheet, name = self.context, self.context.sheet, f"{type(self.material).__name__}.by_point"
        if sheet.layout != "cloud" or self.weights == "published" or context.partition is not None:
            raise InputError(f"{name}: expected sheet.as_cloud(), weights with an energy and a single process")
        given = numbers(name, evaluate(name, values, sheet.points.T.copy()) if callable(values) else values)
        if given.shape not in ((), (sheet.size,)):
            raise InputError(f"{name}: expected a number or shape ({sheet.size},), got shape {given.shape}")
        each = np.broadcast_to(given, sheet.size)
        real = context.types.real
        if self.layout.remembers:
            start = np.tile(each, (self.families.members, 1))
            self.struct.remembered = context.array("remembered", self.owner, real, start, per="bond", restart=True)
        else:
            self.point_values = context.array("point_values", self.owner, real, each, restart=True)
            self.struct.point_values = self.point_values

    def paths(self) -> Sequence[type[Reference]]:
        """The force paths that may be taken, in the order in which they are tried."""
        return paths_on(self.context.device)

    @property
    def force_path(self) -> str:
        """Name of its force path."""
        return self.path.name

    def bond_force(self) -> Array:
        """Force of each family on its pairs [N], (members, N) vec3.

        Raises:
            InputError: with fast kernels, which store only parts of it, or published weights, which have no energy.
        """
        if self.fast or self.weights == "published":
            return super().bond_force()
        return self.pairs

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the internal force [N] at a displacement [m], both (N,) vec3."""
        self.path.add_undamaged(stage, displacement, out)
        self.add_others(stage, displacement, out)

    def add_others(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches of the force after that of undamaged families."""
        self.path.add_others(stage, displacement, out)

    def add_energy(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launch that fills `out`, (N,) float64, with the energy of each family [J]."""
        self.path.add_energy(stage, displacement, out)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of a phase, and those of what the material remembers."""
        state = self.context.state
        if phase is Phase.UNDAMAGED_FORCE:
            self.path.add_undamaged(stage, state.displacement, state.force)
        elif phase is Phase.INTERNAL_FORCE:
            self.add_others(stage, state.displacement, state.force)
        else:
            super().add(phase, stage)
        if self.remembered is not None and phase in (Phase.RUPTURE, Phase.FRAME):
            from ..kernels.bond_associated import remembered

            kernel = remembered(self.layout, self.material.functions, self.remembered)
            self.add_launch(stage, kernel, state.displacement, largest=self.struct.remembered)

    def add_shown(self, stage: Stage, shown: ShownFields) -> None:
        """Add the launches that fill the point fields shown in frames: means over each point's bonds."""
        kernel = shown.of_bonds(self.key, self.material, self.response)
        shown.add_principal(stage, kernel, factors=factors(self.context), terms=self.terms, state=self.state)
        shown.add_counts(stage)

    def soften(self, damage: Array, near: Array) -> None:
        """Reduce the stiffness of each family by the damage of its point, (N,).

        Raises:
            InputError: for published weights, which have no energy.
        """
        if self.weights == "published":
            raise InputError("weights = 'published': expected 'auto', 'plain' or 'corrected' with TearingEnergy")
        self.damage, self.near_damage = damage, near

    def represented_areas(self) -> np.ndarray:
        """Area represented by the bonds of each point of the undamaged sheet [m^2], shape (N,)."""
        return self._areas

    def energy_density(self, stretch: np.ndarray, across: Any = 1.0) -> np.ndarray:
        """Energy density of the material, of several the largest [J/m^3], in pure shear by default."""
        return largest_energy_density(self.material, stretch, across, self.context.device)

    def on_coarser(self, context: Context, horizon: float) -> BuiltLaw | None:
        """Build the law with plain weights on a coarser lattice."""
        return BondAssociatedForce(replace(self.law, weights="plain", horizon=horizon), context)

    def likely_cause(self, safety: float) -> str:
        """The likely cause if a run diverged."""
        if self.weights == "published" and self.lock is None:
            return (
                "the published weights do not conserve energy and can add energy once bonds break; try weights 'plain'"
            )
        return super().likely_cause(safety)
