"""Will a cut run? The energy that a long cut in a strip would release, from one equilibrium without a tear.

The cut runs where `release` passes the tearing energy of the rubber.
"""

from warp_pd import BondAssociated, Fixed, InputError, Measure, Motion, NeoHookean, Newton, Sheet, Simulation
from warp_pd.materials import energy_density
from warp_pd.measures import energy_release_rate


def build(points=31, stretch=1.5):
    """Will a cut run? The energy that a long cut in a strip in pure shear would release.

    Args:
        points: Rows of points along the height.
        stretch: Of the height, above 1.
    """
    if not stretch > 1.0:
        raise InputError(f"stretch = {stretch}: expected more than 1")
    height, rubber = 0.04, NeoHookean(mu=1e5, bulk=1e7)
    middle = 0.5 * height * (1.0 + 1.0 / (points - 1))
    tip = (1.75 * height, middle)
    sheet = Sheet.rectangle(3.5 * height, height, thickness=1e-3, density=1000.0, points=(7 * points // 2, points))
    sheet = sheet.cut((-1.0, middle), tip)
    top = sheet.edges("top")
    return Simulation(
        sheet,
        BondAssociated(rubber, horizon=1.5),
        Newton(load_steps=2),
        loads=[Fixed(sheet.edges("bottom")), Motion(top, [0.0, 1.0], x=0.0, y=[0.0, (stretch - 1.0) * height], z=0.0)],
        measures=[
            Measure(
                "release", "J/m^2", lambda built, frame: energy_release_rate(built, tip, (1.0, 0.0), 0.3 * height),
                height * float(energy_density(rubber, stretch, 1.0)), "H W: Rivlin and Thomas 1953",
            )
        ],
    )  # fmt: skip
