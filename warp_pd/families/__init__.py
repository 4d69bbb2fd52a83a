"""Families of bonds on the host: stencils of lattices, tables of clouds, and masks of intersections."""

from .build import build_families
from .connections import notes_on_folds, require_connected, require_unfolded
from .horizon import require_diagonals
from .masks import pack, unpack
from .tables import (
    INFLUENCE,
    Families,
    InfluenceFunction,
    influence_function,
    inverse_shape,
    tilts_of,
)

__all__ = [
    "INFLUENCE",
    "Families",
    "InfluenceFunction",
    "build_families",
    "influence_function",
    "inverse_shape",
    "notes_on_folds",
    "pack",
    "require_connected",
    "require_diagonals",
    "require_unfolded",
    "tilts_of",
    "unpack",
]
