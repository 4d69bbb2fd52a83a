"""Rupture criteria."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .checks import InputError, finite, positive


@dataclass(frozen=True, eq=False)
class CriticalStretch:
    """A bond breaks for good when its stretch |Y|/|X| passes a critical one. Source: BA and NN papers.

    The energy that breaking releases is the drop of the strain energy at the moment of breaking. It is mostly
    positive; where a torn family is left with its most strained intersections it can be slightly negative.

    Attributes:
        stretch: Critical stretch s_c, above 1.
        spared: Points whose bonds never break, such as those in a clamp; None spares none.

    Raises:
        InputError: otherwise.
    """

    stretch: float
    spared: Any = None

    def __post_init__(self) -> None:
        if finite("CriticalStretch.stretch", self.stretch) <= 1.0:
            raise InputError(f"CriticalStretch.stretch = {self.stretch!r}: allowed is a stretch above 1")


@dataclass(frozen=True, eq=False)
class CriticalEnergy:
    """A bond breaks for good when the energy release rate of its interaction passes Gc / Nc. Source: VE, section 4.3.

    The work of the bond's force, shared by its two ends, over the crack surface h dx that it stands for is its energy
    release rate; Nc is the number of interactions across such a surface, 36 at a horizon of 3.015 spacings. The work
    counts from the start: a law that is under tension at rest counts that tension too. Explicit dynamics alone.

    Attributes:
        energy: Critical energy release rate Gc [N/m].
        spared: Points whose bonds never break, such as those in a clamp; None spares none.

    Raises:
        InputError: for an energy that is not above zero.
    """

    energy: float
    spared: Any = None

    def __post_init__(self) -> None:
        positive("CriticalEnergy.energy", self.energy)


Rupture = CriticalStretch | CriticalEnergy


def crossing_bonds(horizon: float) -> int:
    """Nc: bonds of a square lattice that cross a line, on average a spacing of it, each counted from both ends.

    Args:
        horizon: Over the spacing [-].
    """
    reach = int(horizon)
    return sum(
        abs(across)
        for across in range(-reach, reach + 1)
        for along in range(-reach, reach + 1)
        if across**2 + along**2 <= horizon**2
    )
