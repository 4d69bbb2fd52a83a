"""Bond-associated visco-hyperelasticity: Prony terms on the stress of each intersection."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import warp as wp

from ..device.checks import InputError
from ..device.fields import Array, to_host
from ..device.launches import Stage
from ..interfaces import BuiltLaw, Tangent
from ..interfaces.context import Context
from ..interfaces.phases import Phase
from ..kernels.reference_force import reference_force
from ..kernels.visco import visco_energy, viscous_update
from ..materials import Prony, capabilities
from .bond_associated import BondAssociated, BondAssociatedForce
from .family_law import FamilyLaw
from .force_paths import NO_PRONY, ForcePath, Reference, RowSums
from .prony import at_once, check_prony, prony_array

# What the fast kernels of a CPU fill in with Prony terms: in a step, and off its path.
VISCOUS = ("viscous_step", "viscous_force")


@dataclass(frozen=True)
class Visco(BondAssociated):
    """Bond-associated visco-hyperelasticity in plane stress; the undeformed sheet is stress-free.

    The second Piola stress of every intersection is the material's (the long-term stress) plus stresses that relax: S =
    S_inf(C) + sum_p integral exp(-(t - t') / theta_p) dS_p(C(t')). The instantaneous stress is S_inf + sum_p S_p.
    No motion can extract energy from it; see kernels/visco.py, also for the stored and dissipated energy. The state has
    3 numbers per bond, and 3 more per Prony term.

    When a bond breaks, the energy stored in its Prony terms counts as viscous loss. The strain of the remaining bonds
    jumps, which the energy balance does not include.

    Attributes:
        material: Material of the long-term stress, such as Yeoh. Other arguments are those of BondAssociated.
        prony: Relaxing terms (keyword only); without terms the law is elastic.
        fast: Whether to use fast kernels on a CPU, which combine force and relaxation of a step (keyword only); a GPU
            has none.
    """

    prony: tuple[Prony, ...] = field(default=(), kw_only=True)
    fast: bool = field(default=True, kw_only=True)

    has_tangent: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        check_prony(self.prony)
        if self.prony and capabilities(self.material).goes_slack:
            raise InputError(
                f"prony = {self.prony!r}: expected () with a TensionField material, as Prony terms resist compression"
            )
        if self.weights == "published":
            raise InputError("weights = 'published': expected 'auto', 'plain' or 'corrected' with Visco")

    def build(self, context: Context) -> BuiltLaw:
        """Build the families and tables on the device; without Prony terms those of BondAssociated.

        Raises:
            InputError: if the sheet or the weights do not allow the horizon.
        """
        return ViscoForce(self, context) if self.prony else ElasticVisco(self, context)


class ElasticVisco(BondAssociatedForce):
    """Visco without Prony terms, with only those force paths that store the force of every pair in `pairs`."""

    paths: ClassVar[Sequence[type[ForcePath]]] = (RowSums, Reference)

    def bond_force(self) -> Array:
        """Force of each family on its pairs [N], (members, N) vec3."""
        return self.pairs

    def tangent(self, context: Context, geometric: bool) -> Tangent:
        """Raise, because the law has no tangent.

        Raises:
            InputError: always.
        """
        return FamilyLaw.tangent(self, context, geometric)


class ViscoForce(ElasticVisco):
    """The law on one sheet and device.

    Attributes:
        internal: Internal variables by name.
        rows: The fast kernels of a CPU, or None.
        viscous: Energy that each family has dissipated until the last frame [J], (N,) float64.
    """

    # Those of elastic laws know of no Prony terms.
    paths: ClassVar[Sequence[type[ForcePath]]] = (Reference,)
    depends_on_time = True
    takes_tension_field = False
    takes_regions = False

    def __init__(self, law: Visco, context: Context) -> None:
        super().__init__(law, context)
        self.rows = RowSums(self, VISCOUS) if law.fast and RowSums.applies(self) else None
        self._updated: Stage | None = None
        members, terms, vec3 = self.families.members, len(law.prony), context.types.vec3
        self.prony_terms = law.prony
        self.prony = prony_array(law.prony, context)

        def internal(name: str, shape: tuple[int, int]) -> Array:
            return context.array(name, self.owner, vec3, shape=shape, per="bond", restart=True)

        self.internal: dict[str, Any] = {
            "strain": internal("strain", (members, self.points)),
            "overstress": internal("overstress", (terms * members, self.points)),
            "viscous_work": context.array("viscous_work", self.owner, wp.float64, shape=self.points, restart=True),
        }
        self.viscous = context.array("viscous", self.owner, wp.float64, shape=self.points)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of a phase; at the start those that apply the initial displacement instantaneously."""
        super().add(phase, stage)
        state = self.context.state
        if phase is Phase.INTERNAL_VARIABLES:
            assert state.step is not None
            self.add_update(stage, state.displacement, state.step, self.prony)
        elif phase is Phase.START and self.context.initial_displacement.any():
            self.add_update(stage, state.displacement, *at_once(self.prony_terms, self.context))
            # Fills `viscous`: the stored energy before it lies there as well.
            self.add_energy(stage, state.displacement, self.viscous)

    def begin(self) -> None:
        """Reset the losses: the work of the initial displacement is stored, not dissipated."""
        work = self.internal["viscous_work"]
        work.assign(to_host(work) - to_host(self.viscous))

    def soften(self, damage: Array) -> None:
        """Raise, because the law does not support a damage field.

        Raises:
            InputError: always.
        """
        raise InputError("damage = TearingEnergy: expected Visco without prony, or another criterion")

    def sums(self) -> Mapping[str, Array]:
        """Strain energy and viscous losses."""
        return {**super().sums(), "viscous": self.viscous}

    def add_update(self, stage: Stage, displacement: Array, step: Array, prony: Array) -> None:
        """Add the launch that advances the internal variables to the end of a step [s], a single real number.

        The fast kernel also fills `pairs` with the forces at the end of the step.
        """
        if self.rows is not None:
            self.rows.add_pairs(stage, displacement, "viscous_step", {"step": step, "prony": prony, **self.internal})
            self._updated = stage
            return
        kernel = viscous_update(self.layout, self.law.material.functions)
        stage.launch(
            "Visco", kernel, self.points, **self.family_arguments(displacement), step=step,
            prony=prony, unit_volume=self.unit_volume, **self.internal,
        )  # fmt: skip

    @property
    def shown_internal(self) -> dict[str, Any]:
        """Prony terms, strain and overstress."""
        return {"prony": self.prony, "strain": self.internal["strain"], "overstress": self.internal["overstress"]}

    @property
    def force_path(self) -> str:
        """Name of its force path."""
        return Reference.name if self.rows is None else RowSums.name

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the internal force [N] at a displacement [m], both (N,) vec3."""
        state = {name: self.internal[name] for name in ("strain", "overstress")}
        if self.rows is None:
            stage.launch(
                "Visco", reference_force(*self.key, viscous=True), self.points,
                **self.family_arguments(displacement), constants=self.constants,
                unit_force=self.unit_volume * self.inverse_horizon, prony=self.prony, **state, bond_force=self.pairs,
            )  # fmt: skip
        elif self._updated is not stage:
            self.rows.add_pairs(stage, displacement, "viscous_force", {**NO_PRONY, "prony": self.prony, **state})
        self.add_gather(stage, self.kernels.gather, self.pairs, out)

    def add_energy(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launch that fills `out`, (N,) float64, with the stored energy of each family [J]."""
        stage.launch(
            "Visco", visco_energy(self.layout, self.law.material.functions), self.points,
            **self.family_arguments(displacement), constants=self.constants, unit_volume=self.unit_volume,
            prony=self.prony, **self.internal, out=out, dissipated=self.viscous,
        )  # fmt: skip
