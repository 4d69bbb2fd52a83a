"""Materials: constants and their device functions."""

from typing import TYPE_CHECKING

from ..device.lazy import lazy

if TYPE_CHECKING:
    from .by_region import ByRegion
    from .compressible import Gent, NeoHookean
    from .energy import (
        borne,
        energy_density,
        largest_energy_density,
        material_doubts,
        modulus_in_tension,
        shear_modulus,
        stability_notes,
        stable_to,
        stretch_of_density,
        tension_energy_density,
    )
    from .incompressible import ArrudaBoyce, Carroll, ExtendedTube, Incompressible, MooneyRivlin, Ogden, Yeoh
    from .plane_stress import PlaneStress
    from .protocols import (
        Capabilities,
        Material,
        PairwiseMaterial,
        capabilities,
        check_material,
        padded_constants,
    )
    from .tension_field import WRINKLES, TensionField, with_wrinkles
else:
    __getattr__ = lazy(__name__)

__all__ = [
    "WRINKLES",
    "ArrudaBoyce",
    "ByRegion",
    "Capabilities",
    "Carroll",
    "ExtendedTube",
    "Gent",
    "Incompressible",
    "Material",
    "MooneyRivlin",
    "NeoHookean",
    "Ogden",
    "PairwiseMaterial",
    "PlaneStress",
    "TensionField",
    "Yeoh",
    "borne",
    "capabilities",
    "check_material",
    "energy_density",
    "largest_energy_density",
    "material_doubts",
    "modulus_in_tension",
    "padded_constants",
    "shear_modulus",
    "stability_notes",
    "stable_to",
    "stretch_of_density",
    "tension_energy_density",
    "with_wrinkles",
]
