"""The base class of the package's own materials."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from .energy import stable_to

if TYPE_CHECKING:
    from ..kernels.materials import MaterialFunctions
    from ..kernels.numeric import PairFactory


class PlaneStress:
    """Isotropic sheet in plane stress; `on_device` has its capabilities, see `kernels.materials.MaterialFunctions`."""

    isotropic: ClassVar[bool] = True

    @property
    def functions(self) -> PairFactory:
        """Factory of (stress, energy)."""
        return self.on_device.functions

    def stable_to(self, loading: str) -> float:
        """Largest stretch [-] up to which the material is stable; inf if it always is. See `energy.stable_to`."""
        return stable_to(self, loading)

    @property
    def on_device(self) -> MaterialFunctions:
        """Factories of the material's Warp functions."""
        raise NotImplementedError(f"{type(self).__name__}.on_device: expected the material's Warp functions")
