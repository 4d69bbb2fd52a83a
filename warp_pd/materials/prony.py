"""Terms that relax."""

from __future__ import annotations

from dataclasses import dataclass

from ..device.checks import not_negative, positive


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
