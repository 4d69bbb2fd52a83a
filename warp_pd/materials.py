"""Materials: constants, and the device functions that they belong to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from .checks import InputError, finite, positive


class Material(Protocol):
    """What a force law asks of a material; any object with these two is one.

    Newton's method asks for a third, `response`: a cached factory, precision in bits -> Warp function, see
    kernels/materials.py. The neural law asks for `membrane`, a factory of two functions, see there, for `mu`, the
    unit of its stress, and for `ratios`, which decide the stress over mu.
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
    def membrane(self) -> Callable[[int], tuple[Any, Any]]:
        """See `kernels.materials.gent_membrane`."""
        from .kernels.materials import gent_membrane

        return gent_membrane

    @property
    def ratios(self) -> dict[str, float]:
        """What, besides the stretches, decides the stress over mu."""
        return {"bulk/mu": self.bulk / self.mu, "lock": self.lock}


def padded_constants(material: Material) -> tuple[float, float, float, float]:
    """The constants of `material`, filled with zeros up to four.

    Raises:
        InputError: for more than four, or one that is not finite.
    """
    constants = tuple(finite(f"{type(material).__name__}.constants[{k}]", c) for k, c in enumerate(material.constants))
    if len(constants) > 4:
        raise InputError(f"{type(material).__name__}.constants has {len(constants)} numbers: allowed are four at most")
    return (*constants, *([0.0] * (4 - len(constants))))  # type: ignore[return-value]
