"""Undamaged family of a lattice, shared by many points; kernels compile its values in as constants."""

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
        part: Members of one quarter or half of the family; rotations give all others. In a large family they are
            ordered along a path on which consecutive intersections differ little; the rotated first member follows the
            last one.
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
