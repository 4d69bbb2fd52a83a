"""The tangent of the bond-based law: one 3x3 block a bond, on the device, and as a sparse matrix on the host."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..bonds import unpack
from ..forces.bond_based import BondBasedForce
from ..launches import Workspace
from .equilibrium import OWNER, Equilibrium, factorised

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix

# Tension over the modulus that the tangent always has, so that a point whose bonds are all slack or broken stays in
# the matrix; and times the relative residual where bonds can go slack: it keeps points that nothing holds from
# flying off (strips of docs/wrinkling.md take half the steps), and fades fast enough to leave the convergence
# quadratic. It takes no part in the force, so it changes the way to the answer and not the answer.
LEAST = 1e-10
SLACK_SHARE = 1e-2
SLACK = 1e-6


class BondTangent(Equilibrium):
    """The bond-based law: the stiffness of every bond, kept on the device.

    Attributes:
        blocks: Stiffness of the bonds [N/m], upper triangles, (members, N) vec6.
    """

    force: BondBasedForce

    def __init__(
        self,
        workspace: Workspace,
        force: BondBasedForce,
        held: np.ndarray,
        loaded: bool,
        follower: bool,
        displacement: Any,
        internal: Any,
        external: Any,
        geometric: bool,
    ) -> None:
        """As Equilibrium; `geometric`: whether the tension of the bonds has its part in the stiffness."""
        from ..kernels.bond_based import bond_based_tangent

        super().__init__(workspace, force, held, loaded, follower, displacement, internal, external)
        w, law = workspace, force.law
        self.kernels = bond_based_tangent(
            *law.signature(force.families.layout, force.alive is not None)[:1], w.bits, law.material.pairwise,
            force.alive is not None, bool(held.any()), geometric, w.module,
        )  # fmt: skip
        self.blocks = w.array("bond_stiffness", OWNER, self.types.vec6, shape=(force.families.members, force.points))
        w.launch(
            "linearise", OWNER, self.kernels.linearise, self.points,
            **self._family(), displacement=displacement,
            constants=force.constants, inverse_horizon=force.inverse_horizon,
            unit_stiffness=force.unit_volume * force.inverse_horizon**2, tension=self.tension, blocks=self.blocks,
        )  # fmt: skip
        w.launch(
            "linearise", OWNER, self.kernels.inverse_blocks, self.points,
            family=force.struct, blocks=self.blocks, held_mask=self.held_mask, out=self.inverse_blocks,
        )  # fmt: skip
        w.launch(
            "product", OWNER, self.kernels.product, self.points,
            **self._family(), blocks=self.blocks, direction=self.vector, change=self.image,
        )  # fmt: skip
        self._add_pressure_and_supports("product", self.vector, self.image, follower=True)

    def least_tension(self, relative: float) -> float:
        """Isotropic tension [Pa] in the tangent, at a relative residual."""
        slack = SLACK_SHARE * min(relative, 1.0) if getattr(self.force.law.material, "goes_slack", False) else 0.0
        return max(slack, LEAST) * self.modulus()

    def slack(self) -> bool:
        """Whether points may leave the plane and nothing holds them back: a flat sheet without tension."""
        free = self.held & 4 == 0
        if not free.any():
            return False
        blocks = np.abs(self.blocks.numpy()[:, free])
        return bool(blocks[..., 5].max() < SLACK * blocks[..., [0, 3]].max())

    def modulus(self) -> float:
        """Modulus of stretched bonds [Pa]."""
        return float(self.force.law.material.constants[0])

    def sparse(self) -> SparseBonds:
        """The sparse matrix."""
        return SparseBonds(self)


class SparseBonds:
    """The stiffness of all bonds as a sparse matrix, for a direct factorisation on the host.

    Follower pressure is left out: the matrix is symmetric.
    """

    def __init__(self, tangent: BondTangent) -> None:
        self.tangent = tangent
        self.free = ((tangent.held[:, None] >> np.arange(3)) & 1 == 0).ravel()
        families = tangent.force.families
        point, member = np.nonzero(families.rows_of_points(families.exists))
        if families.neighbours is None:
            assert families.shift is not None
            neighbour = point + families.shift[member]
        else:
            neighbour = families.neighbours[point, member]
        self._bonds = member, point
        # Entries of the matrix: component c of the point against d of its member, and against its own d.
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
        if self.tangent.force.alive is not None:
            # A point that lost every bond is in equilibrium where it is.
            matrix += sparse.diags(self._lost().astype(np.float64), format="csc")
        return matrix

    def _lost(self) -> np.ndarray:
        families, alive = self.tangent.force.families, self.tangent.force.alive
        assert alive is not None
        lost = ~unpack(alive.numpy().T, families.members).any(axis=1)
        return np.repeat(lost, 3)[self.free] * self.tangent.modulus() * self.tangent.force.thickness

    def factorise(self) -> Any:
        """Solver of K x = b on arrays of shape (N, 3); None if K is singular."""
        return factorised(self.matrix(), self.free)
