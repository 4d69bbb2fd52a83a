"""Modules that moved: for one release the old names import the new ones, with a warning."""

from __future__ import annotations

import importlib
import importlib.abc
import importlib.machinery
import sys
import warnings
from collections.abc import Sequence
from types import ModuleType

MOVED = {
    "warp_pd.bonds": ("warp_pd.families", "warp_pd.laws.family_struct"),
    "warp_pd.contact": ("warp_pd.parts",),
    "warp_pd.damage": ("warp_pd.parts", "warp_pd.parts.rupture"),
    "warp_pd.forces": ("warp_pd.laws",),
    "warp_pd.forces.network": ("warp_pd.networks",),
    "warp_pd.forces.training": ("warp_pd.torch_backend.training",),
    "warp_pd.homogeneous": ("warp_pd.analytic_response",),
    "warp_pd.launches": ("warp_pd.device.launches",),
    "warp_pd.loads": ("warp_pd.parts", "warp_pd.parts.boundary_force", "warp_pd.schedules"),
    "warp_pd.off_plane": ("warp_pd.out_of_plane",),
    "warp_pd.runner": ("warp_pd.run.runner", "warp_pd.run.folder"),
}


class MovedModules(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Finds the modules of MOVED under their old names."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """A spec for an old name."""
        if fullname not in MOVED:
            return None
        # A package, so that Python looks for names below it.
        return importlib.machinery.ModuleSpec(fullname, self, is_package=True)

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> ModuleType:
        """A module with everything that the new ones have."""
        new = MOVED[spec.name]
        said = " and ".join(new)
        warnings.warn(f"{spec.name} has moved to {said}; the next release drops the old name", FutureWarning, 2)
        module = ModuleType(spec.name)
        for name in new:
            found = vars(importlib.import_module(name))
            module.__dict__.update({key: value for key, value in found.items() if not key.startswith("__")})
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Does nothing: the module is filled already."""


def install() -> None:
    """Registers the old names with the import system."""
    if not any(isinstance(finder, MovedModules) for finder in sys.meta_path):
        sys.meta_path.append(MovedModules())
