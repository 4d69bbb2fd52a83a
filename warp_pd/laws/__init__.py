"""The bond-associated force law, which maps displacements to forces. interfaces/part.py defines what a law is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .force_paths import Reference

# Faster paths to the force on a device with shared memory, tried in this order before the reference; subjects add them.
FORCE_PATHS: list[Callable[[], Sequence[type[Reference]]]] = []
