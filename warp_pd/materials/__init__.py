"""Materials: constants, and the device functions that they belong to."""

from .compressible import Gent, NeoHookean
from .incompressible import ArrudaBoyce, Incompressible, MooneyRivlin, Ogden, Yeoh
from .pairwise import Bimodular
from .prony import Prony
from .protocols import Capabilities, Material, PairwiseMaterial, capabilities, check_material, padded_constants
from .tension_field import TensionField

__all__ = [
    "ArrudaBoyce",
    "Bimodular",
    "Capabilities",
    "Gent",
    "Incompressible",
    "Material",
    "MooneyRivlin",
    "NeoHookean",
    "Ogden",
    "PairwiseMaterial",
    "Prony",
    "TensionField",
    "Yeoh",
    "capabilities",
    "check_material",
    "padded_constants",
]
