"""Tangents of force laws, for Newton's method."""

from __future__ import annotations

import functools

from ..context import Context
from ..device.checks import InputError
from ..interfaces import BuiltLaw
from ..laws.bond_associated import BondAssociatedForce
from .tangent import Tangent


@functools.singledispatch
def tangent_of(law: BuiltLaw, context: Context, geometric: bool) -> Tangent:
    """Create the tangent of a force law; laws that have one register how it is made.

    Args:
        law: The built law.
        context: Where its arrays are declared.
        geometric: Whether the stiffness from the tension of the sheet is part of it.

    Raises:
        InputError: for a law without a tangent.
    """
    raise _refusal(law)


@tangent_of.register
def _(law: BondAssociatedForce, context: Context, geometric: bool) -> Tangent:
    """Refuses weights without an energy, a material without `response`, or `geometric` = False."""
    from .bond_associated_tangent import BondAssociatedTangent

    if not (law.law.has_tangent or law.steps_implicitly):
        raise _refusal(law)
    if law.weights == "published":
        raise InputError(
            "weights = 'published': expected 'plain' or 'corrected', which have an energy and so a tangent; or use the "
            "solver Explicit or Relaxation"
        )
    if not geometric:
        raise InputError("stiffness = 'constant': expected 'tangent'; only the law BondBased has 'constant'")
    return BondAssociatedTangent(law, context)


def _refusal(law: BuiltLaw) -> InputError:
    others = "Explicit" if getattr(law, "depends_on_time", False) else "Explicit or Relaxation"
    return InputError(
        f"force = {getattr(law, 'owner', type(law).__name__)}: expected BondAssociated, BondBased or Neural, which "
        f"have a tangent; or use the solver {others}"
    )
