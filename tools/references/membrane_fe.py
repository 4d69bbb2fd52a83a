"""Plane finite elements of a stretched neo-Hookean or Yeoh sheet with a hole, a crack or a rigid inclusion.

The sheet of scene `stretch`, edges on rollers or clamped: a quarter of it with its origin at the centre, unknown
displacements in the plane, total-Lagrangian. The material is exactly incompressible and in plane stress, with the
energy per volume

    W(F) = mu / 2 (I + c I^2),   P = dW/dF = mu (1 + 2 c I) (F - J^-2 F^-T),   I = F : F + J^-2 - 3,   J = det F,

with c = 0 for the neo-Hookean sheet and c20 / c10 for Yeoh's, whose mu is 2 c10 (scenes `visco_hole`, `visco_crack`).

Elements are Q9 of scikit-fem, with all nodes of the hole on its circle. At a crack the rows of elements are graded
towards the tip with the power 4, which keeps the order 4 of the forces next to the singularity r^1/2. Newton's method
takes the exact tangent. Forces are sums of nodal reactions, so that they converge as the energy does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.interpolate import RegularGridInterpolator
from skfem import Basis, BilinearForm, ElementQuad2, ElementVector, LinearForm, MeshQuad, MeshQuad2, condense, solve
from skfem.helpers import ddot, det, inv, mul, transpose

Array = npt.NDArray[np.float64]
HALF, RADIUS, CRACK, THICKNESS, MU = 0.25, 0.08, 0.16, 0.01, 0.109e9 / 3.0
GRADING = 4.0
DEFECTS, MODES = ("none", "hole", "crack", "inclusion"), ("equibiaxial", "planar", "uniaxial")


# Meshes: a tensor grid of parameters, and where it lies in the sheet -------------------------------------------


def graded(cells: int) -> Array:
    """Vertices from 0 to 1, dense at 0."""
    return np.linspace(0.0, 1.0, cells + 1) ** GRADING


def around_circle(place: Array) -> Array:
    """Positions [m] of parameters: radial from the circle (0) to the edge (1), angular from x (0) to y (2)."""
    radial, angle = place[0], place[1] * np.pi / 4.0
    direction = np.stack([np.cos(angle), np.sin(angle)])
    edge = HALF * direction / np.abs(direction).max(axis=0)
    return (1.0 - radial) * RADIUS * direction + radial * edge


@dataclass(frozen=True)
class Grid:
    """A quarter of the sheet.

    Attributes:
        axes: Parameters of the vertices along the two directions of the grid.
        place: Parameters (2, ...) -> positions [m].
    """

    axes: tuple[Array, Array]
    place: Callable[[Array], Array]

    @cached_property
    def basis(self) -> Basis:
        """Q9 elements of vectors, mapped by the nodes themselves."""
        mesh = MeshQuad2.from_mesh(MeshQuad.init_tensor(*self.axes))
        return Basis(MeshQuad2(self.place(mesh.doflocs), mesh.t), ElementVector(ElementQuad2()), intorder=6)

    @cached_property
    def parameters(self) -> Array:
        """Parameters of the degrees of freedom, (2, dofs)."""
        return Basis(MeshQuad.init_tensor(*self.axes), ElementVector(ElementQuad2())).doflocs

    @cached_property
    def components(self) -> tuple[Array, Array]:
        """Degrees of freedom along x, and along y."""
        numbers = [self.basis.nodal_dofs, self.basis.facet_dofs, self.basis.interior_dofs]
        x, y = (np.concatenate([n[c] for n in numbers]) for c in (0, 1))
        return x, y

    def carried(self, displacement: Array, finer: Grid) -> Array:
        """A displacement on a finer grid of the same parameters, linear between the nodes of this one."""
        nodes = [np.sort(np.concatenate([a, 0.5 * (a[1:] + a[:-1])])) for a in self.axes]
        found = np.zeros(finer.parameters.shape[1])
        for mine, theirs in zip(self.components, finer.components, strict=True):
            values = np.empty([len(n) for n in nodes])
            at = [np.abs(n[:, None] - p).argmin(axis=0) for n, p in zip(nodes, self.parameters[:, mine], strict=True)]
            values[tuple(at)] = displacement[mine]
            found[theirs] = RegularGridInterpolator(nodes, values)(finer.parameters[:, theirs].T)
        return found


def grid(defect: str, cells: int, crack: float = CRACK) -> Grid:
    """A quarter of the sheet, with `cells` elements along the radius of the defect or of the sheet.

    Args:
        defect: One of DEFECTS. A crack lies along y.
        cells: Number of elements along the first direction; twice as many lie along the second.
        crack: Its length [m].
    """
    if defect in ("hole", "inclusion"):
        return Grid((np.linspace(0.0, 1.0, cells + 1), np.linspace(0.0, 2.0, 2 * cells + 1)), around_circle)
    if defect == "crack":
        tip, ahead = 0.5 * crack, HALF - 0.5 * crack
        along = np.concatenate([tip - tip * graded(cells)[::-1], tip + ahead * graded(cells)[1:]])
        return Grid((HALF * graded(cells), along), np.asarray)
    even = np.linspace(0.0, HALF, cells + 1)
    return Grid((even, even), np.asarray)


# The material ----------------------------------------------------------------------------------------------------


def stress(gradient: Array, stiffening: float = 0.0) -> Array:
    """First Piola stress over mu, of deformation gradients (2, 2, ...).

    Args:
        gradient: Deformation gradients.
        stiffening: c20 / c10 of Yeoh's energy.
    """
    return _factor(gradient, stiffening) * _neo_hookean(gradient)


def stress_change(gradient: Array, change: Array, stiffening: float = 0.0) -> Array:
    """Derivative of the stress over mu at `gradient` in the direction `change`."""
    across, squeeze = transpose(inv(gradient)), 1.0 / det(gradient) ** 2
    base = _neo_hookean(gradient)
    first = change + squeeze * (2.0 * ddot(across, change) * across + mul(across, mul(transpose(change), across)))
    return _factor(gradient, stiffening) * first + 4.0 * stiffening * ddot(base, change) * base


def _neo_hookean(gradient: Array) -> Array:
    return gradient - transpose(inv(gradient)) / det(gradient) ** 2


def _factor(gradient: Array, stiffening: float) -> Array:
    return 1.0 + 2.0 * stiffening * (ddot(gradient, gradient) + 1.0 / det(gradient) ** 2 - 3.0)


@LinearForm
def internal_force(v, w):
    """Virtual work of the stress over mu."""
    return ddot(w.stress, v.grad)


@BilinearForm
def tangent(u, v, w):
    """Derivative of `internal_force`."""
    return ddot(stress_change(np.asarray(w.deformation), np.asarray(u.grad), w.stiffening), v.grad)


# Equilibrium -----------------------------------------------------------------------------------------------------


@dataclass
class Quarter:
    """A quarter of the sheet with its supports.

    Attributes:
        grid: Its elements.
        defect: One of DEFECTS.
        mode: One of MODES.
        grip: "roller", or "clamp": edges move as in a uniform stretch in both directions; not uniaxial.
        stiffening: c20 / c10 of Yeoh's energy.
        crack: Its length [m], that of the grid.
        displacement: [m], of all degrees of freedom.
    """

    grid: Grid
    defect: str
    mode: str
    grip: str = "roller"
    stiffening: float = 0.0
    crack: float = CRACK
    displacement: Array = field(init=False)

    def __post_init__(self) -> None:
        self.displacement = self.grid.basis.zeros()

    @cached_property
    def supports(self) -> tuple[Array, Array, Array]:
        """Degrees of freedom that symmetry or the inclusion holds, those on the right edge, and those on the top."""
        x, y = self.grid.components
        place, near = self.grid.basis.doflocs, 1e-9 * HALF
        middle = x[place[0, x] < near]
        if self.defect == "crack":
            middle = middle[place[1, middle] > 0.5 * self.crack - near]
        held = [middle, y[place[1, y] < near]]
        if self.defect == "inclusion":
            held.append(np.flatnonzero(np.hypot(*place) < RADIUS + near))
        return np.unique(np.concatenate(held)), x[place[0, x] > HALF - near], y[place[1, y] > HALF - near]

    def deformation(self, displacement: Array) -> Array:
        """Deformation gradients at the points of integration, (2, 2, elements, points)."""
        grad = self.grid.basis.interpolate(displacement).grad
        return np.eye(2)[:, :, None, None] + np.asarray(grad)

    def residual(self, displacement: Array) -> Array:
        """Internal forces over mu [m^2], without the thickness."""
        now = stress(self.deformation(displacement), self.stiffening)
        return internal_force.assemble(self.grid.basis, stress=now)

    def stiffness(self, displacement: Array):
        """Derivative of the residual, sparse."""
        return tangent.assemble(self.grid.basis, deformation=self.deformation(displacement), stiffening=self.stiffening)

    def stretch_to(self, stretch: float, tolerance: float = 1e-11, limit: int = 40) -> None:
        """Move the edges to a stretch, and iterate to equilibrium.

        Args:
            stretch: Distance of the edges over that at rest.
            tolerance: Largest change of displacement over HALF in the last iteration.
            limit: Number of iterations.

        Raises:
            ArithmeticError: if Newton's method does not converge. Take smaller steps.
        """
        held, right, top = self.supports
        goal = self.displacement.copy()
        goal[held], goal[right] = 0.0, (stretch - 1.0) * HALF
        fixed = [held, right]
        if self.mode != "uniaxial":
            goal[top] = (stretch - 1.0) * HALF if self.mode == "equibiaxial" else 0.0
            fixed.append(top)
        if self.grip == "clamp":
            place = self.grid.basis.doflocs
            rim = place.max(axis=0) > HALF - 1e-9 * HALF
            for c, dofs in enumerate(self.grid.components):
                along = dofs[rim[dofs]]
                goal[along] = (stretch - 1.0) * place[c, along] if c == 0 or self.mode == "equibiaxial" else 0.0
                fixed.append(along)
        fixed = np.unique(np.concatenate(fixed))
        for _ in range(limit):
            u = self.displacement
            change = np.where(np.isin(np.arange(len(u)), fixed), goal - u, 0.0)
            change = solve(*condense(self.stiffness(u), -self.residual(u), x=change, D=fixed))
            share = 1.0
            while det(self.deformation(u + share * change)).min() <= 0.0:
                share *= 0.5
                if share < 1e-3:
                    raise ArithmeticError(f"stretch {stretch}: an element turns inside out; take smaller steps")
            self.displacement = u + share * change
            if share == 1.0 and np.abs(change).max() < tolerance * HALF:
                return
        raise ArithmeticError(f"stretch {stretch}: no equilibrium after {limit} iterations")

    def forces(self) -> tuple[float, float]:
        """Forces [N] on the whole right edge along x and on the whole top along y."""
        reaction = 2.0 * MU * THICKNESS * self.residual(self.displacement)
        _, right, top = self.supports
        return float(reaction[right].sum()), float(reaction[top].sum())

    def quantities(self) -> dict[str, float]:
        """Forces on the edges [N], and how far the defect opens along x and y, from the middle [m]."""
        found = dict(zip(("force_x", "force_y"), self.forces(), strict=True))
        if self.mode == "uniaxial":
            del found["force_y"]
        if self.defect == "hole":
            found["opening_x"], found["opening_y"] = self.moved((RADIUS, 0.0))[0], self.moved((0.0, RADIUS))[1]
        if self.defect == "crack":
            found["opening_x"], found["opening_y"] = self.moved((0.0, 0.0))[0], self.moved((0.0, 0.5 * self.crack))[1]
        return found

    def moved(self, point: Sequence[float]) -> tuple[float, float]:
        """Displacement [m] of the node nearest to a point [m]."""
        apart = np.hypot(*(self.grid.basis.doflocs - np.asarray(point, float)[:, None]))
        x, y = (c[apart[c].argmin()] for c in self.grid.components)
        return float(self.displacement[x]), float(self.displacement[y])


# The study -------------------------------------------------------------------------------------------------------


def converged(
    defect: str,
    mode: str,
    meshes: Sequence[int],
    stretches: Sequence[float],
    step: float = 0.1,
    grip: str = "roller",
    stiffening: float = 0.0,
    crack: float = CRACK,
) -> dict[float, dict[str, list[float]]]:
    """Quantities of the stretched sheet on meshes that double, by stretch and name.

    The coarsest mesh is stretched in steps of at most `step`. A finer one starts from the displacements before it.
    """
    found: dict[float, dict[str, list[float]]] = {stretch: {} for stretch in stretches}
    known: list[Array] = []
    coarser: Grid | None = None
    for cells in meshes:
        quarter = Quarter(grid(defect, cells, crack), defect, mode, grip, stiffening, crack)
        reached: list[Array] = []
        before = 1.0
        for k, stretch in enumerate(stretches):
            if coarser is None:
                for part in np.linspace(before, stretch, max(1, round((stretch - before) / step)) + 1)[1:]:
                    quarter.stretch_to(float(part))
                before = stretch
            else:
                quarter.displacement = coarser.carried(known[k], quarter.grid)
                quarter.stretch_to(stretch)
            reached.append(quarter.displacement)
            for name, value in quarter.quantities().items():
                found[stretch].setdefault(name, []).append(value)
        coarser, known = quarter.grid, reached
    return found


def richardson(values: Sequence[float]) -> tuple[float, float, float]:
    """Limit of the last three values, from meshes that double; its error estimate; the observed order.

    The estimate is the distance of the limit from the last value, and 1e-9 of it for round-off. Where the differences
    do not shrink, the limit is the last value, the estimate is the last difference, and the order is NaN.
    """
    coarse, middle, fine = values[-3:]
    first, last = middle - coarse, fine - middle
    round_off = 1e-9 * abs(fine)
    if abs(last) <= round_off or first / last <= 1.0:
        return fine, abs(last) + round_off, float("nan")
    order = float(np.log2(first / last))
    limit = fine + last / (2.0**order - 1.0)
    return limit, abs(limit - fine) + round_off, order
