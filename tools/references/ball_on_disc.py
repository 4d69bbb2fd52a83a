"""Ball pressed into a circular membrane that is clamped at its rim: exact but for an integration.

A disc of radius R and thickness h, incompressible, stretched in its plane and clamped; a rigid ball of radius a without
friction is pressed into its centre. A point at the radius r moves to the radius rho and the depth z below the rim's
plane. With the stretches l1 = |d(rho, z)/dr| and l2 = rho/r, the nominal tensions N1 = h dW/dl1 and N2 = h dW/dl2, and
the angle b of the meridian above the plane, equilibrium along the meridian is everywhere

    d(r N1)/dr = N2 cos b,    d rho/dr = l1 cos b,  dz/dr = l1 sin b.

Where the disc lies on the ball, b is the angle on it, db/dr = l1/a; elsewhere N1 db/dr = -N2 sin b / r, so that the
vertical pull 2 pi r N1 sin b is the same at every radius: the force on the ball. No line load acts at the edge of
contact, so that b and l1 go through it without a jump. The angle of that edge is given, and the stretch of the centre
is found such that the rim is where it is held.

Lengths are in units of R, forces in mu h R, energies in mu h R^2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from .shooting import NEO_HOOKEAN, START, Material

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Indented:
    """A disc with a ball pressed into it.

    Attributes:
        depth: Of the lowest point below the plane of the rim.
        force: On the ball.
        stretch: Of the centre.
        edge: Angle of the edge of contact on the ball [rad].
        contact: Radius at rest of the edge of contact.
        energy: Stored.
        least_tension: Smallest nominal tension around the axis: below 0 a real sheet wrinkles.
    """

    depth: float
    force: float
    stretch: float
    edge: float
    contact: float
    energy: float
    least_tension: float


def at_edge(
    edge: float, ball: float, prestretch: float = 1.0, material: Material = NEO_HOOKEAN, tolerance: float = 1e-10
) -> Indented:
    """The disc that touches the ball up to an angle.

    Args:
        edge: Angle between the axis and the edge of contact [rad].
        ball: Radius of the ball.
        prestretch: Radius at which the rim is held.
        material: Its material.
        tolerance: Relative tolerance of the integration.
    """

    def change(touching: bool, r: float, state: Array) -> list[float]:
        l1, rho, angle = state[:3]
        l2 = rho / r
        n1, n2, n11, n12 = material.tensions(l1, l2)
        cos, sin = np.cos(angle), np.sin(angle)
        steeper = ((n2 * cos - n1) - n12 * (l1 * cos - l2)) / (r * n11)
        bend = l1 / ball if touching else -n2 * sin / (r * n1)
        return [steeper, l1 * cos, bend, l1 * sin, 2.0 * np.pi * r * float(material.energy(l1, l2))]

    def leaves(r: float, state: Array) -> float:
        return float(state[2] - edge)

    leaves.terminal = True  # type: ignore[attr-defined]

    def shoot(stretch: float) -> tuple[float, Array, Array]:
        """Radius at rest of the edge of contact, and the states after it, (5, n), with their radii."""
        first = [stretch, stretch * START, stretch * START / ball, 0.0, 0.0]
        settings = {"rtol": tolerance, "atol": 1e-3 * tolerance, "method": "DOP853"}
        on = solve_ivp(lambda r, s: change(True, r, s), (START, 1.0), first, events=leaves, **settings)
        if on.status != 1:
            raise ValueError(f"edge = {edge!r}, ball = {ball!r}: expected an edge of contact inside the disc")
        begin = float(on.t[-1])
        off = solve_ivp(lambda r, s: change(False, r, s), (begin, 1.0), on.y[:, -1], **settings)
        if off.status != 0:
            raise ValueError(f"edge = {edge!r}, ball = {ball!r}: {off.message}")
        return begin, np.concatenate([on.t, off.t]), np.concatenate([on.y, off.y], axis=1)

    def excess(stretch: float) -> float:
        """Of the radius of the rim; a disc stretched too little to lie on the ball up to the edge is too small."""
        try:
            return float(shoot(stretch)[2][1, -1]) - prestretch
        except ValueError:
            return -1.0

    low = high = 1.0 + 1e-6
    while excess(high) < 0.0:
        low, high = high, 1.02 * high
        if high > 50.0:
            raise ValueError(f"edge = {edge!r}, ball = {ball!r}: expected a disc that reaches its rim")
    stretch = float(brentq(excess, low, high, xtol=1e-14, rtol=1e-14))
    contact, radii, states = shoot(stretch)
    l1, rho, angle, z, energy = states
    around = [material.tensions(a, b)[1] for a, b in zip(l1, rho / radii, strict=True)]
    pull = 2.0 * np.pi * material.tensions(float(l1[-1]), prestretch)[0] * float(np.sin(angle[-1]))
    return Indented(float(z[-1]), pull, stretch, edge, contact, float(energy[-1]), float(min(around)))


def at_depth(
    depth: float, ball: float, prestretch: float = 1.0, material: Material = NEO_HOOKEAN, tolerance: float = 1e-8
) -> Indented:
    """The disc whose lowest point has a depth, which an edge of contact between 0.05 and 1.3 rad gives it."""
    edge = float(
        brentq(lambda e: at_edge(e, ball, prestretch, material, tolerance).depth - depth, 0.05, 1.3, xtol=1e-9)
    )
    return at_edge(edge, ball, prestretch, material, tolerance)
