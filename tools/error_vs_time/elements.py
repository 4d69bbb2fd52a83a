"""The static scenes with membrane finite elements, as one more law: what a user would take in place of this code."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from finite_elements import Membrane, gent, incompressible, rectangle
from skfem import Mesh, MeshQuad, MeshQuad2
from study import load_scene
from torn_elements import TornSheet

from warp_pd import NeoHookean

from .errors import NOTCHED_LOAD, Errors, Field, distance, hole_field, pressure_field, tension_field

Array = npt.NDArray[np.float64]
# Where the edges are, over the side.
NEAR = 1e-9
GENT = gent(1e3, 200e3, 160.0)
# Distance between the damage of a cut and its end, over the length of the field, as `TearingEnergy` has it.
RECESS = 0.25 * np.pi
# Of the torn strip, over Gc.
LOAD_STEP = 0.005


@dataclass(frozen=True)
class Solved:
    """A sheet in equilibrium.

    Attributes:
        membrane: Its elements.
        scalar: Relative error of what the scene measures.
        reference: The exact field.
    """

    membrane: Membrane
    scalar: float
    reference: Field

    def errors(self) -> Errors:
        """Of the scalar, and of the field at the points of integration."""
        m = self.membrane
        places = (m.shapes @ m.nodes[m.elements]).reshape(-1, 2)
        found = (m.shapes @ m.displacement[m.elements]).reshape(len(places), -1)
        return self.scalar, distance(found, self.reference(places), m.weights.ravel())


def square(points: int, side: float, nine: bool) -> Mesh:
    """A square with `points` nodes along a side, or one more: there is a node in the middle."""
    nodes = points | 1
    x = np.linspace(0.0, side, (nodes + 1) // 2 if nine else nodes)
    return rectangle(x, x, nine)


def nearest(nodes: Array, x: float, y: float) -> int:
    """The node at a place."""
    return int(np.hypot(nodes[:, 0] - x, nodes[:, 1] - y).argmin())


def pressure(points: int, nine: bool) -> Solved:
    """Scene `pressure`: one load step, from a dome of a fifth of the side: a flat membrane resists no pressure."""
    side, scene = 0.1, load_scene("pressure")
    sheet = Membrane(square(points, side, nine), GENT, 1e-3, 3, pressure=5.0)
    place = sheet.nodes / side
    sheet.displacement[:, 2] = 0.2 * side * (16.0 * np.prod(place * (1.0 - place), axis=1))
    edge = ((place < NEAR) | (place > 1.0 - NEAR)).any(axis=1)
    sheet.solve(np.repeat(edge[:, None], 3, axis=1))
    centre = sheet.displacement[nearest(sheet.nodes, 0.05, 0.05), 2]
    return Solved(sheet, centre / scene.FOLLOWER - 1.0, pressure_field)


def tension(points: int, nine: bool) -> Solved:
    """Scene `tension`: one load step, from a uniform stretch along the pull."""
    scene = load_scene("tension")
    sheet = Membrane(square(points, scene.SIDE, nine), GENT, 1e-3, 2)
    along = sheet.nodes[:, 0] / scene.SIDE
    sheet.displacement[:, 0] = 0.1 * along
    grips = (along < NEAR) | (along > 1.0 - NEAR)
    sheet.solve(np.repeat(grips[:, None], 2, axis=1))
    contraction = sheet.displacement[nearest(sheet.nodes, 0.05, 0.0), 1]
    return Solved(sheet, contraction / scene.CONTRACTION - 1.0, tension_field)


def stretch(points: int, nine: bool) -> Solved:
    """Scene `stretch` with a hole, to twice its size: one load step, from a uniform stretch, edges on rollers."""
    scene = load_scene("stretch")
    half, cells = scene.HALF, max(2, (points - 1) // (4 if nine else 2))
    mesh = around_hole(scene.RADIUS, half, cells, nine)
    sheet = Membrane(mesh, incompressible(scene.MU), scene.THICKNESS, 2)
    sheet.displacement[:] = sheet.nodes
    sheet.solve(np.abs(sheet.nodes) > half * (1.0 - NEAR))
    force = sheet.forces()[sheet.nodes[:, 0] > half * (1.0 - NEAR), 0].sum()
    return Solved(sheet, force / scene.ELEMENTS["hole"]["equibiaxial"][2.0] - 1.0, hole_field)


def around_hole(radius: float, half: float, cells: int, nine: bool) -> Mesh:
    """A square [-half, half]^2 with a round hole: `cells` elements across, eight times as many around."""
    count = 8 * cells
    angle = np.arange(count) * 2.0 * np.pi / count
    direction = np.stack([np.cos(angle), np.sin(angle)])
    # Vertices on each side are evenly spaced in the tangent of the angle, as corners must be among them.
    edge = half * direction / np.abs(direction).max(axis=0)
    outwards = np.linspace(0.0, 1.0, cells + 1)[:, None]
    points = (1.0 - outwards) * (radius * direction)[:, None] + outwards * edge[:, None]
    ring, row = np.arange(count), count * np.arange(cells)[:, None]
    corners = [row + ring, row + count + ring, row + count + (ring + 1) % count, row + (ring + 1) % count]
    mesh = MeshQuad(points.reshape(2, -1), np.stack([c.ravel() for c in corners]))
    if not nine:
        return mesh
    curved = MeshQuad2.from_mesh(mesh)
    nodes = curved.doflocs.copy()
    # Middles of edges on the hole lie inside it by the height of the arc.
    away = np.hypot(*nodes)
    inside = away < radius * (1.0 - 1e-12)
    nodes[:, inside] *= radius / away[inside]
    return MeshQuad2(nodes, curved.t)


@dataclass(frozen=True)
class Torn:
    """A torn sheet: its elements, and the error of the load."""

    membrane: Membrane
    scalar: float

    def errors(self) -> Errors:
        """Of the load."""
        return self.scalar, None


def pure_shear_tear(points: int, nine: bool) -> Torn:
    """Scene `pure_shear_tear`: the height is that of `points` smallest elements, the length of the field of four."""
    scene = load_scene("pure_shear_tear")
    size, energy = scene.HEIGHT / points, 2.0
    length = 4.0 * size
    enough = scene.CUT + 2.5 * length
    begin = scene.CUT - RECESS * length
    sheet = TornSheet(
        scene.LENGTH, scene.HEIGHT, begin, enough + 2.5 * length - begin, energy, length, size, scene.MU
    )  # fmt: skip
    for ratio in (0.2, 0.4, 0.6, 0.75, 0.85, *np.arange(0.9, 2.0, LOAD_STEP)):
        stretch = scene.stretch_at(NeoHookean(scene.MU, 1e6 * scene.MU), ratio * energy / scene.HEIGHT)
        sheet.pull((stretch - 1.0) * scene.HEIGHT, enough)
        if sheet.tip > enough:
            # It tears within the last step.
            return Torn(sheet.membrane, float(ratio) - 0.5 * LOAD_STEP - 1.0)
    raise ArithmeticError("does not tear at twice Gc")


def double_notch(points: int, nine: bool) -> Torn:
    """Scene `double_notch`, its left half, neo-Hookean: the width is that of `points` smallest elements."""
    half, notch, length = 10e-3, 2.5e-3, 7.5e-4
    sheet = TornSheet(half, half, notch - RECESS * length, half, 0.9, length, 2.0 * half / points, 1e3, mirrored=True)
    largest = 0.0
    for opening in (0.5e-3, 1e-3, 1.5e-3, 1.8e-3, *np.arange(2e-3, 4e-3, 2e-5)):
        # Two halves, 1 mm thick.
        force = 2e-3 * sheet.pull(opening, 0.99 * half)
        if force < 0.9 * largest:
            return Torn(sheet.membrane, largest / NOTCHED_LOAD - 1.0)
        largest = max(force, largest)
    raise ArithmeticError("does not tear")


SCENES: dict[str, Callable[[int, bool], Solved | Torn]] = {
    "pressure": pressure, "tension": tension, "stretch": stretch, "pure_shear_tear": pure_shear_tear,
    "double_notch": double_notch,
}  # fmt: skip
