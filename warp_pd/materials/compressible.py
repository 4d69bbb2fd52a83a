"""Slightly compressible materials in plane stress: neo-Hookean and Gent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from ..device.checks import positive

if TYPE_CHECKING:
    from ..kernels.factories import FunctionFactory, PairFactory


@dataclass(frozen=True)
class NeoHookean:
    """Slightly compressible neo-Hookean sheet in plane stress.

    Psi = mu/2 (I1b - 3) + K/8 (J^2 + J^-2 - 2). Source: NN paper.

    Attributes:
        mu: Shear modulus [Pa].
        bulk: Bulk modulus K [Pa].

    Raises:
        InputError: for a modulus that is not above zero.
    """

    mu: float
    bulk: float

    isotropic: ClassVar[bool] = True

    def __post_init__(self) -> None:
        positive("mu", self.mu)
        positive("bulk", self.bulk)

    @property
    def constants(self) -> tuple[float, ...]:
        """(mu, K)."""
        return (self.mu, self.bulk)

    @property
    def functions(self) -> PairFactory:
        """See `kernels.neo_hookean.neo_hookean`."""
        from ..kernels.neo_hookean import neo_hookean

        return neo_hookean

    @property
    def response(self) -> FunctionFactory:
        """See `kernels.neo_hookean.neo_hookean_response`."""
        from ..kernels.neo_hookean import neo_hookean_response

        return neo_hookean_response

    @property
    def near(self) -> FunctionFactory:
        """See `kernels.neo_hookean.neo_hookean_near`."""
        from ..kernels.neo_hookean import neo_hookean_near

        return neo_hookean_near

    @property
    def width(self) -> FunctionFactory:
        """See `kernels.neo_hookean.neo_hookean_width`."""
        from ..kernels.neo_hookean import neo_hookean_width

        return neo_hookean_width

    @property
    def volume(self) -> FunctionFactory:
        """See `kernels.neo_hookean.neo_hookean_volume`."""
        from ..kernels.neo_hookean import neo_hookean_volume

        return neo_hookean_volume

    @property
    def membrane(self) -> PairFactory:
        """See `kernels.neo_hookean.neo_hookean_membrane`."""
        from ..kernels.neo_hookean import neo_hookean_membrane

        return neo_hookean_membrane

    @property
    def ratios(self) -> dict[str, float]:
        """What, besides the stretches, decides the stress over mu."""
        return {"bulk/mu": self.bulk / self.mu}


@dataclass(frozen=True)
class Gent:
    """Slightly compressible Gent sheet in plane stress: stiffens without bound as I1b - 3 nears Jm.

    Psi = -(mu Jm/2) ln(1 - (I1b - 3)/Jm) + (1/D) ((J^2 - 1)/2 - ln J), with K = 2/D. Source: BA paper.

    Attributes:
        mu: Shear modulus [Pa].
        bulk: Small-strain bulk modulus K = 2/D [Pa].
        lock: Jm [-].

    Raises:
        InputError: for a constant that is not above zero.
    """

    mu: float
    bulk: float
    lock: float

    isotropic: ClassVar[bool] = True

    def __post_init__(self) -> None:
        positive("mu", self.mu)
        positive("bulk", self.bulk)
        positive("lock", self.lock)

    @property
    def constants(self) -> tuple[float, ...]:
        """(mu, K, Jm)."""
        return (self.mu, self.bulk, self.lock)

    @property
    def functions(self) -> PairFactory:
        """See `kernels.gent.gent`."""
        from ..kernels.gent import gent

        return gent

    @property
    def response(self) -> FunctionFactory:
        """See `kernels.gent.gent_response`."""
        from ..kernels.gent import gent_response

        return gent_response

    @property
    def near(self) -> FunctionFactory:
        """See `kernels.gent.gent_near`."""
        from ..kernels.gent import gent_near

        return gent_near

    @property
    def width(self) -> FunctionFactory:
        """See `kernels.gent.gent_width`."""
        from ..kernels.gent import gent_width

        return gent_width

    @property
    def volume(self) -> FunctionFactory:
        """See `kernels.gent.gent_volume`."""
        from ..kernels.gent import gent_volume

        return gent_volume

    @property
    def membrane(self) -> PairFactory:
        """See `kernels.gent.gent_membrane`."""
        from ..kernels.gent import gent_membrane

        return gent_membrane

    @property
    def ratios(self) -> dict[str, float]:
        """What, besides the stretches, decides the stress over mu."""
        return {"bulk/mu": self.bulk / self.mu, "lock": self.lock}
