"""Membrane finite elements in space or in the plane, total-Lagrangian: what a user would take in place of this code.

scikit-fem gives meshes, shape functions and quadrature; element matrices are products over all elements at once, which
is some thirty times as fast as its forms, which loop over pairs of shape functions. The energy per volume is

    W(t, d),  t = tr C,  d = det C,  C = F^T F,   S = 2 (W_t I + W_d adj C),   P = F S,

with the stretch across the sheet eliminated (plane stress). Newton's method takes the exact tangent, that of the
pressure included, and SuperLU solves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from warp_pd import InputError

try:
    from scipy.sparse import csc_matrix
    from scipy.sparse.linalg import splu
    from skfem import Basis, ElementQuad1, ElementQuad2, Mesh, MeshQuad, MeshQuad2
except ModuleNotFoundError as error:
    raise InputError(f"finite elements need scikit-fem ({error}): pip install -e .[references]") from error

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
# (t, d) -> W_t, W_d, W_tt, W_td, W_dd.
Response = Callable[[Array, Array], tuple[Array, ...]]
# Newton's method ends when no node moves by more than this share of the sheet's size; the next would be its square.
TOLERANCE = 1e-6
MOST_ITERATIONS = 60
# Change of trace and determinant by the derivative of adj C, with shear strains doubled.
ADJUGATE = np.array([[0.0, 4.0, 0.0], [4.0, 0.0, 0.0], [0.0, 0.0, -2.0]])


def neo_hookean(mu: float) -> Response:
    """The exactly incompressible neo-Hookean material: W = mu / 2 (t + 1 / d - 3)."""

    def response(t: Array, d: Array) -> tuple[Array, ...]:
        zero = np.zeros_like(d)
        return zero + 0.5 * mu, -0.5 * mu / d**2, zero, zero, mu / d**3

    return response


def gent(mu: float, bulk: float, lock: float) -> Response:
    """The compressible Gent material of `warp_pd.Gent`: C33 = c by Newton's method at every point of integration."""

    def invariant(t: Array, d: Array, c: Array) -> tuple[Array, Array, Array, Array, Array]:
        """I1 bar - 3's first derivatives of the energy, and what the second ones need."""
        p = (c * d) ** (-1.0 / 3.0)
        first = p * (t + c)
        room = 1.0 - (first - 3.0) / lock
        slope = 0.5 * mu / room
        return p, first, slope, slope / (lock * room), p - first / (3.0 * c)

    def response(t: Array, d: Array) -> tuple[Array, ...]:
        c = 1.0 / d
        for _ in range(30):
            p, first, g1, g2, i_c = invariant(t, d, c)
            q = c * d
            h1, h2 = 0.25 * bulk * (1.0 - 1.0 / q), 0.25 * bulk / q**2
            i_cc = (-p - i_c + first / c) / (3.0 * c)
            psi_cc = g2 * i_c**2 + g1 * i_cc + h2 * d**2
            change = -(g1 * i_c + h1 * d) / psi_cc
            c = c * np.exp(np.clip(change / c, -0.5, 0.5))
            if np.abs(change / c).max() < 1e-7:
                break
        p, first, g1, g2, i_c = invariant(t, d, c)
        q = c * d
        h1, h2 = 0.25 * bulk * (1.0 - 1.0 / q), 0.25 * bulk / q**2
        i_d = -first / (3.0 * d)
        psi_cc = g2 * i_c**2 + g1 * (-p - i_c + first / c) / (3.0 * c) + h2 * d**2
        psi_tc = g2 * p * i_c - g1 * p / (3.0 * c)
        psi_dc = g2 * i_d * i_c + g1 * (-p + first / (3.0 * c)) / (3.0 * d) + h2 * d * c + h1
        psi_td = g2 * p * i_d - g1 * p / (3.0 * d)
        psi_dd = g2 * i_d**2 + g1 * 4.0 * first / (9.0 * d**2) + h2 * c**2
        return (
            g1 * p, g1 * i_d + h1 * c,
            g2 * p**2 - psi_tc**2 / psi_cc, psi_td - psi_tc * psi_dc / psi_cc, psi_dd - psi_dc**2 / psi_cc,
        )  # fmt: skip

    return response


