"""A band of damage whose mass falls with its stiffness, to tell what holds fast cracks back.

The mass of a point is its mass at rest times (1 - d)^2, as its stiffness is, but at least LEAST of it, so that the
stable step is not too short. Waves in the band are then as fast as in the sheet. No rubber is so; it is no part of the
package.
"""

import functools
from dataclasses import dataclass

import warp as wp

from warp_pd.interfaces import BuiltPart, Part
from warp_pd.kernels.effects import kernel
from warp_pd.kernels.numeric import numeric
from warp_pd.step import Phase

LEAST = 0.1


@functools.cache
def lighter(bits):
    """Kernel that sets the mass by the damage."""
    real = numeric(bits).real

    @kernel()
    def set_mass(
        damage: wp.array(dtype=real), at_rest: wp.array(dtype=real), least: real, first: int, mass: wp.array(dtype=real)
    ):
        i = wp.tid() + first
        left = real(1.0) - damage[i]
        mass[i] = at_rest[i] * wp.max(left * left, least)

    return set_mass


@dataclass(frozen=True)
class LightBand(Part):
    """The band of the damage field of the scene is light."""

    unbalanced = True

    def build(self, context, law):
        """Declare the mass at rest."""
        return BuiltLightBand(context)


class BuiltLightBand(BuiltPart):
    """The part on a device."""

    label = "loads: LightBand"

    def __init__(self, context):
        self.context, sheet = context, context.sheet
        mass = sheet.areas * sheet.thickness * sheet.density
        self.at_rest = context.array("mass_at_rest", "LightBand", context.types.real, mass)

    def add(self, phase, stage):
        """Add the launch."""
        if phase is Phase.INTERNAL_VARIABLES:
            stage.launch(
                "LightBand", lighter(self.context.bits), self.context.sheet.size, least=LEAST,
                damage=self.context.fields["damage_field"], at_rest=self.at_rest, mass=self.context.state.mass,
            )  # fmt: skip
