"""Pairwise materials, for bond-based laws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..device.checks import not_negative, positive

if TYPE_CHECKING:
    from ..kernels.factories import PairwiseFactory


@dataclass(frozen=True)
class Bimodular:
    """Pairwise material with different moduli for stretched and compressed bonds. Source: IM, section 4.

    A compressive modulus of zero models a wrinkling membrane.

    Attributes:
        tension: Young's modulus E+ of stretched bonds [Pa].
        compression: Young's modulus E- of compressed bonds [Pa], at least 0; by default E+.

    Raises:
        InputError: if E+ is not positive, or E- is negative.
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
        """Whether compressed bonds carry no force."""
        return self.compression == 0.0

    @property
    def one_modulus(self) -> bool:
        """Whether compressed bonds are as stiff as stretched ones."""
        return self.compression is None or self.compression == self.tension

    @property
    def pairwise(self) -> PairwiseFactory:
        """See `kernels.pairwise.bimodular`."""
        from ..kernels.papers.pairwise import bimodular

        return bimodular
