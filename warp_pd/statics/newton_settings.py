"""Settings and report of the search for equilibrium."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from ..device.checks import InputError, below_one, count, one_of, positive

PRECONDITIONERS = ("auto", "multigrid", "algebraic", "direct", "jacobi")


@dataclass(frozen=True, kw_only=True)
class NewtonSettings:
    """Settings of Newton's method in statics and in time steps; attributes as for `Newton`."""

    tolerance: float | None = None
    most_iterations: int = 30
    most_cuts: int = 6
    preconditioner: str = "auto"
    duration: float = 1.0
    precision: int = 64

    @property
    def stiffness(self) -> str:
        """The tangent, or "constant" (`Newton`)."""
        return "tangent"

    @property
    def at_fixed_load(self) -> NewtonSettings:
        """Settings of steps at a fixed load factor."""
        return self

    def __post_init__(self) -> None:
        if self.tolerance is not None:
            below_one("tolerance", self.tolerance)
        positive("duration", self.duration)
        count("most_iterations", self.most_iterations, 1)
        count("most_cuts", self.most_cuts, 0)
        one_of("preconditioner", self.preconditioner, PRECONDITIONERS)


class StaticSolver(NewtonSettings):
    """Base class of `Newton` and `ArcLength`."""

    dynamic: ClassVar[bool] = False
    steps_explicitly: ClassVar[bool] = False
    equal_frames: ClassVar[bool] = False
    mass_damping: ClassVar[float | None] = None


@dataclass(frozen=True, kw_only=True)
class PathSettings(StaticSolver):
    """Settings of `ArcLength` beyond those of `StaticSolver`; see `ArcLength` for the attributes."""

    increment: float = 0.1
    most_steps: int = 200
    most_iterations: int = 12
    most_cuts: int = 10
    modes: int = 3
    switch: int = 0

    @property
    def at_fixed_load(self) -> NewtonSettings:
        """Newton's own number of steps: from a slack sheet it does not fall with the load, as that of correctors."""
        return replace(self, most_iterations=max(self.most_iterations, NewtonSettings.most_iterations))

    def __post_init__(self) -> None:
        super().__post_init__()
        below_one("increment", self.increment)
        count("most_steps", self.most_steps, 1)
        count("modes", self.modes, 0)
        if count("switch", self.switch, 0) and self.modes == 0:
            raise InputError(f"switch = {self.switch!r}: expected modes > 0, which find bifurcations; got modes = 0")


@dataclass
class Report:
    """Report of one search; becomes "solve" in summary.json.

    Attributes:
        solver: Name of the solver.
        preconditioner: Preconditioner in use.
        load_steps: One entry per attempted load step: share (load factor), converged, rounds of rupture, and per
            lattice, coarsest first: points, relative residuals, whether the last one is round-off above the tolerance,
            accepted fractions of the steps, products with the stiffness.
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
