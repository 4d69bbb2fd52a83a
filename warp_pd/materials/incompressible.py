"""Exactly incompressible materials in plane stress, and your own."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from ..device.checks import InputError, finite, not_negative, positive
from .plane_stress import PlaneStress
from .protocols import out_of_order

if TYPE_CHECKING:
    from ..kernels.materials import MaterialFunctions
    from ..kernels.numeric import FunctionFactory

# Constants that no rubber has: others over the first, locking stretch of a chain, exponents.
MOST_RATIO, MOST_LOCK, MOST_EXPONENT = 10.0, 100.0, 100.0


class Incompressible(PlaneStress):
    """Exactly incompressible sheet in plane stress, defined by its energy, one Warp function (base class).

    A subclass is a frozen dataclass with `constants`, at most four numbers, and `energy`, a cached factory from the
    precision in bits to a Warp function (I1 - 3, I2 - 3, constants) -> vec6 of Psi, Psi_1, Psi_2, Psi_11, Psi_12,
    Psi_22 [Pa]. Stress, fast paths and the tangent for Newton's method follow from it. See kernels/incompressible.py,
    and docs/materials.md for writing your own material.
    """

    @property
    def energy(self) -> FunctionFactory:
        """Factory of the energy."""
        raise NotImplementedError(f"{type(self).__name__}.energy: expected a factory of a Warp function")

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
        c10: First constant [Pa].
        c01: Second constant [Pa]. A negative one makes the material unstable at large equibiaxial stretches.

    Raises:
        InputError: if c10 or the shear modulus, 2 (c10 + c01), is not positive.
    """

    c10: float
    c01: float = 0.0

    def __post_init__(self) -> None:
        positive("c10", self.c10)
        if finite("c01", self.c01) <= -self.c10:
            raise InputError(
                f"c01 = {self.c01!r}: expected more than -c10 = {-self.c10!r}, for a positive shear modulus"
            )

    @property
    def doubts(self) -> list[str]:
        """Whether its constants may be in another order."""
        return out_of_order("c10, c01", MooneyRivlin__c01=(self.c01, MOST_RATIO * self.c10, "ten times c10"))

    @property
    def stable(self) -> bool:
        """Whether c01 is not negative."""
        return self.c01 >= 0.0

    @property
    def shear_modulus(self) -> float:
        """2 (c10 + c01) [Pa]."""
        return 2.0 * (self.c10 + self.c01)

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
        c10: First constant [Pa]; the shear modulus is 2 c10.
        c20: Second constant [Pa], any sign.
        c30: Third constant [Pa], any sign.

    Raises:
        InputError: for c10 that is not above zero.
    """

    c10: float
    c20: float = 0.0
    c30: float = 0.0

    def __post_init__(self) -> None:
        positive("c10", self.c10)
        finite("c20", self.c20)
        finite("c30", self.c30)

    @property
    def doubts(self) -> list[str]:
        """Whether its constants may be in another order."""
        most = MOST_RATIO * self.c10, "ten times c10"
        return out_of_order("c10, c20, c30", Yeoh__c20=(self.c20, *most), Yeoh__c30=(self.c30, *most))

    @property
    def stable(self) -> bool:
        """Whether no constant is negative."""
        return self.c20 >= 0.0 and self.c30 >= 0.0

    @property
    def shear_modulus(self) -> float:
        """2 c10 [Pa]."""
        return 2.0 * self.c10

    @property
    def constants(self) -> tuple[float, ...]:
        """(c10, c20, c30)."""
        return (self.c10, self.c20, self.c30)

    @property
    def energy(self) -> FunctionFactory:
        """See `kernels.incompressible.yeoh`."""
        from ..kernels.incompressible import yeoh

        return yeoh


# Terms of the initial shear modulus over mu, by even powers of 1 / lock.
SERIES = (1.0, 3.0 / 5.0, 99.0 / 175.0, 513.0 / 875.0, 42039.0 / 67375.0)


@dataclass(frozen=True)
class ArrudaBoyce(Incompressible):
    """Incompressible Arruda-Boyce sheet, five terms of the eight-chain model.

    The initial shear modulus is mu (1 + 3/(5 lm^2) + 99/(175 lm^4) + 513/(875 lm^6) + 42039/(67375 lm^8)).

    Attributes:
        mu: Modulus [Pa].
        lock: Locking stretch lm of a chain, greater than 1. The five-term series stiffens near it but stays
            finite.

    Raises:
        InputError: if mu is not positive, or lock is not greater than 1.
    """

    mu: float
    lock: float

    stable: ClassVar[bool] = True

    def __post_init__(self) -> None:
        positive("mu", self.mu)
        if finite("lock", self.lock) <= 1.0:
            raise InputError(f"lock = {self.lock!r}: expected a stretch greater than 1")

    @property
    def doubts(self) -> list[str]:
        """Whether its constants may be in another order."""
        return out_of_order("mu, lock", ArrudaBoyce__lock=(self.lock, MOST_LOCK, f"{MOST_LOCK:g}"))

    @property
    def shear_modulus(self) -> float:
        """The initial shear modulus [Pa]."""
        return self.mu * sum(c / self.lock ** (2 * power) for power, c in enumerate(SERIES))

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
class Carroll(Incompressible):
    """Incompressible Carroll sheet: Psi = a (I1 - 3) + b (I1^4 - 81) + c (sqrt(I2) - sqrt(3)).

    The term of I2 was found from what Treloar's biaxial tests need beyond the first invariant. Source: Carroll,
    J. Elasticity 103 (2011) 173.

    Attributes:
        a: First constant [Pa].
        b: Second constant [Pa], which stiffens the rubber; some 1e-6 of the first.
        c: Third constant [Pa].

    Raises:
        InputError: if a constant is negative, or the shear modulus, 2 a + 216 b + c / sqrt(3), is zero.
    """

    a: float
    b: float
    c: float

    stable: ClassVar[bool] = True

    def __post_init__(self) -> None:
        for name in ("a", "b", "c"):
            not_negative(name, getattr(self, name))
        if self.shear_modulus == 0.0:
            raise InputError("a = b = c = 0: expected a positive shear modulus, 2 a + 216 b + c / sqrt(3)")

    @property
    def doubts(self) -> list[str]:
        """Whether its constants may be in another order."""
        return out_of_order("a, b, c", Carroll__b=(self.b, 0.01 * max(self.a, self.c), "a hundredth of the others"))

    @property
    def shear_modulus(self) -> float:
        """2 a + 216 b + c / sqrt(3) [Pa]."""
        return 2.0 * self.a + 216.0 * self.b + self.c / math.sqrt(3.0)

    @property
    def constants(self) -> tuple[float, ...]:
        """(a, b, c)."""
        return (self.a, self.b, self.c)

    @property
    def energy(self) -> FunctionFactory:
        """See `kernels.incompressible.carroll`."""
        from ..kernels.incompressible import carroll

        return carroll


@dataclass(frozen=True)
class ExtendedTube(PlaneStress):
    """Incompressible sheet of the extended tube model: chains of finite length in a tube of their neighbours.

    Psi = gc / 2 ((1 - delta^2) x / (1 - delta^2 x) + ln(1 - delta^2 x)) + 2 ge / beta^2 (sum l^-beta - 3), x = I1 - 3.
    Source: Kaliske and Heinrich, Rubber Chem. Technol. 72 (1999) 602.

    Attributes:
        gc: Modulus of the crosslinks [Pa].
        delta: Finite length of the chains [-]: the stress grows without bound where I1 - 3 nears 1 / delta^2.
        ge: Modulus of the tube [Pa].
        beta: How the tube gives way to the chains [-], 0 to 1.

    Raises:
        InputError: if a modulus is negative or both are zero, delta is not from 0 to below sqrt(1/2), or beta is not
            above 0 and at most 1.
    """

    gc: float
    delta: float
    ge: float
    beta: float

    stable: ClassVar[bool] = True

    def __post_init__(self) -> None:
        for name in ("gc", "delta", "ge"):
            not_negative(name, getattr(self, name))
        if self.delta**2 >= 0.5:
            raise InputError(f"delta = {self.delta!r}: expected less than sqrt(1/2), for crosslinks that resist")
        if positive("beta", self.beta) > 1.0:
            raise InputError(f"beta = {self.beta!r}: expected at most 1")
        if self.shear_modulus == 0.0:
            raise InputError("gc = ge = 0: expected a positive shear modulus, gc (1 - 2 delta^2) + ge")

    @property
    def shear_modulus(self) -> float:
        """The initial shear modulus, gc (1 - 2 delta^2) + ge [Pa]."""
        return self.gc * (1.0 - 2.0 * self.delta**2) + self.ge

    @property
    def constants(self) -> tuple[float, ...]:
        """(gc, delta, ge, beta)."""
        return (self.gc, self.delta, self.ge, self.beta)

    @property
    def on_device(self) -> MaterialFunctions:
        """See `kernels.extended_tube`."""
        from ..kernels.extended_tube import extended_tube

        return extended_tube()


@dataclass(frozen=True)
class Ogden(PlaneStress):
    """Incompressible Ogden sheet: Psi = sum_p mu_p / a_p (l1^a_p + l2^a_p + l3^a_p - 3), l1 l2 l3 = 1.

    The shear modulus is half the sum of mu_p a_p. The material is written in principal stretches instead of invariants
    and has separate device functions. Source: Ogden, Proc. R. Soc. A 326 (1972) 565.

    Attributes:
        mu: Moduli mu_p [Pa], one per term, any sign.
        exponents: Exponents a_p [-], one per term.

    Raises:
        InputError: if the numbers of moduli and exponents differ, or the shear modulus is not positive.
    """

    mu: tuple[float, ...]
    exponents: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("mu", "exponents"):
            if not isinstance(getattr(self, name), tuple | list):
                raise InputError(f"{name} = {getattr(self, name)!r}: expected a tuple of numbers")
            for p, value in enumerate(getattr(self, name)):
                finite(f"{name}[{p}]", value)
        given = f"mu = {self.mu!r} with exponents = {self.exponents!r}"
        if len(self.mu) != len(self.exponents) or not self.mu:
            raise InputError(f"{given}: expected equal numbers of both, at least one")
        if sum(m * a for m, a in zip(self.mu, self.exponents, strict=True)) <= 0.0:
            raise InputError(f"{given}: expected a positive sum of products")

    @classmethod
    def of(cls, **constants: float) -> Ogden:
        """Create the material from mu_1, alpha_1, mu_2, alpha_2, ..., for fits.

        Raises:
            InputError: for other names, an incomplete term, or invalid constants.
        """
        terms = range(1, (len(constants) + 1) // 2 + 1)
        names = [f"{name}_{p}" for p in terms for name in ("mu", "alpha")]
        if sorted(names) != sorted(constants):
            raise InputError(f"Ogden.of({', '.join(constants)}): expected {', '.join(names or ('mu_1', 'alpha_1'))}")
        return cls(tuple(constants[f"mu_{p}"] for p in terms), tuple(constants[f"alpha_{p}"] for p in terms))

    @property
    def doubts(self) -> list[str]:
        """Whether moduli and exponents may be swapped."""
        largest = max(abs(a) for a in self.exponents)
        return out_of_order("mu, exponents", Ogden__exponents=(largest, MOST_EXPONENT, f"{MOST_EXPONENT:g}"))

    @property
    def stable(self) -> bool:
        """Whether all products mu_p a_p are positive."""
        return all(m * a >= 0.0 for m, a in zip(self.mu, self.exponents, strict=True))

    @property
    def shear_modulus(self) -> float:
        """Half the sum of mu_p a_p [Pa]."""
        return 0.5 * sum(m * a for m, a in zip(self.mu, self.exponents, strict=True))

    @property
    def constants(self) -> tuple[float, ...]:
        """(mu_1, a_1, mu_2, a_2, ...)."""
        return tuple(number for term in zip(self.mu, self.exponents, strict=True) for number in term)

    @property
    def on_device(self) -> MaterialFunctions:
        """See `kernels.ogden`."""
        from ..kernels.ogden import ogden

        # One term is two of which the second is zero: both then share their kernels.
        return ogden(max(2, len(self.mu)))
