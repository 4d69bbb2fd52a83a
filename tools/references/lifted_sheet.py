"""Scenes `pressure_dynamic` and `out_of_plane` (NN 6.1 and 6.2) by explicit finite elements of four nodes.

A sheet of 1 x 1 m without bending stiffness, neo-Hookean. Where such a sheet is compressed it wrinkles as finely as its
nodes allow; `relaxed` takes the energy of tension field theory instead, which has a limit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from finite_elements import Membrane, Motion, neo_hookean, rectangle

Array = npt.NDArray[np.float64]
MATERIAL = neo_hookean(1e3, 100e3)
MU, DENSITY, THICKNESS, SIDE = 1e3, 1000.0, 0.01, 1.0
PATCH = 0.04
# Step over the time that the fastest wave of an unstretched sheet, 2 sqrt(mu/rho), takes through an element.
STEP = 0.25


def sheet(cells: int, relaxed: bool = False, pressure: float = 0.0) -> Motion:
    """A sheet at rest with no node held.

    Args:
        cells: Elements along a side.
        relaxed: Whether compressed states carry no compression.
        pressure: That follows the surface [Pa].
    """
    x = np.linspace(0.0, SIDE, cells + 1)
    material = MATERIAL.relaxed if relaxed else MATERIAL
    membrane = Membrane(rectangle(x, x, nine=False), material, THICKNESS, 3, pressure)
    held = np.zeros(len(membrane.nodes), bool)
    step = STEP * SIDE / cells / (2.0 * np.sqrt(MU / DENSITY))
    return Motion(membrane, DENSITY, 0.0, held, lambda time: np.zeros((int(held.sum()), 3)), step)


def under_pressure(cells: int) -> Motion:
    """NN 6.1: all edges fixed, 20 Pa from the start."""
    motion = sheet(cells, pressure=20.0)
    motion.damping = 0.1
    motion.held[:] = ((motion.membrane.nodes == 0.0) | (motion.membrane.nodes == SIDE)).any(axis=1)
    return motion


def lifted(cells: int, relaxed: bool = False) -> Motion:
    """NN 6.2: the left edge fixed, the nodes near the middle of the right one moved until 2 s."""
    motion = sheet(cells, relaxed)
    motion.damping = 0.1
    x, y = motion.membrane.nodes.T
    patch = np.hypot(x - SIDE, y - 0.5 * SIDE) <= PATCH * (1.0 + 1e-9)
    motion.held[:] = patch | (x == 0.0)
    motion.path = lambda time: np.outer(patch[motion.held] & (time < 2.0), [0.025, 0.0, 0.05])
    return motion


def snapshots(motion: Motion, times: Sequence[float]) -> list[Array]:
    """Displacements at times [s], (3, along x, along y) [m]; 2 s, when the motion of the patch stops, ends a step."""
    nodes = motion.membrane.nodes.round(9)
    order = np.lexsort((nodes[:, 1], nodes[:, 0]))
    side = len(np.unique(nodes[:, 0]))
    found = {}
    for time in sorted({*times, 2.0 if max(times) > 2.0 else times[0]}):
        motion.run(time)
        found[time] = motion.membrane.displacement[order].T.reshape(3, side, side).copy()
    return [found[time] for time in times]
