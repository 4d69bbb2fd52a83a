"""Rupture criteria."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .checks import InputError, finite


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
