"""Materials of bonds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..device.checks import not_negative, positive

if TYPE_CHECKING:
    from ..kernels.factories import PairwiseFactory


@dataclass(frozen=True)
class Bimodular:
    """Pairwise material with a modulus for stretched bonds and one for compressed ones. Source: IM, section 4.

    A wrinkling membrane has no compressive modulus.

    Attributes:
        tension: Young's modulus E+ of stretched bonds [Pa].
        compression: Young's modulus E- of compressed bonds [Pa], 0 or more; by default E+.

    Raises:
        InputError: for a modulus E+ that is not above zero, or E- below zero.
    """

    tension: float
    compression: float | None = None

    def __post_init__(self) -> None:
        positive("tension", self.tension)
        if self.compression is not None:
            not_negative("compression", self.compression)

    @property
    def constants(self) -> tuple[float, ...]:
        """(E+, E-)."""
        return (self.tension, self.tension if self.compression is None else self.compression)

    @property
    def goes_slack(self) -> bool:
        """Whether compressed bonds carry nothing."""
        return self.compression == 0.0

    @property
    def one_modulus(self) -> bool:
        """Whether compressed bonds are as stiff as stretched ones."""
        return self.compression is None or self.compression == self.tension

    @property
    def pairwise(self) -> PairwiseFactory:
        """See `kernels.pairwise.bimodular`."""
        from ..kernels.pairwise import bimodular

        return bimodular
