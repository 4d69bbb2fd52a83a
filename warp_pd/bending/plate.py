"""Bending stiffness as a part of a scene."""

from __future__ import annotations

from dataclasses import dataclass

from ..context import Context
from ..device.checks import InputError, positive
from ..device.fields import Array
from ..device.launches import Stage
from ..implicit.internal_variables import InternalVariables, internal_variables_of
from ..interfaces import BuiltLaw, BuiltPart, Part
from ..statics.fictitious_mass import fictitious_mass
from ..statics.tangent import Tangent, tangent_of
from .law import BendingForce


@dataclass(frozen=True)
class Plate(Part):
    """Resistance to bending beside any force law with an energy density (docs/bending.md), one of the loads of a scene.

    Attributes:
        stiffness: Bending stiffness D [N m]; None for that of a plate of the material and the thickness,
            E h^3 / (12 (1 - nu^2)). Poisson's ratio is always that of the material.

    Raises:
        InputError: if the stiffness is not positive.
    """

    stiffness: float | None = None

    @property
    def only_one(self) -> str:
        """A sheet has one bending stiffness."""
        return "parts Plate; expected one"

    def __post_init__(self) -> None:
        if self.stiffness is not None:
            positive("Plate.stiffness", self.stiffness)

    def around(self, law: BuiltLaw, context: Context) -> BuiltLaw:
        """The law with bending beside it.

        Raises:
            InputError: for bonds that break in static equilibrium, several materials, or a material without stiffness.
        """
        if context.layout.breakable and context.at_rest:
            raise InputError("loads = Plate: damage not supported in equilibrium; expected Explicit")
        if context.layout.varies:
            raise InputError("loads = Plate: expected one material, the same at all points")
        return BendingForce(law, context, self.stiffness)  # type: ignore[abstract]

    def build(self, context: Context, law: BuiltLaw) -> BuiltPart:
        """Nothing beside the law."""
        return BuiltPlate()


class BuiltPlate(BuiltPart):
    """The law acts for it."""

    label = "loads = Plate"


@internal_variables_of.register
def _(law: BendingForce) -> InternalVariables | None:
    return internal_variables_of(law.law)


@fictitious_mass.register(BendingForce)
def _(law: BendingForce, stage: Stage) -> Array | None:
    return fictitious_mass(law.law, stage)


@tangent_of.register
def _(law: BendingForce, context: Context, geometric: bool) -> Tangent:
    from .tangent import BendingTangent

    return BendingTangent(law, tangent_of(law.law, context, geometric))
