"""Settings and report of the search for equilibrium."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol


class EquilibriumSettings(Protocol):
    """Settings common to all searches for equilibrium, see `warp_pd.Newton`."""

    @property
    def tolerance(self) -> float | None:
        """Relative residual of equilibrium, or None for the default."""
        ...

    @property
    def most_iterations(self) -> int:
        """Maximum number of Newton steps per load step."""
        ...

    @property
    def preconditioner(self) -> str:
        """Preconditioner, or "auto"."""
        ...

    @property
    def stiffness(self) -> str:
        """Stiffness: "tangent" or "constant"."""
        ...

    @property
    def duration(self) -> float:
        """Load time at full load [s]."""
        ...


class NewtonSettings(EquilibriumSettings, Protocol):
    """Settings of `warp_pd.Newton`."""

    @property
    def load_steps(self) -> int:
        """Number of planned load steps."""
        ...

    @property
    def most_cuts(self) -> int:
        """Maximum number of cutbacks over the whole path."""
        ...


class PathSettings(EquilibriumSettings, Protocol):
    """Settings of `warp_pd.ArcLength`."""

    @property
    def increment(self) -> float:
        """Largest change of the load factor in a step."""
        ...

    @property
    def most_steps(self) -> int:
        """Maximum number of steps along the path."""
        ...

    @property
    def most_cuts(self) -> int:
        """Maximum number of times that one step is halved."""
        ...

    @property
    def modes(self) -> int:
        """Number of lowest eigenvalues of the tangent to find."""
        ...


@dataclass
class Report:
    """Report of one search; becomes "solve" in summary.json.

    Attributes:
        solver: Name of the solver.
        preconditioner: Preconditioner in use.
        load_steps: One entry per attempted load step: share (load factor), converged, rounds of rupture, and per
            lattice, coarsest first: points, relative residuals, accepted fractions of the steps, products with the
            stiffness.
    """

    solver: str
    preconditioner: str
    load_steps: list[dict[str, Any]] = field(default_factory=list)
    seconds: float = 0.0

    def summary(self, points: int, reached: float) -> dict[str, Any]:
        """The report as plain numbers and lists; iterations and products are those on the finest lattice."""
        finest = [level for step in self.load_steps for level in step["lattices"] if level["points"] == points]
        return {
            "solver": self.solver,
            "preconditioner": self.preconditioner,
            "iterations": sum(len(level["shares"]) for level in finest),
            "products": sum(level["products"] for level in finest),
            "rounds": sum(step["rounds"] for step in self.load_steps),
            "residuals": [r for level in finest for r in level["residuals"]],
            "reached": reached,
            "seconds": self.seconds,
            "load_steps": self.load_steps,
        }
