"""The tangent of the bond-associated law: stiffness products, and the sparse matrix for small sheets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..bonds import Families, unpack
from ..checks import InputError
from ..forces.bond_associated import BondAssociatedForce
from ..kernels.kinematics import DEGENERATE
from ..launches import Workspace
from .equilibrium import OWNER, Equilibrium, factorised

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

SLACK_STRESS = 1e-6


class Tangent(Equilibrium):
    """The bond-associated law: its stiffness, matrix-free, or stored by lattice steps.

    Attributes:
        gradient: F of every intersection [-], (members, N).
        stress: Its weighted stress [Pa].
        moduli: Its weighted moduli [Pa].
    """

    force: BondAssociatedForce

    def __init__(
        self,
        workspace: Workspace,
        force: BondAssociatedForce,
        held: np.ndarray,
        loaded: bool,
        follower: bool,
        displacement: Any,
        internal: Any,
        external: Any,
        assembled: bool,
    ) -> None:
        from ..kernels.bond_associated_tangent import bond_associated_tangent

        super().__init__(workspace, force, held, loaded, follower, displacement, internal, external)
        w, t, law, shape = workspace, self.types, force.law, (force.families.members, force.points)
        layout, material, broken, _ = law.signature(force.families.layout, force.alive is not None)
        response = response_of(law.material)
        self.kernels = bond_associated_tangent(layout, w.bits, material, response, broken, bool(held.any()), w.module)
        self.gradient = w.array("gradient", OWNER, t.mat32, shape=shape)
        self.stress = w.array("stress", OWNER, t.vec3, shape=shape)
        self.moduli = w.array("moduli", OWNER, t.vec6, shape=shape)
        self._matrix = self._allocate_matrix() if assembled else None
        self._add_linearise()
        self._add_product()

    @property
    def assembled(self) -> bool:
        """Whether the tangent is stored as a matrix."""
        return self._matrix is not None

    def _allocate_matrix(self) -> tuple[Any, Any, Any]:
        """Blocks by offset and point, index shift of each offset, offset of each pair of members."""
        w, families = self.workspace, self.force.families
        assert families.steps is not None
        lattice_row = _lattice_row(families)
        offsets, pairs = pair_offsets(families.steps)
        return (
            w.array("matrix", OWNER, self.types.mat33, shape=(len(offsets), self.points)),
            w.array("matrix_shift", OWNER, wp.int32, offsets[:, 0] + lattice_row * offsets[:, 1]),
            w.array("pair_offset", OWNER, wp.int32, pairs),
        )

    def _add_linearise(self) -> None:
        w, n, force, stage = self.workspace, self.points, self.force, "linearise"
        w.launch(
            stage, OWNER, self.kernels.linearise, n,
            **self._family(), displacement=self.displacement, constants=force.constants,
            inverse_horizon=force.inverse_horizon, tension=self.tension, gradient=self.gradient, stress=self.stress,
            moduli=self.moduli,
        )  # fmt: skip
        unit_stiffness = force.unit_volume * force.inverse_horizon**2
        if self._matrix is not None:
            w.launch(
                stage, OWNER, self.kernels.assemble, n,
                family=force.struct, gradient=self.gradient, stress=self.stress, moduli=self.moduli,
                pair_offset=self._matrix[2], unit_stiffness=unit_stiffness, matrix=self._matrix[0],
            )  # fmt: skip
            w.launch(
                stage, OWNER, self.kernels.inverse_diagonal, n,
                matrix=self._matrix[0], held_mask=self.held_mask, out=self.inverse_blocks,
            )  # fmt: skip
            return
        w.launch(
            stage, OWNER, self.kernels.inverse_blocks, n,
            **self._family(), displacement=self.displacement, gradient=self.gradient, stress=self.stress,
            moduli=self.moduli, held_mask=self.held_mask,
            unit_stiffness=unit_stiffness, out=self.inverse_blocks,
        )  # fmt: skip

    def add_product(self, stage: str, vector: Any, image: Any, follower: bool) -> None:
        """Add the launches of image = K vector, held components of the image zero.

        Args:
            stage: Where to add them.
            vector: (N,) vec3.
            image: (N,) vec3.
            follower: Whether follower pressure, if there is any, has its share in K.
        """
        w, n, force = self.workspace, self.points, self.force
        if self._matrix is not None:
            w.launch(
                stage, OWNER, self.kernels.matrix_product, n,
                matrix=self._matrix[0], shift=self._matrix[1], direction=vector, change=image,
            )  # fmt: skip
        else:
            w.launch(
                stage, OWNER, self.kernels.product, n,
                **self._family(), direction=vector, gradient=self.gradient, stress=self.stress, moduli=self.moduli,
                inverse_horizon=force.inverse_horizon, unit_force=force.unit_volume * force.inverse_horizon,
                bond_force=force.bond_force,
            )  # fmt: skip
            w.point(stage, OWNER, force.kernels.gather, n, **self._family(), bond_force=force.bond_force, force=image)
        self._add_pressure_and_supports(stage, vector, image, follower)

    def _add_product(self) -> None:
        self.add_product("product", self.vector, self.image, follower=True)

    def slack(self) -> bool:
        """Whether the sheet carries no stress: a flat one then has no stiffness across its plane."""
        return bool(np.abs(self.stress.numpy()).max() < SLACK_STRESS * self.modulus())

    def modulus(self) -> float:
        """Mean of dS11/dC11 over the sheet [Pa], at the last linearisation."""
        return float(self.moduli.numpy()[..., 0].sum() / self.points)

    def sparse(self) -> SparseTangent:
        """The sparse matrix."""
        return SparseTangent(self)


def pair_offsets(steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lattice steps between any two points of a family, the centre last among its members.

    Args:
        steps: Steps to the members, shape (n, 2).

    Returns:
        The distinct steps, zero first, shape (O, 2), and the index of the step from one member to another,
        shape (n + 1, n + 1).
    """
    places = np.vstack([steps, [[0, 0]]])
    apart = (places[None] - places[:, None]).reshape(-1, 2)
    distinct, which = np.unique(apart, axis=0, return_inverse=True)
    order = np.argsort(np.abs(distinct).sum(axis=1), kind="stable")
    rank = np.empty(len(order), int)
    rank[order] = np.arange(len(order))
    return distinct[order], rank[which.ravel()].reshape(len(places), len(places))


