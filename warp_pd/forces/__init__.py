"""Force laws: how displacements turn into forces.

A force law is a frozen dataclass with these attributes and methods:
    material, horizon, weights
    has_energy          whether its force is minus the gradient of an energy, or at least reports one
    has_tangent         whether Newton's method has a tangent for it
    signature(layout, breakable)            what decides which kernels are compiled
    build(workspace, sheet, breakable)      the law on a device: families, struct, alive, kernels, constants,
                                            add_force and, with an energy, add_energy; internal, add_update,
                                            add_start and start
"""

from __future__ import annotations

from pathlib import Path

from ..checks import InputError, one_of
from ..materials import Material
from .bond_associated import BondAssociated
from .bond_based import BondBased
from .hyperelastic_bonds import HyperelasticBonds
from .neural import Neural
from .nodal import Nodal
from .visco import Visco, ViscoBondBased

ForceLaw = BondAssociated | BondBased | HyperelasticBonds | Nodal | Neural | Visco | ViscoBondBased

NAMES = ("bond_associated", "nodal", "closed_form", "neural", "neural_fused")

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


def force_law(name: str, material: Material, horizon: float, weights: str = "auto") -> ForceLaw:
    """The law that a scene's `force` names.

    Args:
        name: "bond_associated", "nodal", "closed_form", "neural" (Torch), "neural_fused" (the same network in a
            kernel), or the file of a network, ending in .npz, for Torch.
        material: The scene's material.
        horizon: Horizon over the spacing [-].
        weights: Those of the bond-associated law; the others have none.

    Raises:
        InputError: for an unknown name, or weights that the law does not have.
    """
    network = None
    if name.endswith(".npz"):
        name, network = "neural", Path(name)
    one_of("force", name, NAMES)
    if name == "bond_associated":
        return BondAssociated(material, horizon=horizon, weights=weights)
    if weights != "auto":
        raise InputError(f"weights = {weights!r}: allowed with force {name!r} is 'auto', only bond_associated has any")
    if name == "nodal":
        return Nodal(material, horizon=horizon)
    evaluation = {"neural": "torch", "neural_fused": "fused"}.get(name, name)
    return Neural(material, horizon=horizon, evaluation=evaluation, network=network)
