"""Tangent of a force law with bending beside it: products, and a sparse matrix for a direct solution."""

from __future__ import annotations

import functools
from typing import Any, Protocol

import numpy as np

from ..device.fields import Array, assign
from ..device.launches import Stage
from ..interfaces import Solve, SparseTangent, Tangent
from ..interfaces.context import Context
from ..kernels.bending import BendingKernels
from ..kernels.effects import Kernel
from .slopes import Slopes
from .sparse import factorised

OWNER = "Newton"
# Points up to which the tangent is factorised on the host: shorter waves are too stiff for 3x3 blocks.
DIRECT_POINTS = 100_000


class Bending(Protocol):
    """What the tangent needs of the force of bending (interface).

    Attributes:
        context: Its context.
        kernels: Kernels of bending.
        plate: Their tables.
        slopes: Points and weights of the slopes.
        pulls: What triangles store, (ROWS, F), a buffer.
    """

    context: Context
    kernels: BendingKernels
    plate: Any
    slopes: Slopes
    pulls: Array

    def slope_array(self, name: str) -> Array:
        """An array of 3 x 2 matrices at the points, (6, N)."""
        ...

    def add_slopes(self, stage: Stage, displacement: Array, slope: Array) -> None:
        """Add the launch of the slopes of a displacement."""
        ...

    def triangle_array(self, name: str) -> Array:
        """An array of what triangles store, (ROWS, F)."""
        ...

    def add_sums(self, stage: Stage, gather: Kernel, changes: Array | None, force: Array) -> None:
        """Add the launches that add the force of what triangles store, or its change, to `force`."""
        ...


class BendingTangent(Tangent):
    """The tangent of a law and of bending.

    Attributes:
        force: The law with bending.
        law: Tangent of the law alone.
    """

    direct_points = DIRECT_POINTS

    def __init__(self, force: Bending, law: Tangent) -> None:
        self.force, self.law, self.inverse_blocks = force, law, law.inverse_blocks
        self._stage: str | None = None
        context, t = force.context, force.context.types
        self._here, self._along, self._out = (
            context.array(f"bending_{name}", OWNER, t.vec3, shape=context.sheet.size)
            for name in ("here", "along", "image")
        )
        self._slope, self._slope_change = (force.slope_array(f"tangent_{name}") for name in ("slope", "change"))
        self._changes = force.triangle_array("changes")

    def is_slack(self) -> bool:
        """False: a sheet without stress resists bending."""
        return False

    def modulus(self) -> float:
        """Modulus of the sheet without bending [Pa]."""
        return self.law.modulus()

    def min_tension(self, relative: float) -> float:
        """Minimum isotropic tension [Pa] that the tangent of the law needs at a relative residual."""
        return self.law.min_tension(relative)

    def add_linearise(self, stage: Stage, displacement: Array, tension: Array) -> None:
        """Add the launches that compute the tangent at a displacement, with an isotropic tension [Pa] added."""
        self.law.add_linearise(stage, displacement, tension)
        force = self.force
        n = force.context.sheet.size
        stage.launch(OWNER, force.kernels.keep, n, displacement=displacement, kept=self._here)
        force.add_slopes(stage, self._here, self._slope)

    def add_product(self, stage: Stage, direction: Array, change: Array) -> None:
        """Add the launches that fill `change` [N] with the derivative of the force along a direction [m]."""
        self.law.add_product(stage, direction, change)
        self.add_bending(stage, direction, change)

    def add_turning(self, stage: Stage, direction: Array) -> Array | None:
        """Add the launch of the law without bending."""
        return self.law.add_turning(stage, direction)

    def add_bending(self, stage: Stage, direction: Array, change: Array) -> None:
        """Add the launches that add the part of bending."""
        force = self.force
        force.add_slopes(stage, direction, self._slope_change)
        stage.launch(
            OWNER, force.kernels.change, len(force.context.sheet.triangles), plate=force.plate,
            displacement=self._here, slope=self._slope, direction=direction, slope_change=self._slope_change,
            pulls=force.pulls, changes=self._changes,
        )  # fmt: skip
        force.add_sums(stage, force.kernels.gather_change, self._changes, change)

    def sparse(self) -> SparseTangent:
        """The tangent as a sparse matrix, from the next linearisation on."""
        return BendingMatrix(self, self.law.sparse())

    @functools.cached_property
    def _columns(self) -> Columns:
        return Columns(self.force)

    def matrix(self) -> Any:
        """K of bending alone [N/m], sparse, shape (3 N, 3 N)."""
        context, columns = self.force.context, self._columns
        if self._stage is None:
            # Of this tangent: natural modes have one of their own, after Newton's.
            self._stage = f"columns of bending {len(context.stages)}"
            stage = context.stage(self._stage, "every column of the stiffness of bending")
            self.add_bending(stage, self._along, self._out)
        run = context.sequence(self._stage).run
        blocks = np.zeros((len(columns.other), 3, 3))
        for colour, entries in enumerate(columns.of_colour):
            chosen = columns.colours == colour
            for c in range(3):
                along = np.zeros((len(chosen), 3))
                along[chosen, c] = 1.0
                assign(self._along, along)
                self._out.zero_()
                run()
                blocks[entries, :, c] = -self._out.numpy()[columns.point[entries]]
        return columns.assembled(blocks)


