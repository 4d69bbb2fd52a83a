"""Explicit finite elements of a neo-Hookean membrane: scenes `pressure_dynamic` and `out_of_plane` (NN 6.1 and 6.2).

A sheet of 1 x 1 m with three unknowns a node, total-Lagrangian, without bending stiffness. Elements are bilinear
squares with 2 x 2 points of integration; the mass is lumped, and the method of central differences takes

    v' = [(1 - c dt/2) v + dt f / m] / (1 + c dt/2),   u' = u + dt v',   c the damping by mass [1/s].

The material is that of the NN paper, in plane stress: W = mu/2 (J^-2/3 tr - 3) + K/8 (J^2 + J^-2 - 2) with
tr = C11 + C22 + C33, J^2 = C33 det C, and C33 from dW/dC33 = 0. Nothing here is shared with the package.

Where such a sheet is compressed it wrinkles as finely as its nodes allow. `relaxed` takes the energy of tension field
theory instead: a state that would be compressed across its larger principal stretch carries the stress of a strip in
tension, along it alone; one that is stretched in no direction carries none.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
MU, BULK, DENSITY, THICKNESS, SIDE = 1e3, 100e3, 1000.0, 0.01, 1.0
PATCH = 0.04
# Of the points of integration, over the side of an element.
NEAR, FAR = 0.5 - 0.5 / np.sqrt(3.0), 0.5 + 0.5 / np.sqrt(3.0)
# Step over the time that the fastest wave of an unstretched sheet, 2 sqrt(mu/rho), takes through an element.
STEP = 0.25


def thickness_stretch(green: Array, determinant: Array, c33: Array) -> Array:
    """C33 of zero stress across the sheet, by four steps of Newton's method from a guess.

    Args:
        green: C11 + C22, any shape.
        determinant: det C of the plane.
        c33: The guess.
    """
    for _ in range(4):
        j2 = c33 * determinant
        shear = MU * j2 ** (-1.0 / 3.0)
        value = shear * (2.0 * c33 - green) / 3.0 + 0.25 * BULK * (j2 - 1.0 / j2)
        slope = shear * (4.0 / 9.0 + green / (9.0 * c33)) + 0.25 * BULK * (determinant + 1.0 / (j2 * c33))
        c33 = c33 - value / slope
    return c33


def stress(first: Array, second: Array, c33: Array) -> tuple[Array, Array, Array]:
    """First Piola stress of a membrane, and C33.

    Args:
        first: Column of the deformation gradient along x, (3, ...).
        second: That along y.
        c33: A guess of C33, (...).

    Returns:
        Columns of the stress, (3, ...) [Pa]; C33.
    """
    c11, c22, c12 = ((a * b).sum(axis=0) for a, b in ((first, first), (second, second), (first, second)))
    determinant = c11 * c22 - c12 * c12
    c33 = thickness_stretch(c11 + c22, determinant, c33)
    shear = MU * (c33 * determinant) ** (-1.0 / 3.0)
    # S = shear (I - C33 C^-1), and P = F S.
    share = c33 / determinant
    s11, s22, s12 = shear * (1.0 - share * c22), shear * (1.0 - share * c11), shear * share * c12
    return first * s11 + second * s12, first * s12 + second * s22, c33


def strip_width(large: Array) -> Array:
    """Squared stretch across a strip that is pulled to the squared stretch `large` along it, by Newton's method."""
    width = large**-0.5
    for _ in range(4):
        j2 = large * width**2
        shear = MU * j2 ** (-1.0 / 3.0)
        value = shear * (width - large) / 3.0 + 0.25 * BULK * (j2 - 1.0 / j2)
        slope = shear * (1.0 / 9.0 + 2.0 * large / (9.0 * width)) + 0.5 * BULK * (j2 + 1.0 / j2) / width
        width = width - value / slope
    return width


def tension_field_stress(first: Array, second: Array, c33: Array) -> tuple[Array, Array, Array]:
    """The same of the relaxed energy."""
    c11, c22, c12 = ((a * b).sum(axis=0) for a, b in ((first, first), (second, second), (first, second)))
    mean, radius = 0.5 * (c11 + c22), np.hypot(0.5 * (c11 - c22), c12)
    large, small = np.maximum(mean + radius, 1.0), mean - radius
    width = strip_width(large)
    taut = small >= width
    p1, p2 = np.zeros_like(first), np.zeros_like(first)
    c33 = np.where(taut, c33, width)
    p1[:, taut], p2[:, taut], c33[taut] = stress(first[:, taut], second[:, taut], c33[taut])
    slack = ~taut
    c11, c22, c12, large, small, width = (c[slack] for c in (c11, c22, c12, large, small, width))
    pull = MU * (large * width**2) ** (-1.0 / 3.0) * (1.0 - width / large) / np.maximum(large - small, 1e-9)
    f1, f2 = first[:, slack], second[:, slack]
    p1[:, slack] = pull * (f1 * (c11 - small) + f2 * c12)
    p2[:, slack] = pull * (f1 * c12 + f2 * (c22 - small))
    return p1, p2, c33


