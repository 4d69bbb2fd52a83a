"""Force laws that scenes can select by name."""

from __future__ import annotations

from pathlib import Path

from ..device.checks import InputError, one_of
from ..interfaces import Law
from ..laws.bond_associated import BondAssociated
from ..materials import WRINKLES, Material, with_wrinkles

NAMES = ("bond_associated", "nodal", "closed_form", "neural", "neural_fused")


def point_areas(areas: str, weights: str) -> str:
    """Argument `areas` of `Sheet.rectangle` from that of a scene, whose "auto" is how a law's papers count.

    BA and NN have one volume a point, so "auto" is "whole" with published weights; other weights need "shared".
    """
    if one_of("areas", areas, ("auto", "shared", "whole")) == "auto":
        return "whole" if weights == "published" else "shared"
    return areas


def force_law(name: str, material: Material, horizon: float, weights: str = "auto", wrinkles: str = "resolved") -> Law:
    """Create the law named by a scene's argument `force`.

    Args:
        name: "bond_associated", "nodal", "closed_form", "neural" (Torch), "neural_fused" (the same network in a
            kernel), or the file of a network, ending in .npz, for Torch.
        material: The scene's material.
        horizon: Horizon in spacings [-].
        weights: Weights of the law; Nodal has none.
        wrinkles: "relaxed" or "resolved", see `with_wrinkles`; "auto" means "relaxed" for laws that accept any
            material.

    Raises:
        InputError: if the name is unknown or the law does not have these weights.
    """
    network = None
    if name.endswith(".npz"):
        name, network = "neural", Path(name)
    one_of("force", name, NAMES)
    if one_of("wrinkles", wrinkles, ("auto", *WRINKLES)) == "auto":
        wrinkles = "relaxed" if name in ("bond_associated", "nodal") else "resolved"
    material = with_wrinkles(material, wrinkles)
    if name == "bond_associated":
        return BondAssociated(material, horizon=horizon, weights=weights)
    if name == "nodal":
        if weights != "auto":
            raise InputError(f"weights = {weights!r}: expected 'auto', because force 'nodal' has no weights")
        from .nodal import Nodal

        return Nodal(material, horizon=horizon)
    from .neural.law import Neural

    evaluation = {"neural": "torch", "neural_fused": "fused"}.get(name, name)
    return Neural(material, horizon=horizon, evaluation=evaluation, network=network, weights=weights)
