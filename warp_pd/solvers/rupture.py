"""Rupture at rest: bonds break only once the sheet has come to rest, and then it looks for rest again."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..simulation import Built

# A sheet torn in two or gone slack carries nothing: its unbalanced force is measured by this share of what it carried.
LEAST_LOAD = 1e-3
# Rounds of rupture at one load step after which the tear counts as running through.
MOST_ROUNDS = 1000


class Rupture:
    """Breaks the over-stretched bonds of a sheet at rest; without a criterion there are none."""

    def __init__(self, built: Built) -> None:
        self.alive = built.force.alive
        self._launches = built.workspace.sequence("rupture")

    def breaks(self) -> bool:
        """Break what is over-stretched; whether anything was."""
        if self.alive is None:
            return False
        before = self.alive.numpy().copy()
        self._launches.run()
        return bool((self.alive.numpy() != before).any())
