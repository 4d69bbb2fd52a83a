"""Exactly incompressible materials in plane stress: Mooney-Rivlin, Yeoh, Arruda-Boyce, Ogden, and your own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..device.checks import InputError, finite, not_negative, positive
from .plane_stress import PlaneStress

if TYPE_CHECKING:
    from ..kernels.factories import FunctionFactory
    from ..kernels.materials import MaterialFunctions


class Incompressible(PlaneStress):
    """Exactly incompressible sheet in plane stress: what a material needs is its energy, one Warp function.

    A subclass is a frozen dataclass with `constants`, at most four numbers, and `energy`, a cached factory, precision
    in bits -> Warp function (I1 - 3, I2 - 3, constants) -> vec6 of Psi, Psi_1, Psi_2, Psi_11, Psi_12, Psi_22 [Pa].
    The rest follows from it: stress, fast paths, the tangent of Newton's method. See kernels/incompressible.py, and
    docs/materials.md for your own material.
    """

    @property
    def energy(self) -> FunctionFactory:
        """Factory of the energy."""
        raise NotImplementedError(f"{type(self).__name__}.energy: a factory of a Warp function is needed")

    @property
    def on_device(self) -> MaterialFunctions:
        """See `kernels.incompressible.incompressible`."""
        from ..kernels.incompressible import incompressible

        return incompressible(self.energy)


@dataclass(frozen=True)
class MooneyRivlin(Incompressible):
    """Incompressible Mooney-Rivlin sheet: Psi = c10 (I1 - 3) + c01 (I2 - 3).

    With c01 = 0 it is the exactly incompressible neo-Hookean sheet of shear modulus 2 c10.

    Attributes:
        c10: [Pa].
        c01: [Pa].

    Raises:
        InputError: for c10 that is not above zero, or c01 below zero.
    """

    c10: float
    c01: float = 0.0

    def __post_init__(self) -> None:
        positive("c10", self.c10)
        not_negative("c01", self.c01)

    @property
    def constants(self) -> tuple[float, ...]:
        """(c10, c01)."""
        return (self.c10, self.c01)

    @property
    def energy(self) -> FunctionFactory:
        """See `kernels.incompressible.mooney_rivlin`."""
        from ..kernels.incompressible import mooney_rivlin

        return mooney_rivlin


@dataclass(frozen=True)
class Yeoh(Incompressible):
    """Incompressible Yeoh sheet: Psi = c10 (I1 - 3) + c20 (I1 - 3)^2 + c30 (I1 - 3)^3. Source: VE eq. 11b.

    Attributes:
        c10: [Pa]; the shear modulus is 2 c10.
        c20: [Pa], any sign.
        c30: [Pa], any sign.

    Raises:
        InputError: for c10 that is not above zero.
    """

    c10: float
    c20: float = 0.0
    c30: float = 0.0

    def __post_init__(self) -> None:
        positive("c10", self.c10)

    @property
    def constants(self) -> tuple[float, ...]:
        """(c10, c20, c30)."""
        return (self.c10, self.c20, self.c30)

    @property
    def energy(self) -> FunctionFactory:
        """See `kernels.incompressible.yeoh`."""
        from ..kernels.incompressible import yeoh

        return yeoh


@dataclass(frozen=True)
class ArrudaBoyce(Incompressible):
    """Incompressible Arruda-Boyce sheet, five terms of the eight-chain model.

    The shear modulus at rest is mu (1 + 3/(5 lm^2) + 99/(175 lm^4) + 513/(875 lm^6) + 42039/(67375 lm^8)).

    Attributes:
        mu: [Pa].
        lock: Locking stretch lm of a chain, above 1; five terms stiffen towards it but do not end there.

    Raises:
        InputError: for mu that is not above zero, or lock of 1 or less.
    """

    mu: float
    lock: float

    def __post_init__(self) -> None:
        positive("mu", self.mu)
        if finite("lock", self.lock) <= 1.0:
            raise InputError(f"lock = {self.lock!r}: expected a stretch above 1")

    @property
    def constants(self) -> tuple[float, ...]:
        """(mu, lm)."""
        return (self.mu, self.lock)

    @property
    def energy(self) -> FunctionFactory:
        """See `kernels.incompressible.arruda_boyce`."""
        from ..kernels.incompressible import arruda_boyce

        return arruda_boyce


@dataclass(frozen=True)
class Ogden(PlaneStress):
    """Incompressible Ogden sheet: Psi = sum_p mu_p / a_p (l1^a_p + l2^a_p + l3^a_p - 3), l1 l2 l3 = 1.

    The shear modulus is half the sum of mu_p a_p. As it is written in principal stretches, not invariants, its
    device functions are its own.

    Attributes:
        mu: One or two moduli mu_p [Pa].
        exponents: As many exponents a_p [-].

    Raises:
        InputError: for other numbers of terms, or a shear modulus that is not above zero.
    """

    mu: tuple[float, ...]
    exponents: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("mu", "exponents"):
            if not isinstance(getattr(self, name), tuple | list):
                raise InputError(f"{name} = {getattr(self, name)!r}: expected a tuple of one or two numbers")
        if len(self.mu) != len(self.exponents) or len(self.mu) not in (1, 2):
            raise InputError(f"mu = {self.mu!r} with exponents = {self.exponents!r}: expected one or two of each")
        if sum(m * a for m, a in zip(self.mu, self.exponents, strict=True)) <= 0.0:
            raise InputError(
                f"mu = {self.mu!r} with exponents = {self.exponents!r}: expected a sum of products above 0"
            )

    @property
    def constants(self) -> tuple[float, ...]:
        """(mu_1, a_1, mu_2, a_2)."""
        return tuple(number for term in zip(self.mu, self.exponents, strict=True) for number in term)

    @property
    def on_device(self) -> MaterialFunctions:
        """See `kernels.ogden`."""
        from ..kernels.ogden import ogden

        return ogden
