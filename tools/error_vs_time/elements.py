"""The static scenes with membrane finite elements, as one more law: meshes, supports, errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from stretch import elements as known_hole
from study import REFERENCES

from warp_pd.__main__ import load_scene

from .membrane import Membrane, around_hole, gent, neo_hookean, rectangle
from .references import Errors, interpolated, quarter_field

Array = npt.NDArray[np.float64]
# Where the edges are, as a share of the side.
NEAR = 1e-9


@dataclass(frozen=True)
class Solved:
    """A sheet in equilibrium.

    Attributes:
        membrane: Its elements.
        scalar: Relative error of what the scene measures.
        reference: Points (n, 2) [m] -> displacements [m] of the reference; NaN where it has none.
    """

    membrane: Membrane
    scalar: float
    reference: Callable[[Array], Array]

    def errors(self) -> Errors:
        """Of the scalar, and of the field in the L2 norm, at the points of integration."""
        m = self.membrane
        places = (m.shapes @ m.nodes[m.elements]).reshape(-1, 2)
        found = (m.shapes @ m.displacement[m.elements]).reshape(len(places), -1)
        reference = self.reference(places)
        here = np.isfinite(reference).all(axis=1)
        weights = m.weights.reshape(-1, 1)[here]
        missed = (weights * (found - reference)[here] ** 2).sum() / (weights * reference[here] ** 2).sum()
        return self.scalar, float(np.sqrt(missed))


def square(points: int, side: float, nine: bool) -> tuple[Array, int]:
    """Vertices along a side with `points` nodes, or one more: there is a node in the middle."""
    nodes = points | 1
    return np.linspace(0.0, side, (nodes + 1) // 2 if nine else nodes), nodes


def nearest(nodes: Array, x: float, y: float) -> int:
    """The node at a place."""
    return int(np.hypot(nodes[:, 0] - x, nodes[:, 1] - y).argmin())


def pressure(points: int, nine: bool) -> Solved:
    """Scene `pressure`: one load step, from a dome of a fifth of the side: a flat membrane resists no pressure."""
    side, scene = 0.1, load_scene("pressure")
    x, _ = square(points, side, nine)
    sheet = Membrane(rectangle(x, x, nine), gent(1e3, 200e3, 160.0), 1e-3, 3, pressure=5.0)
    share = sheet.nodes / side
    sheet.displacement[:, 2] = 0.2 * side * (16.0 * np.prod(share * (1.0 - share), axis=1))
    edge = ((share < NEAR) | (share > 1.0 - NEAR)).any(axis=1)
    sheet.solve(np.repeat(edge[:, None], 3, axis=1))
    data = np.load(REFERENCES / "pressure.npz")
    moved = data["x"] - np.column_stack([data["X"], np.zeros(len(data["X"]))])
    centre = sheet.displacement[nearest(sheet.nodes, 0.05, 0.05), 2]
    return Solved(sheet, centre / scene.FOLLOWER - 1.0, lambda p: quarter_field(data["X"], moved, p, (0.05, 0.05)))


def tension(points: int, nine: bool) -> Solved:
    """Scene `tension`: one load step, from a uniform stretch along the pull."""
    scene = load_scene("tension")
    side = scene.SIDE
    x, _ = square(points, side, nine)
    sheet = Membrane(rectangle(x, x, nine), gent(1e3, 200e3, 160.0), 1e-3, 2)
    along = sheet.nodes[:, 0] / side
    sheet.displacement[:, 0] = 0.1 * along
    grips = (along < NEAR) | (along > 1.0 - NEAR)
    sheet.solve(np.repeat(grips[:, None], 2, axis=1))
    data = np.load(REFERENCES / "tension.npz")
    moved = data["x"] - data["X"]

    def reference(places: Array) -> Array:
        offset = places - np.array([0.0, 0.05])
        field = interpolated(data["X"], moved, np.column_stack([offset[:, 0], np.abs(offset[:, 1])]))
        field[:, 1] *= np.where(offset[:, 1] < 0.0, -1.0, 1.0)
        return field

    contraction = sheet.displacement[nearest(sheet.nodes, 0.05, 0.0), 1]
    return Solved(sheet, contraction / scene.CONTRACTION - 1.0, reference)


def stretch(points: int, nine: bool) -> Solved:
    """Scene `stretch` with a hole, to twice its size: one load step, from a uniform stretch, edges on rollers."""
    scene = load_scene("stretch")
    half, cells = scene.HALF, max(2, (points - 1) // (4 if nine else 2))
    sheet = Membrane(around_hole(scene.RADIUS, half, cells, nine), neo_hookean(scene.MU), scene.THICKNESS, 2)
    sheet.displacement[:] = sheet.nodes
    edges = np.abs(sheet.nodes) > half * (1.0 - NEAR)
    sheet.solve(edges)
    forces, _ = sheet.assembled()
    force = forces[sheet.nodes[:, 0] > half * (1.0 - NEAR), 0].sum()
    known = known_hole("equibiaxial", 2.0)
    assert known is not None

    def reference(places: Array) -> Array:
        # Splines do not reach outside the nodes; the mesh is straight between the nodes of its hole.
        field = interpolated(*known, places)
        field[np.hypot(*places.T) < scene.RADIUS] = np.nan
        return field

    return Solved(sheet, force / scene.ELEMENTS["hole"]["equibiaxial"][2.0] - 1.0, reference)


SCENES: dict[str, Callable[[int, bool], Solved]] = {"pressure": pressure, "tension": tension, "stretch": stretch}