@dataclass
class Sheet:
    """A sheet on its way: nodes of a grid of square elements, seen as (3, along x, along y).

    Attributes:
        cells: Elements along a side.
        pressure: That follows the surface [Pa].
        damping: By mass [1/s].
        held: Nodes with a given velocity, (cells + 1, cells + 1).
        motion: Time [s] -> velocity of the held nodes [m/s], (3, number of held nodes).
        relaxed: Whether compressed states carry no compression.
    """

    cells: int
    pressure: float
    damping: float
    held: npt.NDArray[np.bool_]
    motion: Callable[[float], Array]
    relaxed: bool = False
    time: float = 0.0
    displacement: Array = field(init=False)
    velocity: Array = field(init=False)
    _c33: list[Array] = field(init=False)

    def __post_init__(self) -> None:
        nodes = self.cells + 1
        self.displacement, self.velocity = np.zeros((3, nodes, nodes)), np.zeros((3, nodes, nodes))
        self._c33 = [np.ones((self.cells, self.cells)) for _ in range(4)]

    @property
    def size(self) -> float:
        """Side of an element [m]."""
        return SIDE / self.cells

    def masses(self) -> Array:
        """Of the nodes [kg]; those on an edge have half, corners a quarter."""
        along = np.full(self.cells + 1, self.size)
        along[[0, -1]] *= 0.5
        return DENSITY * THICKNESS * np.outer(along, along)

    def forces(self) -> Array:
        """On the nodes [N], by stress and pressure."""
        u = self.displacement
        along_x, along_y = np.diff(u, axis=1) / self.size, np.diff(u, axis=2) / self.size
        total = np.zeros_like(u)
        area = 0.25 * self.size**2
        stress_of = tension_field_stress if self.relaxed else stress
        for point, (x, y) in enumerate(((NEAR, NEAR), (FAR, NEAR), (NEAR, FAR), (FAR, FAR))):
            first = (1.0 - y) * along_x[:, :, :-1] + y * along_x[:, :, 1:]
            second = (1.0 - x) * along_y[:, :-1] + x * along_y[:, 1:]
            first[0] += 1.0
            second[1] += 1.0
            p1, p2, self._c33[point] = stress_of(first, second, self._c33[point])
            p1 *= THICKNESS * area / self.size
            p2 *= THICKNESS * area / self.size
            total[:, :-1, :-1] += (1.0 - y) * p1 + (1.0 - x) * p2
            total[:, 1:, :-1] += x * p2 - (1.0 - y) * p1
            total[:, :-1, 1:] += y * p1 - (1.0 - x) * p2
            total[:, 1:, 1:] -= y * p1 + x * p2
            if self.pressure != 0.0:
                push = self.pressure * area * np.cross(first, second, axis=0)
                total[:, :-1, :-1] += (1.0 - x) * (1.0 - y) * push
                total[:, 1:, :-1] += x * (1.0 - y) * push
                total[:, :-1, 1:] += (1.0 - x) * y * push
                total[:, 1:, 1:] += x * y * push
        return total

    def run(self, until: float, step: float = STEP) -> None:
        """Go on to a time [s], in equal steps."""
        longest = step * self.size / (2.0 * np.sqrt(MU / DENSITY))
        steps = max(1, int(np.ceil((until - self.time) / longest - 1e-9)))
        dt, begin = (until - self.time) / steps, self.time
        slower, faster = 1.0 - 0.5 * dt * self.damping, 1.0 + 0.5 * dt * self.damping
        inverse_mass = 1.0 / self.masses()
        for k in range(steps):
            # A first step from rest is a half kick.
            kick = 0.5 * dt if begin == 0.0 and k == 0 else dt
            self.velocity = (slower * self.velocity + kick * self.forces() * inverse_mass) / faster
            self.velocity[:, self.held] = self.motion(begin + (k + 0.5) * dt)
            self.displacement += dt * self.velocity
        self.time = until


def nodes(cells: int) -> tuple[Array, Array]:
    """Places of the nodes, (cells + 1, cells + 1) each [m]."""
    x, y = np.meshgrid(*[np.linspace(0.0, SIDE, cells + 1)] * 2, indexing="ij")
    return x, y


def under_pressure(cells: int) -> Sheet:
    """NN 6.1: all edges fixed, 20 Pa from the start."""
    held = np.zeros((cells + 1, cells + 1), bool)
    held[[0, -1]] = held[:, [0, -1]] = True
    return Sheet(cells, 20.0, 0.1, held, lambda time: np.zeros((3, 1)))


def lifted(cells: int, relaxed: bool = False) -> Sheet:
    """NN 6.2: the left edge fixed, the nodes near the middle of the right one moved until 2 s."""
    x, y = nodes(cells)
    patch = np.hypot(x - SIDE, y - 0.5 * SIDE) <= PATCH * (1.0 + 1e-9)
    held = patch | (x == 0.0)

    def motion(time: float) -> Array:
        going = patch[held] & (time < 2.0)
        return np.array([[0.025], [0.0], [0.05]]) * going

    return Sheet(cells, 0.0, 0.1, held, motion, relaxed)


def snapshots(sheet: Sheet, times: Sequence[float]) -> list[Array]:
    """Displacements (3, cells + 1, cells + 1) [m] at times [s]; 2 s, when the motion stops, ends a step."""
    found = {}
    for time in sorted({*times, 2.0 if max(times) > 2.0 else times[0]}):
        sheet.run(time)
        if not np.isfinite(sheet.displacement).all():
            raise ArithmeticError(f"{sheet.cells} cells: the run diverged before {time:g} s; take a smaller step")
        found[time] = sheet.displacement.copy()
    return [found[time] for time in times]
