"""Coarser lattices over the same rectangle, for initial guesses and as a multigrid preconditioner.

The coarse sheets have the same law, with plain weights and the same horizon in spacings, so no matrix is assembled:
every level is linearised at the displacement of the finest one. Solving on coarse levels first gives Newton's method a
good start. A V-cycle, smoothed by block Jacobi and solved directly on the coarsest level, makes the number of
iterations independent of the number of points.
"""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ..context import Context, State
from ..device.fields import Array, assign, doubles
from ..device.launches import Stage
from ..geometry.sheet import Sheet
from ..geometry.triangulation import Lattice
from ..interfaces import BuiltLaw, System
from ..kernels.loads import begin_loads
from ..kernels.statics.equilibrium import lattice_transfer
from .factors import Solve
from .level import OWNER, Level
from .tangent import tangent_of

# The coarsest lattice has at most this many points, and every lattice this many along each side.
MAX_COARSEST = 300
MIN_SIDE = 7
MIN_HORIZON = 1.5


class Hierarchy:
    """Levels of one sheet, finest first, and the V-cycle between them.

    Attributes:
        levels: The levels.
        lattices: Their lattices.
    """

    def __init__(self, finest: Level, system: System) -> None:
        """Build the coarser levels of an uncut rectangle, whose law and loads can be built on coarser lattices."""
        context = finest.context
        sheet = context.sheet
        assert sheet.lattice is not None
        self.levels, self.lattices = [finest], [sheet.lattice]
        # Dead loads [N], restricted from the finest level.
        self._dead_loads: list[Array | None] = [None]
        self._dead: Array | None = None
        coarser_lattices = coarser(sheet.lattice)
        if context.options.loaded and coarser_lattices:
            self._dead = context.array("dead_loads", OWNER, context.types.vec3, shape=sheet.size)
            stage = context.stage("dead loads", "every load step, for the coarser lattices")
            system.external.add_dead(stage, self._dead)
        for depth, lattice in enumerate(coarser_lattices, 1):
            self._add_coarser(finest, system, depth, lattice)
        self._smoothers = [Smoother(level) for level in self.levels]
        for fine in range(len(self.levels) - 1):
            self._add_transfer(fine)
        self._sparse = self.levels[-1].tangent.sparse()
        self._coarsest: Solve | None = None
        # Whether the coarsest tangent is yet to be factorised.
        self._renewed = False
        # Level that starts from an equilibrium of the next coarser one, and tension added to the tangents there.
        self._started: int | None = None
        self._tension = 0.0

    def _add_coarser(self, finest: Level, system: System, depth: int, lattice: Lattice) -> None:
        context = coarse_context(finest.context, depth, lattice, self.lattices[0])
        law = coarse_law(finest.law, context, lattice)
        following = [found for load in finest.following if (found := load.on_coarser(context, law)) is not None]
        level = Level(context, law, tangent_of(law, context, True), following, moves=finest.inertia is not None)
        stage, state = context.stage("evaluate", "every residual of Newton"), context.state
        dead: Array | None = None
        with stage.one_launch():
            law.add_force(stage, state.displacement, state.force)
            if state.external is not None:
                dead = context.array("dead_loads", OWNER, context.types.vec3, shape=level.points)
                begin = begin_loads(context.bits, True)
                stage.pointwise(OWNER, begin, level.points, constant=dead, external=state.external)
                for load in following:
                    load.add_force(stage, state.displacement, state.external)
        level.add_residual(stage, None if system.external.keep_dead_apart() is None else dead)
        self._dead_loads.append(dead)
        self.levels.append(level)
        self.lattices.append(lattice)

    def set_loads(self, index: int) -> None:
        """Restrict the current dead loads of the finest lattice to a coarser one."""
        loads = self._dead_loads[index]
        if loads is not None and self._dead is not None:
            self.levels[0].run("dead loads")
            dead = doubles(self._dead)
            assign(loads, restrict_loads(dead, self.lattices[0], self.lattices[index]))

    def _add_transfer(self, index: int) -> None:
        fine, coarse = self.levels[index], self.levels[index + 1]
        a, b = self.lattices[index], self.lattices[index + 1]
        context = fine.context
        interpolate, smoothly, restrict = lattice_transfer(context.bits, context.options.held)
        smoother, below = self._smoothers[index], self._smoothers[index + 1]
        down = context.stage("down", "every V-cycle, downwards")
        smoother.add_down(down)
        down.launch(
            OWNER, restrict, coarse.points,
            right_side=smoother.right_side, image=fine.image, columns=a.columns, rows=a.rows, coarse_columns=b.columns,
            coarse_rows=b.rows, held_mask=coarse.context.state.held_mask, coarse=below.right_side,
        )  # fmt: skip
        up = context.stage("up", "every V-cycle, upwards")
        up.launch(
            OWNER, interpolate, fine.points,
            source=below.solution, source_columns=b.columns, source_rows=b.rows, columns=a.columns, rows=a.rows,
            held_mask=context.state.held_mask, target=smoother.solution,
        )  # fmt: skip
        smoother.add_up(up)
        context.stage("start from coarser", "every load step").launch(
            OWNER, smoothly, fine.points,
            source=coarse.displacement, source_columns=b.columns, source_rows=b.rows, columns=a.columns, rows=a.rows,
            target=fine.displacement,
        )  # fmt: skip
        context.stage("sample", "every load step and tangent, for the coarser lattice").launch(
            OWNER, smoothly, coarse.points,
            source=fine.displacement, source_columns=a.columns, source_rows=a.rows, columns=b.columns, rows=b.rows,
            target=coarse.displacement,
        )  # fmt: skip

    def linearise(self, finest: int, tension: float, keep: bool = False) -> None:
        """Compute the tangents of `finest` and all coarser levels at its displacement, and set up the smoothers.

        Where a sheet is slack on a coarser level but not on the finest, the V-cycle would take far too long a step. So
        coarser levels of a material that goes slack get the mean tension of the sheet in addition. With `keep` coarser
        levels keep the tangents that they have, as they do where an equilibrium of theirs is the start.
        """
        self.levels[finest].linearise(tension)
        last = len(self.levels) - 1
        started, self._started = self._started == finest < last - 1, None
        if finest < last and (keep or (started and tension == 0.0 == self._tension)):
            return
        for index in range(finest, last):
            self.levels[index].run("sample")
        if finest < last and self.levels[last].law.goes_slack:
            self.levels[last].linearise(tension)
            tension = max(tension, self.levels[last].tangent.mean_tension())
        self._tension = tension
        for level in self.levels[finest + 1 :]:
            level.linearise(tension)
        self._renewed = True
        if finest < len(self.levels) - 1:
            # Common to all levels: measured on a small one.
            largest = self._smoothers[-2].largest_eigenvalue()
            for smoother in self._smoothers:
                smoother.tune(largest)

    @property
    def usable(self) -> bool:
        """Whether the coarsest tangent could be factorised."""
        return self._coarsest is not None

    def prepare(self, keep: bool = False) -> bool:
        """Factorise the coarsest tangent; return whether the levels are usable. `linearise` knows what to keep."""
        if self._renewed:
            self._coarsest, self._renewed = self._sparse.factorise(), False
        return self.usable

    def sides(self, index: int) -> tuple[Array, Array]:
        """Right-hand side and solution of the V-cycle that starts at a level, (N,) vec3."""
        return self._smoothers[index].right_side, self._smoothers[index].solution

    def cycle(self, finest: int) -> None:
        """Run one V-cycle that starts at the level `finest`."""
        last = len(self.levels) - 1
        for index in range(finest, last):
            self.levels[index].run("down")
        side, solution = self.sides(last)
        assert self._coarsest is not None
        assign(solution, self._coarsest(doubles(side)))
        for index in reversed(range(finest, last)):
            self.levels[index].run("up")

    def products_per_cycle(self, finest: int) -> int:
        """Number of stiffness products of one V-cycle on its finest level."""
        return 2 * SWEEPS if finest < len(self.levels) - 1 else 0

    def sample(self) -> None:
        """Interpolate the displacement of the finest level to all coarser ones."""
        self._started = None
        for level in self.levels[:-1]:
            level.run("sample")

    def start(self, index: int) -> None:
        """Interpolate the displacement of the next coarser level to level `index`."""
        self.levels[index].run("start from coarser")
        self._started = index


