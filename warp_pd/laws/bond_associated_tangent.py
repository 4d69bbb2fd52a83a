"""Tangent of the bond-associated law: stiffness products, and a sparse matrix for small sheets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..device.checks import InputError
from ..device.fields import Array
from ..device.launches import Stage
from ..families import Families, remaining_inverse, tilts_of, unpack
from ..interfaces import Solve
from ..interfaces.context import Context
from ..kernels.bond_associated_tangent import bond_associated_tangent
from ..kernels.bond_state import gather_pairs
from ..kernels.lattice_matrix import lattice_matrix
from ..materials import capabilities
from .sparse import factorised
from .variational import BondAssociatedLaw

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

OWNER = "Newton"
# Largest stress divided by the modulus of a sheet that counts as slack.
SLACK_STRESS = 1e-6
# Stiffness over modulus times thickness that a factorisation adds to every component where bonds can break: points
# without bonds stay where they are. The force has no part in it.
LOOSE = 1e-9


class BondAssociatedTangent:
    """The tangent of the bond-associated law, matrix-free or stored by lattice offsets.

    Attributes:
        gradient: F of every intersection [-], (members, N).
        stress: Weighted stress of every intersection [Pa], (members, N).
        moduli: Weighted moduli of every intersection [Pa], (members, N).
        inverse_blocks: Inverse diagonal blocks of the stiffness, (N,) mat33 [m/N].
    """

    direct_points = 0

    def __init__(self, force: BondAssociatedLaw, context: Context) -> None:
        """Allocate the tangent. Raises InputError for a material without `response`."""
        self.force, self.context, self.held = force, context, context.held
        t, shape, n = context.types, (force.families.members, force.points), force.points
        self.gradient = context.array("gradient", OWNER, t.mat32, shape=shape, per="bond")
        self.stress = context.array("stress", OWNER, t.vec3, shape=shape, per="bond")
        self.moduli = context.array("moduli", OWNER, t.vec6, shape=shape, per="bond")
        self.inverse_blocks = context.array("inverse_blocks", OWNER, t.mat33, shape=n)
        material = force.material
        response = capabilities(material).response
        if response is None:
            raise InputError(
                f"material = {type(material).__name__}: expected a material with `response` for the solver Newton; "
                f"or use the solver Relaxation"
            )
        layout, functions, _ = force.key
        held = context.features.held
        self.kernels = bond_associated_tangent(layout, functions, response, held)
        self.gather = gather_pairs(layout, softens=False)
        self._matrix = self._allocate_matrix() if self._stores_matrix() else None
        self._matrix_kernels = lattice_matrix(layout, held) if self._matrix is not None else None

    def _stores_matrix(self) -> bool:
        """Whether the tangent is stored as a matrix, which makes products four times faster on a CPU."""
        sheet = self.context.sheet
        whole = sheet.lattice is not None and not sheet.cuts and self.force.intact is None
        return whole and bool(self.context.device.is_cpu)

    def _allocate_matrix(self) -> tuple[Array, Array, Array]:
        """Allocate the blocks by offset and point, index shifts of offsets, and offsets of member pairs."""
        context, families = self.context, self.force.families
        assert families.steps is not None
        lattice_row = _lattice_row(families)
        offsets, pairs = pair_offsets(families.steps)
        shift = offsets[:, 0] + lattice_row * offsets[:, 1]
        return (
            context.array("matrix", OWNER, context.types.mat33, shape=(len(offsets), self.force.points), per="bond"),
            context.array("matrix_shift", OWNER, wp.int32, shift, per="table"),
            context.array("pair_offset", OWNER, wp.int32, pairs, per="table"),
        )

    def add_linearise(self, stage: Stage, displacement: Array, tension: Array) -> None:
        """Add the launches that compute the tangent at a displacement, with an isotropic tension [Pa] added."""
        force, n = self.force, self.force.points
        state: dict[str, Any] = {"gradient": self.gradient, "stress": self.stress, "moduli": self.moduli}
        held_mask = self.context.state.held_mask
        stage.launch(
            OWNER, self.kernels.linearise, n,
            **force.family_arguments(displacement), constants=force.constants, tension=tension, damage=force.damage,
            **state,
        )  # fmt: skip
        unit_stiffness = force.unit_volume * force.inverse_horizon**2
        if self._matrix is not None and self._matrix_kernels is not None:
            stage.launch(
                OWNER, self._matrix_kernels.assemble, n,
                family=force.struct, **state, pair_offset=self._matrix[2], unit_stiffness=unit_stiffness,
                matrix=self._matrix[0],
            )  # fmt: skip
            stage.launch(
                OWNER, self._matrix_kernels.inverse_diagonal, n,
                matrix=self._matrix[0], held_mask=held_mask, out=self.inverse_blocks,
            )  # fmt: skip
            return
        stage.launch(
            OWNER, self.kernels.inverse_blocks, n,
            family=force.struct, intact=force.intact, displacement=displacement, **state, held_mask=held_mask,
            unit_stiffness=unit_stiffness, out=self.inverse_blocks,
        )  # fmt: skip

    def add_product(self, stage: Stage, direction: Array, change: Array) -> None:
        """Add the launches that fill `change` [N] with the derivative of the force along a direction [m]."""
        force, n = self.force, self.force.points
        if self._matrix is not None and self._matrix_kernels is not None:
            stage.launch(
                OWNER, self._matrix_kernels.product, n,
                matrix=self._matrix[0], shift=self._matrix[1], direction=direction, change=change,
            )  # fmt: skip
            return
        stage.launch(
            OWNER, self.kernels.product, n,
            family=force.struct, intact=force.intact, direction=direction, gradient=self.gradient, stress=self.stress,
            moduli=self.moduli, inverse_horizon=force.inverse_horizon,
            unit_force=force.unit_volume * force.inverse_horizon, bond_force=force.pairs,
        )  # fmt: skip
        force.add_gather(stage, self.gather, force.pairs, change)

    def is_slack(self) -> bool:
        """Whether the sheet carries no stress: a flat sheet then has no out-of-plane stiffness."""
        return bool(np.abs(self.stress.numpy()).max() < SLACK_STRESS * self.modulus())

    def modulus(self) -> float:
        """Mean of dS11/dC11 over the sheet [Pa], at the last linearisation."""
        return float(self.moduli.numpy()[..., 0].sum() / self.force.points)

    def min_tension(self, relative: float) -> float:
        """Zero, because the tangent needs no added tension."""
        return 0.0

    def sparse(self) -> BondAssociatedMatrix:
        """The tangent as a sparse matrix."""
        return BondAssociatedMatrix(self)


def pair_offsets(steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lattice steps between any two points of a family; the centre counts as the last member.

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
    """Number of points in a row of the lattice, from the index shifts of the stencil."""
    assert families.steps is not None and families.shift is not None
    upwards = np.flatnonzero((families.steps == [0, 1]).all(axis=1))
    return int(families.shift[upwards[0]])


class BondAssociatedMatrix:
    """The tangent as a sparse matrix, K = B^T A B, for a direct factorisation on the host.

    B has the coefficients of the displacements of D_ij in F_ij and changes only when bonds break. A has one symmetric
    6x6 block per intersection, read from the device. Follower pressure is not included, so the matrix is symmetric.
    """

    def __init__(self, tangent: BondAssociatedTangent) -> None:
        self.tangent = tangent
        self.free = ((tangent.held[:, None] >> np.arange(3)) & 1 == 0).ravel()
        self._intact: np.ndarray | None = None
        self._read_bonds()

    def _read_bonds(self) -> None:
        """Recompute B if bonds have broken."""
        from scipy import sparse

        intact = self.tangent.force.intact
        if self._intact is not None and (intact is None or (intact.numpy() == self._intact).all()):
            return
        self._intact = np.zeros(0) if intact is None else intact.numpy().copy()
        coefficients, self.entries = gradient_matrix(self.tangent.force)
        self.gradients = sparse.kron(coefficients, sparse.identity(3), format="csr")[:, self.free]

    def matrix(self) -> csr_matrix:
        """K of the free components [N/m], shape (free, free)."""
        from scipy import sparse

        self._read_bonds()
        t, (member, point) = self.tangent, self.entries
        F = t.gradient.numpy()[member, point].astype(np.float64)
        S = t.stress.numpy()[member, point].astype(np.float64)
        T = t.moduli.numpy()[member, point].astype(np.float64)
        blocks = intersection_stiffness(F, S, T) * t.force.unit_volume
        count = len(member)
        A = sparse.bsr_matrix((blocks, np.arange(count), np.arange(count + 1)), shape=(6 * count, 6 * count))
        return (self.gradients.T @ (A.tocsr() @ self.gradients)).tocsc()

    def factorise(self, added: np.ndarray | None = None) -> Solve | None:
        """Solver of K x = b on arrays of shape (N, 3), with blocks added to K; None if K is singular."""
        from scipy import sparse

        matrix, t = self.matrix(), self.tangent
        if t.force.intact is not None:
            least = LOOSE * t.modulus() * t.force.thickness
            matrix += least * sparse.identity(matrix.shape[0], format="csc")
        return factorised(matrix, self.free, added)


def intersection_stiffness(F: np.ndarray, S: np.ndarray, T: np.ndarray) -> np.ndarray:
    """Second derivative of W Psi by F, whose columns F e1 and F e2 are stacked.

    Args:
        F: Deformation gradients, shape (M, 3, 2).
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


