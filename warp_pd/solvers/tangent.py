"""The tangent of a sheet at rest: residual, stiffness products, and the sparse matrix for small sheets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..bonds import DEGENERATE, Families, unpack
from ..checks import InputError
from ..forces.bond_associated import BondAssociatedForce
from ..launches import LaunchSequence, Workspace

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

OWNER = "Newton"


class Tangent:
    """One sheet on the device, its residual at a displacement and its stiffness there.

    The stages: "evaluate" the residual, "linearise", "product" (image = K vector), "advance".

    Attributes:
        force: The force law on this sheet.
        held: Bits of held components, uint8, shape (N,), on the host.
        displacement: Where the residual is evaluated [m], (N,) vec3.
        base: Last accepted displacement [m].
        direction: Newton's step [m].
        residual: Unbalanced force of free components [N].
        vector: Input of the product.
        image: Output of the product.
        inverse_blocks: Inverse diagonal blocks, (N,) mat33.
    """

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
        from ..kernels.equilibrium import equilibrium
        from ..kernels.numeric import numeric

        w, t, n = workspace, numeric(workspace.bits), force.points
        self.workspace, self.force, self.types, self.held = w, force, t, held
        self.loaded, self.follower = loaded, follower
        self.displacement, self.internal, self.external = displacement, internal, external
        law = force.law
        layout, material, broken, _ = law.signature(force.families.layout, force.alive is not None)
        response = response_of(law.material)
        has_held = bool(held.any())
        self.kernels = bond_associated_tangent(layout, w.bits, material, response, broken, has_held, w.module)
        self.fields = equilibrium(w.bits, has_held, loaded, w.module)
        members = force.families.members
        self.held_mask = w.array("held_components", OWNER, wp.uint8, held) if has_held else None
        self.gradient = w.array("gradient", OWNER, t.mat32, shape=(members, n))
        self.stress = w.array("stress", OWNER, t.vec3, shape=(members, n))
        self.moduli = w.array("moduli", OWNER, t.vec6, shape=(members, n))
        self.inverse_blocks = w.array("inverse_blocks", OWNER, t.mat33, shape=n)
        self.base = w.array("base", OWNER, t.vec3, shape=n)
        self.direction = w.array("newton_step", OWNER, t.vec3, shape=n)
        self.residual = w.array("unbalanced_force", OWNER, t.vec3, shape=n)
        self.reaction = w.array("squared_reaction", OWNER, wp.float64, shape=n)
        self.vector = w.array("vector", OWNER, t.vec3, shape=n)
        self.image = w.array("image", OWNER, t.vec3, shape=n)
        self.tension = w.array("tension", OWNER, t.real, shape=1)
        self.share = w.array("share", OWNER, t.real, shape=1)
        self.dead = w.array("dead_loads", OWNER, t.vec3, shape=n) if loaded else None
        self.pressure = w.array("pressure", OWNER, t.vec3, shape=1) if follower else None
        self.pressure_value = w.array("pressure_value", OWNER, t.real, shape=1) if follower else None
        self._matrix = self._allocate_matrix() if assembled else None
        self._sequences: dict[str, LaunchSequence] = {}
        self._add_evaluate()
        self._add_linearise()
        self._add_product()

    @property
    def assembled(self) -> bool:
        """Whether the tangent is stored as a matrix."""
        return self._matrix is not None

    @property
    def points(self) -> int:
        """Number of points."""
        return self.force.points

    def _family(self) -> dict[str, Any]:
        return {"family": self.force.struct, "alive": self.force.alive}

    def _add_evaluate(self) -> None:
        from ..kernels.loads import constant_loads, follower_pressure

        w, n, force = self.workspace, self.points, self.force
        w.launch(
            "advance", OWNER, self.fields.advance, n,
            base=self.base, direction=self.direction, share=self.share, displacement=self.displacement,
        )  # fmt: skip
        stage = "evaluate"
        force.add_force(stage, self.displacement, self.internal)
        if self.loaded:
            w.launch(
                stage, OWNER, constant_loads(w.bits, True, w.module), n, constant=self.dead, external=self.external
            )
        if self.follower:
            kernel = follower_pressure(force.families.layout, w.bits, force.alive is not None, True, w.module)
            w.launch(
                stage, OWNER, kernel, n,
                **self._family(), displacement=self.displacement, inverse_horizon=force.inverse_horizon,
                unit_pressure=force.families.reference_area, factors=self.pressure, schedule=0,
                external=self.external,
            )  # fmt: skip
        w.launch(
            stage, OWNER, self.fields.imbalance, n,
            held_mask=self.held_mask, force=self.internal, external=self.external, residual=self.residual,
            reaction=self.reaction,
        )  # fmt: skip

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
        from ..kernels.bond_associated_tangent import follower_pressure_tangent

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
            w.launch(stage, OWNER, force.kernels.gather, n, **self._family(), bond_force=force.bond_force, force=image)
        if self.follower and follower:
            kernel = follower_pressure_tangent(force.families.layout, w.bits, force.alive is not None, w.module)
            w.launch(
                stage, OWNER, kernel, n,
                **self._family(), displacement=self.displacement, direction=vector,
                inverse_horizon=force.inverse_horizon, unit_area=force.families.reference_area,
                pressure=self.pressure_value, change=image,
            )  # fmt: skip
        w.launch(stage, OWNER, self.fields.hold, n, held_mask=self.held_mask, change=image)

    def _add_product(self) -> None:
        self.add_product("product", self.vector, self.image, follower=True)

    # What the host asks for ----------------------------------------------------------------------------

    def run(self, stage: str) -> None:
        """Run a stage now."""
        if stage not in self._sequences:
            self._sequences[stage] = self.workspace.sequence(stage)
        self._sequences[stage].run()

    def set_loads(self, dead: np.ndarray | None, pressure: float) -> None:
        """Dead forces [N], shape (N, 3), and follower pressure [Pa]."""
        if self.dead is not None and dead is not None:
            assign(self.dead, dead)
        if self.follower:
            assign(self.pressure, np.array([[pressure, 0.0, 0.0]]))
            assign(self.pressure_value, np.array([pressure]))

    def evaluate(self) -> tuple[float, float]:
        """Norm of the unbalanced force and of loads and reactions [N], at `displacement`."""
        self.run("evaluate")
        return float(np.sqrt(dot(self.residual, self.residual))), float(np.sqrt(total(self.reaction)))

    def linearise(self, tension: float) -> None:
        """Take the tangent at `displacement`, with an isotropic tension [Pa] added to the stress."""
        assign(self.tension, np.array([tension]))
        self.run("linearise")

    def step_to(self, share: float) -> None:
        """Set displacement = base + share direction."""
        assign(self.share, np.array([share]))
        self.run("advance")

    def modulus(self) -> float:
        """Mean of dS11/dC11 over the sheet [Pa], at the last linearisation."""
        return float(self.moduli.numpy()[..., 0].sum() / self.points)


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


def assign(array: Any, values: np.ndarray) -> None:
    """Copy host values into a device array, in its own precision."""
    scalar = getattr(array.dtype, "_wp_scalar_type_", array.dtype)
    array.assign(np.ascontiguousarray(values, dtype=wp.dtype_to_numpy(scalar)))


def dot(a: Any, b: Any) -> float:
    """Scalar product of two (N,) vec3 arrays."""
    if a.device.is_cpu:
        # Not by BLAS, whose threads would go on spinning on the cores that the kernels need.
        return float(np.einsum("ic,ic->", a.numpy(), b.numpy(), dtype=np.float64))
    return float(wp.utils.array_inner(a, b))


def total(a: Any) -> float:
    """Sum of a scalar array."""
    return float(a.numpy().sum()) if a.device.is_cpu else float(wp.utils.array_sum(a))


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
        from scipy.sparse.linalg import splu

        try:
            factors = splu(self.matrix(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        except RuntimeError:
            return None
        free = self.free

        def solve(b: np.ndarray) -> np.ndarray:
            x = np.zeros(free.size)
            x[free] = factors.solve(np.ascontiguousarray(b.ravel()[free], dtype=np.float64))
            return x.reshape(b.shape)

        return solve


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