def coarser(lattice: Lattice) -> list[Lattice]:
    """Lattices over the same rectangle, each with half as many spacings as the one before."""
    result = []
    while lattice.columns * lattice.rows > MAX_COARSEST:
        columns, rows = lattice.columns // 2 + 1, lattice.rows // 2 + 1
        if min(columns, rows) < MIN_SIDE:
            break
        width, height = lattice.dx * (lattice.columns - 1), lattice.dy * (lattice.rows - 1)
        lattice = Lattice(columns, rows, width / (columns - 1), height / (rows - 1))
        result.append(lattice)
    return result


def coarse_points(lattice: Lattice, finest: Lattice) -> np.ndarray:
    """The point of the finest lattice nearest to each point of a coarser one."""
    columns = np.round(np.arange(lattice.columns) * (finest.columns - 1) / (lattice.columns - 1)).astype(int)
    rows = np.round(np.arange(lattice.rows) * (finest.rows - 1) / (lattice.rows - 1)).astype(int)
    return np.asarray((columns[None, :] + rows[:, None] * finest.columns).ravel())


def restrict_loads(forces: np.ndarray, finest: Lattice, lattice: Lattice) -> np.ndarray:
    """Work-equivalent forces on the points of a coarser lattice [N], shape (N, 3)."""
    along_x, along_y = _hats(finest.columns, lattice.columns), _hats(finest.rows, lattice.rows)
    grid = forces.reshape(finest.rows, finest.columns, 3)
    return np.asarray(np.einsum("Yy,yxc,Xx->YXc", along_y, grid, along_x, optimize=True).reshape(-1, 3))


