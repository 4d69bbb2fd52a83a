"""Materials: constants, and the device functions that they belong to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from .checks import InputError, finite, not_negative, positive


class Material(Protocol):
    """What a force law asks of a material; any object with these two is one.

    Newton's method asks for a third, `response`, the fast paths of the bond-associated law for `near`: cached
    factories, precision in bits -> Warp function, see kernels/materials.py. Fastest is a material that also says
    `isotropic = True`. The neural law asks for `membrane`, a factory of two functions, see there, for `mu`, the unit
    of its stress, and for `ratios`, which decide the stress over mu.
    """

    @property
    def constants(self) -> tuple[float, ...]:
        """At most four numbers, passed to the device functions."""
        ...

    @property
    def functions(self) -> Callable[[int], tuple[Any, Any]]:
        """Cached factory: precision in bits -> Warp functions (stress, energy), see kernels/materials.py."""
        ...


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
    def functions(self) -> Callable[[int], tuple[Any, Any]]:
        """See `kernels.materials.neo_hookean`."""
        from .kernels.materials import neo_hookean

        return neo_hookean

    @property
    def response(self) -> Callable[[int], Any]:
        """See `kernels.materials.neo_hookean_response`."""
        from .kernels.materials import neo_hookean_response

        return neo_hookean_response

    @property
    def near(self) -> Callable[[int], Any]:
        """See `kernels.materials.neo_hookean_near`."""
        from .kernels.materials import neo_hookean_near

        return neo_hookean_near

    @property
    def membrane(self) -> Callable[[int], tuple[Any, Any]]:
        """See `kernels.materials.neo_hookean_membrane`."""
        from .kernels.materials import neo_hookean_membrane

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
    def functions(self) -> Callable[[int], tuple[Any, Any]]:
        """See `kernels.materials.gent`."""
        from .kernels.materials import gent

        return gent

    @property
    def response(self) -> Callable[[int], Any]:
        """See `kernels.materials.gent_response`."""
        from .kernels.materials import gent_response

        return gent_response

    @property
    def near(self) -> Callable[[int], Any]:
        """See `kernels.materials.gent_near`."""
        from .kernels.materials import gent_near

        return gent_near

    @property
    def membrane(self) -> Callable[[int], tuple[Any, Any]]:
        """See `kernels.materials.gent_membrane`."""
        from .kernels.materials import gent_membrane

        return gent_membrane

    @property
    def ratios(self) -> dict[str, float]:
        """What, besides the stretches, decides the stress over mu."""
        return {"bulk/mu": self.bulk / self.mu, "lock": self.lock}


class PairwiseMaterial(Protocol):
    """What the bond-based law asks of a material; any object with these two is one."""

    @property
    def constants(self) -> tuple[float, ...]:
        """At most four numbers, passed to the device function; the first is a modulus."""
        ...

    @property
    def pairwise(self) -> Callable[[int], Any]:
        """Cached factory: precision in bits -> Warp functions (force, slope, energy), see kernels/pairwise.py."""
        ...


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
    def pairwise(self) -> Callable[[int], Any]:
        """See `kernels.pairwise.bimodular`."""
        from .kernels.pairwise import bimodular

        return bimodular


def padded_constants(material: Material | PairwiseMaterial) -> tuple[float, float, float, float]:
    """The constants of `material`, filled with zeros up to four.

    Raises:
        InputError: for more than four, or one that is not finite.
    """
    constants = tuple(finite(f"{type(material).__name__}.constants[{k}]", c) for k, c in enumerate(material.constants))
    if len(constants) > 4:
        raise InputError(f"{type(material).__name__}.constants has {len(constants)} numbers: allowed are four at most")
    return (*constants, *([0.0] * (4 - len(constants))))  # type: ignore[return-value]
