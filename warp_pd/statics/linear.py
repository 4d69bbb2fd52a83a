"""Linear solvers for Newton's method: conjugate gradients and GMRES on the host, conjugate gradients of Warp on a GPU.

Warp's solvers take 0.3 s per scalar product on a CPU. Those on the host copy every vector there, which costs about
a second on a million points. GMRES, for follower loads, is always on the host: Warp's checks the residual only at
restarts and, with the few vectors that fit in memory, did not converge on a million points.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from ..device.fields import Array, assign, doubles
from ..device.graph import launch_now
from .aggregates import Aggregates
from .factors import ChangedBlocks, Solve
from .krylov import conjugate_gradients, gmres
from .level import OWNER, Level
from .multigrid import Hierarchy

# Iterations after which a solve is taken as it is: with multigrid it needs ten or so.
MAX_ITERATIONS = {"multigrid": 60, "algebraic": 60, "direct": 60, "jacobi": 4000}
RESTART = 60
# Cycles of GMRES for a solve that must reach its accuracy: its own estimate ends the first one a little early.
CLOSE_CYCLES = 4


class LinearSolver:
    """Solves the linear system K x = b of one level.

    Attributes:
        products: Number of stiffness products so far, including those of the preconditioner.
        symmetric: Whether K is: a factorisation then solves alone, and conjugate gradients if K is also definite.
    """

    def __init__(
        self, level: Level, index: int, kind: str, hierarchy: Hierarchy | Aggregates | None, definite: bool = True
    ) -> None:
        """Allocate the solver of a level.

        Args:
            level: The level.
            index: Its index in the hierarchy.
            kind: Preconditioner, "multigrid", "algebraic", "direct" or "jacobi".
            hierarchy: All levels, for "multigrid", or the aggregates, for "algebraic".
            definite: Whether K is positive definite; otherwise GMRES is used.
        """
        self.level, self.index, self.kind, self.hierarchy = level, index, kind, hierarchy
        self.products = 0
        self.factors: Solve | None = None
        self._changing: ChangedBlocks | None = None
        self._added: Callable[[np.ndarray], np.ndarray] | None = None
        self._sparse = level.tangent.sparse() if kind == "direct" else None
        self.symmetric = level.tangent.symmetric and not level.following
        self._conjugate = definite and self.symmetric
        self.on_device = self._conjugate and not level.context.device.is_cpu
        if self.on_device:
            self._allocate()

    def _allocate(self) -> None:
        """Allocate vectors and launches for Warp's solver, which calls the launches with its own vectors."""
        level, context, n = self.level, self.level.context, self.level.points
        self._right_side = context.array("krylov_right_side", OWNER, context.types.vec3, shape=n)
        self._preconditioned = context.array("preconditioned", OWNER, context.types.vec3, shape=n)
        stage = context.stage("krylov", "every iteration of the linear solve")
        vectors: dict[str, Any] = {"x": self._right_side, "z": self._preconditioned}
        stage.launch(OWNER, level.kernels.combine, n, **vectors, alpha=1.0, y=self._right_side, beta=0.0)
        stage.launch(OWNER, level.kernels.scale_blocks, n, **vectors, inverse_blocks=level.tangent.inverse_blocks)
        self._combination, self._block_scaling = stage.launches()

    def prepare(self, keep: bool = False) -> bool:
        """Factorise or aggregate if the preconditioner needs it; return whether that succeeded.

        With `keep` the aggregates of an earlier tangent will do.
        """
        if self.hierarchy is not None:
            return self.hierarchy.prepare(keep)
        if self._sparse is not None:
            blocks = self.level.contact_stiffness()
            self.factors = self._sparse.factorise(blocks)
            if self.factors is not None and blocks is not None:
                self.factors = self._changing = ChangedBlocks(self.factors, blocks)
            return self.factors is not None
        return True

    def follow_contact(self) -> bool:
        """Let the factorisation of an earlier tangent have the contact that is here; return whether it could."""
        self.level.run("contact stiffness")
        blocks = self.level.contact_stiffness()
        return self._changing is not None and blocks is not None and self._changing.take(blocks)

    def solve(self, right_side: np.ndarray, accuracy: float) -> None:
        """Solve for `direction` of the level to `accuracy` times the norm of the right-hand side.

        A result that does not reach the accuracy is used anyway; the line search decides whether to accept it.
        """
        if self.factors is not None and self.symmetric:
            assign(self.level.direction, self.factors(right_side))
        elif self.on_device:
            self._on_device(right_side, accuracy)
        else:
            self._on_host(right_side, accuracy)

    def solve_closely(
        self, right_side: np.ndarray, accuracy: float, added: Callable[[np.ndarray], np.ndarray] | None = None
    ) -> bool:
        """Solve for `direction` by iterations on the host; return whether the accuracy was reached.

        The preconditioner may be that of an earlier tangent. `added` is a function of vectors of shape (3 N,) that is
        added to K x, for the transposed tangent.
        """
        self._added = added
        try:
            return self._on_host(right_side, accuracy, CLOSE_CYCLES)
        finally:
            self._added = None

    @property
    def prepared(self) -> bool:
        """Whether there is a preconditioner."""
        if self.hierarchy is not None:
            return self.hierarchy.usable
        return self.kind != "direct" or self.factors is not None

    # Host ----------------------------------------------------------------------------------------------

    def _on_host(self, right_side: np.ndarray, accuracy: float, cycles: int = 1) -> bool:
        b = np.ascontiguousarray(right_side).ravel()
        most = MAX_ITERATIONS[self.kind]
        if self._conjugate:
            x, reached = conjugate_gradients(self.product, self.precondition, b, accuracy, most)
        else:
            cycles = max(cycles, -(-most // RESTART))
            x, reached = gmres(self.product, self.precondition, b, accuracy, RESTART, cycles)
        assign(self.level.direction, x.reshape(-1, 3))
        return reached

    def product(self, x: np.ndarray) -> np.ndarray:
        """K x, both of shape (3 N,)."""
        assign(self.level.vector, x.reshape(-1, 3))
        self.level.run("product")
        self.products += 1
        image = doubles(self.level.image).ravel()
        return np.asarray(image if self._added is None else image + self._added(x))

    def precondition(self, r: np.ndarray) -> np.ndarray:
        """An approximation of K^-1 r, both of shape (3 N,)."""
        r = r.reshape(-1, 3)
        if self.factors is not None:
            return self.factors(r).ravel()
        hierarchy = self.hierarchy
        if hierarchy is None:
            return np.asarray(np.einsum("iab,ib->ia", self.level.tangent.inverse_blocks.numpy(), r).ravel())
        side, solution = hierarchy.sides(self.index)
        assign(side, r)
        hierarchy.cycle(self.index)
        self.products += hierarchy.products_per_cycle(self.index)
        return doubles(solution).ravel()

    # Warp ----------------------------------------------------------------------------------------------

    def _on_device(self, right_side: np.ndarray, accuracy: float) -> None:
        from warp.optim.linear import LinearOperator, cg

        level, n = self.level, self.level.points
        device, vec3 = level.context.device, level.context.types.vec3
        A = LinearOperator((n, n), vec3, device, self._device_product)
        M = LinearOperator((n, n), vec3, device, self._device_precondition)
        assign(self._right_side, right_side)
        level.direction.zero_()
        # By default Warp takes the relative tolerance as the absolute one, in newtons, far above any force here. An
        # iteration that the host takes no part in is captured: launching its kernels one by one takes longer than they.
        found: Any = cg(
            A, self._right_side, level.direction, tol=accuracy, atol=0.0, maxiter=MAX_ITERATIONS[self.kind], M=M,
            check_every=5, use_cuda_graph=self.hierarchy is None and self.factors is None,
        )  # fmt: skip
        cycle = self.hierarchy.products_per_cycle(self.index) if self.hierarchy is not None else 0
        self.products += (int(found[0]) + 1) * (1 + cycle)

    def _device_product(self, x: Array, y: Array, z: Array, alpha: float, beta: float) -> None:
        wp.copy(self.level.vector, x)
        self.level.run("product")
        self._combine(self.level.image, alpha, y, beta, z)

    def _device_precondition(self, x: Array, y: Array, z: Array, alpha: float, beta: float) -> None:
        hierarchy = self.hierarchy
        if hierarchy is not None:
            side, solution = hierarchy.sides(self.index)
            wp.copy(side, x)
            hierarchy.cycle(self.index)
        elif self.factors is not None:
            solution = self._preconditioned
            assign(solution, self.factors(doubles(x)))
        else:
            solution = self._preconditioned
            launch_now(self._block_scaling, self.level.context.device, x=x)
        self._combine(solution, alpha, y, beta, z)

    def _combine(self, x: Array, alpha: float, y: Array, beta: float, z: Array) -> None:
        device = self.level.context.device
        launch_now(self._combination, device, x=x, alpha=float(alpha), y=y, beta=float(beta), z=z)
