"""The tangent of a law with bending beside it, for Newton's method."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from ..device.fields import Array
from ..device.launches import Stage
from ..geometry.triangulation import numbers_of_ranges
from ..kernels.bending.tangent import STATE, bending_tangent
from ..kernels.statics.tangent_matrix import tangent_matrix
from ..statics.factors import Factoriser, Solve
from ..statics.tangent import HostBlocks, Prediction, SparseTangent, Tangent
from .law import BendingForce, kinds

OWNER = "Newton"
# Points up to which the tangent is factorised on the host: shorter waves are too stiff for 3x3 blocks.
DIRECT_POINTS = 100_000
# The six vectors of a triangle, see kernels/bending/plate.py, by the derivatives of the position along its two sides at
# its three corners, (6, 3) each; and by its corners.
ALONG = np.array(
    [[-1.0, 1.0, 0.0], [0.0, 0.0, 0.0], [-0.5, 0.0, 0.5], [-0.5, -0.5, 0.0], [0.0, 0.0, 0.0], [0.0, 0.5, 0.5]]
)
ACROSS = np.array(
    [[0.0, 0.0, 0.0], [-1.0, 0.0, 1.0], [-0.5, 0.5, 0.0], [0.0, 0.0, 0.0], [-0.5, 0.0, -0.5], [0.0, -0.5, -0.5]]
)
SIDES = np.array(
    [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0], [0.0, -1.0, 1.0]]
)


class BendingTangent(Tangent):
    """The tangent of a law and of bending, whose blocks are stored.

    Attributes:
        force: The law with bending.
        law: Tangent of the law alone.
        starts: First block of each row, (N + 1,).
        columns: Columns of the blocks, ascending in each row, (blocks,).
        blocks: Stiffness of bending alone [N/m], (blocks,) mat33.
    """

    direct_points = DIRECT_POINTS

    def __init__(self, force: BendingForce, law: Tangent) -> None:
        self.force, self.law, self.inverse_blocks = force, law, law.inverse_blocks
        self.symmetric, self.predicts = law.symmetric, law.can_predict
        context = self._context = force.context
        t, n = context.types, context.sheet.size
        self._kernels = bending_tangent(context.bits, context.layout.curved, context.layout.breakable)
        self._mirror = tangent_matrix(context.bits, context.options.held).mirror
        self._stencils, starts, columns = self._tables()
        self.starts = context.array("bending_starts", OWNER, wp.int32, starts, per="table")
        self.columns = context.array("bending_columns", OWNER, wp.int32, columns, per="table")
        self.blocks = context.array("bending_blocks", OWNER, t.mat33, shape=len(columns), per="once")
        self._here = context.array("bending_here", OWNER, t.vec3, shape=n) if law.can_predict else None
        self._slope = force.slope_array("tangent_slope")
        self._state = context.array(
            "bending_state", OWNER, t.real, shape=(STATE, len(context.sheet.triangles)), per="face"
        )

    def _tables(self) -> tuple[Any, np.ndarray, np.ndarray]:
        """Stencils of the triangles on the device, and the pattern of the blocks."""
        context, sheet = self._context, self._context.sheet
        point, shares, begins = stencils(self.force)
        counts, faces = np.diff(begins), len(sheet.triangles)
        most, face = int(counts.max()), np.repeat(np.arange(faces), counts)
        place = np.arange(len(point)) - begins[face]
        steps, each = np.zeros((most, faces), int), np.zeros((most, faces, 6))
        steps[place, face], each[place, face] = point - sheet.triangles[face, 0], shares
        corners = np.zeros((faces, 3), int)
        for corner in range(3):
            found = np.flatnonzero(point == sheet.triangles[face, corner])
            corners[face[found], corner] = place[found]
        whole = np.column_stack([counts, corners, steps.T])
        kind, one = kinds(whole, np.moveaxis(each, 1, 0).reshape(faces, -1))
        t, order = context.types, np.argsort(point, kind="stable")
        values = {
            "kind": (wp.int32, kind), "counts": (wp.int32, counts[one]), "steps": (wp.int32, steps[:, one]),
            "corners": (wp.vec3i, corners[one]), "shares": (t.vec6, each[:, one]),
            "begins": (wp.int32, np.searchsorted(point[order], np.arange(sheet.size + 1))),
            "places": (wp.int32, (most * face + place)[order]),
        }  # fmt: skip
        tables = self._kernels.Stencils()
        for name, (dtype, value) in values.items():
            setattr(tables, name, context.array(f"stencil_{name}", OWNER, dtype, value, per="table"))
        return tables, *pattern(point, begins, sheet.size)

    def is_slack(self) -> bool:
        """False: a sheet without stress resists bending."""
        return False

    def modulus(self) -> float:
        """Size of the moduli in the plane [Pa], without bending."""
        return self.law.modulus()

    def mean_tension(self) -> float:
        """Mean tension of the sheet [Pa]."""
        return self.law.mean_tension()

    def min_tension(self, relative: float) -> float:
        """Minimum isotropic tension [Pa] that the tangent of the law needs at a relative residual."""
        return self.law.min_tension(relative)

    def add_linearise(
        self, stage: Stage, displacement: Array, tension: Array, inertia: Array | None = None,
        predicted: Prediction | None = None,
    ) -> None:  # fmt: skip
        """Add the launches that compute the tangent at a displacement; see `Tangent`."""
        self.law.add_linearise(stage, displacement, tension, inertia, predicted)
        force, context = self.force, self._context
        n = context.sheet.size
        if self._here is not None:
            stage.launch(OWNER, force.kernels.keep, n, displacement=displacement, kept=self._here)
        force.add_slopes(stage, displacement, self._slope)
        stage.launch(
            OWNER, self._kernels.bend, len(context.sheet.triangles), plate=force.plate, displacement=displacement,
            slope=self._slope, state=self._state,
        )  # fmt: skip
        rows: dict[str, Any] = {"starts": self.starts, "columns": self.columns, "matrix": self.blocks}
        stage.launch(
            OWNER, self._kernels.assemble, n, plate=force.plate, stencils=self._stencils, state=self._state, **rows
        )
        stage.launch(OWNER, self._mirror, n, **rows)

    def add_product(self, stage: Stage, direction: Array, change: Array, rough: bool = False) -> None:
        """Add the launches that fill `change` [N] with the derivative of the force along a direction [m]."""
        self.law.add_product(stage, direction, change, rough)
        stage.launch(
            OWNER, self._kernels.product, self._context.sheet.size, matrix=self.blocks, starts=self.starts,
            columns=self.columns, direction=direction, change=change,
        )  # fmt: skip

    def add_turning(self, stage: Stage, direction: Array) -> Array | None:
        """Add the launch of the law, and with predicted stresses one of how far sides of triangles turn."""
        longest = self.law.add_turning(stage, direction)
        if not self.predicts:
            return longest
        force, context = self.force, self._context
        shortest = context.array("longest_turn", OWNER, context.types.real, shape=context.sheet.size)
        stage.launch(
            OWNER, force.kernels.turning, context.sheet.size, plate=force.plate, displacement=self._here,
            direction=direction, of_law=longest, longest=shortest,
        )  # fmt: skip
        return shortest

    def sparse(self) -> SparseTangent:
        """The tangent as a sparse matrix, from the next linearisation on."""
        return BendingMatrix(self, self.law.sparse())


class BendingMatrix:
    """The tangent as a sparse matrix on the host, for a direct factorisation.

    Attributes:
        free: Mask of free components, shape (3 N,).
    """

    def __init__(self, tangent: BendingTangent, law: SparseTangent) -> None:
        self._law, self.free = law, law.free
        self._bending = HostBlocks(tangent.starts, tangent.columns, tangent.blocks, self.free)
        self._factorise = Factoriser(self.free)

    def matrix(self) -> Any:
        """K of the free components [N/m], a SciPy sparse matrix."""
        return (self._law.matrix() + self._bending.matrix()).tocsc()

    def factorise(self, added: np.ndarray | None = None) -> Solve | None:
        """Solver of K x = b on arrays of shape (N, 3), with blocks added to K; None if K is singular."""
        return self._factorise(self.matrix(), added)


def stencils(force: BendingForce) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points that the strains of each triangle depend on, and B [-] of kernels/bending/tangent.py.

    Returns:
        The points, ascending for each triangle, (E,); their shares of the six vectors, (E, 6); and the first entry of
        each triangle, (F + 1,).
    """
    slopes, triangles = force.slopes, force.context.sheet.triangles
    faces, n = len(triangles), force.context.sheet.size
    begins = np.searchsorted(slopes.point, np.arange(n + 1))
    face, point, share = [], [], []
    for corner, sides in enumerate(force.flat_sides()):
        every, at = np.arange(faces), triangles[:, corner]
        owner, entry = numbers_of_ranges(begins[at], begins[at + 1])
        along, across = np.einsum("eb,ebm->me", slopes.weights[entry], sides[owner])
        fitted = along[:, None] * ALONG[:, corner] + across[:, None] * ACROSS[:, corner]
        own = np.tile(SIDES[:, corner], (faces, 1))
        np.subtract.at(own, owner, fitted)
        face += [owner, every]
        point += [slopes.other[entry], at]
        share += [fitted, own]
    keys = np.concatenate(face) * n + np.concatenate(point)
    order = np.argsort(keys, kind="stable")
    found, first = np.unique(keys[order], return_index=True)
    shares = np.add.reduceat(np.concatenate(share)[order], first)
    return found % n, shares, np.searchsorted(found // n, np.arange(faces + 1))


def pattern(point: np.ndarray, begins: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Points that share a triangle's stencil, as starts of rows, (N + 1,), and columns in ascending order."""
    from scipy import sparse

    fits = sparse.csr_matrix((np.ones(len(point), np.float32), point, begins), shape=(len(begins) - 1, n))
    found = (fits.T @ fits).tocsr()
    found.sort_indices()
    return found.indptr, found.indices