def gradient_matrix(force: BondAssociatedLaw) -> tuple[csr_matrix, tuple[np.ndarray, np.ndarray]]:
    """Coefficients of the displacement in the gradients F_ij.

    Returns:
        Sparse matrix [1/m], shape (2 M, N), rows 2 q and 2 q + 1 for the two columns of the q-th F_ij; and the
        member and point of each of the M intersections that determine a gradient.
    """
    from scipy import sparse

    families = force.families
    intact = families.rows_of_points(families.exists)
    if force.intact is not None:
        intact = unpack(force.intact.numpy().T, families.members)
    g, usable = _coefficients(families, intact)
    point, member = np.nonzero(usable)
    values = g[point, member]
    q, k = np.nonzero((values != 0.0).any(axis=-1))
    neighbour = families.heads(point[q], k)
    values = values[q, k] / families.horizon
    rows = np.concatenate([2 * q, 2 * q + 1, 2 * q, 2 * q + 1])
    columns = np.concatenate([neighbour, neighbour, point[q], point[q]])
    data = np.concatenate([values[:, 0], values[:, 1], -values[:, 0], -values[:, 1]])
    shape = (2 * len(point), families.points)
    return sparse.csr_matrix((data, (rows, columns)), shape=shape), (member, point)


def _coefficients(families: Families, intact: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """c_k K_ij^-1 xi_ik by point, j, k, shape (N, n, n, 2), and a mask of usable intersections, shape (N, n).

    On a curved sheet R^-1 K_ij^-1 (kernels/kinematics.py) takes the place of K_ij^-1.
    """
    shared = families.bonds.ndim == 2
    bonds = families.bonds[None] if shared else families.rows_of_points(families.bonds)
    influence = families.influence if shared else families.rows_of_points(families.influence)
    c = np.where(intact, influence, 0.0) * families.rows_of_points(families.member_areas)
    common = unpack(families.common if shared else families.rows_of_points(families.common), families.members)
    weighted = np.where(common[None] if shared else common, c[:, None, :], 0.0)
    products = np.stack([bonds[..., 0] ** 2, bonds[..., 0] * bonds[..., 1], bonds[..., 1] ** 2], axis=-1)
    shape = np.einsum("njk,nkc->njc", weighted, np.broadcast_to(products, (*c.shape, 3)), optimize=True)
    undamaged, _ = families.inverse_shapes()
    components, usable = remaining_inverse(shape, families.rows_of_points(undamaged))
    usable &= intact
    inverse = np.where(usable[..., None], components, 0.0)[..., [0, 1, 1, 2]].reshape(*usable.shape, 2, 2)
    g = weighted[..., None] * np.einsum("njab,nkb->njka", inverse, np.broadcast_to(bonds, (*c.shape, 2)), optimize=True)
    if families.frames is not None:
        tilts = tilts_of(np.einsum("njka,nk->nja", g, families.rises))[:, :, None]
        g -= (g * tilts).sum(axis=-1, keepdims=True) * tilts
    return g, usable
