"""Materials of a sheet with a damage field, continued beyond its strength without stiffening."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..materials.by_region import ByRegion
from ..materials.compressible import Gent
from ..materials.energy import borne, energy_density, stretch_of_density
from ..materials.incompressible import Incompressible
from ..materials.plane_stress import PlaneStress
from ..materials.protocols import Capabilities, Material, capabilities, padded_constants
from ..materials.tension_field import TensionField

if TYPE_CHECKING:
    from ..kernels.materials import MaterialFunctions
    from ..kernels.numeric import FunctionFactory

# Stretches at which energies are compared, and the relative difference of energies that counts as round-off.
STRETCHES, ROUND_OFF = np.geomspace(1.0, 1e3, 4001), 1e-9
# A material that at 64 times the strength has less than this fraction more stiffness than at the strength does not
# stiffen: nearly incompressible neo-Hookean rubber.
STIFFENS, FAR = 0.1, 64.0
# Fraction of the least I1 - 3 at the strength below which the energy is not looked at.
CERTAIN = 0.9


def continued(material: Material, strength: float, device: Any = None) -> Material:
    """A material with the same energy up to a strength [J/m^3], which does not stiffen beyond.

    A material that does not stiffen is returned as it is.

    Args:
        material: Any hyperelastic continuum material.
        strength: Energy density [J/m^3].
        device: Warp device that evaluates the material.
    """
    if isinstance(material, ByRegion):
        regions = [(points, continued(each, strength, device)) for points, each in material.regions]
        return replace(material, material=continued(material.material, strength, device), regions=regions)
    if isinstance(material, TensionField):
        return replace(material, material=continued(material.material, strength, device))
    if isinstance(material, Gent):
        return ContinuedGent(material.mu, material.bulk, material.lock, _locked_at(material, strength))
    end = stretch_of_density(lambda stretch: energy_density(material, stretch, 1.0, device), strength, STRETCHES)
    return _continued_from(material, strength, end, device) if np.isfinite(end) else material


def _continued_from(material: Material, strength: float, end: float, device: Any) -> Material:
    """The same for a single material that reaches the strength at a stretch `end` [-] in planar tension."""
    from ..kernels.incompressible import incompressible_width

    known, excess = capabilities(material), (end - 1.0 / end) ** 2
    modulus, slopes = _slopes(energy_density(material, STRETCHES, 1.0, device), strength)
    constant = known.by_point is None and known.remembers is None and known.isotropic
    if constant and known.width is incompressible_width:
        if not _knows_only_first_invariant(material, end, device):
            least = _least_excess(material, strength, end, device)
            return ContinuedEnergy(material, strength, least, tuple(slopes), (modulus, excess))
        if slopes[-1] > 1.0 - ROUND_OFF:
            return material
        if isinstance(material, Incompressible):
            return ContinuedInvariant(material, excess)
    if slopes[int(np.log2(FAR)) - 1] > 1.0 - STIFFENS:
        return material
    least = _least_excess(material, strength, end, device) if constant else -1.0
    return ContinuedEnergy(material, strength, least, tuple(slopes))


@dataclass(frozen=True)
class ContinuedInvariant(Incompressible):
    """A material of I1 alone, continued.

    Attributes:
        material: The material.
        excess: I1 - 3 at the strength [-].
    """

    material: Incompressible
    excess: float

    @property
    def constants(self) -> tuple[float, ...]:
        """Constants of the material, with the excess before the last."""
        *first, last = padded_constants(self.material)  # type: ignore[arg-type]
        return (*first, self.excess, last)

    @property
    def energy(self) -> FunctionFactory:
        """See `kernels.tearing.continuation.continued_energy`."""
        from ..kernels.tearing.continuation import continued_energy

        return continued_energy(self.material.energy)


@dataclass(frozen=True)
class ContinuedGent(Gent):
    """A Gent material, continued; it has no lock.

    Attributes:
        excess: I1b - 3 at the strength [-].
    """

    excess: float

    @property
    def constants(self) -> tuple[float, ...]:
        """(mu, K, Jm, excess)."""
        return (*super().constants, self.excess)

    @property
    def on_device(self) -> MaterialFunctions:
        """See `kernels.compressible.continued_gent`."""
        from ..kernels.compressible import continued_gent

        return continued_gent


@dataclass(frozen=True)
class ContinuedEnergy(PlaneStress):
    """Any other material, its energy mapped beyond the strength.

    Attributes:
        material: The material.
        strength: Energy density [J/m^3].
        least: I1 - 3 below which the energy is certainly below the strength [-].
        slopes: Derivative of the new energy by the old one at 2, 4, ... times the strength.
        planar: Derivative of the energy by I1 - 3 [Pa], and I1 - 3, at the strength in planar tension, of a material
            that goes over to a neo-Hookean one.
    """

    material: Material
    strength: float
    least: float
    slopes: tuple[float, ...]
    planar: tuple[float, ...] = ()

    @property
    def constants(self) -> tuple[float, ...]:
        """Constants of the material, with those of the mapping before the last."""
        *first, last = padded_constants(self.material)
        return (*first, self.least, self.strength, *self.slopes, *self.planar, last)

    @property
    def isotropic(self) -> bool:  # type: ignore[override]
        """Whether the material is."""
        return self._known.isotropic

    @property
    def by_point(self) -> Any:
        """Values by point of the material."""
        return self._known.by_point

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes of the material."""
        return self._known.notes

    @property
    def remembers(self) -> FunctionFactory | None:
        """What the material remembers."""
        from ..kernels.tearing.continuation import of_given

        remembers = self._known.remembers
        return None if remembers is None else of_given(self.material.functions, bool(self.planar), remembers)

    @property
    def on_device(self) -> MaterialFunctions:
        """See `kernels.tearing.continuation.continued_functions`."""
        from ..kernels.tearing.continuation import continued_functions

        known = self._known
        return continued_functions(
            self.material.functions, bool(self.planar), known.near, known.response, known.volume, known.width
        )

    @property
    def _known(self) -> Capabilities:
        return capabilities(self.material)


