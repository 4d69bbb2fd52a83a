"""Visco-hyperelastic force laws: Yeoh's energy and Prony terms, as published for bonds and through intersections."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..bonds import Families, build_families
from ..checks import InputError, one_of, positive
from ..launches import Workspace, run_once
from ..materials import Prony, Yeoh
from ..sheet import Sheet
from .bond_associated import BondAssociated, BondAssociatedForce
from .family_force import FamilyForce, require_one_material

UPDATES = ("exact", "series")
# Relaxation time [s] on the way to the initial displacement: nothing relaxes.
AT_ONCE = 1e30


@dataclass(frozen=True)
class Visco(BondAssociated):
    """Bond-associated visco-hyperelasticity in plane stress, free of stress at rest.

    The second Piola stress of every intersection is the material's, which is what is left after a long time, plus
    stresses that relax: S = S_inf(C) + sum_p integral exp(-(t - t') / theta_p) dS_p(C(t')). The instantaneous stress
    is S_inf + sum_p S_p. Nothing can be gained from it, whatever the motion: see kernels/visco.py, which also
    says what is stored and what is lost. Its state needs 3 numbers a bond, and 3 more a Prony term.

    Where a bond breaks, the energy that its Prony terms stored counts as viscous loss, and the strain of the others
    jumps, which the energy balance does not follow.

    Attributes:
        material: What is left after a long time, such as Yeoh; see BondAssociated for all but prony.
        prony: Terms that relax, by name only; none makes this the elastic law, on plain kernels.
    """

    prony: tuple[Prony, ...] = field(default=(), kw_only=True)
    fast: bool = field(default=False, init=False)

    has_tangent = False

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_prony(self.prony)
        if self.weights == "published":
            raise InputError("weights = 'published': allowed with Visco are 'auto', 'plain' and 'corrected'")

    def signature(self, layout: str, breakable: bool) -> tuple[Any, ...]:
        """What decides which kernels are compiled."""
        elastic = super().signature(layout, breakable)
        return (*elastic, "prony") if self.prony else elastic

    def build(self, workspace: Workspace, sheet: Sheet, breakable: bool) -> BondAssociatedForce:
        """Families and tables on the device; without Prony terms those of BondAssociated.

        Raises:
            InputError: for a horizon that the sheet or the weights do not allow.
        """
        if not self.prony:
            return BondAssociatedForce(self, workspace, sheet, breakable)
        return ViscoForce(self, workspace, sheet, breakable)


class ViscoForce(BondAssociatedForce):
    """The law on one sheet and device.

    Attributes:
        internal: Internal variables by name.
        viscous: Energy that each family has dissipated [J], (N,) float64, as of the last frame.
    """

    def __init__(self, law: Visco, workspace: Workspace, sheet: Sheet, breakable: bool) -> None:
        import warp as wp

        from ..kernels.visco import visco

        super().__init__(law, workspace, sheet, breakable)
        layout, bits, material, broken, _form = self.signature
        self.visco = visco(layout, bits, material, broken, workspace.module)
        members, terms = self.families.members, len(law.prony)
        self.prony = _prony_array(law.prony, workspace, self.types)
        self.internal = {
            "strain": workspace.array("strain", "Visco", self.types.vec3, shape=(members, self.points)),
            "overstress": workspace.array("overstress", "Visco", self.types.vec3, shape=(terms * members, self.points)),
            "viscous_work": workspace.array("viscous_work", "Visco", wp.float64, shape=self.points),
        }
        self.viscous = workspace.array("viscous", "Visco", wp.float64, shape=self.points)

    def add_update(self, stage: str, displacement: Any, step: Any, prony: Any = None) -> None:
        """Add the launch that brings the internal variables to the end of a step [s], one real number."""
        self.workspace.launch(
            stage, "Visco", self.visco.update, self.points,
            **self.family_arguments(displacement), step=step, prony=self.prony if prony is None else prony,
            unit_volume=self.unit_volume, **self.internal,
        )  # fmt: skip

    def add_start(self, stage: str, displacement: Any) -> None:
        """Add the launches that bring the internal variables to a displacement [m] reached at once."""
        self.add_update(stage, displacement, *_at_once(self.law, self.workspace, self.types))
        # Fills `viscous`: the stored energy before it lies there as well.
        self.add_energy(stage, displacement, self.viscous)

    def start(self) -> None:
        """Run what `add_start` added: what it took to get there is stored, none of it lost."""
        launches = self.workspace.stages.get("start", [])
        run_once(self.workspace.device, launches)
        if launches:
            work = self.internal["viscous_work"]
            work.assign(work.numpy() - self.viscous.numpy())

    def add_force(self, stage: str, displacement: Any, force: Any) -> None:
        """Add the launches that turn a displacement [m] into the internal force [N], both (N,) vec3."""
        state = {name: self.internal[name] for name in ("strain", "overstress")}
        self.workspace.launch(
            stage, "Visco", self.visco.visco_force, self.points,
            **self.family_arguments(displacement), constants=self.constants,
            unit_force=self.unit_volume * self.inverse_horizon, prony=self.prony, **state, bond_force=self.bond_force,
        )  # fmt: skip
        self.add_gather(stage, self.bond_force, force)

    def add_energy(self, stage: str, displacement: Any, out: Any) -> None:
        """Add the launch that fills `out`, (N,) float64, with the stored energy of each family [J]."""
        self.workspace.launch(
            stage, "Visco", self.visco.stored_energy, self.points,
            **self.family_arguments(displacement), constants=self.constants, unit_volume=self.unit_volume,
            prony=self.prony, **self.internal, out=out, dissipated=self.viscous,
        )  # fmt: skip


@dataclass(frozen=True)
class ViscoBondBased:
    """The published visco-hyperelastic bond law of Yeoh sheets (VE eqs. 46 to 75).

    Its two-dimensional energy c10 (I1 - 2) + c20 (I1 - 2)^2 has no pressure term: a sheet at rest is under tension,
    4 c10 w |X| / m in a bond, and free edges contract. I1 is that of the point's own family (eq. 41), where the paper
    takes the stretch of the whole sheet: so the law knows holes and cracks; and m (eq. 39) is the sum over the family,
    where the paper writes its integral, pi h horizon^4. Without Prony terms its forces have an energy, with them not.

    Attributes:
        material: Yeoh with c10 and c20.
        horizon: Horizon over the spacing of the sheet [-].
        prony: Terms that relax, by name only.
        update: "exact" for a stretch that changes linearly over a step, or "series", eq. 60.
    """

    material: Yeoh
    horizon: float = 3.015
    prony: tuple[Prony, ...] = field(default=(), kw_only=True)
    update: str = field(default="exact", kw_only=True)

    weights = "pairwise"
    has_tangent = False

    def __post_init__(self) -> None:
        positive("horizon", self.horizon)
        one_of("update", self.update, UPDATES)
        _check_prony(self.prony)
        if not isinstance(self.material, Yeoh) or self.material.c30 != 0.0:
            raise InputError(f"material = {self.material!r}: allowed is Yeoh with c30 = 0")

    @property
    def has_energy(self) -> bool:
        """Whether its forces have an energy."""
        return not self.prony

    def signature(self, layout: str, breakable: bool) -> tuple[Any, ...]:
        """What decides which kernels are compiled."""
        return (layout, "visco bonds", breakable, bool(self.prony), self.update)

    def build(self, workspace: Workspace, sheet: Sheet, breakable: bool) -> ViscoBondBasedForce:
        """Families and tables on the device.

        Raises:
            InputError: for a horizon that the sheet does not allow.
        """
        return ViscoBondBasedForce(self, workspace, sheet, breakable)


class ViscoBondBasedForce(FamilyForce):
    """The law on one sheet and device.

    Attributes:
        internal: Internal variables by name.
        bond_force: What the family of a point pulls each of its bonds with [N], (members, N) vec3.
    """

    weights = "pairwise"

    def __init__(self, law: ViscoBondBased, workspace: Workspace, sheet: Sheet, breakable: bool) -> None:
        from ..kernels.visco_bonds import visco_bonds

        require_one_material(sheet, "the law ViscoBondBased")
        families = build_families(sheet, law.horizon, "inverse_square", intersections=False)
        super().__init__("ViscoBondBased", law, workspace, sheet, breakable, families, None, _bond_weights(families))
        self.has_energy = law.has_energy
        self.kernels = visco_bonds(
            families.layout, workspace.bits, breakable, bool(law.prony), law.update == "series", workspace.module
        )
        shape = (families.members, self.points)
        self.bond_force = workspace.array("bond_force", self.owner, self.types.vec3, shape=shape)
        self.prony = None
        if law.prony:
            real, rows = self.types.real, len(law.prony) * families.members
            self.prony = _prony_array(law.prony, workspace, self.types)
            self.internal = {
                "strain": workspace.array("strain", self.owner, real, shape=shape),
                "viscous_stretch": workspace.array("viscous_stretch", self.owner, real, shape=(rows, self.points)),
            }

    def add_update(self, stage: str, displacement: Any, step: Any, prony: Any = None) -> None:
        """Add the launch that brings the internal variables to the end of a step [s], one real number."""
        if self.internal:
            self.workspace.launch(
                stage, self.owner, self.kernels.update, self.points,
                **self.family_arguments(displacement), step=step, prony=self.prony if prony is None else prony,
                **self.internal,
            )  # fmt: skip

    def add_start(self, stage: str, displacement: Any) -> None:
        """Add the launch that brings the internal variables to a displacement [m] reached at once."""
        if self.internal:
            self.add_update(stage, displacement, *_at_once(self.law, self.workspace, self.types))

    def start(self) -> None:
        """Run what `add_start` added."""
        run_once(self.workspace.device, self.workspace.stages.get("start", []))

    def add_force(self, stage: str, displacement: Any, force: Any) -> None:
        """Add the launches that turn a displacement [m] into the internal force [N], both (N,) vec3."""
        self.workspace.launch(
            stage, self.owner, self.kernels.half_forces, self.points,
            **self.family_arguments(displacement), constants=self.constants,
            unit_force=self.unit_volume * self.inverse_horizon, prony=self.prony,
            strain=self.internal.get("strain"), viscous_stretch=self.internal.get("viscous_stretch"),
            bond_force=self.bond_force,
        )  # fmt: skip
        self.add_gather(stage, self.bond_force, force)


def _check_prony(prony: tuple[Prony, ...]) -> None:
    if not isinstance(prony, tuple) or not all(isinstance(term, Prony) for term in prony):
        raise InputError(f"prony = {prony!r}: allowed is a tuple of Prony")


def _at_once(law: Visco | ViscoBondBased, workspace: Workspace, types: Any) -> tuple[Any, Any]:
    """A step of one second, and the Prony terms without time to relax in it."""
    slow = tuple(replace(term, time=AT_ONCE, exponent=0.0) for term in law.prony)
    return workspace.array("one_second", "Visco", types.real, np.ones(1)), _prony_array(slow, workspace, types)


def _prony_array(prony: tuple[Prony, ...], workspace: Workspace, types: Any) -> Any:
    return workspace.array("prony", "Visco", types.parameters, np.array([term.constants for term in prony]))


def _bond_weights(families: Families) -> np.ndarray:
    """4 w a_i a_k / sum_k w |xi|^2 a_k by row, areas over the reference area, shape (R, n)."""
    squared = np.where(families.exists, (families.bonds**2).sum(axis=-1), 0.0)
    share = families.member_shares
    return 4.0 * families.areas[:, None] * share / (share * squared).sum(axis=1, keepdims=True)