def _lattice_row(families: Families) -> int:
    """Points in a row of the lattice, from the index shifts of the stencil."""
    assert families.steps is not None and families.shift is not None
    upwards = np.flatnonzero((families.steps == [0, 1]).all(axis=1))
    return int(families.shift[upwards[0]])


def response_of(material: Any) -> Any:
    """The factory of the stress and moduli of a material.

    Raises:
        InputError: if it has none.
    """
    if not hasattr(material, "response"):
        raise InputError(
            f"material = {type(material).__name__}: allowed with Newton are materials with `response`; "
            f"take the solver Relaxation"
        )
    return material.response


class SparseTangent:
    """The tangent as a sparse matrix, K = B^T A B, for a direct factorisation on the host.

    B holds the coefficients with which the points of D_ij enter F_ij and changes only when bonds break; A, one
    symmetric 6x6 block an intersection, is read from the device. Follower pressure is left out: the matrix is
    symmetric.
    """

    def __init__(self, tangent: Tangent) -> None:
        self.tangent = tangent
        self.coefficients, self.entries = gradient_matrix(tangent.force)
        free = (tangent.held[:, None] >> np.arange(3)) & 1 == 0
        self.free = free.ravel()

    def matrix(self) -> csr_matrix:
        """K of the free components [N/m], shape (free, free)."""
        from scipy import sparse

        t, (member, point) = self.tangent, self.entries
        F = t.gradient.numpy()[member, point].astype(np.float64)
        S = t.stress.numpy()[member, point].astype(np.float64)
        T = t.moduli.numpy()[member, point].astype(np.float64)
        blocks = intersection_stiffness(F, S, T) * t.force.unit_volume
        count = len(member)
        A = sparse.bsr_matrix((blocks, np.arange(count), np.arange(count + 1)), shape=(6 * count, 6 * count))
        B = sparse.kron(self.coefficients, sparse.identity(3), format="csr")[:, self.free]
        return (B.T @ (A.tocsr() @ B)).tocsc()

    def factorise(self) -> Any:
        """Solver of K x = b on arrays of shape (N, 3); None if K is singular."""
        return factorised(self.matrix(), self.free)