def _hats(fine: int, coarse: int) -> np.ndarray:
    """Weights of linear interpolation, shape (coarse, fine)."""
    place = np.arange(fine) * (coarse - 1) / (fine - 1)
    return np.maximum(0.0, 1.0 - np.abs(place[None, :] - np.arange(coarse)[:, None]))


def coarse_context(context: Context, depth: int, lattice: Lattice, finest: Lattice) -> Context:
    """Context of a coarser lattice over the same rectangle, with the state needed for equilibrium."""
    sheet = context.sheet
    width, height = lattice.dx * (lattice.columns - 1), lattice.dy * (lattice.rows - 1)
    near = coarse_points(lattice, finest)
    solid = sheet.at_points(lambda values: values[near])
    coarse = Sheet.rectangle(
        width, height, thickness=solid["thickness"], density=solid["density"], points=(lattice.columns, lattice.rows)
    )
    held = context.held[near]
    made = context.on(coarse, f"lattice {depth} ", held)
    vec3, n = made.types.vec3, coarse.size
    # A coarser lattice is only ever in equilibrium: no point of it has a velocity or a mass.
    nothing = wp.zeros(0, dtype=vec3, device=made.device)
    made.state = State(
        displacement=made.array("displacement", OWNER, vec3, shape=n),
        velocity=nothing,
        force=made.array("force", OWNER, vec3, shape=n),
        mass=nothing,
        external=made.array("external", OWNER, vec3, shape=n) if made.options.loaded else None,
        held_mask=made.array("held", OWNER, wp.uint8, held) if made.options.held else None,
    )
    return made


def coarse_law(law: BuiltLaw, context: Context, lattice: Lattice) -> BuiltLaw:
    """The law on a coarser lattice, with a horizon that includes at least diagonal neighbours."""
    ratio = max(MIN_HORIZON, 1.001 * float(np.hypot(lattice.dx, lattice.dy)) / context.sheet.spacing)
    found = law.on_coarser(context, ratio)
    assert found is not None
    return found


# Sweeps before and after the coarse correction, and the ratio of the largest to the smallest eigenvalue of D^-1 K
# that they smooth.
SWEEPS = 2
SPECTRUM_RATIO = 5.0
# Steps of the power iteration and safety factor of its result; fewer steps on a large sheet, where each is expensive.
POWER_ITERATIONS, SAFETY = 12, 1.1
FEW_ITERATIONS, FEW_SAFETY = 6, 1.3


class Smoother:
    """The sweeps of one level.

    Attributes:
        right_side: Right-hand side of the V-cycle, (N,) vec3.
        solution: Its solution, (N,) vec3.
    """

    def __init__(self, level: Level) -> None:
        self.level = level
        context, t, n = level.context, level.context.types, level.points
        self.right_side = context.array("right_side", OWNER, t.vec3, shape=n)
        self.solution = context.array("correction", OWNER, t.vec3, shape=n)
        self._omegas = context.array("sweep_factors", OWNER, t.real, shape=SWEEPS, per="once")

    def add_down(self, stage: Stage) -> None:
        """Add the sweeps from zero, and the product of the solution into `image`."""
        for sweep in range(SWEEPS):
            self._sweep(stage, sweep, fresh=sweep == 0)
        self.level.add_product(stage, self.solution, self.level.image, following=False, rough=True)

    def add_up(self, stage: Stage) -> None:
        """Add the sweeps after the coarse correction, in reverse order."""
        for sweep in reversed(range(SWEEPS)):
            self._sweep(stage, sweep, fresh=False)

    def _sweep(self, stage: Stage, sweep: int, fresh: bool) -> None:
        level = self.level
        if not fresh:
            level.add_product(stage, self.solution, level.image, following=False, rough=True)
        stage.launch(
            OWNER, level.kernels.smooth, level.points,
            inverse_blocks=level.tangent.inverse_blocks, right_side=self.right_side, image=level.image,
            omegas=self._omegas, sweep=sweep, fresh=int(fresh), solution=self.solution,
        )  # fmt: skip

    def largest_eigenvalue(self, iterations: int = POWER_ITERATIONS, safety: float = SAFETY) -> float:
        """Estimated bound on the eigenvalues of D^-1 K, by power iteration."""
        level = self.level
        blocks = doubles(level.tangent.inverse_blocks)
        v = np.random.default_rng(0).normal(size=(level.points, 3))
        v /= math.sqrt(v.size)
        largest = 1.0
        for _ in range(iterations):
            assign(level.vector, v)
            level.run("product")
            v = np.einsum("iab,ib->ia", blocks, doubles(level.image))
            largest = math.sqrt(float(np.einsum("ic,ic->", v, v)))
            v /= largest
        return safety * largest

    def tune(self, largest: float) -> None:
        """Set the sweeps for the largest eigenvalue of D^-1 K."""
        angles = np.cos(np.pi * (2.0 * np.arange(SWEEPS) + 1.0) / (2.0 * SWEEPS))
        middle, half = 0.5 * largest * (1.0 + 1.0 / SPECTRUM_RATIO), 0.5 * largest * (1.0 - 1.0 / SPECTRUM_RATIO)
        assign(self._omegas, 1.0 / (middle + half * angles))
