"""The bond-associated force law, which maps displacements to forces. interfaces/law.py defines what a law is."""

from collections.abc import Callable, Sequence
from typing import Any

# Faster paths to the force on a device with shared memory, tried in this order before the reference; subjects add
# functions that return them, which inherit from `Reference` of force_paths.py.
FORCE_PATHS: list[Callable[[], Sequence[Any]]] = []
