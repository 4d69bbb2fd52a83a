"""Simulation: a scene that can be built, planned and run."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..materials import capabilities
from .scene import Measure, Outcome, Scene

if TYPE_CHECKING:
    from .built import Built
    from .result import Result


@dataclass(eq=False, repr=False)
class Simulation(Scene):
    """A sheet and everything that acts on it. Nothing is allocated before `build` or `run`."""

    __doc__ = f"{__doc__}\n{(Scene.__doc__ or '').split(chr(10), 1)[1]}"

    def __repr__(self) -> str:
        """One line per part instead of the default text with all arrays."""
        from ..output.notebook import text_table
        from .result import scene_rows

        return text_table(f"Simulation {self.scene!r}", scene_rows(self))

    def _repr_html_(self) -> str:
        """HTML for a notebook, one line per part."""
        from ..output.notebook import html_table
        from .result import scene_rows

        return html_table(f"Simulation {self.scene!r}", scene_rows(self))

    def build(self, device: str | None = None, precision: int | None = None) -> Built:
        """Allocate arrays and declare kernels and launches, without compiling.

        Args:
            device: "cpu", "cuda", "cuda:0", ...; by default CUDA if available.
            precision: 32 or 64; by default the solver's.

        Raises:
            InputError: for parts that do not fit together, or a device that does not exist.
        """
        from .built import compose

        return compose(self, device, precision)

    def plan(self, device: str | None = None, precision: int | None = None) -> str:
        """Table of the arrays and launches of this simulation."""
        from .result import plan

        return plan(self.build(device, precision))

    def draw(self, path: str | os.PathLike[str] | None = None) -> Any:
        """Draw the undeformed sheet without building the simulation; see `warp_pd.draw_sheet`."""
        from . import VIEWERS

        return VIEWERS[-1].draw_sheet(self.sheet, path, self.scene, capabilities(self.force.material).regions)

    def run(self, **options: Any) -> Result:
        """Run the simulation; options as for `warp_pd.run.runner.run`. Notebooks show the progress by default."""
        from .runner import run

        if "reporter" not in options and "IPython" in sys.modules:
            from ..output.notebook import in_notebook
            from ..output.progress import Progress

            if in_notebook():
                options["reporter"] = Progress()
        return run(self, **options)


__all__ = ["Measure", "Outcome", "Simulation"]