@dataclass(eq=False)
class Membrane:
    """A sheet of quadrilaterals.

    Attributes:
        mesh: Of scikit-fem; MeshQuad2 for elements of nine nodes.
        material: Its energy.
        thickness: [m].
        components: 2 in the plane, 3 in space.
        pressure: Follower pressure along the normal [Pa], in space only.
        displacement: Of the nodes, (N, components) [m].
        iterations: Newton's, so far.
    """

    mesh: Mesh
    material: Response
    thickness: float
    components: int
    pressure: float = 0.0
    displacement: Array = field(init=False)
    iterations: int = 0

    def __post_init__(self) -> None:
        self.displacement = np.zeros((self.nodes.shape[0], self.components))

    @cached_property
    def basis(self) -> Basis:
        """Scalar shape functions."""
        curved = isinstance(self.mesh, MeshQuad2)
        return Basis(self.mesh, ElementQuad2() if curved else ElementQuad1(), intorder=4 if curved else 2)

    @cached_property
    def nodes(self) -> Array:
        """(N, 2) [m]."""
        return np.ascontiguousarray(self.basis.doflocs.T)

    @cached_property
    def elements(self) -> Indices:
        """Nodes of each element, (elements, nodes of one)."""
        return np.ascontiguousarray(self.basis.element_dofs.T).astype(np.int64)

    @cached_property
    def shapes(self) -> Array:
        """Shape functions at the points of integration, (elements, points, nodes of one)."""
        values = [np.broadcast_to(np.asarray(b[0]), self.weights.shape) for b in self.basis.basis]
        return np.ascontiguousarray(np.stack(values, axis=-1))

    @cached_property
    def gradients(self) -> Array:
        """(elements, points, nodes of one, 2) [1/m]."""
        stacked = np.stack([np.asarray(b[0].grad) for b in self.basis.basis])
        return np.ascontiguousarray(stacked.transpose(2, 3, 0, 1))

    @cached_property
    def weights(self) -> Array:
        """Areas of the points of integration, (elements, points) [m^2]."""
        return np.asarray(self.basis.dx)

    @cached_property
    def pattern(self) -> tuple[Indices, Indices, Indices]:
        """Where each entry of the element matrices goes, and the columns of the sparse matrix."""
        dofs = (self.elements[:, :, None] * self.components + np.arange(self.components)).reshape(
            len(self.elements), -1
        )
        size = self.displacement.size
        keys = (dofs[:, None, :] * size + dofs[:, :, None]).ravel()
        unique, where = np.unique(keys, return_inverse=True)
        columns = np.searchsorted(unique // size, np.arange(size + 1))
        return where, unique % size, columns

    def solve(self, held: npt.NDArray[np.bool_]) -> None:
        """Iterate to equilibrium with the components of `held`, (N, components), kept where they are.

        Raises:
            InputError: if Newton's method does not converge.
        """
        free = np.flatnonzero(~held.ravel())
        size = float(np.ptp(self.nodes, axis=0).max())
        for _ in range(MOST_ITERATIONS):
            residual, tangent = self.assembled()
            self.iterations += 1
            reduced = csc_matrix(tangent[free][:, free])
            factors = splu(reduced, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options={"SymmetricMode": True})
            change = np.zeros(self.displacement.size)
            change[free] = factors.solve(-residual.ravel()[free])
            largest = np.abs(change).max()
            if not np.isfinite(largest):
                break
            # A trial that moves by more than a fifth of the sheet is beyond what the tangent knows.
            self.displacement += min(1.0, 0.2 * size / largest) * change.reshape(self.displacement.shape)
            if largest < TOLERANCE * size:
                return
        raise InputError(f"membrane: expected an equilibrium, got none in {self.iterations} iterations")

    def deformation(self) -> Array:
        """Deformation gradients, (elements, points, components, 2)."""
        moved = self.displacement[self.elements].transpose(0, 2, 1)[:, None] @ self.gradients
        moved[..., :2, :] += np.eye(2)
        return moved

    def assembled(self) -> tuple[Array, csc_matrix]:
        """Forces on the nodes that are out of balance, (N, components) [N], and their derivative."""
        gradients, weights = self.gradients, self.weights * self.thickness
        deformation = self.deformation()
        C = deformation.swapaxes(-1, -2) @ deformation
        adjugate = np.stack([C[..., 1, 1], C[..., 0, 0], -C[..., 0, 1]], axis=-1)
        t, d = C[..., 0, 0] + C[..., 1, 1], C[..., 0, 0] * C[..., 1, 1] - C[..., 0, 1] ** 2
        w_t, w_d, w_tt, w_td, w_dd = self.material(t, d)
        ones = np.array([1.0, 1.0, 0.0])
        S = 2.0 * (w_t[..., None] * ones + w_d[..., None] * adjugate)
        both = ones[:, None] * adjugate[..., None, :]
        moduli = (
            4.0 * w_tt[..., None, None] * np.outer(ones, ones)
            + 4.0 * w_td[..., None, None] * (both + both.swapaxes(-1, -2))
            + 4.0 * w_dd[..., None, None] * adjugate[..., :, None] * adjugate[..., None, :]
            + w_d[..., None, None] * ADJUGATE
        )
        stress = np.stack([S[..., 0], S[..., 2], S[..., 2], S[..., 1]], axis=-1).reshape(*S.shape[:-1], 2, 2)
        pulled = gradients @ (weights[..., None, None] * stress)
        forces = (pulled @ deformation.swapaxes(-1, -2)).sum(axis=1)
        # Strains (11, 22, twice 12) by displacements of the nodes, (elements, points, 3, nodes, components).
        along, across = deformation[..., None, :, 0], deformation[..., None, :, 1]
        g1, g2 = gradients[..., 0][..., None], gradients[..., 1][..., None]
        strains = np.stack([g1 * along, g2 * across, g1 * across + g2 * along], axis=2)
        e, q, _, n, c = strains.shape
        strains = strains.reshape(e, q, 3, n * c)
        weighted = (weights[..., None, None] * moduli) @ strains
        matrix = strains.reshape(e, q * 3, n * c).swapaxes(-1, -2) @ weighted.reshape(e, q * 3, n * c)
        blocks = matrix.reshape(e, n, c, n, c)
        geometric = pulled.transpose(0, 2, 1, 3).reshape(e, n, 2 * q) @ gradients.transpose(0, 1, 3, 2).reshape(
            e, 2 * q, n
        )
        for k in range(c):
            blocks[:, :, k, :, k] += geometric
        if self.pressure:
            self.add_pressure(deformation, forces, blocks)
        residual = np.zeros_like(self.displacement)
        np.add.at(residual, self.elements, forces)
        where, rows, columns = self.pattern
        size = self.displacement.size
        values = np.bincount(where, weights=matrix.ravel(), minlength=len(rows))
        return residual, csc_matrix((values, rows, columns), shape=(size, size))

    def add_pressure(self, deformation: Array, forces: Array, blocks: Array) -> None:
        """The force p (x_1 x x_2) on an area, and its derivative."""
        one, two = deformation[..., 0], deformation[..., 1]
        loaded = self.pressure * self.weights[..., None] * self.shapes
        forces -= loaded.swapaxes(-1, -2) @ np.cross(one, two)
        for k, unit in enumerate(np.eye(3)):
            # Derivative of the area vector by component k of the gradients along 1 and 2.
            turned = np.stack([np.cross(unit, two), np.cross(one, unit)], axis=-2)
            change = self.gradients @ turned
            blocks[:, :, :, :, k] -= np.einsum("eqa,eqbc->eacb", loaded, change, optimize=True)


def rectangle(x: Array, y: Array, nine: bool) -> Mesh:
    """A tensor grid of vertices."""
    mesh = MeshQuad.init_tensor(x, y)
    return MeshQuad2.from_mesh(mesh) if nine else mesh


def around_hole(radius: float, half: float, cells: int, nine: bool) -> Mesh:
    """A square [-half, half]^2 with a round hole: `cells` elements across, eight times as many around."""
    count = 8 * cells
    angle = np.arange(count) * 2.0 * np.pi / count
    direction = np.stack([np.cos(angle), np.sin(angle)])
    # Vertices on each side are evenly spaced in the tangent of the angle, as corners must be among them.
    edge = half * direction / np.abs(direction).max(axis=0)
    share = np.linspace(0.0, 1.0, cells + 1)[:, None]
    points = (1.0 - share) * (radius * direction)[:, None] + share * edge[:, None]
    ring, row = np.arange(count), count * np.arange(cells)[:, None]
    corners = [row + ring, row + count + ring, row + count + (ring + 1) % count, row + (ring + 1) % count]
    mesh = MeshQuad(points.reshape(2, -1), np.stack([c.ravel() for c in corners]))
    if not nine:
        return mesh
    curved = MeshQuad2.from_mesh(mesh)
    nodes = curved.doflocs.copy()
    # Middles of edges on the hole lie inside it by the height of the arc.
    away = np.hypot(*nodes)
    inside = away < radius * (1.0 - 1e-12)
    nodes[:, inside] *= radius / away[inside]
    return MeshQuad2(nodes, curved.t)
