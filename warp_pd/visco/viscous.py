"""Terms of viscous laws: Prony series, and Maxwell elements."""

from __future__ import annotations

from dataclasses import dataclass

from ..device.checks import not_negative, positive


@dataclass(frozen=True)
class Prony:
    """A term of a Prony series: a Yeoh stress that relaxes. Sources: VE eqs. 17 and 19.

    The relaxation time is theta = time * |dC/dt|^-exponent, with the rate |dC/dt| of the three-dimensional strain [1/s]
    (VE eqs. 31 to 33). In the paper each test has one fixed rate: give it as `rate`. Without it the local, current rate
    is used; then nothing relaxes at rest unless the exponent is 0.

    Attributes:
        c10: First Yeoh constant [Pa].
        c20: Second Yeoh constant [Pa], at least 0: the energy must be convex so that dissipation is not negative.
        time: Relaxation time at the rate 1/s [s]; phi_ref in the paper.
        exponent: eta in the paper [-]; 0 for a constant relaxation time.
        rate: A fixed rate [1/s], or None.

    Raises:
        InputError: if a constant is outside these bounds.
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
        """(c10, c20, relaxation time at the fixed rate or at 1/s, exponent, 0 for a fixed rate)."""
        if self.rate is None:
            return (self.c10, self.c20, self.time, self.exponent)
        return (self.c10, self.c20, self.time * self.rate**-self.exponent, 0.0)


@dataclass(frozen=True)
class Maxwell:
    """A viscous branch: a neo-Hookean network whose chains let go and form again free of stress.

    At a constant stretch its stress decays as exp(-t / time), at small strains it is the spring and dashpot in series
    of a Prony series. No motion extracts energy from it. See kernels/visco/maxwell.py; sources: Green and Tobolsky
    1946, Lubliner 1985.

    Attributes:
        modulus: Shear modulus of the branch [Pa], in addition to that of the material.
        time: Relaxation time [s].

    Raises:
        InputError: if a constant is not positive.
    """

    modulus: float
    time: float

    def __post_init__(self) -> None:
        positive("Maxwell.modulus", self.modulus)
        positive("Maxwell.time", self.time)

    @property
    def constants(self) -> tuple[float, float, float, float]:
        """(modulus, time, 0, 0)."""
        return (self.modulus, self.time, 0.0, 0.0)
