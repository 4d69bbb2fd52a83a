"""Undamaged family of a lattice, which many points have: its numbers are constants in kernels."""

from dataclasses import dataclass

# Above this number of members a family is large: sums are then carried from bond to bond.
LARGE = 16


@dataclass(frozen=True)
class Stencil:
    """Undamaged family of a lattice, in units of the horizon and of the area of an inner point.

    Attributes:
        steps: Lattice steps to each member.
        turns: 4 if a rotation by 90 degrees maps the family onto itself, 2 if only one by 180 degrees does.
        turned: Member onto which that rotation maps each member.
        bonds: X_ik of each member.
        moments: w_ik X_ik of each member.
        part: Members of one quarter or half; rotations give all others. Those of a large family are in the order of a
            path along which intersections differ little; the rotation of the first one follows the last one.
        inside: Whether each member (second index) belongs to the intersection of each bond of the part.
        inverse: K_ij^-1 (11, 12, 22) of each bond of the part.
        weights: W_ij of each bond of the part.
    """

    steps: tuple[tuple[int, int], ...]
    turns: int
    turned: tuple[int, ...]
    bonds: tuple[tuple[float, float], ...]
    moments: tuple[tuple[float, float], ...]
    part: tuple[int, ...]
    inside: tuple[tuple[bool, ...], ...]
    inverse: tuple[tuple[float, float, float], ...]
    weights: tuple[float, ...]
