"""A sheet at rest or on its way there: loads, unbalanced force, trial steps; what every law's tangent shares."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..launches import LaunchSequence, Workspace

if TYPE_CHECKING:
    from ..forces.bond_associated import BondAssociatedForce
    from ..forces.bond_based import BondBasedForce

OWNER = "Newton"


class Equilibrium:
    """One sheet on the device and its residual at a displacement; the stages "evaluate" and "advance".

    A law's tangent adds the stages "linearise" and "product" (image = K vector), and says by `slack` whether the
    state just linearised has no stiffness against some displacement, by `modulus` how stiff the sheet is [Pa], and
    by `sparse` what can be factorised.

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
        tension: Isotropic tension in the tangent [Pa], one number.
    """

    def __init__(
        self,
        workspace: Workspace,
        force: BondAssociatedForce | BondBasedForce,
        held: np.ndarray,
        loaded: bool,
        follower: bool,
        displacement: Any,
        internal: Any,
        external: Any,
    ) -> None:
        from ..kernels.equilibrium import equilibrium
        from ..kernels.numeric import numeric

        w, t, n = workspace, numeric(workspace.bits), force.points
        self.workspace, self.force, self.types, self.held = w, force, t, held
        self.loaded, self.follower = loaded, follower
        self.displacement, self.internal, self.external = displacement, internal, external
        has_held = bool(held.any())
        self.fields = equilibrium(w.bits, has_held, loaded, w.module)
        self.held_mask = w.array("held_components", OWNER, wp.uint8, held) if has_held else None
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
        self._sequences: dict[str, LaunchSequence] = {}
        self._add_evaluate()

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
            w.point(stage, OWNER, constant_loads(w.bits, True, w.module), n, constant=self.dead, external=self.external)
        if self.follower:
            kernel = follower_pressure(force.families.layout, w.bits, force.alive is not None, True, w.module)
            w.point(
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

    def _add_pressure_and_supports(self, stage: str, vector: Any, image: Any, follower: bool) -> None:
        """Add what follower pressure and supports change about the product of the law alone."""
        from ..kernels.bond_associated_tangent import follower_pressure_tangent

        w, n, force = self.workspace, self.points, self.force
        if self.follower and follower:
            kernel = follower_pressure_tangent(force.families.layout, w.bits, force.alive is not None, w.module)
            w.launch(
                stage, OWNER, kernel, n,
                **self._family(), displacement=self.displacement, direction=vector,
                inverse_horizon=force.inverse_horizon, unit_area=force.families.reference_area,
                pressure=self.pressure_value, change=image,
            )  # fmt: skip
        w.launch(stage, OWNER, self.fields.hold, n, held_mask=self.held_mask, change=image)

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


def factorised(matrix: Any, free: np.ndarray) -> Any:
    """Solver of K x = b on arrays of shape (N, 3); None if K is singular.

    Args:
        matrix: K of the free components [N/m], symmetric, in columns.
        free: Which components are free, shape (3 N,); the others of x are zero.
    """
    from scipy.sparse.linalg import splu

    try:
        factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:
        return None

    def solve(b: np.ndarray) -> np.ndarray:
        x = np.zeros(free.size)
        x[free] = factors.solve(np.ascontiguousarray(b.ravel()[free], dtype=np.float64))
        return x.reshape(b.shape)

    return solve
