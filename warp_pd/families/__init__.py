"""Families of bonds on the host: stencils of lattices, tables of clouds, and masks of intersections."""

from .build import build_families
from .connections import require_connected
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
    "pack",
    "require_connected",
    "require_diagonals",
    "tilts_of",
    "unpack",
]
