"""Tears by membrane finite elements: the damage field of the package on quadrilaterals, by alternate minimisation.

The energy is that of kernels/tearing/damage_field.py (model AT1) with W of tension field theory,

    E = h int ((1 - d)^2 + REMAINS) W(F) + h int (3 Gc / 8) (d / l + l |grad d|^2).

Displacement (by Newton's method) and damage (quadratic, between its last value and 1, by active sets) are minimised in
turn until neither changes. A crack is a row of elements of damage 1. That row, of height e, adds 3 e / (8 l) to the
energy of a tear, so Gc is divided by 1 + 3 e / (8 l). Elements have the size e where the tear runs, and grow elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from finite_elements import Membrane, TensionField, rectangle
from scipy.sparse import csc_matrix, diags
from scipy.sparse.linalg import splu

Array = npt.NDArray[np.float64]
# Stiffness that remains of broken elements, share of the energy that resists compression.
REMAINS, SHARE = 1e-6, 0.01
# Change of the damage at which a load is done, rounds at most, damage of a tear.
SETTLED, ROUNDS, TORN = 2e-3, 1000, 0.9
# Ratio of an element to its neighbour where they grow.
GROWTH = 1.25


def grown(length: float, size: float) -> Array:
    """Distances, rising from above 0 to `length`, about `size` apart at first and ever more."""
    if length < 1e-9 * size:
        return np.zeros(0)
    count = max(1, int(np.log1p(length / size * (GROWTH - 1.0)) / np.log(GROWTH)))
    places = np.cumsum(GROWTH ** np.arange(count))
    return length * places / places[-1]


def graded(length: float, begin: float, middle: float, end: float, size: float) -> Array:
    """Places from 0 to `length`, about `size` apart from `begin` to `end`; one of them is at `middle`."""
    begin, middle, end = np.clip((begin, middle, end), 0.0, length)
    before, after = (max(1, round(part / size)) for part in (middle - begin, end - middle))
    inner = [np.linspace(begin, middle, before, endpoint=False), np.linspace(middle, end, after, endpoint=False), [end]]
    return np.unique(np.concatenate([begin - grown(begin, size), *inner, end + grown(length - end, size)]))


@dataclass(eq=False)
class TornSheet:
    """A rectangle, 1 m thick, with a crack from the left along half of its height, whose upper and lower edge part.

    Attributes:
        width, height: [m].
        crack: Length of the crack [m].
        reach: Distance ahead of the crack in which elements are small [m].
        energy: Gc [J/m^2].
        length: l [m].
        size: e [m].
        mu: Shear modulus [Pa].
        mirrored: Whether the right edge is a line of symmetry.
        membrane: The elements.
        damage: At the nodes, (N,).

    Raises:
        ArithmeticError: if elements are too large for the damage field or the crack.
    """

    width: float
    height: float
    crack: float
    reach: float
    energy: float
    length: float
    size: float
    mu: float
    mirrored: bool = False
    membrane: Membrane = field(init=False)
    damage: Array = field(init=False)

    def __post_init__(self) -> None:
        half, toughness = 0.5 * self.height, self.energy / (1.0 + 3.0 * self.size / (8.0 * self.length))
        band = (round(2.0 * self.length / self.size) + 0.5) * self.size
        tip = self.crack
        along = graded(self.width, tip - 2.0 * self.length, tip, tip + self.reach, self.size)
        # The crack is a row of elements: the middle of the height is that of one.
        low = half - 0.5 * self.size
        mesh = rectangle(along, graded(self.height, half - band, low, half + band, self.size), nine=False)
        self._material = TensionField(self.mu, SHARE)
        self.membrane = Membrane(mesh, lambda t, d: tuple(self._left * w for w in self._material(t, d)), 1.0, 2)
        by_gradient, self._by_value = self.membrane._operators
        self._area = self.membrane.weights.ravel()
        self._unit = 0.375 * toughness / self.length
        stiff = 2.0 * self._unit * self.length**2 * np.repeat(self._area, 2)
        self._smooth = by_gradient.T @ diags(stiff) @ by_gradient
        x, y = self.membrane.nodes.T
        # The element ahead of the last broken node bears next to nothing: the crack ends behind it.
        self._cracked = (abs(y - half) < 0.6 * self.size) & (x < self.crack - 0.5 * self.size)
        if self._cracked.sum() < 2 or self.size > 0.75 * self.length:
            raise ArithmeticError(
                f"size = {self.size:g} m: expected at most 3/4 of the length, and less than the crack"
            )
        self.damage = np.where(self._cracked, 1.0, 0.0)
        self._damaged_by(np.zeros_like(self._area))

    @property
    def tip(self) -> float:
        """Where the tear ends [m]."""
        return float(self.membrane.nodes[self.damage > TORN, 0].max())

    @property
    def tear_energy(self) -> float:
        """Energy of the damage field [J]."""
        d = self.damage
        return float(self._unit * (self._by_value @ d * self._area).sum() + 0.5 * d @ self._smooth @ d)

    def pull(self, opening: float, enough: float) -> float:
        """Move the edges apart to an `opening` [m], to equilibrium or until the tip is beyond `enough` [m].

        Returns:
            The force [N].
        """
        sheet = self.membrane
        x, y = sheet.nodes.T
        top = y > self.height * (1.0 - 1e-9)
        held = np.repeat((top | (y < self.height * 1e-9))[:, None], 2, axis=1)
        if self.mirrored:
            held[x > self.width * (1.0 - 1e-9), 0] = True
        goal = np.zeros_like(sheet.displacement)
        goal[:, 1] = opening * (y / self.height - 0.5)
        for _ in range(ROUNDS):
            sheet.solve(held, goal, tolerance=1e-5)
            G = sheet.deformation()
            C = np.einsum("eqac,eqbc->eqab", G, G)
            density = self._material.energy(np.trace(C, axis1=2, axis2=3), np.linalg.det(C)).ravel()
            before = self.damage
            self._damaged_by(density)
            if self.tip > enough or np.abs(self.damage - before).max() < SETTLED:
                break
        return float(sheet.forces()[top, 1].sum())

    def _damaged_by(self, density: Array) -> None:
        """Take the damage of least energy at a density [J/m^3], (points of integration,), not below the present one."""
        matrix = csc_matrix(self._smooth + self._by_value.T @ diags(2.0 * density * self._area) @ self._by_value)
        load = self._by_value.T @ (self._area * (2.0 * density - self._unit))
        least, found = self.damage, self.damage.copy()
        low, high = np.zeros(len(load), bool), self._cracked.copy()
        for _ in range(60):
            free = ~(low | high)
            found[low], found[high] = least[low], 1.0
            known = load - matrix[:, ~free] @ found[~free]
            found[free] = splu(csc_matrix(matrix[free][:, free])).solve(known[free])
            slope = matrix @ found - load
            now = (
                (low & (slope > 0.0)) | (free & (found < least)),
                self._cracked | (high & (slope < 0.0)) | (free & (found > 1.0)),
            )
            if np.array_equal(now, (low, high)):
                break
            low, high = now
        self.damage = np.clip(found, least, 1.0)
        self._left = ((1.0 - self._by_value @ self.damage) ** 2 + REMAINS).reshape(self.membrane.weights.shape)
