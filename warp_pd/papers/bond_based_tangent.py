"""Tangent of the bond-based law: one 3x3 block per bond on the device, and a sparse matrix on the host."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..context import Context
from ..device.checks import InputError
from ..device.fields import Array
from ..device.launches import Stage
from ..families import unpack
from ..kernels.papers.bond_based import bond_based_tangent
from ..laws.family_law import FamilyLaw
from ..materials import PairwiseMaterial, capabilities
from ..statics.factors import Factoriser, Solve
from ..statics.tangent import Prediction

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix

OWNER = "Newton"
# Tension divided by the modulus. The first is always in the tangent: a point whose bonds are all slack or broken
# stays in the matrix. The second is multiplied by the relative residual and used if bonds can become slack: it keeps
# points without stiffness from flying off, and fades fast enough that
# convergence remains quadratic. Neither enters the force, so they change the iterations but not the solution.
MIN_TENSION = 1e-10
SLACK_TENSION = 1e-2
SLACK = 1e-6


class BondBasedTangent:
    """The tangent of the bond-based law on the device.

    Attributes:
        blocks: Stiffness of the bonds [N/m], upper triangles, (members, N) vec6.
        inverse_blocks: Inverse diagonal blocks of the stiffness, (N,) mat33 [m/N].
    """

    direct_points = 100_000
    symmetric = True
    can_predict = predicts = False

    def __init__(self, force: FamilyLaw, material: PairwiseMaterial, context: Context, geometric: bool) -> None:
        """Allocate the tangent; `geometric` is whether the stiffness includes the tension of the bonds."""
        self.material = material
        self.force, self.context, self.held = force, context, context.held
        t, shape = context.types, (force.families.members, force.points)
        self.blocks = context.array("bond_stiffness", OWNER, t.vec6, shape=shape, per="bond")
        self.inverse_blocks = context.array("inverse_blocks", OWNER, t.mat33, shape=force.points)
        self.kernels = bond_based_tangent(context.layout, material.pairwise, context.options.held, geometric)

    def add_linearise(
        self, stage: Stage, displacement: Array, tension: Array, inertia: Array | None = None,
        predicted: Prediction | None = None,
    ) -> None:  # fmt: skip
        """Add the launches that compute the tangent at a displacement; see `Tangent`."""
        if inertia is not None:
            raise InputError("force = BondBased: not supported by the solver Implicit; expected Explicit")
        force = self.force
        stage.launch(
            OWNER, self.kernels.linearise, force.points,
            family=force.struct, displacement=displacement, constants=force.constants,
            unit_stiffness=force.unit_stiffness, tension=tension, blocks=self.blocks,
        )  # fmt: skip
        stage.launch(
            OWNER, self.kernels.inverse_blocks, force.points,
            family=force.struct, blocks=self.blocks, held_mask=self.context.state.held_mask, out=self.inverse_blocks,
        )  # fmt: skip

    def add_product(self, stage: Stage, direction: Array, change: Array, rough: bool = False) -> None:
        """Add the launch that fills `change` [N] with the derivative of the force along a direction [m]."""
        force = self.force
        stage.launch(
            OWNER, self.kernels.product, force.points,
            family=force.struct, blocks=self.blocks, direction=direction, change=change,
        )  # fmt: skip

    def mean_tension(self) -> float:
        """Zero: the law has no coarser lattices."""
        return 0.0

    def min_tension(self, relative: float) -> float:
        """Isotropic tension [Pa] to add to the tangent at a relative residual."""
        goes_slack = capabilities(self.material).goes_slack
        slack = SLACK_TENSION * min(relative, 1.0) if goes_slack else 0.0
        return max(slack, MIN_TENSION) * self.modulus()

    def add_turning(self, stage: Stage, direction: Array) -> None:
        """Nothing: bonds have no orientation."""

    def is_slack(self) -> bool:
        """Whether the sheet has no out-of-plane stiffness, being flat and without tension."""
        free = self.held & 4 == 0
        if not free.any():
            return False
        blocks = np.abs(self.blocks.numpy()[:, free])
        return bool(blocks[..., 5].max() < SLACK * blocks[..., [0, 3]].max())

    def modulus(self) -> float:
        """Modulus of bonds in tension, E+ [Pa]."""
        return float(self.material.constants[0])

    def sparse(self) -> BondBasedMatrix:
        """The tangent as a sparse matrix."""
        return BondBasedMatrix(self)


class BondBasedMatrix:
    """The stiffness of all bonds as a sparse matrix, for a direct factorisation on the host.

    Follower pressure is not included, so the matrix is symmetric.
    """

    def __init__(self, tangent: BondBasedTangent) -> None:
        self.tangent = tangent
        self.free = ((tangent.held[:, None] >> np.arange(3)) & 1 == 0).ravel()
        self._factorise = Factoriser(self.free)
        families = tangent.force.families
        point, member = np.nonzero(families.rows_of_points(families.exists))
        neighbour = families.heads(point, member)
        self._bonds = member, point
        # Entries of the matrix: component c of the point with component d of its member, and with its own d.
        number = np.cumsum(self.free) - 1
        c, d = (axis.ravel() for axis in np.meshgrid(np.arange(3), np.arange(3), indexing="ij"))
        row, across, own = 3 * point[:, None] + c, 3 * neighbour[:, None] + d, 3 * point[:, None] + d
        self._off, self._diagonal = self.free[row] & self.free[across], self.free[row] & self.free[own]
        rows = np.concatenate([number[row[self._off]], number[row[self._diagonal]]])
        columns = np.concatenate([number[across[self._off]], number[own[self._diagonal]]])
        self._size = int(self.free.sum())
        order = np.lexsort((rows, columns))
        new = np.ones(len(order), bool)
        new[1:] = (np.diff(rows[order]) != 0) | (np.diff(columns[order]) != 0)
        self._order, self._begins = order, np.flatnonzero(new)
        self._rows = rows[order][new]
        self._starts = np.concatenate([[0], np.cumsum(np.bincount(columns[order][new], minlength=self._size))])

    def matrix(self) -> csc_matrix:
        """K of the free components [N/m], shape (free, free)."""
        from scipy import sparse

        member, point = self._bonds
        blocks = self.tangent.blocks.numpy()[member, point].astype(np.float64)[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]]
        entries = np.concatenate([-blocks[self._off], blocks[self._diagonal]])
        data = np.add.reduceat(entries[self._order], self._begins)
        matrix = sparse.csc_matrix((data, self._rows, self._starts), shape=(self._size, self._size))
        if self.tangent.force.intact is not None:
            # A point without intact bonds is in equilibrium anywhere.
            matrix += sparse.diags(self._lost().astype(np.float64), format="csc")
        return matrix

    def _lost(self) -> np.ndarray:
        families, intact = self.tangent.force.families, self.tangent.force.intact
        assert intact is not None
        lost = ~unpack(intact.numpy().T, families.members).any(axis=1)
        return np.asarray(np.repeat(lost, 3)[self.free] * self.tangent.modulus() * self.tangent.force.thickness)

    def factorise(self, added: np.ndarray | None = None) -> Solve | None:
        """Solver of K x = b on arrays of shape (N, 3), with blocks added to K; None if K is singular."""
        return self._factorise(self.matrix(), added)
