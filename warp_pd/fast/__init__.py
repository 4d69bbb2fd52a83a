"""Faster paths to the same force: families that share blocks, undamaged lattices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..laws import FORCE_PATHS

if TYPE_CHECKING:
    from ..laws.force_paths import Reference


def _paths() -> Sequence[type[Reference]]:
    from .force_paths import PATHS

    return PATHS


FORCE_PATHS.append(_paths)
