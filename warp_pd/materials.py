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


class Incompressible:
    """Exactly incompressible sheet in plane stress: what a material needs is its energy, one Warp function.

    A subclass is a frozen dataclass with `constants`, at most four numbers, and `energy`, a cached factory, precision
    in bits -> Warp function (I1 - 3, I2 - 3, constants) -> vec6 of Psi, Psi_1, Psi_2, Psi_11, Psi_12, Psi_22 [Pa].
    The rest follows from it: stress, fast paths, the tangent of Newton's method. See kernels/incompressible.py, and
    docs/materials.md for a material of one's own.
    """

    isotropic: ClassVar[bool] = True

    @property
    def energy(self) -> Callable[[int], Any]:
        """Factory of the energy."""
        raise NotImplementedError(f"{type(self).__name__}.energy: a factory of a Warp function is needed")

    @property
    def functions(self) -> Callable[[int], tuple[Any, Any]]:
        """See `kernels.incompressible.incompressible`."""
        return self._made.functions

    @property
    def near(self) -> Callable[[int], Any]:
        """See `kernels.incompressible.incompressible`."""
        return self._made.near

    @property
    def response(self) -> Callable[[int], Any]:
        """See `kernels.incompressible.incompressible`."""
        return self._made.response

    @property
    def _made(self) -> Any:
        from .kernels.incompressible import incompressible

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
    def energy(self) -> Callable[[int], Any]:
        """See `kernels.incompressible.mooney_rivlin`."""
        from .kernels.incompressible import mooney_rivlin

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
    def energy(self) -> Callable[[int], Any]:
        """See `kernels.incompressible.yeoh`."""
        from .kernels.incompressible import yeoh

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
            raise InputError(f"lock = {self.lock!r}: allowed is a stretch above 1")

    @property
    def constants(self) -> tuple[float, ...]:
        """(mu, lm)."""
        return (self.mu, self.lock)

    @property
    def energy(self) -> Callable[[int], Any]:
        """See `kernels.incompressible.arruda_boyce`."""
        from .kernels.incompressible import arruda_boyce

        return arruda_boyce


@dataclass(frozen=True)
class Ogden:
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

    isotropic: ClassVar[bool] = True

    def __post_init__(self) -> None:
        for name in ("mu", "exponents"):
            if not isinstance(getattr(self, name), tuple | list):
                raise InputError(f"{name} = {getattr(self, name)!r}: allowed is a tuple of one or two numbers")
        if len(self.mu) != len(self.exponents) or len(self.mu) not in (1, 2):
            raise InputError(f"mu = {self.mu!r} with exponents = {self.exponents!r}: allowed are one or two of each")
        if sum(m * a for m, a in zip(self.mu, self.exponents, strict=True)) <= 0.0:
            raise InputError(
                f"mu = {self.mu!r} with exponents = {self.exponents!r}: allowed is a sum of products above 0"
            )

    @property
    def constants(self) -> tuple[float, ...]:
        """(mu_1, a_1, mu_2, a_2)."""
        return tuple(number for term in zip(self.mu, self.exponents, strict=True) for number in term)

    @property
    def functions(self) -> Callable[[int], tuple[Any, Any]]:
        """See `kernels.incompressible.ogden`."""
        from .kernels.incompressible import ogden

        return ogden

    @property
    def near(self) -> Callable[[int], Any]:
        """See `kernels.incompressible.ogden_near`."""
        from .kernels.incompressible import ogden_near

        return ogden_near

    @property
    def response(self) -> Callable[[int], Any]:
        """See `kernels.incompressible.ogden_response`."""
        from .kernels.incompressible import ogden_response

        return ogden_response


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


@dataclass(frozen=True)
class Prony:
    """A term of a Prony series: a Yeoh stress that relaxes. Sources: VE eqs. 17 and 19.

    The relaxation time is theta = time * |dC/dt|^-exponent, with |dC/dt| the rate of the strain in space [1/s] (VE
    eqs. 31 to 33). As published a test has one such rate: give it. Without it the rate is that of the place and the
    moment; where nothing moves, nothing relaxes then, unless the exponent is 0.

    Attributes:
        c10: [Pa].
        c20: [Pa], 0 or more: a convex energy cannot give energy away.
        time: Relaxation time at the rate 1/s [s]; phi_ref of the paper.
        exponent: eta of the paper [-]; 0 makes the relaxation time a constant.
        rate: A fixed rate [1/s], or None.

    Raises:
        InputError: for constants outside these bounds.
    """

    c10: float
    c20: float = 0.0
    time: float = 1.0
    exponent: float = 0.0
    rate: float | None = None

    def __post_init__(self) -> None:
        positive("Prony.c10", self.c10)
        not_negative("Prony.c20", self.c20)
        positive("Prony.time", self.time)
        not_negative("Prony.exponent", self.exponent)
        if self.rate is not None:
            positive("Prony.rate", self.rate)

    @property
    def constants(self) -> tuple[float, float, float, float]:
        """(c10, c20, relaxation time at the fixed rate or at 1/s, exponent that is left)."""
        if self.rate is None:
            return (self.c10, self.c20, self.time, self.exponent)
        return (self.c10, self.c20, self.time * self.rate**-self.exponent, 0.0)


def check_material(material: Any, kind: str) -> None:
    """Check that a material is one of continua ("functions") or of pairs of points ("pairwise"), and its constants.

    Raises:
        InputError: if it is not, or as of `padded_constants`.
    """
    example = {"functions": "NeoHookean(mu, bulk)", "pairwise": "Bimodular(modulus)"}[kind]
    if isinstance(material, type) or not hasattr(material, kind):
        raise InputError(f"material = {material!r}: allowed with this law is a material such as {example}")
    padded_constants(material)


def padded_constants(material: Material | PairwiseMaterial) -> tuple[float, float, float, float]:
    """The constants of `material`, filled with zeros up to four.

    Raises:
        InputError: for more than four, one that is not finite, or what is no material.
    """
    if not hasattr(material, "constants"):
        raise InputError(f"material = {material!r}: allowed is a material, such as NeoHookean(mu, bulk)")
    constants = tuple(finite(f"{type(material).__name__}.constants[{k}]", c) for k, c in enumerate(material.constants))
    if len(constants) > 4:
        raise InputError(f"{type(material).__name__}.constants has {len(constants)} numbers: allowed are four at most")
    return (*constants, *([0.0] * (4 - len(constants))))  # type: ignore[return-value]
