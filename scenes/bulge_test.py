"""A bulge test: a rubber membrane, clamped at its rim, is inflated, and the height of its top is measured.

A Gent sheet (mu, Jm = `lock`, bulk modulus `ratio` mu), a disc or a square of radius or half side 50 mm, 1 mm thick,
clamped on its edge under a follower pressure. Small heights determine the shear modulus, large ones the stiffening of
the rubber; so `warp-pd fit bulge_test DATA.csv --vary mu,lock --measure center_deflection` finds both from one curve of
height against pressure (docs/fitting.md). `prestretch` is the stretch at which the sheet was clamped. The pressure
rises with the load factor in `load_steps` steps.

The reference for the disc is the exact membrane of incompressible rubber (tools/references/shooting.py); the
discrete one is slightly compressible.
"""

from warp_pd import BondAssociated, Fixed, Gent, InputError, Measure, Newton, Pressure, Sheet, Simulation
from warp_pd.device.checks import count, one_of, positive
from warp_pd.fitting import Deflection
from warp_pd.shapes.curves import Circle

RADIUS, DENSITY = 0.05, 1000.0
# Height of the top [m] by pressure [Pa], with the defaults, but incompressible.
HEIGHT = {20e3: 0.082526, 40e3: 0.123409}


def build(
    points: int = 21,
    horizon: float = 2.015,
    shape: str = "circle",
    mu: float = 0.4e6,
    lock: float = 30.0,
    ratio: float = 1000.0,
    thickness: float = 1e-3,
    pressure: float = 40e3,
    prestretch: float = 1.0,
    load_steps: int = 10,
    tolerance: float | None = None,
) -> Simulation:
    """Build the scene.

    Args:
        shape: Rim: "circle" or "square".
        mu: Shear modulus [Pa].
        lock: Jm of the Gent rubber [-].
        ratio: Bulk over shear modulus [-].
        thickness: Thickness [m].
    """
    one_of("shape", shape, ("circle", "square"))
    count("points", points, 5)
    if positive("prestretch", prestretch) < 1.0:
        raise InputError(f"prestretch = {prestretch!r}: expected 1 or more")
    size = {"thickness": thickness, "density": DENSITY}
    if shape == "circle":
        sheet = Sheet.outline(Circle((0.0, 0.0), RADIUS), spacing=2.0 * RADIUS / (points - 1), **size)
    else:
        sheet = Sheet.rectangle(2.0 * RADIUS, 2.0 * RADIUS, points=points, origin=(-RADIUS, -RADIUS), **size)
    rim = sheet.edges("all")
    centre = sheet.nearest(0.0, 0.0)
    if prestretch > 1.0:
        sheet = sheet.prestretched(prestretch)
    standard = (mu, lock, thickness, prestretch, shape) == (0.4e6, 30.0, 1e-3, 1.0, "circle")
    return Simulation(
        sheet,
        force=BondAssociated(Gent(mu, ratio * mu, lock), horizon=horizon, weights="corrected"),
        loads=[Fixed(rim), Pressure(pressure)],
        solver=Newton(tolerance=tolerance, load_steps=load_steps),
        measures=[
            Measure("pressure", "Pa", lambda built, frame: pressure * frame.time),
            Measure(
                "center_deflection",
                "m",
                Deflection(centre, "z"),
                HEIGHT.get(pressure) if standard else None,
                "exact membrane, incompressible Gent",
            ),
        ],
        section="own bulge",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    plots.surfaces(folder / "bulge.png", plots.frames_at(folder, [history[-1]["time"]]), field="u3", label="u3 (m)")
    plots.curves(
        folder / "curve.png",
        history,
        ["center_deflection"],
        ylabel="height (m)",
        against="pressure",
        xlabel="pressure (Pa)",
    )
