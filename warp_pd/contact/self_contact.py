"""Contact of a sheet with itself, and of its pieces with each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..context import Context
from ..device.checks import InputError, not_negative, positive, said
from ..interfaces import BuiltContact, BuiltLaw, Contact


@dataclass(frozen=True)
class SelfContact(Contact):
    """Repulsion between points that share no bond, within a piece and between pieces.

    The energy of a pair is stiffness (d - r)^2 / 2 at a distance r below d. d is `distance`; within a piece it is
    limited to 0.7 times the reference distance of the pair, so there is no contact in the reference state. Pairs with a
    broken bond are included. Source: short-range forces of Silling and Askari (2005). Only with the solver Explicit.

    Attributes:
        distance: Contact distance [m]; by default 1.5 spacings. A point cannot pass through the sheet while its stretch
            is less than 1.4 distance / spacing.
        stiffness: Contact stiffness of two points that each represent one spacing squared [N/m]; by default a tenth of
            the thickness times the modulus in pure shear. A larger stiffness shortens the time step.
        friction: Coefficient of Coulomb friction. Sticking contacts creep: under a tangential force T they slip at
            about n T dt / m, with n contacts at a point.
        surface: Whether triangles have contact instead of points, by impulses in each step
            (kernels/contact/sheet_contact.py): apart from neighbours within about two spacings nothing passes, and the
            time step is not shortened. The default of `distance` is then a tenth of the spacing, and
            `stiffness` must be None.

    Raises:
        InputError: if distance or stiffness is not positive, friction is negative, or `surface` is not a bool or comes
            with a stiffness.
    """

    distance: float | None = None
    stiffness: float | None = None
    friction: float = 0.0
    surface: bool = False

    does_work: ClassVar[bool] = False
    only_one: ClassVar[str] = "SelfContact: expected at most one"

    def __post_init__(self) -> None:
        for name, value in (("distance", self.distance), ("stiffness", self.stiffness)):
            if value is not None:
                positive(f"SelfContact.{name}", value)
        not_negative("SelfContact.friction", self.friction)
        if not isinstance(self.surface, bool):
            raise InputError(f"SelfContact.surface = {said(self.surface)}: expected True or False")
        if self.surface and self.stiffness is not None:
            raise InputError(f"SelfContact.stiffness = {said(self.stiffness)}: expected None with surface = True")

    def build(self, context: Context, law: BuiltLaw) -> BuiltContact:
        """Build the contact on a device."""
        if self.surface:
            from .sheet_surface import SheetSurface

            return SheetSurface(context, law, self.distance, self.friction)
        from .point_pairs import PointPairs

        return PointPairs(self, context, law)
