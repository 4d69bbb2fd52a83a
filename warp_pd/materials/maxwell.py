"""Maxwell elements for viscous laws."""

from __future__ import annotations

from dataclasses import dataclass

from ..device.checks import positive


@dataclass(frozen=True)
class Maxwell:
    """A viscous branch: a neo-Hookean network whose chains let go and form again free of stress.

    At a constant stretch its stress decays as exp(-t / time), at small strains it is the spring and dashpot in series
    of a Prony series. No motion extracts energy from it. See kernels/maxwell.py; sources: Green and Tobolsky 1946,
    Lubliner 1985.

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