def intersection_stiffness(F: np.ndarray, S: np.ndarray, T: np.ndarray) -> np.ndarray:
    """Second derivative of W Psi by F, columns F e1 and F e2 after each other.

    Args:
        F: shape (M, 3, 2).
        S: Weighted stress 11, 12, 22, shape (M, 3).
        T: Weighted moduli, upper triangle, shape (M, 6).

    Returns:
        shape (M, 6, 6).
    """
    b = np.zeros((len(F), 3, 6))
    b[:, 0, :3] = 2.0 * F[..., 0]
    b[:, 1, 3:] = 2.0 * F[..., 1]
    b[:, 2, :3], b[:, 2, 3:] = F[..., 1], F[..., 0]
    moduli = T[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    blocks = 0.5 * b.transpose(0, 2, 1) @ (moduli @ b)
    for c in range(3):
        blocks[:, c, c] += S[:, 0]
        blocks[:, c, 3 + c] += S[:, 1]
        blocks[:, 3 + c, c] += S[:, 1]
        blocks[:, 3 + c, 3 + c] += S[:, 2]
    return blocks


def gradient_matrix(force: BondAssociatedForce) -> tuple[csr_matrix, tuple[np.ndarray, np.ndarray]]:
    """Coefficients of the displacement in the gradients F_ij.

    Returns:
        Sparse matrix [1/m], shape (2 M, N), rows 2 q and 2 q + 1 for the two columns of the q-th F_ij; and the
        member and point of each of the M intersections that determine a gradient.
    """
    from scipy import sparse

    families = force.families
    standing = families.rows_of_points(families.exists)
    if force.alive is not None:
        standing = unpack(force.alive.numpy().T, families.members)
    g, usable = _coefficients(families, standing)
    point, member = np.nonzero(usable)
    values = g[point, member]
    q, k = np.nonzero((values != 0.0).any(axis=-1))
    neighbour = _neighbours(families, point[q], k)
    values = values[q, k] / families.horizon
    rows = np.concatenate([2 * q, 2 * q + 1, 2 * q, 2 * q + 1])
    columns = np.concatenate([neighbour, neighbour, point[q], point[q]])
    data = np.concatenate([values[:, 0], values[:, 1], -values[:, 0], -values[:, 1]])
    shape = (2 * len(point), families.points)
    return sparse.csr_matrix((data, (rows, columns)), shape=shape), (member, point)


def _coefficients(families: Families, standing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """c_k K_ij^-1 xi_ik by point, j, k, shape (N, n, n, 2), and which intersections are usable, shape (N, n)."""
    shared = families.bonds.ndim == 2
    bonds = families.bonds[None] if shared else families.bonds
    c = np.where(standing, families.influence, 0.0) * families.rows_of_points(families.member_areas)
    common = unpack(families.common, families.members)
    weighted = np.where(common[None] if shared else common, c[:, None, :], 0.0)
    products = np.stack([bonds[..., 0] ** 2, bonds[..., 0] * bonds[..., 1], bonds[..., 1] ** 2], axis=-1)
    shape = np.einsum("njk,nkc->njc", weighted, np.broadcast_to(products, (*c.shape, 3)), optimize=True)
    determinant = shape[..., 0] * shape[..., 2] - shape[..., 1] ** 2
    usable = standing & (determinant > DEGENERATE * (0.5 * (shape[..., 0] + shape[..., 2])) ** 2)
    inverse = np.stack([shape[..., 2], -shape[..., 1], -shape[..., 1], shape[..., 0]], axis=-1)
    inverse /= np.where(usable, determinant, 1.0)[..., None]
    inverse = inverse.reshape(*usable.shape, 2, 2)
    g = weighted[..., None] * np.einsum("njab,nkb->njka", inverse, np.broadcast_to(bonds, (*c.shape, 2)), optimize=True)
    return g, usable


def _neighbours(families: Families, point: np.ndarray, member: np.ndarray) -> np.ndarray:
    if families.neighbours is None:
        assert families.shift is not None
        return point + families.shift[member]
    return families.neighbours[point, member]
