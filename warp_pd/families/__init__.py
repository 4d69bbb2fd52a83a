"""Families of bonds on the host: stencils of lattices, tables of clouds, and masks of intersections."""

from .build import build_families, notes_on_folds, require_connected, require_unfolded
from .tables import (
    INFLUENCE,
    Families,
    InfluenceFunction,
    influence_function,
    inverse_shape,
    notes_on_reach,
    pack,
    require_diagonals,
    tilts_of,
    unpack,
)

__all__ = [
    "INFLUENCE",
    "Families",
    "InfluenceFunction",
    "build_families",
    "influence_function",
    "inverse_shape",
    "notes_on_folds",
    "notes_on_reach",
    "pack",
    "require_connected",
    "require_diagonals",
    "require_unfolded",
    "tilts_of",
    "unpack",
]
