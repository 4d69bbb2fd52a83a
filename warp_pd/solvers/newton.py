"""Newton's method for static equilibrium: load steps, line search, added tension for slack sheets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.checks import count, one_of
from ..device.schedules import Schedule
from ..interfaces import BuiltLaw, BuiltSolver, History, System
from ..interfaces.context import Context
from ..interfaces.phases import Phase
from .newton_settings import StaticSolver
from .search import Search
from .static_system import BuiltStatic

STIFFNESSES = ("tangent", "constant")
# What Newton's method does of a step in time: forces, prescribed motion (by itself), rupture in equilibrium.
NOT_DONE = (
    Phase.RIGID_DRIFT, Phase.PROJECT, Phase.INTERNAL_VARIABLES, Phase.BOND_WORK, Phase.RIGID_KICK, Phase.SEPARATE,
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Newton(StaticSolver):
    """Newton's method for static equilibrium, for force laws with an energy ("plain" or "corrected" weights).

    The load factor s runs from 0 to 1: schedules are evaluated at the time s * duration, and loads without a schedule
    are multiplied by s. A load step that fails is halved (a cutback). On an uncut rectangle every load step is first
    solved on coarser lattices; elsewhere load steps after the first start from a linear extrapolation of the last two
    states. With a rupture criterion every load step finds equilibrium, breaks the bonds that exceed the criterion, and
    repeats until none break.

    A Newton step is accepted based on the work of the unbalanced force along it (Matthies and Strang, Int. J. Numer.
    Meth. Eng. 14, 1979), unless that force grows tenfold. This needs no potential, so it also works for follower
    pressure. Unsymmetric tangents are solved by GMRES, symmetric ones by conjugate gradients. If a step fails, or the
    initial state is slack, an isotropic tension is added to the tangent (not to the force) and removed as steps
    succeed.

    Attributes:
        tolerance: Norm of the unbalanced force divided by the norm of loads and reactions at which equilibrium is
            accepted; by default 1e-8 in float64 and 1e-4 in float32, which is limited by round-off.
        load_steps: Number of equal load steps, before cutbacks; each is recorded as a frame.
        most_iterations: Number of Newton steps after which a load step counts as failed.
        most_cuts: Maximum number of cutbacks over the whole path.
        preconditioner: "multigrid" (coarser lattices; uncut rectangles of more than 300 points, horizons up to 2.5),
            "algebraic" (aggregates of points by PyAMG; any sheet of more than 300 points whose bonds do not break,
            horizons up to 2.5), "direct" (a sparse factorisation on the host), "jacobi" (3x3 blocks), or "auto":
            multigrid where possible, otherwise algebraic on a CPU from 2000 points, direct below, and jacobi on a GPU.
            The bond-based law has no multigrid and is solved directly on both, up to 100 000 points.
        stiffness: "tangent", or, for the bond-based law, "constant": the published method without the geometric
            stiffness of the bonds (IM eq. 16, with current directions and moduli) and with full steps. For comparison
            only: it becomes slow and then oscillates as deformations and the ratio of moduli grow.
    """

    load_steps: int = 1
    stiffness: str = "tangent"

    def __post_init__(self) -> None:
        super().__post_init__()
        count("load_steps", self.load_steps, 1)
        one_of("stiffness", self.stiffness, STIFFNESSES)

    @property
    def frame_count(self) -> int:
        """Number of frames after the first, one per planned load step."""
        return self.load_steps

    @property
    def default_ramp(self) -> Schedule:
        """Loads without a schedule are proportional to the load factor."""
        return Schedule(np.array([0.0, self.duration]), np.repeat([[0.0], [1.0]], 3, axis=1))

    def build(self, context: Context, law: BuiltLaw) -> BuiltSolver:
        """Build the solver on a device.

        Raises:
            InputError: if the law has no tangent.
        """
        return BuiltNewton(self, context, law)


class BuiltNewton(BuiltStatic):
    """Newton's method on a device; a failed run ends in the state of its last good load step."""

    label = "solver = Newton"
    search: Search

    def __init__(self, solver: Newton, context: Context, law: BuiltLaw) -> None:
        self.solver, self.context = solver, context
        # Before anything else: a law without a tangent is refused.
        self.tangent = law.tangent(context, solver.stiffness == "tangent")

    def prepare(self, system: System) -> None:
        """Compose residual, tangent and, on a rectangle, the coarser lattices.

        Raises:
            InputError: for parts that Newton's method does not support.
        """
        system.refuse_phases("Newton", NOT_DONE)
        self.search = Search(self.solver, self.solver.load_steps, system, self.tangent)

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes on load steps between which the sheet may have jumped."""
        return [
            f"Newton: between load factors {jump['from']:.4g} and {jump['to']:.4g} the sheet moved "
            f"{jump['moved']:.3g} m, {jump['times']:.1f} times as far as in the load steps before: it may have "
            "jumped over a maximum of the load (a limit point), or buckled; "
            "the solver ArcLength follows what lies between, or prescribe a displacement (Motion) or the volume "
            "(EnclosedVolume)"
            for jump in self.search.jumps
        ] + self.search.rupture.notes()
