"""The rubber of the cases, and the force laws that are made of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from warp_pd import (
    Bimodular,
    BondAssociated,
    BondBased,
    BondNeoHookean,
    Built,
    Explicit,
    Gent,
    HyperelasticBonds,
    InputError,
    NeoHookean,
    Neural,
    Nodal,
    Prony,
    Sheet,
    Simulation,
    Visco,
    ViscoBondBased,
    Yeoh,
)
from warp_pd.interfaces import Law

from .verdicts import NotApplicableError

MU, DENSITY, THICKNESS, HORIZON = 1e3, 1e3, 0.01, 2.015


@dataclass(frozen=True)
class Rubber:
    """The rubber that the materials of the laws stand for. A shear wave crosses most sheets in a second.

    Attributes:
        mu: Shear modulus [Pa].
        ratio: K/mu.
        lock: Jm of a Gent sheet, or None.
        relaxation: Relaxation time of viscous laws [s].
    """

    mu: float = MU
    ratio: float = 100.0
    lock: float | None = None
    relaxation: float = 0.1

    @property
    def material(self) -> NeoHookean | Gent:
        """Neo-Hookean, or Gent with a lock."""
        bulk = self.ratio * self.mu
        return NeoHookean(self.mu, bulk) if self.lock is None else Gent(self.mu, bulk, self.lock)

    @property
    def prony(self) -> tuple[Prony, ...]:
        """Two terms: one relaxes over a constant time, the other over a time that falls with the rate."""
        return (
            Prony(0.125 * self.mu, time=self.relaxation),
            Prony(0.05 * self.mu, time=10.0 * self.relaxation, exponent=1.6665),
        )

    def only_mu(self, volume: str) -> float:
        """The shear modulus, for bond laws that know nothing else; `volume` says what they do with the volume.

        Raises:
            NotApplicableError: for a rubber that differs from the default in more than that.
        """
        if self.lock is not None:
            raise NotApplicableError("the law has no lock")
        if self.ratio != Rubber.ratio:
            raise NotApplicableError(f"the law has no K/mu: {volume}")
        return self.mu

    def thickness_stretch(self, a: float, b: float) -> float:
        """C33 at the principal stretches a and b, independent of the kernels: zero of sigma_33; NaN past the lock."""
        trace, det, bulk = a * a + b * b, (a * b) ** 2, self.ratio * self.mu

        def thickness_stress(c33: Any) -> Any:
            volume = c33 * det
            pressure = 0.5 * bulk * (volume - 1.0) if self.lock else 0.25 * bulk * (volume - 1.0 / volume)
            return self._shear(trace, c33, volume) * (2.0 * c33 - trace) / 3.0 + pressure

        # The root lies on the near side of the pole that the Gent material has at its lock.
        grid = np.geomspace(1e-2, 1e8, 40001) / det
        values, good = thickness_stress(grid), self._shear(trace, grid, grid * det) > 0.0
        at = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0) & good[:-1] & good[1:])
        if len(at) == 0:
            return math.nan
        return float(brentq(thickness_stress, grid[at[0]], grid[at[0] + 1], xtol=1e-15, rtol=8.9e-16))

    def _shear(self, trace: float, c33: Any, volume: Any) -> Any:
        modified = volume ** (-1.0 / 3.0)
        if self.lock is None:
            return self.mu * modified
        return self.mu * self.lock * modified / (self.lock - modified * (trace + c33) + 3.0)

    def stress(self, a: float, b: float) -> np.ndarray:
        """Principal first Piola stresses [Pa]."""
        c33 = self.thickness_stretch(a, b)
        g = self._shear(a * a + b * b, c33, c33 * (a * b) ** 2)
        return g * np.array([a - c33 / a, b - c33 / b])

    def share_of_lock(self, a: float) -> float:
        """(I1b - 3) / Jm under equibiaxial stretch; 1 past the lock."""
        assert self.lock is not None
        c33 = self.thickness_stretch(a, a)
        if math.isnan(c33):
            return 1.0
        return ((c33 * a**4) ** (-1.0 / 3.0) * (2.0 * a * a + c33) - 3.0) / self.lock

    def energy(self, a: float, b: float) -> float:
        """Stored energy [J/m^3] at the principal stretches a and b, along the path that raises both together."""
        share, weight = np.polynomial.legendre.leggauss(24)
        share, weight = 0.5 * (share + 1.0), 0.5 * weight
        path = np.array([a - 1.0, b - 1.0])
        return float(sum(w * self.stress(*(1.0 + s * path)) @ path for s, w in zip(share, weight, strict=True)))


RUBBER = Rubber()
# By the name in the table: makes the law of a rubber.
LAWS: dict[str, Callable[[Rubber], Law]] = {
    "nodal": lambda r: Nodal(r.material),
    "published": lambda r: BondAssociated(r.material, horizon=HORIZON, weights="published"),
    "plain": lambda r: BondAssociated(r.material, horizon=HORIZON, weights="plain"),
    "corrected": lambda r: BondAssociated(r.material, horizon=HORIZON, weights="corrected"),
    "closed form": lambda r: Neural(r.material, evaluation="closed_form", weights="published"),
    "neural": lambda r: Neural(r.material, evaluation="fused", weights="published"),
    "bond-based": lambda r: BondBased(Bimodular(3.0 * r.only_mu("nu is 1/3"))),
    "hyperelastic bonds": lambda r: HyperelasticBonds(BondNeoHookean(r.only_mu("it is incompressible"))),
    "visco": lambda r: Visco(r.material, prony=r.prony, horizon=HORIZON, weights="corrected"),
    "visco bonds": lambda r: ViscoBondBased(Yeoh(0.5 * r.only_mu("its energy ignores the volume")), prony=r.prony),
    "visco series": lambda r: replace(LAWS["visco bonds"](r), update="series"),
}


@dataclass(frozen=True)
class Trial:
    """Where a case runs.

    Attributes:
        law: Name of the law.
        bits: 32 or 64.
        device: Name of the device, or None.
        steps: Of the oscillation; the spin takes a tenth.
        seconds: After which these two stop.
        short: Whether fewer steps will do.
    """

    law: str
    bits: int
    device: str | None
    steps: int = 1_000_000
    seconds: float = 20.0
    short: bool = False

    def simulation(self, sheet: Sheet, rubber: Rubber = RUBBER, **parts: Any) -> Simulation:
        """A simulation of the sheet with the law.

        Raises:
            NotApplicableError: if the law does not take the rubber.
        """
        parts.setdefault("solver", Explicit(1.0))
        try:
            return Simulation(sheet, LAWS[self.law](rubber), **parts)
        except InputError as error:
            raise NotApplicableError(str(error)) from None

    def built(self, sheet: Sheet, rubber: Rubber = RUBBER, **parts: Any) -> Built:
        """The same on the device, compiled."""
        built = self.simulation(sheet, rubber, **parts).build(self.device, self.bits)
        built.context.compile()
        return built