class Columns:
    """Points whose columns of the stiffness have no row in common are of one colour: one product fills them all.

    See Curtis, Powell and Reid, J. Inst. Maths Applics 13, 1974.

    Attributes:
        point, other: Rows and columns of the 3x3 blocks, (E,).
        colours: Colour of each point, (N,).
        of_colour: Blocks in the columns of each colour.
    """

    def __init__(self, force: Bending) -> None:
        from scipy import sparse

        triangles, slopes, n = force.context.sheet.triangles, force.slopes, force.context.sheet.size
        faces = np.repeat(np.arange(len(triangles)), 3)
        corners = sparse.csr_matrix(
            (np.ones(len(faces), np.float32), (faces, triangles.ravel())), shape=(len(triangles), n)
        )
        ends = np.append(slopes.point, np.arange(n)), np.append(slopes.other, np.arange(n))
        fits = sparse.csr_matrix((np.ones(len(ends[0]), np.float32), ends), shape=(n, n))
        of_triangle = corners @ fits
        self.pattern = (of_triangle.T @ of_triangle).tocsr()
        self.pattern.sort_indices()
        self.point = np.repeat(np.arange(n), np.diff(self.pattern.indptr))
        self.other = self.pattern.indices
        self.colours = self._coloured()
        order = np.argsort(self.colours[self.other], kind="stable")
        counts = np.bincount(self.colours[self.other])
        self.of_colour = np.split(order, np.cumsum(counts)[:-1])

    def _coloured(self) -> np.ndarray:
        """The first free colour of each point in turn."""
        conflicts = (self.pattern @ self.pattern).tocsr()
        colours = np.full(conflicts.shape[0], -1)
        begins, others = conflicts.indptr, conflicts.indices
        for i in range(len(colours)):
            taken = np.zeros(len(colours) + 1 if i == 0 else colours[:i].max() + 3, bool)
            taken[colours[others[begins[i] : begins[i + 1]]]] = True
            taken[-1] = False
            colours[i] = int(np.argmin(taken))
        return colours

    def assembled(self, blocks: np.ndarray) -> Any:
        """The matrix of these blocks."""
        from scipy import sparse

        n = len(self.colours)
        return sparse.bsr_matrix((blocks, self.other, self.pattern.indptr), shape=(3 * n, 3 * n))


class BendingMatrix:
    """The tangent as a sparse matrix on the host, for a direct factorisation.

    Attributes:
        free: Mask of free components, shape (3 N,).
    """

    def __init__(self, tangent: BendingTangent, law: SparseTangent) -> None:
        self._tangent, self._law, self.free = tangent, law, law.free

    def matrix(self) -> Any:
        """K of the free components [N/m], a SciPy sparse matrix."""
        return (self._law.matrix() + self._tangent.matrix().tocsr()[self.free][:, self.free]).tocsc()

    def factorise(self, added: np.ndarray | None = None) -> Solve | None:
        """Solver of K x = b on arrays of shape (N, 3), with blocks added to K; None if K is singular."""
        return factorised(self.matrix(), self.free, added)
