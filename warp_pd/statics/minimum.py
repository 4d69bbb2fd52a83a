"""Whether an equilibrium is a minimum of the energy: a search for a motion x along which it falls in second order.

A quadratic form x K x below zero proves that it is none; that the search finds no such x proves nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..device.fields import doubles
from ..geometry.sheet import Sheet
from ..geometry.triangulation import doubled_normals, vector_sums
from .krylov import Map, dot, norm
from .level import Level
from .linear import LinearSolver
from .stability import extreme
from .static_rounds import UNIT_ROUND_OFF

# Products of the stiffness that a search takes for each of Newton's steps, which costs 20 to 40 times as much, and
# their bounds; a factorised tangent costs more, and its solutions less. The search goes on to the last one where there
# is a negative pivot, or once a motion was found.
SHARE, FEWEST_PRODUCTS, FACTORISED_PRODUCTS, MOST_PRODUCTS = 0.5, 2, 10, 20
# A quotient counts as negative below so many times that of round-off, and of the unbalanced force that is left over the
# size of the sheet.
MARGIN, LEFT = 100.0, 10.0
# The same in units of the stiffness that slack parts of a sheet keep: pressed together by it they would buckle, in
# waves that a tension field stands for.
SLACK = 2.0
# Relative residual of a solve with a tangent that is not symmetric.
CLOSE = 1e-6
# Norm of K x - (x K x) x over a positive x K x below which a search has come to an eigenvalue, the lowest as a rule.
SETTLED = 0.3
# Difference of heights over the size of a sheet below which it is flat.
FLAT = 1e-6
# A direction that is shorter by this factor after the others have been taken out of it adds nothing.
DEPENDENT = 1e-10


@dataclass(frozen=True)
class Falling:
    """A motion along which the energy of an equilibrium falls in second order.

    Attributes:
        factor: Load factor of the equilibrium.
        point: The point that moves most.
        component: The component that moves most there: 0, 1 or 2.
        flat: Whether the sheet lies in its plane there, and would leave it.
    """

    factor: float
    point: int
    component: int
    flat: bool

    @classmethod
    def along(cls, motion: np.ndarray, factor: float, sheet: Sheet, displacement: np.ndarray) -> Falling:
        """The fall of a sheet along a motion [m], from a displacement [m], both of shape (N, 3)."""
        point, component = np.unravel_index(int(np.argmax(np.abs(motion))), motion.shape)
        heights = (sheet.positions + displacement)[:, 2]
        flat = component == 2 and float(np.ptp(heights)) < FLAT * float(sheet.extent.max())
        return cls(factor, int(point), int(component), bool(flat))

    def note(self, solver: str, sheet: Sheet) -> str:
        """What the user is told."""
        place = ", ".join(f"{x:.4g}" for x in sheet.points[self.point])
        flat = ", or hold z of all points (Fixed) if it is to stay flat" if self.flat else ""
        return (
            f"{solver}: the equilibrium at load factor {self.factor:.4g} is not stable: the energy falls along a "
            f"motion that is largest along {'xyz'[self.component]} at point {self.point} ({place}): begin with a bump "
            f"there (initial_displacement), try Explicit with damping{flat}"
        )


def least_quotient(
    product: Map, precondition: Map, start: np.ndarray, most: int, enough: float
) -> tuple[np.ndarray, float]:
    """A vector of norm 1 with a small x K x, and that value.

    It ends below `enough`, near an eigenvalue that is positive, or after `most` products.

    Locally optimal preconditioned conjugate gradients (Knyazev, SIAM J. Sci. Comput. 23, 2001), for one vector.
    """
    size = norm(start)
    if not (size > 0.0 and math.isfinite(size)):
        return start, 0.0
    x = start / size
    image = product(x)
    value, before = dot(x, image), None
    for _ in range(most - 1):
        if value < enough or not math.isfinite(value):
            break
        basis, images, rest = [x], [image], image - value * x
        if norm(rest) < SETTLED * value:
            break
        further = orthonormal(precondition(rest), basis)
        if further is None:
            break
        basis.append(further)
        images.append(product(further))
        if before is not None:
            # The image of the last direction follows from those of the vectors that are taken out of it.
            direction, its_image = before
            for _ in range(2):
                parts = [dot(vector, direction) for vector in basis]
                for part, vector, of_vector in zip(parts, basis, images, strict=True):
                    direction, its_image = direction - part * vector, its_image - part * of_vector
            length = norm(direction)
            if length > DEPENDENT:
                basis.append(direction / length)
                images.append(its_image / length)
        form = np.array([[dot(a, b) for b in images] for a in basis])
        if not np.isfinite(form).all():
            break
        weights = np.linalg.eigh(0.5 * (form + form.T))[1][:, 0]
        before = combined(weights[1:], basis[1:]), combined(weights[1:], images[1:])
        x, image = weights[0] * x + before[0], weights[0] * image + before[1]
        value = dot(x, image)
    return x, value


def orthonormal(vector: np.ndarray, basis: list[np.ndarray]) -> np.ndarray | None:
    """A vector without its parts along others, of norm 1; None if nothing is left."""
    whole = norm(vector)
    for _ in range(2):
        for other in basis:
            vector = vector - dot(other, vector) * other
    left = norm(vector)
    return vector / left if left > DEPENDENT * whole and math.isfinite(left) else None


def combined(weights: np.ndarray, vectors: list[np.ndarray]) -> np.ndarray:
    """Linear combination of vectors."""
    return np.asarray(sum(weight * vector for weight, vector in zip(weights, vectors, strict=True)))


def random_motion(size: int) -> np.ndarray:
    """The vector with which a search begins, the same in every run."""
    return np.random.default_rng(0).normal(size=size)


def across(sheet: Sheet, displacement: np.ndarray) -> np.ndarray:
    """A random motion across a sheet, (N, 3), in which thin sheets fall; all of it without triangles."""
    if not len(sheet.triangles):
        return random_motion(displacement.size).reshape(-1, 3)
    of_triangles = doubled_normals(sheet.positions + displacement, sheet.triangles)
    normals = vector_sums(of_triangles, sheet.triangles, len(displacement))
    return np.asarray(random_motion(len(normals))[:, None] * normals)


class SearchOfFall:
    """The search at the end of Newton's method, with the preconditioner of its last step.

    Points that touch a body stay where they are in it, which keeps the pressure of contact out of the energy.

    Args:
        level: The sheet in equilibrium.
        solver: Its linear solver.
        modulus: Mean modulus [Pa].
        steps: Number of Newton's steps so far, from which follows how long the search may take.
    """

    def __init__(self, level: Level, solver: LinearSolver, modulus: float, steps: int) -> None:
        self.level, self.solver = level, solver
        fewest = FEWEST_PRODUCTS if solver.factors is None else FACTORISED_PRODUCTS
        self._most = min(MOST_PRODUCTS, max(fewest, round(SHARE * steps)))
        sheet = level.context.sheet
        self._free = (~level.held).ravel()
        for contact in level.contacts:
            self._free &= np.repeat(~doubles(contact.blocks).any(axis=(1, 2)), 3)
        stiffness = modulus * float(np.mean(sheet.thickness))
        left = norm(doubles(level.residual).ravel()) / float(level.context.whole.extent.max())
        slack = SLACK * level.law.slack_stiffness * float(np.mean(sheet.thickness))
        self._enough = -MARGIN * UNIT_ROUND_OFF[level.context.bits] * stiffness - LEFT * left - slack

    def motion(self) -> np.ndarray | None:
        """A motion along which the energy falls, shape (N, 3); None if none is found."""
        products = self.solver.products
        found = self._found()
        self.solver.products = products
        return found

    def _found(self) -> np.ndarray | None:
        level, solver, pivots = self.level, self.solver, None
        if not level.exact:
            level.linearise(0.0)
        elif solver.factors is not None and solver.symmetric and not level.contacts:
            pivots = solver.factors.negative()
            if pivots == 0:
                return None
        start = self._precondition(random_motion(self._free.size))
        x, value = self._search(start, MOST_PRODUCTS if pivots else self._most)
        if not value < self._enough:
            return None
        level.predicting = False
        level.linearise(0.0)
        x, value = self._search(x, MOST_PRODUCTS)
        if not value < self._enough or not (solver.symmetric or self._confirmed()):
            return None
        return x.reshape(-1, 3)

    def _search(self, start: np.ndarray, most: int) -> tuple[np.ndarray, float]:
        return least_quotient(self._product, self._precondition, start, most, self._enough)

    def _product(self, x: np.ndarray) -> np.ndarray:
        return np.where(self._free, self.solver.product(x), 0.0)

    def _precondition(self, r: np.ndarray) -> np.ndarray:
        return np.where(self._free, self.solver.precondition(np.where(self._free, r, 0.0)), 0.0)

    def _confirmed(self) -> bool:
        """Whether a tangent that is not symmetric has an eigenvalue with a negative real part.

        Its quadratic form is that of its symmetric part, which may be negative where the sheet is stable.
        """
        level, solver = self.level, self.solver
        free = np.flatnonzero(~level.held.ravel())

        def solved(b: np.ndarray) -> np.ndarray:
            whole = np.zeros(self._free.size)
            whole[free] = b.ravel()
            solver.solve_closely(whole, CLOSE)
            return np.asarray(doubles(level.direction).ravel()[free])

        # Contact adds its pressure.
        found = None if level.contacts else extreme(solved, len(free), 1, "SR")
        return found is not None and bool(found[0][0] < 0.0 and 1.0 / found[0][0] < self._enough)
