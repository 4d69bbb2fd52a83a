"""Fictitious masses of dynamic relaxation: row sums of the stiffness."""

from __future__ import annotations

import functools
from typing import Any

from ..device.fields import Array
from ..device.launches import Stage
from ..interfaces import BuiltLaw
from ..kernels.effects import Kernel
from ..kernels.statics.relaxation import row_sums
from ..laws.bond_associated import BondAssociatedForce
from ..laws.family_law import FamilyLaw
from ..materials import capabilities, modulus_in_tension

# Strain at which a sheet is taut everywhere; its largest frequency with the fictitious mass, 0.30 to 0.32 at every
# horizon.
TAUT, TAUT_FREQUENCY = 0.05, 0.3
# Strain of a strip of one spacing whose force counts as none where all is slack.
SLACK_STRAIN = 1e-2


@functools.singledispatch
def fictitious_mass(law: BuiltLaw, stage: Stage) -> Array | None:
    """Add the launches that fill and return an array (N,) with a fictitious mass [N/m]; None if the law has none.

    Laws that have one register how it is found.
    """
    return None


@fictitious_mass.register(BondAssociatedForce)
def _(law: BondAssociatedForce, stage: Stage) -> Array | None:
    """None for a material without `response`."""
    material, context = law.material, law.context
    response = capabilities(material).response
    if response is None:
        return None
    rows, total = row_sums(law.layout, response, law.law.form)
    own = context.array("own_row", "Relaxation", context.types.real, shape=law.points)
    least = 1e-3 * _modulus(law) * law.thickness

    def add_density(name: str, displacement: Array, taut: Array | None) -> Array:
        density = context.array(name, "Relaxation", context.types.real, shape=law.points)
        stage.launch(
            "Relaxation", rows, law.points,
            family=law.struct, displacement=displacement, constants=law.constants,
            unit_stiffness=law.unit_stiffness, damage=law.damage, row=law.pairs, own=own,
        )  # fmt: skip
        stage.launch(
            "Relaxation", total, law.points, family=law.struct, row=law.pairs, own=own, least=least, taut=taut,
            density=density,
        )  # fmt: skip
        return density

    taut = None
    if law.goes_slack and not law.slack_stiffness:
        # What is slack may be taut a step later, and would then be too stiff for its density.
        stretched = context.array("stretched", "Relaxation", context.types.vec3, TAUT * context.sheet.positions)
        taut = add_density("taut_mass", stretched, None)
        law.slack_frequency = TAUT_FREQUENCY
        law.slack_force = 1e3 * least * SLACK_STRAIN * context.whole.spacing
    return add_density("fictitious_mass", context.state.displacement, taut)


def _modulus(law: BondAssociatedForce) -> float:
    """A positive modulus of the material [Pa]."""
    first = float(next(iter(law.material.constants), 0.0))
    return first if first > 0.0 else modulus_in_tension(law.material, law.context.device)


def add_row_sums(law: FamilyLaw, stage: Stage, kernel: Kernel, least: float, **more: Any) -> Array:
    """Add the launch that fills an array (N,) with the row sums of the stiffness, at least `least` [N/m]."""
    context = law.context
    density = context.array("fictitious_mass", "Relaxation", context.types.real, shape=law.points)
    law.add_launch(
        stage, kernel, context.state.displacement, unit_stiffness=law.unit_stiffness, least=least, density=density,
        **more,
    )  # fmt: skip
    return density
