"""The bond-associated correspondence law, as published and in its variational form."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..bonds import Families, InfluenceFunction, build_families, influence_function, unpack
from ..checks import InputError, one_of, positive
from ..launches import Workspace
from ..materials import Material, check_material
from ..sheet import Sheet
from .family_force import FamilyForce, require_one_material
from .fast_path import fast_path

if TYPE_CHECKING:
    from ..weights import CorrectedWeights, RectangleWeights

WEIGHTS = ("auto", "published", "plain", "corrected")
BROKEN = ("redistribute", "drop")
# Largest horizon at which weights are corrected: beyond, the solve takes minutes.
MOST_CORRECTED = 4.5
MOST_CORRECTED_CLOUD = 100_000


@dataclass(frozen=True)
class BondAssociated:
    """Bond-associated correspondence: one deformation gradient and one stress a bond.

    Attributes:
        material: Any hyperelastic material.
        horizon: Horizon over the spacing of the sheet [-].
        weights: How the bonds share the area of their point:
            "published": not at all; the force of a bond comes from its own stress alone, with volume
                fractions (BA eqs. 38 and 43). It has no energy and misses uniform stress by about 1 %.
            "plain": in proportion to |D_ij|; conserves energy, exact for uniform stress inside the sheet.
            "corrected": the nearest weights for which uniform stress is in equilibrium up to the edges too.
            "auto": "plain" once anything can break or at horizons above 4.5, "corrected" otherwise.
            With rupture, "corrected" holds as long as the family of a point is whole; what a damaged family
            does is up to `broken`.
        influence: Influence function of r = |X| / horizon: "linear" 1 - r, "inverse" 1/r, "inverse_square"
            1/r^2, or a function of an array.
        broken: What becomes of the area of broken bonds. "drop" loses it: the stable step does not fall
            when bonds break. "redistribute" gives it to the remaining bonds of the point: a crack opens a
            little less too wide (7.0 against 8.6 % above the exact opening, 12 spacings half length, horizon
            3.15), at a step up to a third shorter; breaking can add energy then, and the energy of a torn strip
            balanced within 1 % at a `safety` of 0.02 whatever the step, at 0.05 and 0.1 not always.
        fast: Whether the force takes the fast kernels where there are some; they agree with the plain ones to
            round-off. Plain ones are there to be read and compared with.
    """

    material: Material
    horizon: float = 2.015
    weights: str = "auto"
    influence: str | InfluenceFunction = "linear"
    broken: str = "drop"
    fast: bool = True

    has_tangent = True

    def __post_init__(self) -> None:
        positive("horizon", self.horizon)
        one_of("weights", self.weights, WEIGHTS)
        one_of("broken", self.broken, BROKEN)
        influence_function(self.influence)
        check_material(self.material, "functions")

    def resolved_weights(self, breakable: bool) -> str:
        """The weights that "auto" stands for."""
        if self.weights != "auto":
            return self.weights
        return "plain" if breakable or self.horizon > MOST_CORRECTED else "corrected"

    def signature(self, layout: str, breakable: bool) -> tuple[Any, ...]:
        """What decides which kernels are compiled."""
        form = "published" if self.weights == "published" else "variational"
        return (layout, self.material.functions, self.broken if breakable else None, form)

    def build(self, workspace: Workspace, sheet: Sheet, breakable: bool) -> BondAssociatedForce:
        """Families and tables on the device.

        Raises:
            InputError: for a horizon that the sheet or the weights do not allow.
        """
        return BondAssociatedForce(self, workspace, sheet, breakable)


class BondAssociatedForce(FamilyForce):
    """The law on one sheet and device.

    Attributes:
        weights: The weights in use, "published", "plain" or "corrected".
        fast_path: Its fast kernels, or None.
    """

    has_energy = True

    def __init__(self, law: BondAssociated, workspace: Workspace, sheet: Sheet, breakable: bool) -> None:
        from ..kernels.bond_associated import bond_associated

        self.weights = law.resolved_weights(breakable)
        if self.weights == "published" or (breakable and law.broken == "redistribute"):
            # Their kernels make weights of their own.
            require_one_material(sheet, f"weights {self.weights!r} and broken {law.broken!r}")
        families, inverse, weights, self.correction = tables(law, sheet, self.weights)
        weights = families.stiffened(weights)
        super().__init__("BondAssociated", law, workspace, sheet, breakable, families, inverse, weights)
        self.columns = sheet.lattice.columns if sheet.lattice is not None else 0
        layout, *key = law.signature(families.layout, breakable)[:4]
        self.signature = (layout, workspace.bits, *key)
        self.kernels = bond_associated(*self.signature, workspace.module)
        self.fast_path = fast_path(self, inverse, weights)

    @functools.cached_property
    def bond_force(self) -> Any:
        """What the family of a point does to each of its pairs [N], shape (members, N); for those who ask for it."""
        shape = (self.families.members, self.points)
        return self.workspace.array("bond_force", self.owner, self.types.vec3, shape=shape)

    def add_force(self, stage: str, displacement: Any, force: Any) -> None:
        """Add the launches that turn a displacement [m] into the internal force [N], both (N,) vec3."""
        if self.fast_path is not None:
            self.fast_path.add_force(stage, displacement, force)
            return
        self.add_plain_families(stage, displacement)
        self.add_gather(stage, self.bond_force, force)

    def add_plain_families(self, stage: str, displacement: Any, inner: int = -1) -> None:
        """Add the launch that fills `bond_force`, but for whole families of the kind `inner`."""
        from ..kernels.bond_associated import plain_force

        self.workspace.launch(
            stage, self.owner, plain_force(*self.signature, inner >= 0, self.workspace.module), self.points,
            **self.family_arguments(displacement), constants=self.constants,
            unit_force=self.unit_volume * self.inverse_horizon, inner=inner, bond_force=self.bond_force,
        )  # fmt: skip


def tables(
    law: BondAssociated, sheet: Sheet, weights: str
) -> tuple[Families, np.ndarray, np.ndarray, dict[str, float] | None]:
    """Families and their tables.

    Returns:
        The families; K^-1 by row, shape (R, n, 3); weights over the reference area by row, shape (R, n) (for
        "published" the sizes |D_ij| instead); what the correction did, or None.

    Raises:
        InputError: if the weights cannot be corrected at this horizon or on so large a cloud.
    """
    if weights == "corrected":
        _require_correctable(law, sheet)
    depth = 0
    families = build_families(sheet, law.horizon, law.influence)
    if weights == "corrected" and sheet.lattice is not None:
        rectangle = _rectangle(families, sheet)
        depth = rectangle.depth
        families = build_families(sheet, law.horizon, law.influence, depth)
    inverse, size = families.inverse_shapes()
    if weights == "published":
        return families, inverse, size, None
    total = size.sum(axis=1)
    plain = (families.areas / np.where(total > 0.0, total, 1.0))[:, None] * size
    if weights == "plain":
        return families, inverse, plain, None
    if sheet.lattice is None:
        solved = _cloud_correction(families, sheet, plain)
        return families, inverse, solved.weights / families.reference_area, _report(solved, sheet)
    assert families.first is not None and families.severed is not None
    columns = sheet.lattice.columns
    corrected = rectangle.at(families.first % columns, families.first // columns) / families.reference_area
    return families, inverse, np.where(families.severed[:, None], plain, corrected), _report(rectangle.solved, sheet)


def _require_correctable(law: BondAssociated, sheet: Sheet) -> None:
    if law.horizon > MOST_CORRECTED:
        raise InputError(
            f"weights = 'corrected' at horizon = {law.horizon!r}: allowed up to {MOST_CORRECTED}; take weights 'plain'"
        )
    if sheet.lattice is None and sheet.size > MOST_CORRECTED_CLOUD:
        raise InputError(
            f"weights = 'corrected' on a cloud of {sheet.size} points: allowed up to {MOST_CORRECTED_CLOUD}; "
            f"take weights 'plain'"
        )


def _rectangle(families: Families, sheet: Sheet) -> RectangleWeights:
    from ..weights import rectangle_corrected

    assert sheet.lattice is not None and families.steps is not None
    lattice = sheet.lattice
    return rectangle_corrected(
        lattice.columns,
        lattice.rows,
        (lattice.dx, lattice.dy),
        offsets=families.steps,
        influence=families.influence,
        common=unpack(families.common, families.members),
    )


def _cloud_correction(families: Families, sheet: Sheet, plain: np.ndarray) -> CorrectedWeights:
    from ..weights import corrected_weights, edge_vectors, reached_points

    assert families.neighbours is not None and families.severed is not None
    return corrected_weights(
        sheet.points,
        sheet.areas,
        families.neighbours,
        families.influence,
        unpack(families.common, families.members),
        edge_vectors=edge_vectors(sheet.points, sheet.triangles),
        start=plain * families.reference_area,
        frozen=families.severed,
        unbalanced=reached_points(families.neighbours, families.severed) | families.severed,
    )


def _report(solved: CorrectedWeights, sheet: Sheet) -> dict[str, float]:
    """What the correction did, for summary.json; residuals in spacings."""
    return {
        "residual": solved.residual / sheet.spacing,
        "residual_of_plain": solved.start_residual / sheet.spacing,
        "smallest_ratio": solved.smallest_ratio,
        "largest_ratio": solved.largest_ratio,
        "points_left_unbalanced": solved.unbalanced_points,
        "seconds": solved.seconds,
    }
