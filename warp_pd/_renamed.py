"""Renamed attributes of a built simulation: for one release the old names work, with a warning."""

from __future__ import annotations

import operator
import warnings
from typing import Any

RENAMED = {
    "workspace": "context",
    "force": "law",
    "step": "state.step",
    "mass": "state.mass",
    "held": "context.held",
    "stable_step": "solver.stable_step",
    "strain_energy": "law.strain_energy",
    "kinetic_energy": "checks.kinetic_energy",
    "damage": "rupture.damage",
    "intact": "rupture.intact_faces",
}


class RenamedAttributes:
    """Finds attributes of RENAMED under their old names."""

    def __getattr__(self, name: str) -> Any:
        if name not in RENAMED:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        new = RENAMED[name]
        warnings.warn(f"{name} is now called {new}; the next release drops the old name", FutureWarning, 2)
        return operator.attrgetter(new)(self)