def _locked_at(material: Gent, strength: float) -> float:
    """I1b - 3 at which the energy of constant volume reaches the strength."""
    return float(-material.lock * np.expm1(-2.0 * strength / (material.mu * material.lock)))


def _knows_only_first_invariant(material: Material, end: float, device: Any) -> bool:
    """Whether planar and uniaxial tension of the same I1 have the same energy, up to and beyond the strength."""
    stretch = 1.0 + (end - 1.0) * np.array([0.25, 0.5, 1.0, 1.5])
    wanted = (stretch - 1.0 / stretch) ** 2
    # l^2 + 2 / l - 3 = wanted, of which the largest root is the uniaxial stretch.
    uniaxial = np.array([np.roots([1.0, 0.0, -3.0 - x, 2.0]).real.max() for x in wanted])
    planar = energy_density(material, stretch, 1.0, device)
    found = energy_density(material, uniaxial, 1.0 / np.sqrt(uniaxial), device)
    both = np.isfinite(planar) & np.isfinite(found)
    return bool((np.abs(found - planar)[both] <= ROUND_OFF * planar[both]).all())


def _slopes(planar: np.ndarray, strength: float) -> tuple[float, np.ndarray]:
    """The slopes phi' at 2, 4, ... times the strength, from the energy in planar tension at STRETCHES.

    It never rises, since only what stiffens is changed.
    """
    from ..kernels.tearing.continuation import KNOTS

    usable = borne(planar)
    density, excess = planar[:usable], (STRETCHES - 1.0 / STRETCHES)[:usable] ** 2
    knots = strength * 2.0 ** np.arange(KNOTS + 1)
    stiffness = np.interp(knots, density, np.gradient(density, excess))
    return float(stiffness[0]), np.minimum.accumulate(np.minimum(stiffness[0] / stiffness, 1.0))[1:]


def _least_excess(material: Material, strength: float, end: float, device: Any) -> float:
    """Certainly less than I1 - 3 of any state whose energy exceeds the strength [-], for an isotropic material."""
    first = np.geomspace(1e-2, 4.0 * end, 240)
    first, second = np.meshgrid(first, first)
    over = ~(energy_density(material, first, second, device) < strength)
    excess = first**2 + second**2 + (first * second) ** -2.0 - 3.0
    return CERTAIN * float(excess[over].min())
