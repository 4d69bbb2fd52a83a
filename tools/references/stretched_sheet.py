"""A stretched neo-Hookean or Yeoh sheet with a hole, a crack or a rigid inclusion, by plane finite elements.

The sheet of scene `stretch`, edges on rollers or clamped: a quarter of it with its origin at the centre. The material
is exactly incompressible and in plane stress, W = mu / 2 (I + c I^2): c = 0 for the neo-Hookean sheet, and c20 / c10
for Yeoh's, whose mu is 2 c10 (scenes `visco_hole`, `visco_crack`).

Elements have nine nodes, those of the hole on its circle. At a crack the rows of elements are graded towards the tip
with the power 4, which keeps the order 4 of the forces next to the singularity r^1/2. Forces are sums of nodal
reactions, so that they converge as the energy does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt
from finite_elements import Membrane, incompressible, rectangle
from scipy.interpolate import RegularGridInterpolator
from skfem import Basis, ElementQuad2, Mesh, MeshQuad2

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
HALF, RADIUS, CRACK, THICKNESS, MU = 0.25, 0.08, 0.16, 0.01, 0.109e9 / 3.0
NEAR, GRADING = 1e-9 * HALF, 4.0
DEFECTS, MODES = ("none", "hole", "crack", "inclusion"), ("equibiaxial", "planar", "uniaxial")


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
    def mesh(self) -> Mesh:
        """Elements, mapped by all of their nodes."""
        flat = rectangle(*self.axes, nine=True)
        return MeshQuad2(self.place(flat.doflocs), flat.t)

    @cached_property
    def parameters(self) -> Array:
        """Parameters of the nodes, (N, 2)."""
        return Basis(rectangle(*self.axes, nine=True), ElementQuad2()).doflocs.T.round(12)

    def carried(self, displacement: Array, finer: Grid) -> Array:
        """A displacement on a finer grid of the same parameters, linear between the nodes of this one."""
        first, second = self.parameters.T
        values = displacement[np.lexsort((second, first))]
        axes = np.unique(first), np.unique(second)
        return RegularGridInterpolator(axes, values.reshape(*map(len, axes), 2))(finer.parameters)


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


@dataclass
class Quarter:
    """A quarter of the sheet with its supports.

    Attributes:
        grid: Its elements.
        defect: One of DEFECTS.
        mode: One of MODES.
        grip: "roller", or "clamp": edges move as in a uniform stretch in both directions; not uniaxial.
        mu: Shear modulus [Pa].
        stiffening: c20 / c10 of Yeoh's energy.
        crack: Its length [m], that of the grid.
        membrane: Its finite elements.
    """

    grid: Grid
    defect: str
    mode: str
    grip: str = "roller"
    mu: float = MU
    stiffening: float = 0.0
    crack: float = CRACK
    membrane: Membrane = field(init=False)

    def __post_init__(self) -> None:
        material = incompressible(self.mu, self.stiffening)
        self.membrane = Membrane(self.grid.mesh, material, THICKNESS, 2, intorder=6)

    @cached_property
    def edges(self) -> tuple[Flags, Flags]:
        """Nodes of the right edge, and those of the top, (N,)."""
        x, y = self.membrane.nodes.T
        return x > HALF - NEAR, y > HALF - NEAR

    def supports(self, stretch: float) -> tuple[Flags, Array]:
        """Given components of the displacement, and where they go [m], (N, 2) each."""
        (x, y), (right, top) = self.membrane.nodes.T, self.edges
        held, goal = np.zeros((len(x), 2), bool), np.zeros((len(x), 2))
        held[:, 0] = right | ((x < NEAR) & ((self.defect != "crack") | (y > 0.5 * self.crack - NEAR)))
        held[:, 1] = (y < NEAR) | (top & (self.mode != "uniaxial"))
        held[(np.hypot(x, y) < RADIUS + NEAR) & (self.defect == "inclusion")] = True
        goal[right, 0] = (stretch - 1.0) * HALF
        goal[top, 1] = (stretch - 1.0) * HALF if self.mode == "equibiaxial" else 0.0
        if self.grip == "clamp":
            rim = right | top
            held[rim] = True
            goal[rim] = (stretch - 1.0) * self.membrane.nodes[rim]
            goal[rim, 1] *= self.mode == "equibiaxial"
        return held, goal

    def stretch_to(self, stretch: float) -> None:
        """Move the edges to a stretch, and iterate to equilibrium.

        Args:
            stretch: Distance of the edges over that at rest.

        Raises:
            ArithmeticError: if Newton's method does not converge. Take smaller steps.
        """
        self.membrane.solve(*self.supports(stretch), tolerance=1e-11, limit=40)

    def quantities(self) -> dict[str, float]:
        """Forces on the edges of the whole sheet [N], and how far the defect opens from the middle [m]."""
        reaction = 2.0 * self.membrane.forces()
        found = {"force_x": float(reaction[self.edges[0], 0].sum()), "force_y": float(reaction[self.edges[1], 1].sum())}
        if self.mode == "uniaxial":
            del found["force_y"]
        ends = {"hole": ((RADIUS, 0.0), (0.0, RADIUS)), "crack": ((0.0, 0.0), (0.0, 0.5 * self.crack))}
        for c, place in enumerate(ends.get(self.defect, ())):
            node = np.hypot(*(self.membrane.nodes - place).T).argmin()
            found[f"opening_{'xy'[c]}"] = float(self.membrane.displacement[node, c])
        return found


def converged(
    defect: str,
    mode: str,
    meshes: Sequence[int],
    stretches: Sequence[float],
    step: float = 0.1,
    crack: float = CRACK,
    **settings: float | str,
) -> dict[float, dict[str, list[float]]]:
    """Quantities of the stretched sheet on meshes that double, by stretch and name.

    The coarsest mesh is stretched in steps of at most `step`. A finer one starts from the displacements before it.
    `settings` are attributes of `Quarter`.
    """
    found: dict[float, dict[str, list[float]]] = {stretch: {} for stretch in stretches}
    known: list[Array] = []
    coarser: Grid | None = None
    for cells in meshes:
        quarter = Quarter(grid(defect, cells, crack), defect, mode, crack=crack, **settings)  # type: ignore[arg-type]
        reached: list[Array] = []
        before = 1.0
        for k, stretch in enumerate(stretches):
            if coarser is None:
                for part in np.linspace(before, stretch, max(1, round((stretch - before) / step)) + 1)[1:]:
                    quarter.stretch_to(float(part))
                before = stretch
            else:
                quarter.membrane.displacement = coarser.carried(known[k], quarter.grid)
                quarter.stretch_to(stretch)
            reached.append(quarter.membrane.displacement)
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
