"""Slightly compressible materials in plane stress: neo-Hookean and Gent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from ..device.checks import positive
from .plane_stress import PlaneStress
from .protocols import out_of_order

if TYPE_CHECKING:
    from ..kernels.materials import MaterialFunctions

# Lock [-] that no chain reaches: at a stretch of 100.
MOST_LOCK = 1e4


@dataclass(frozen=True)
class NeoHookean(PlaneStress):
    """Slightly compressible neo-Hookean sheet in plane stress.

    Psi = mu/2 (I1b - 3) + K/8 (J^2 + J^-2 - 2). Source: NN paper.

    Attributes:
        mu: Shear modulus [Pa].
        bulk: Bulk modulus K [Pa].

    Raises:
        InputError: if a modulus is not positive.
    """

    mu: float
    bulk: float

    stable: ClassVar[bool] = True

    def __post_init__(self) -> None:
        positive("mu", self.mu)
        positive("bulk", self.bulk)

    @property
    def shear_modulus(self) -> float:
        """Mu [Pa]."""
        return self.mu

    @property
    def doubts(self) -> list[str]:
        """Whether its constants may be in another order."""
        return out_of_order("mu, bulk", NeoHookean__mu=(self.mu, self.bulk, "bulk"))

    @property
    def constants(self) -> tuple[float, ...]:
        """(mu, K)."""
        return (self.mu, self.bulk)

    @property
    def on_device(self) -> MaterialFunctions:
        """See `kernels.compressible`."""
        from ..kernels.compressible import neo_hookean

        return neo_hookean

    @property
    def ratios(self) -> dict[str, float]:
        """Ratios of constants that, with the stretches, determine the stress divided by mu."""
        return {"bulk/mu": self.bulk / self.mu}


@dataclass(frozen=True)
class Gent(PlaneStress):
    """Slightly compressible Gent sheet in plane stress, which stiffens without bound as I1b - 3 approaches Jm.

    Psi = -(mu Jm/2) ln(1 - (I1b - 3)/Jm) + (1/D) ((J^2 - 1)/2 - ln J), with K = 2/D. Source: BA paper.

    Attributes:
        mu: Shear modulus [Pa].
        bulk: Small-strain bulk modulus K = 2/D [Pa].
        lock: Jm [-].

    Raises:
        InputError: if a constant is not positive.
    """

    mu: float
    bulk: float
    lock: float

    stable: ClassVar[bool] = True

    def __post_init__(self) -> None:
        positive("mu", self.mu)
        positive("bulk", self.bulk)
        positive("lock", self.lock)

    @property
    def shear_modulus(self) -> float:
        """Mu [Pa]."""
        return self.mu

    @property
    def doubts(self) -> list[str]:
        """Whether its constants may be in another order."""
        lock = (self.lock, MOST_LOCK, f"{MOST_LOCK:g}")
        return out_of_order("mu, bulk, lock", Gent__mu=(self.mu, self.bulk, "bulk"), Gent__lock=lock)

    @property
    def constants(self) -> tuple[float, ...]:
        """(mu, K, Jm)."""
        return (self.mu, self.bulk, self.lock)

    @property
    def on_device(self) -> MaterialFunctions:
        """See `kernels.compressible`."""
        from ..kernels.compressible import gent

        return gent

    @property
    def ratios(self) -> dict[str, float]:
        """Ratios of constants that, with the stretches, determine the stress divided by mu."""
        return {"bulk/mu": self.bulk / self.mu, "lock": self.lock}
