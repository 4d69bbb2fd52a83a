"""Data of a lattice for the path of undamaged families (fast/force_paths.py)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..families import Families, unpack
from ..kernels.families import WORD
from ..kernels.fast.stencil import LARGE, Stencil

TOLERANCE = 1e-9


@dataclass(frozen=True)
class Rotation:
    """A rotation that may map a family onto itself.

    Attributes:
        turns: Number of such rotations in a full turn, 4 or 2.
    """

    turns: int

    def of(self, x: Any, y: Any) -> tuple[Any, Any]:
        """The rotated vector."""
        return (-y, x) if self.turns == 4 else (-x, -y)

    def turned(self, steps: list[tuple[int, int]]) -> list[int]:
        """Member to which each member is mapped, -1 if there is none."""
        return [steps.index(step) if (step := self.of(x, y)) in steps else -1 for x, y in steps]

    def part(self, steps: list[tuple[int, int]]) -> list[int]:
        """A subset of members whose rotations give all members."""
        return [k for k, (x, y) in enumerate(steps) if (x > 0 and y >= 0) or (self.turns == 2 and x <= 0 < y)]

    def keeps(self, steps: list[tuple[int, int]], bonds: np.ndarray, weight: np.ndarray) -> bool:
        """Whether it maps bonds and weights onto themselves."""
        turned = self.turned(steps)
        if min(turned) < 0:
            return False
        apart = np.abs(bonds[turned] - np.column_stack(self.of(*bonds.T))).max()
        return bool(max(apart, np.abs(weight[turned] / weight - 1.0).max()) <= TOLERANCE)


ROTATIONS = (Rotation(4), Rotation(2))


def undamaged_stencil(families: Families, inverse: np.ndarray, weights: np.ndarray) -> tuple[Stencil, int] | None:
    """Stencil of the undamaged inner families of a lattice or grid, and their table row; None if there are none.

    The result is None on clouds, for more than 32 members, and on sheets so small that no family is complete and has
    symmetric weights. Tables are those of `Reference.of`.
    """
    if families.family_class is None or families.steps is None or len(families.steps) > WORD:
        return None
    n, gridded = len(families.steps), families.layout == "grid"
    row = families.commonest_row
    area, weight = families.areas[row], weights[row, :n] / families.areas[row]
    bonds, influence, common = (
        table[row, :n] if gridded else table for table in (families.bonds, families.influence, families.common)
    )
    if not families.exists[row, :n].all() or not families.has_common:
        return None
    if np.ptp(families.member_areas[row, :n]) > TOLERANCE * area:
        return None
    steps = [(int(x), int(y)) for x, y in families.steps]
    found = [rotation for rotation in ROTATIONS if rotation.keeps(steps, bonds, weight)]
    if not found:
        return None
    rotation = found[0]
    inside, turned = unpack(common, n), rotation.turned(steps)
    part = rotation.part(steps)
    if n > LARGE:
        part = short_path(part, inside, turned)
    stencil = Stencil(
        steps=tuple(steps),
        turns=rotation.turns,
        turned=tuple(turned),
        bonds=tuple((_even(x), _even(y)) for x, y in bonds),
        moments=tuple((_even(x), _even(y)) for x, y in influence[:, None] * bonds),
        part=tuple(part),
        inside=tuple(tuple(bool(b) for b in inside[j]) for j in part),
        inverse=tuple((_even(a), _even(b), _even(c)) for a, b, c in inverse[row, part] * area),
        weights=tuple(_even(w) for w in weight[part]),
    )
    return stencil, row


def short_path(part: list[int], inside: np.ndarray, turned: list[int]) -> list[int]:
    """Order the bonds of a part so that consecutive intersections differ little.

    The rotated first bond follows the last one. Starting from every bond, sections of the path are reversed as long as
    it gets shorter (2-opt).

    Args:
        part: The bonds.
        inside: Whether each member (second index) belongs to the intersection of each bond.
        turned: Member to which the rotation maps each member.
    """

    def length(path: list[int]) -> int:
        return int((inside[path] != inside[[*path[1:], turned[path[0]]]]).sum())

    def shortened(path: list[int]) -> list[int]:
        count = len(path)
        sections = [(a, b) for a in range(1, count) for b in range(a + 2, count + 1)]
        while True:
            best = min([path, *([*path[:a], *path[a:b][::-1], *path[b:]] for a, b in sections)], key=length)
            if length(best) == length(path):
                return path
            path = best

    paths = [shortened([first, *(j for j in part if j != first)]) for first in part]
    return min(paths, key=lambda path: (length(path), int(inside[path[0]].sum())))


def _even(value: float) -> float:
    """Round off the last digits, which depend on the size of the sheet, so that sheets share kernels."""
    return float(f"{value:.14g}")
