"""The linear solves of Newton's method: SciPy's solvers on a CPU, Warp's conjugate gradients on a GPU.

Warp's take 0.3 s a scalar product on a CPU. SciPy's copy every vector to the host, which costs a second or so on a
million points; GMRES, for follower loads, is SciPy's everywhere: Warp's looks at the residual only when it
restarts, and with the few vectors that makes affordable it did not converge on a million points.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from .bond_tangent import BondTangent
from .equilibrium import OWNER, assign
from .tangent import Tangent

if TYPE_CHECKING:
    from .newton import Search

# Iterations after which a solve is taken as it is: with multigrid it needs ten or so.
MOST_ITERATIONS = {"multigrid": 60, "direct": 60, "jacobi": 4000}
RESTART = 60


class LinearSolver:
    """Solves K direction = right side of one level.

    Attributes:
        products: Stiffness products so far, those of the preconditioner included.
    """

    def __init__(self, search: Search, index: int) -> None:
        self.search, self.index = search, index
        self.level: Tangent | BondTangent = search.levels[index]
        self.kind = search.preconditioner
        self.products = 0
        self._factors: Any = None
        self._sparse = self.level.sparse() if self.kind == "direct" else None
        if self._stays_on_device:
            w, n = self.level.workspace, self.level.points
            self._right_side = w.array("krylov_right_side", OWNER, self.level.types.vec3, shape=n)
            self._preconditioned = w.array("preconditioned", OWNER, self.level.types.vec3, shape=n)

    @property
    def _stays_on_device(self) -> bool:
        return not (self.level.workspace.device.is_cpu or self.level.follower)

    def prepare(self) -> bool:
        """Factorise if that is the preconditioner; whether the tangent allows it."""
        if self._sparse is not None:
            self._factors = self._sparse.factorise()
            return self._factors is not None
        return True

    def solve(self, right_side: np.ndarray, accuracy: float) -> None:
        """Set `direction` of the level; ends at `accuracy` times the norm of the right side.

        A solve that does not get there is left as it is: the line search judges the direction.
        """
        if self._sparse is not None and not self.level.follower:
            assign(self.level.direction, self._factors(right_side))
        elif self._stays_on_device:
            self._on_device(right_side, accuracy)
        else:
            self._on_host(right_side, accuracy)

    # SciPy ---------------------------------------------------------------------------------------------

    def _on_host(self, right_side: np.ndarray, accuracy: float) -> None:
        from scipy.sparse.linalg import LinearOperator, cg, gmres

        size = right_side.size
        A = LinearOperator((size, size), matvec=self._product, dtype=np.float64)
        M = LinearOperator((size, size), matvec=self._precondition, dtype=np.float64)
        b = np.ascontiguousarray(right_side).ravel()
        most = MOST_ITERATIONS[self.kind]
        if self.level.follower:
            x, _ = gmres(A, b, rtol=accuracy, restart=RESTART, maxiter=-(-most // RESTART), M=M)
        else:
            x, _ = cg(A, b, rtol=accuracy, maxiter=most, M=M)
        assign(self.level.direction, x.reshape(-1, 3))

    def _product(self, x: np.ndarray) -> np.ndarray:
        assign(self.level.vector, x.reshape(-1, 3))
        self.level.run("product")
        self.products += 1
        return self.level.image.numpy().astype(np.float64).ravel()

    def _precondition(self, r: np.ndarray) -> np.ndarray:
        r = r.reshape(-1, 3)
        if self.kind == "direct":
            return self._factors(r).ravel()
        if self.kind == "jacobi":
            return np.einsum("iab,ib->ia", self.level.inverse_blocks.numpy(), r).ravel()
        hierarchy = self.search.hierarchy
        assert hierarchy is not None
        side, solution = hierarchy.sides(self.index)
        assign(side, r)
        hierarchy.cycle(self.index)
        self.products += hierarchy.products_per_cycle(self.index)
        return solution.numpy().astype(np.float64).ravel()

    # Warp ----------------------------------------------------------------------------------------------

    def _on_device(self, right_side: np.ndarray, accuracy: float) -> None:
        from warp.optim.linear import LinearOperator, cg

        level, n = self.level, self.level.points
        device, vec3 = level.workspace.device, level.types.vec3
        A = LinearOperator((n, n), vec3, device, self._device_product)
        M = LinearOperator((n, n), vec3, device, self._device_precondition)
        assign(self._right_side, right_side)
        level.direction.zero_()
        # Warp's absolute tolerance would else be the relative one, in newtons far above any force here.
        cg(
            A, self._right_side, level.direction, tol=accuracy, atol=0.0, maxiter=MOST_ITERATIONS[self.kind], M=M,
            check_every=5, use_cuda_graph=False,
        )  # fmt: skip

    def _device_product(self, x: Any, y: Any, z: Any, alpha: float, beta: float) -> None:
        wp.copy(self.level.vector, x)
        self.level.run("product")
        self.products += 1
        self._combine(self.level.image, alpha, y, beta, z)

    def _device_precondition(self, x: Any, y: Any, z: Any, alpha: float, beta: float) -> None:
        hierarchy = self.search.hierarchy
        if hierarchy is not None:
            side, solution = hierarchy.sides(self.index)
            wp.copy(side, x)
            hierarchy.cycle(self.index)
            self.products += hierarchy.products_per_cycle(self.index)
        elif self._sparse is not None:
            solution = self._preconditioned
            assign(solution, self._factors(x.numpy().astype(np.float64)))
        else:
            solution = self._preconditioned
            wp.launch(
                self.level.fields.scale_blocks, dim=self.level.points,
                inputs=[self.level.inverse_blocks, x, 0, solution], device=self.level.workspace.device,
                block_dim=self.level.workspace.block_dim,
            )  # fmt: skip
        self._combine(solution, alpha, y, beta, z)

    def _combine(self, x: Any, alpha: float, y: Any, beta: float, z: Any) -> None:
        wp.launch(
            self.level.fields.combine, dim=self.level.points,
            inputs=[x, float(alpha), y, float(beta), 0, z], device=self.level.workspace.device,
            block_dim=self.level.workspace.block_dim,
        )  # fmt: skip
