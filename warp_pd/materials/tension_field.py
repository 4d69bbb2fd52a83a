"""Tension field theory: wrinkles finer than the spacing, by a relaxed energy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from ..device.checks import InputError, not_negative, one_of
from .plane_stress import PlaneStress
from .protocols import Material, capabilities, check_material

if TYPE_CHECKING:
    from ..kernels.materials import MaterialFunctions
    from ..kernels.numeric import FunctionFactory

WRINKLES = ("relaxed", "resolved")


@dataclass(frozen=True)
class TensionField(PlaneStress):
    """A material that does not resist compression, because the sheet wrinkles more finely than the spacing.

    Its energy is the relaxed energy of the material, see kernels/tension_field.py: no principal stress is negative, and
    the stiffness never exceeds that of the taut sheet. Wrinkles that the points could resolve do not form.
    Sources: Reissner 1938, Pipkin 1986, Steigmann 1990.

    Attributes:
        material: Any isotropic continuum hyperelastic material, including user-defined ones. Its `width`, if available,
            gives the width in uniaxial tension; otherwise it is computed from the stress.
        slack_stiffness: Stiffness [Pa] that the sheet keeps where it is slack or wrinkled, and has in addition where it
            is taut. A thousandth of the shear modulus lets static solvers converge where slack regions come and go,
            as behind cracks.

    Raises:
        InputError: for any other material, or a negative stiffness.
    """

    material: Material
    slack_stiffness: float = 0.0

    goes_slack: ClassVar[bool] = True

    def __post_init__(self) -> None:
        not_negative("TensionField.slack_stiffness", self.slack_stiffness)
        check_material(self.material, "functions")
        known = capabilities(self.material)
        name = type(self.material).__name__
        if known.regions:
            raise InputError("TensionField.material = ByRegion: expected a TensionField in each region instead")
        if known.goes_slack:
            raise InputError(f"TensionField.material = {name}: expected a material that resists compression")
        if known.remembers is not None:
            raise InputError(f"TensionField.material = {name}: expected a material without an internal variable")
        if not known.isotropic:
            raise InputError(f"TensionField.material = {name}: expected an isotropic material, with `isotropic = True`")

    @property
    def constants(self) -> tuple[float, ...]:
        """The constants of the material."""
        return self.material.constants

    @property
    def lock(self) -> float | None:
        """Locking parameter of the material [-], or None."""
        return capabilities(self.material).lock

    @property
    def by_point(self) -> Any:
        """Values by point of the material."""
        return capabilities(self.material).by_point

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes of the material."""
        return capabilities(self.material).notes

    @property
    def wrinkle_width(self) -> FunctionFactory:
        """Width of the material in uniaxial tension."""
        from ..kernels.tension_field import width_from_stress

        return capabilities(self.material).width or width_from_stress(self.material.functions)

    @property
    def resisting(self) -> Material:
        """The material."""
        return self.material

    @property
    def on_device(self) -> MaterialFunctions:
        """Warp functions of the material with wrinkles, made by `kernels.tension_field.tension_field`."""
        from ..kernels.tension_field import tension_field

        known = capabilities(self.material)
        return tension_field(
            self.material.functions, known.near, known.response, known.volume, self.wrinkle_width,
            float(self.slack_stiffness),
        )  # fmt: skip


def with_wrinkles(material: Material, wrinkles: str) -> Material:
    """The material for a scene's argument `wrinkles`.

    Args:
        material: Any isotropic continuum hyperelastic material.
        wrinkles: "relaxed": wrinkles are finer than the spacing, see TensionField. "resolved": the points resolve the
            wrinkles, and the sheet resists in-plane compression.

    Raises:
        InputError: for any other value.
    """
    return TensionField(material) if one_of("wrinkles", wrinkles, WRINKLES) == "relaxed" else material
