"""Force laws, which map displacements to forces, one file per law. interfaces/law.py defines their interface."""

from typing import TYPE_CHECKING

from ..device.lazy import lazy

if TYPE_CHECKING:
    from .bond_associated import BondAssociated
    from .bond_based import BondBased
    from .by_name import NAMES, ForceLaw, force_law
    from .hyperelastic_bonds import HyperelasticBonds
    from .neural.law import Neural
    from .nodal import Nodal
    from .visco import Visco
    from .visco_bonds import ViscoBondBased
else:
    __getattr__ = lazy(
        __name__,
        {
            "bond_associated": "BondAssociated",
            "bond_based": "BondBased",
            "by_name": "NAMES ForceLaw force_law",
            "hyperelastic_bonds": "HyperelasticBonds",
            "neural.law": "Neural",
            "nodal": "Nodal",
            "visco": "Visco",
            "visco_bonds": "ViscoBondBased",
        },
    )

__all__ = [
    "NAMES",
    "BondAssociated",
    "BondBased",
    "ForceLaw",
    "HyperelasticBonds",
    "Neural",
    "Nodal",
    "Visco",
    "ViscoBondBased",
    "force_law",
]
