"""Slightly compressible materials in plane stress: neo-Hookean and Gent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from ..device.checks import positive

if TYPE_CHECKING:
    from ..kernels import compressible as kernels
    from ..kernels.factories import FunctionFactory, PairFactory


class Compressible:
    """Slightly compressible sheet in plane stress; its functions follow from its equations, kernels/compressible.py."""

    isotropic: ClassVar[bool] = True

    @property
    def functions(self) -> PairFactory:
        """See `kernels.compressible.Compressible`."""
        return self._made.functions

    @property
    def near(self) -> FunctionFactory:
        """See `kernels.compressible.Compressible`."""
        return self._made.near

    @property
    def width(self) -> FunctionFactory:
        """See `kernels.compressible.Compressible`."""
        return self._made.width

    @property
    def volume(self) -> FunctionFactory:
        """See `kernels.compressible.Compressible`."""
        return self._made.volume

    @property
    def membrane(self) -> PairFactory:
        """See `kernels.compressible.Compressible`."""
        return self._made.membrane

    @property
    def _made(self) -> kernels.Compressible:
        raise NotImplementedError(f"{type(self).__name__}._made: the functions of its kernels are needed")


@dataclass(frozen=True)
class NeoHookean(Compressible):
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

    def __post_init__(self) -> None:
        positive("mu", self.mu)
        positive("bulk", self.bulk)

    @property
    def constants(self) -> tuple[float, ...]:
        """(mu, K)."""
        return (self.mu, self.bulk)

    @property
    def response(self) -> FunctionFactory:
        """See `kernels.neo_hookean.neo_hookean_response`."""
        from ..kernels.neo_hookean import neo_hookean_response

        return neo_hookean_response

    @property
    def _made(self) -> kernels.Compressible:
        from ..kernels.neo_hookean import neo_hookean

        return neo_hookean

    @property
    def ratios(self) -> dict[str, float]:
        """What, besides the stretches, decides the stress over mu."""
        return {"bulk/mu": self.bulk / self.mu}


@dataclass(frozen=True)
class Gent(Compressible):
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

    def __post_init__(self) -> None:
        positive("mu", self.mu)
        positive("bulk", self.bulk)
        positive("lock", self.lock)

    @property
    def constants(self) -> tuple[float, ...]:
        """(mu, K, Jm)."""
        return (self.mu, self.bulk, self.lock)

    @property
    def response(self) -> FunctionFactory:
        """See `kernels.gent.gent_response`."""
        from ..kernels.gent import gent_response

        return gent_response

    @property
    def _made(self) -> kernels.Compressible:
        from ..kernels.gent import gent

        return gent

    @property
    def ratios(self) -> dict[str, float]:
        """What, besides the stretches, decides the stress over mu."""
        return {"bulk/mu": self.bulk / self.mu, "lock": self.lock}
