"""Coarser lattices over the same rectangle: where Newton starts, and its preconditioner.

The coarse sheets carry the same law, with plain weights and the same horizon in spacings, so nothing is
assembled: every level is linearised at the displacement of the finest one. Solving on them first puts Newton
near the answer; a V-cycle through them, smoothed by block Jacobi and solved directly on the coarsest, makes the
number of iterations independent of the number of points.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..forces.bond_associated import BondAssociatedForce
from ..launches import Workspace
from ..sheet import Lattice, Sheet
from .equilibrium import OWNER, assign
from .tangent import SparseTangent, Tangent

if TYPE_CHECKING:
    from ..simulation import Built

# The coarsest lattice has at most this many points, and every lattice this many along each side.
COARSEST = 300
FEWEST = 7
# Chebyshev sweeps before and after the coarse correction, over this share of the spectrum of D^-1 K.
SWEEPS = 2
SPECTRUM_SHARE = 5.0
POWER_ITERATIONS = 12
SAFETY = 1.1
COARSE_HORIZON = 1.5


class Hierarchy:
    """Levels of one sheet, finest first, and the V-cycle between them.

    Attributes:
        levels: The tangents.
        lattices: Their lattices.
    """

    def __init__(self, finest: Tangent, built: Built) -> None:
        sheet = built.simulation.sheet
        assert sheet.lattice is not None
        self.levels, self.lattices = [finest], [sheet.lattice]
        for lattice in coarser(sheet.lattice):
            self.levels.append(_coarse_tangent(finest, sheet, lattice, self.lattices[0]))
            self.lattices.append(lattice)
        self._omegas: list[Any] = []
        self._sides: list[tuple[Any, Any]] = []
        for level in self.levels:
            self._add_level(level)
        for fine in range(len(self.levels) - 1):
            self._add_transfer(fine)
        self._sparse = SparseTangent(self.levels[-1])
        self._coarsest: Any = None

    def _add_level(self, level: Tangent) -> None:
        w, t, n = level.workspace, level.types, level.points
        right_side = w.array("right_side", OWNER, t.vec3, shape=n)
        solution = w.array("correction", OWNER, t.vec3, shape=n)
        self._sides.append((right_side, solution))
        self._omegas.append(w.array("sweep_factors", OWNER, t.real, shape=SWEEPS))

    def _sweep(self, stage: str, index: int, sweep: int, fresh: bool) -> None:
        level, (right_side, solution) = self.levels[index], self._sides[index]
        if not fresh:
            level.add_product(stage, solution, level.image, follower=False)
        level.workspace.launch(
            stage, OWNER, level.fields.smooth, level.points,
            inverse_blocks=level.inverse_blocks, right_side=right_side, image=level.image,
            omegas=self._omegas[index], sweep=sweep, fresh=int(fresh), solution=solution,
        )  # fmt: skip

    def _add_transfer(self, index: int) -> None:
        from ..kernels.equilibrium import lattice_transfer

        fine, coarse = self.levels[index], self.levels[index + 1]
        a, b = self.lattices[index], self.lattices[index + 1]
        w = fine.workspace
        interpolate, smoothly, restrict = lattice_transfer(w.bits, fine.held_mask is not None, w.module)
        (right_side, solution), (coarse_side, coarse_solution) = self._sides[index], self._sides[index + 1]
        down, up = f"down {index}", f"up {index}"
        for sweep in range(SWEEPS):
            self._sweep(down, index, sweep, fresh=sweep == 0)
        fine.add_product(down, solution, fine.image, follower=False)
        w.launch(
            down, OWNER, restrict, coarse.points,
            right_side=right_side, image=fine.image, columns=a.columns, rows=a.rows, coarse_columns=b.columns,
            coarse_rows=b.rows, held_mask=coarse.held_mask, coarse=coarse_side,
        )  # fmt: skip
        w.launch(
            up, OWNER, interpolate, fine.points,
            source=coarse_solution, source_columns=b.columns, source_rows=b.rows, columns=a.columns, rows=a.rows,
            held_mask=fine.held_mask, target=solution,
        )  # fmt: skip
        w.launch(
            f"start {index}", OWNER, smoothly, fine.points,
            source=coarse.displacement, source_columns=b.columns, source_rows=b.rows, columns=a.columns, rows=a.rows,
            target=fine.displacement,
        )  # fmt: skip
        w.launch(
            f"sample {index}", OWNER, smoothly, coarse.points,
            source=fine.displacement, source_columns=a.columns, source_rows=a.rows, columns=b.columns, rows=b.rows,
            target=coarse.displacement,
        )  # fmt: skip
        for sweep in reversed(range(SWEEPS)):
            self._sweep(up, index, sweep, fresh=False)

    def _run(self, stage: str, index: int) -> None:
        self.levels[index].run(f"{stage} {index}")

    def linearise(self, finest: int, tension: float) -> None:
        """Take the tangents of `finest` and all coarser levels, at its displacement; set the smoothers up."""
        self.levels[finest].linearise(tension)
        for index in range(finest, len(self.levels) - 1):
            self._run("sample", index)
            self.levels[index + 1].linearise(tension)
        self._coarsest = self._sparse.factorise()
        if finest < len(self.levels) - 1:
            top = SAFETY * self._largest_eigenvalue(len(self.levels) - 2)
            angles = np.cos(np.pi * (2.0 * np.arange(SWEEPS) + 1.0) / (2.0 * SWEEPS))
            middle, half = 0.5 * top * (1.0 + 1.0 / SPECTRUM_SHARE), 0.5 * top * (1.0 - 1.0 / SPECTRUM_SHARE)
            for omegas in self._omegas:
                assign(omegas, 1.0 / (middle + half * angles))

    def _largest_eigenvalue(self, index: int) -> float:
        """Of D^-1 K, by power iteration on a small level: D and K scale alike, so it holds for all."""
        level = self.levels[index]
        blocks = level.inverse_blocks.numpy().astype(np.float64)
        v = np.random.default_rng(0).normal(size=(level.points, 3))
        largest = 1.0
        for _ in range(POWER_ITERATIONS):
            assign(level.vector, v / np.linalg.norm(v))
            level.run("product")
            v = np.einsum("iab,ib->ia", blocks, level.image.numpy().astype(np.float64))
            largest = float(np.linalg.norm(v))
        return largest

    @property
    def usable(self) -> bool:
        """Whether the coarsest tangent could be factorised."""
        return self._coarsest is not None

    def sides(self, index: int) -> tuple[Any, Any]:
        """Right side and solution of the V-cycle that begins at a level, (N,) vec3."""
        return self._sides[index]

    def cycle(self, finest: int) -> None:
        """One V-cycle from the level `finest` down and back."""
        last = len(self.levels) - 1
        for index in range(finest, last):
            self._run("down", index)
        side, solution = self._sides[last]
        assign(solution, self._coarsest(side.numpy().astype(np.float64)))
        for index in reversed(range(finest, last)):
            self._run("up", index)

    def products_per_cycle(self, finest: int) -> int:
        """Stiffness products that one V-cycle makes on its finest level."""
        return 2 * SWEEPS if finest < len(self.levels) - 1 else 0

    def start(self, index: int) -> None:
        """Interpolate the displacement of the next coarser level to level `index`."""
        self._run("start", index)


def coarser(lattice: Lattice) -> list[Lattice]:
    """Lattices over the same rectangle, each with half the spacings of the one before."""
    result = []
    while lattice.columns * lattice.rows > COARSEST:
        columns, rows = lattice.columns // 2 + 1, lattice.rows // 2 + 1
        if min(columns, rows) < FEWEST:
            break
        width, height = lattice.dx * (lattice.columns - 1), lattice.dy * (lattice.rows - 1)
        lattice = Lattice(columns, rows, width / (columns - 1), height / (rows - 1))
        result.append(lattice)
    return result


def coarse_points(lattice: Lattice, finest: Lattice) -> np.ndarray:
    """The point of the finest lattice nearest to each point of a coarser one."""
    columns = np.round(np.arange(lattice.columns) * (finest.columns - 1) / (lattice.columns - 1)).astype(int)
    rows = np.round(np.arange(lattice.rows) * (finest.rows - 1) / (lattice.rows - 1)).astype(int)
    return (columns[None, :] + rows[:, None] * finest.columns).ravel()


def restrict_loads(forces: np.ndarray, finest: Lattice, lattice: Lattice) -> np.ndarray:
    """Forces on the points of a coarser lattice that do the same work [N], shape (N, 3)."""
    along_x, along_y = _hats(finest.columns, lattice.columns), _hats(finest.rows, lattice.rows)
    grid = forces.reshape(finest.rows, finest.columns, 3)
    return np.einsum("Yy,yxc,Xx->YXc", along_y, grid, along_x, optimize=True).reshape(-1, 3)


def _hats(fine: int, coarse: int) -> np.ndarray:
    """Weights of linear interpolation, shape (coarse, fine)."""
    place = np.arange(fine) * (coarse - 1) / (fine - 1)
    return np.maximum(0.0, 1.0 - np.abs(place[None, :] - np.arange(coarse)[:, None]))


def _coarse_tangent(finest: Tangent, sheet: Sheet, lattice: Lattice, finest_lattice: Lattice) -> Tangent:
    w, t = finest.workspace, finest.types
    width, height = lattice.dx * (lattice.columns - 1), lattice.dy * (lattice.rows - 1)
    coarse = Sheet.rectangle(
        width, height, thickness=sheet.thickness, density=sheet.density, points=(lattice.columns, lattice.rows)
    )
    own = Workspace(w.device, w.bits, w.module, w.block_dim, arrays=w.arrays)
    law = finest.force.law
    ratio = max(COARSE_HORIZON, 1.001 * float(np.hypot(lattice.dx, lattice.dy)) / coarse.spacing)
    force = BondAssociatedForce(replace(law, weights="plain", horizon=ratio), own, coarse, False)
    n = coarse.size
    return Tangent(
        own,
        force,
        finest.held[coarse_points(lattice, finest_lattice)],
        finest.loaded,
        finest.follower,
        own.array("displacement", OWNER, t.vec3, shape=n),
        own.array("force", OWNER, t.vec3, shape=n),
        own.array("external", OWNER, t.vec3, shape=n) if finest.loaded else None,
        finest.assembled,
    )
