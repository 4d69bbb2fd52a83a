"""Rupture criteria."""

from __future__ import annotations

from dataclasses import dataclass

from .checks import InputError, finite


@dataclass(frozen=True)
class CriticalStretch:
    """A bond breaks for good when its stretch |Y|/|X| passes a critical one. Source: BA and NN papers.

    Attributes:
        stretch: Critical stretch s_c, above 1.

    Raises:
        InputError: otherwise.
    """

    stretch: float

    def __post_init__(self) -> None:
        if finite("CriticalStretch.stretch", self.stretch) <= 1.0:
            raise InputError(f"CriticalStretch.stretch = {self.stretch!r}: allowed is a stretch above 1")
