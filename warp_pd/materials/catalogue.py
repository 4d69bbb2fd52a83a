"""Named rubbers: law and constants, density, strength and tearing energy, each with its source.

    from warp_pd.materials.catalogue import ecoflex_00_30

A rubber is a module attribute; `rubbers()` gives all of them. Values without a known source are absent; asking for one
raises an InputError. See docs/rubbers.md for how the constants were found and how far they are off.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ..device.checks import InputError
from .incompressible import MooneyRivlin, Ogden, Yeoh
from .plane_stress import PlaneStress


@dataclass(frozen=True)
class Rubber:
    """One named rubber.

    Attributes:
        name: Its name in this module.
        material: Law with constants, for `BondAssociated` and others.
        largest_stretch: Largest uniaxial stretch [-] of the data behind the constants. The law goes on beyond it.
        source: Where the constants come from, and how.
        residual: Root mean square deviation of the nominal stress over the largest stress of each test [-]; None
            where the constants are the source's, or pass through two numbers of a data sheet.
        measured: Other values known, "density", "strength" or "tearing_energy", with the source of each.

    Raises:
        InputError: if a density, strength or tearing energy is asked for that is not known.
    """

    name: str
    material: PlaneStress
    largest_stretch: float
    source: str
    residual: float | None = None
    measured: Mapping[str, tuple[float, str]] = field(default_factory=dict)

    @property
    def density(self) -> float:
        """Mass density [kg/m^3]."""
        return self._known("density")

    @property
    def strength(self) -> float:
        """Nominal stress at break in uniaxial tension [Pa]."""
        return self._known("strength")

    @property
    def tearing_energy(self) -> float:
        """Tearing energy [J/m^2]."""
        return self._known("tearing_energy")

    def _known(self, quantity: str) -> float:
        if quantity not in self.measured:
            raise InputError(f"{quantity} of {self.name}: not known, give your own")
        return self.measured[quantity][0]


PSI = 6894.757293168361
BULLETIN = "Smooth-On technical bulletin, quoted in silicone_table.rs of github.com/via-balaena/CortenForge"
TWO_POINTS = f"two constants through the 100 % modulus and the tensile strength at break: {BULLETIN}"
NATURAL = {"density": (930.0, "Thermopedia, Natural rubber: specific gravity 0.93 at room temperature")}
TABLES = "data as tabulated in github.com/Chongran-Zhao/Calibration-Hyperelasticity (commit 27d9953); fitted here"


def _smooth_on(name: str, material: PlaneStress, largest: float, density: float, psi: float) -> Rubber:
    """One of the silicones of Smooth-On; strength in psi."""
    measured = {"density": (density, f"specific gravity: {BULLETIN}"), "strength": (psi * PSI, BULLETIN)}
    return Rubber(name, material, largest, TWO_POINTS, measured=measured)


ecoflex_00_10 = _smooth_on("ecoflex_00_10", Yeoh(14965.1, 198.605), 9.0, 1040.0, 120.0)
ecoflex_00_20 = _smooth_on("ecoflex_00_20", Yeoh(14749.0, 252.5), 9.45, 1070.0, 160.0)
ecoflex_00_30 = _smooth_on("ecoflex_00_30", Yeoh(18663.0, 259.0), 10.0, 1070.0, 200.0)
ecoflex_00_50 = _smooth_on("ecoflex_00_50", Yeoh(22262.0, 344.2), 10.8, 1070.0, 315.0)
dragon_skin_10 = _smooth_on("dragon_skin_10", Ogden((47182.1,), (2.768262,)), 11.0, 1070.0, 475.0)
dragon_skin_20 = _smooth_on("dragon_skin_20", Ogden((99088.9,), (2.846368,)), 7.2, 1080.0, 550.0)
dragon_skin_30 = _smooth_on("dragon_skin_30", Ogden((150419.0,), (3.041327,)), 4.64, 1080.0, 500.0)

rtv_615 = Rubber(
    "rtv_615",
    Yeoh(1.63e5, 1.39e4, 934.0),
    2.93,
    "Marechal et al., Soft Robotics (2020), doi 10.1089/soro.2019.0115: ASTM D412, crosshead strain; fitted here",
    0.002,
    {"strength": (2.507e6, "the same, stress at which the mean curve ends")},
)
sylgard_184 = Rubber(
    "sylgard_184",
    MooneyRivlin(1.32e6 / 6.0),
    1.4,
    "Johnston et al., J. Micromech. Microeng. 24 (2014) 035017, abstract: E = 1.32 MPa (cured at 25 C; 2.97 at 200 C)",
    measured={"strength": (3.51e6, "the same, cured at 25 C; 7.65 MPa at 200 C")},
)
pdms_network = Rubber(
    "pdms_network",
    Ogden((2.231e5, 9056.0), (0.451, 3.407)),
    1.94,
    f"Kawamura et al., Macromolecules 34 (2001): end-linked PDMS, uniaxial and equibiaxial; {TABLES}",
    0.0128,
)
silicone_meunier = Rubber(
    "silicone_meunier",
    Yeoh(1.612e5, 415.3, 1698.0),
    2.17,
    f"Meunier et al., Polymer Testing 27 (2008) 765: unfilled silicone, three tests at once; {TABLES}",
    0.0319,
)
natural_rubber = Rubber(
    "natural_rubber",
    Ogden((0.63e6, 1.2e3, -1e4), (1.3, 5.0, -2.0)),
    7.6,
    "Ogden, Proc. R. Soc. A 326 (1972) 565: his fit to Treloar's (1944) three tests of vulcanised natural rubber",
    0.0338,
    NATURAL,
)
gum_rubber_james = Rubber(
    "gum_rubber_james",
    Ogden((3.97e5, 26.98), (2.036, 7.27)),
    4.77,
    f"James, Green, Simpson, J. Appl. Polym. Sci. 19 (1975) 2033: gum vulcanisate, uniaxial; {TABLES}",
    0.0049,
    NATURAL,
)
isoprene_rubber = Rubber(
    "isoprene_rubber",
    Ogden((4.28e5, -3.189e4), (1.705, -1.398)),
    3.7,
    f"Kawabata et al., Macromolecules 14 (1981) 154: isoprene rubber, three tests at once; {TABLES}",
    0.0109,
)
vhb_4910 = Rubber(
    "vhb_4910",
    Ogden((28400.0, 776.0), (1.149, 3.2056)),
    6.0,
    "Zhao, github.com/Chongran-Zhao/VHB4910_data (commit a23efd8): held for 400 s at eight stretches; fitted here",
    0.0034,
)
polyurea = Rubber(
    "polyurea",
    Yeoh(0.1996e6, 0.0170e6),
    4.0,
    "Huang, Oterkus et al. (2019), VE table 2; the largest stretch is that of their example 6.1",
)
NINE_CIRCLES = (
    "Kamarei, Zeng, Dolbow, Lopez-Pamies, Comput. Methods Appl. Mech. Engrg. 448 (2026) 118449, as in their "
    "Examples/Trousers.py of github.com/farhadkama/FEniCSx_Kamarei_Lopez-Pamies (commit adbdfd2)"
)
pu_elastomer = Rubber(
    "pu_elastomer",
    MooneyRivlin(0.52e6 / 2.0),
    1.23,
    f"{NINE_CIRCLES}: a polyurethane elastomer, shear modulus 0.52 MPa; the largest stretch is that of the strength",
    measured={"strength": (0.3e6, NINE_CIRCLES), "tearing_energy": (41.0, f"{NINE_CIRCLES}: 0.041 N/mm")},
)


def rubbers() -> tuple[Rubber, ...]:
    """All rubbers of this module."""
    return tuple(value for value in globals().values() if isinstance(value, Rubber))
