"""Base class of the package's continuum materials."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from ..kernels.factories import FunctionFactory, PairFactory
    from ..kernels.materials import MaterialFunctions


class PlaneStress:
    """Isotropic sheet in plane stress; its properties forward to `kernels.materials.MaterialFunctions`."""

    isotropic: ClassVar[bool] = True

    @property
    def functions(self) -> PairFactory:
        """Factory of (stress, energy)."""
        return self.on_device.functions

    @property
    def near(self) -> FunctionFactory | None:
        """Factory of `stress_near`."""
        return self.on_device.near

    @property
    def response(self) -> FunctionFactory | None:
        """Factory of stress and moduli."""
        return self.on_device.response

    @property
    def volume(self) -> FunctionFactory | None:
        """Factory of the volume change."""
        return self.on_device.volume

    @property
    def width(self) -> FunctionFactory | None:
        """Factory of the width in uniaxial tension."""
        return self.on_device.width

    @property
    def membrane(self) -> PairFactory | None:
        """Factory of the Warp functions for volume change and shear modulus; None if the material has none."""
        return self.on_device.membrane

    @property
    def on_device(self) -> MaterialFunctions:
        """Factories of the material's Warp functions."""
        raise NotImplementedError(
            f"{type(self).__name__}.on_device: expected an implementation that returns the Warp functions"
        )
