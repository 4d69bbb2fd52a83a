"""Energy release rates of scenes `edge_notch`, `flaw_sensitivity` and `trousers`, by finite elements of four nodes.

With a displacement q of the material that moves the tip along x and is zero far from it, the energy changes by

    G = -integral of (W dq/dx - P_b . x_,x dq/dX_b),

the derivative of the energy by the length of the crack at fixed supports. Half of each sheet is modelled, what lies
above the line of the crack, or a quarter with one tip. On the line ahead of the tip y = 0; trousers are symmetric by
half a turn about x, so there z = 0 too. The energy of tension field theory has states without stiffness; a share of the
full energy makes up for it, which halves until G over it has a limit (Aitken).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt
from finite_elements import Membrane, TensionField, rectangle
from scipy.sparse import csc_matrix, identity
from scipy.sparse.linalg import splu

Array = npt.NDArray[np.float64]
MU = 1e3
# Scene edge_notch and scene trousers [m].
WIDTH, HEIGHT = 0.04, 0.06
LEG, LENGTH, CUT = 0.01, 0.06, 0.02
SHARES = (1.0, 0.1, 0.032, 0.016, 0.008, 0.004, 0.002, 0.001)
# Number of shares from which the limit is known.
ENOUGH = 5


def release_rate(membrane: Membrane, move: Array) -> float:
    """G of the whole sheet [J/m^2], twice that of its half; `move` is q at the nodes, (N,)."""
    material = membrane.material
    assert isinstance(material, TensionField)
    G, P, C, _ = membrane._stressed()
    slope = (membrane._operators[0] @ move).reshape(*membrane.weights.shape, 2)
    energy = material.energy(C[0] + C[1], C[0] * C[1] - C[2] ** 2)
    moved = energy * slope[..., 0] - np.einsum("eqc,eqbc,eqb->eq", G[..., 0, :], P, slope)
    return -2.0 * float((moved * membrane.weights).sum())


def notched(ratio: float, stretches: Sequence[float], cells: int = 10) -> list[tuple[float, float]]:
    """Factor k = G / (2 a W) of a notch of length a, with the full energy and in tension field theory.

    Args:
        ratio: Length of the notch over the width of the strip.
        stretches: Distance of the ends over that at rest, increasing.
        cells: Elements along the notch.
    """
    notch = ratio * WIDTH
    graded = np.linspace(0.0, 1.0, cells + 1) ** 2, np.linspace(0.0, 1.0, 2 * cells + 1) ** 2
    along = np.concatenate([notch - notch * graded[0][::-1], notch + (WIDTH - notch) * graded[1][1:]])
    sheet = Membrane(rectangle(along, 0.5 * HEIGHT * graded[1], nine=False), TensionField(MU, 1.0), 1.0, 2)
    x, y = sheet.nodes.T
    top = y > 0.5 * HEIGHT - 1e-9
    held = np.zeros((len(x), 2), bool)
    held[:, 1] = top | ((y < 1e-9) & (x > notch - 1e-9))
    held[np.hypot(x - 0.5 * WIDTH, y - 0.5 * HEIGHT).argmin(), 0] = True
    reach = 0.4 * min(notch, WIDTH - notch)
    move = np.clip(2.0 - np.maximum(abs(x - notch), y) / reach, 0.0, 1.0)
    found, before = [], 1.0
    taut = sheet.displacement
    for stretch in stretches:
        sheet.displacement, sheet.material = taut, TensionField(MU, 1.0)
        goal = np.zeros_like(taut)
        for part in np.linspace(before, stretch, 1 + int(np.ceil((stretch - before) / 0.1)))[1:]:
            goal[top, 1] = (part - 1.0) * 0.5 * HEIGHT
            sheet.solve(held, goal)
        taut, before = sheet.displacement, stretch
        scale = notch * MU * (stretch**2 + 2.0 / stretch - 3.0)
        values = []
        for share in SHARES:
            sheet.material = TensionField(MU, share)
            try:
                sheet.solve(held, goal)
            except ArithmeticError:
                # As slack as Newton's method bears; the limit does not hang on the last share.
                if len(values) < ENOUGH:
                    raise
                break
            values.append(release_rate(sheet, move) / scale)
        found.append((values[0], limit(values)))
    return found


def flawed(ratio: float, stretches: Sequence[float], cells: int = 10) -> list[float]:
    """Factors C = G / (2 pi a W) of a crack of 2 a in the middle of a square that is stretched alike along both sides.

    Nothing in it is compressed, so the tension field is that of the full energy.

    Args:
        ratio: Length of the crack over the side.
        stretches: Of the sides, increasing.
        cells: Elements along half the crack.
    """
    found = []
    for stretch, (quarter, move) in zip(stretches, stretched_squares(ratio, stretches, cells), strict=True):
        density = 0.5 * (2.0 * stretch**2 + stretch**-4.0 - 3.0)
        found.append(release_rate(quarter, move) / (2.0 * np.pi * ratio * density))
    return found


def stretched_squares(ratio: float, stretches: Sequence[float], cells: int) -> Iterator[tuple[Membrane, Array]]:
    """A quarter of that square at each stretch, half a side long, of mu 1 Pa; and q, the move of its tip."""
    graded = np.linspace(0.0, 1.0, cells + 1) ** 2, np.linspace(0.0, 1.0, 2 * cells + 1) ** 2
    along = np.concatenate([ratio - ratio * graded[0][::-1], ratio + (1.0 - ratio) * graded[1][1:]])
    quarter = Membrane(rectangle(along, graded[1], nine=False), TensionField(1.0, 1.0), 1.0, 2)
    x, y = quarter.nodes.T
    right, top = x > 1.0 - 1e-9, y > 1.0 - 1e-9
    held = np.column_stack([right | (x < 1e-9), top | ((y < 1e-9) & (x > ratio - 1e-9))])
    before, goal = 1.0, np.zeros_like(quarter.displacement)
    for stretch in stretches:
        for part in np.linspace(before, stretch, 1 + int(np.ceil((stretch - before) / 0.1)))[1:]:
            goal[right, 0] = goal[top, 1] = part - 1.0
            quarter.solve(held, goal)
        before = stretch
        yield quarter, np.clip(2.0 - np.maximum(abs(x - ratio), y) / (0.4 * min(ratio, 1.0 - ratio)), 0.0, 1.0)


def trousers(opening: float, cells: int = 8, share: float = 0.003) -> tuple[float, float]:
    """G of the trousers, and that by the formula of Rivlin and Thomas [J/m^2].

    Args:
        opening: How far the end of each leg is beyond its length without stress [m].
        cells: Elements across a leg.
        share: Fraction of the full energy.

    Raises:
        ArithmeticError: if the sheet finds no equilibrium.
    """
    x, y = np.linspace(0.0, LENGTH, round(LENGTH / LEG * cells) + 1), np.linspace(0.0, LEG, cells + 1)
    sheet = Membrane(rectangle(x, y, nine=False), TensionField(MU, share), 1.0, 3)
    x, y = sheet.nodes.T
    end, leg = x < 1e-9, x < CUT
    held = np.zeros((len(x), 3), bool)
    held[((y < 1e-9) & (x > CUT - 1e-9)) | (x > LENGTH - 1e-9), 1:] = True
    held[end] = True
    # Taut legs, folded by a right angle.
    sheet.displacement[leg, 0] = CUT - x[leg]
    sheet.displacement[leg, 2] = (CUT - x[leg]) * (1.0 + opening / CUT)
    settle(sheet, held)
    rate = release_rate(sheet, np.clip(2.0 - abs(x - CUT) / (0.4 * CUT), 0.0, 1.0))
    force = float(sheet.forces()[end, 2].sum())
    stretches = np.linspace(1.0, 3.0, 8000)
    stretch = float(np.interp(force, LEG * MU * (stretches - stretches**-2), stretches))
    return rate, 2.0 * stretch * force - LEG * MU * (stretch**2 + 2.0 / stretch - 3.0)


def settle(sheet: Membrane, held: Array, steps: int = 100, tolerance: float = 5e-3) -> None:
    """Newton's method with a diagonal that fades: what is slack has no stiffness in space.

    Raises:
        ArithmeticError: if forces do not fall to a fraction of the reactions.
    """
    free, size = np.flatnonzero(~held.ravel()), float(np.ptp(sheet.nodes, axis=0).max())
    for k in range(steps):
        forces, tangent = sheet.assembled()
        unbalanced = forces.ravel()[free]
        if np.linalg.norm(unbalanced) < tolerance * np.linalg.norm(forces):
            return
        shifted = tangent[free][:, free] + 0.3 * max(1.0, 1e3 * 0.5**k) * MU * 1e-3 * identity(len(free))
        factors = splu(csc_matrix(shifted), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        change = np.zeros(sheet.displacement.size)
        change[free] = factors.solve(-unbalanced)
        change *= min(1.0, 0.05 * size / np.abs(change).max())
        sheet.displacement = sheet.displacement + change.reshape(sheet.displacement.shape)
    raise ArithmeticError(f"no equilibrium after {steps} iterations")


def limit(values: Sequence[float]) -> float:
    """Limit of a series from its last three values, by Aitken; the last one where the differences do not shrink."""
    first, last = values[-2] - values[-3], values[-1] - values[-2]
    ratio = last / first if first else 1.0
    return values[-1] + last * ratio / (1.0 - ratio) if 0.0 < ratio < 0.95 else values[-1]
