"""A blunt needle is pushed through a sheet.

A neo-Hookean sheet of rubber (mu 0.4 MPa, 1 mm), clamped at its edges, tears at a tearing energy.
The needle is a capsule, as thick as the points resolve, with friction. The sheet is drawn into a cone, tears at the
tip, and slips up the shaft. There is no closed form: the force grows, and falls as the sheet tears.
"""

from warp_pd import (
    BodyPath,
    BondAssociated,
    Capsule,
    Explicit,
    Fixed,
    Measure,
    NeoHookean,
    Outcome,
    RigidBody,
    Sheet,
    Simulation,
    TearingEnergy,
    TensionField,
)
from warp_pd.device.checks import count, positive
from warp_pd.measures import largest, time_above, worst_balance

MU = 0.4e6


def build(
    points: int = 61,
    horizon: float = 2.015,
    tearing_energy: float = 5e3,
    damage_length: float | None = None,
    thickness: float = 4.0,
    speed: float = 2.0,
    depth: float = 0.12,
    friction: float = 0.3,
    damping: float = 5.0,
    frames: int = 60,
    safety: float = 0.4,
) -> Simulation:
    """Build the scene.

    Args:
        damage_length: Length of the damage field [m]; by default that of TearingEnergy.
        thickness: Diameter of the needle, in spacings.
        speed: Speed of the needle [m/s].
        depth: Distance by which the tip is pushed [m].
    """
    sheet = Sheet.rectangle(0.15, 0.15, thickness=1e-3, density=1000.0, points=count("points", points, 21))
    diameter, length = positive("thickness", thickness) * sheet.spacing, 0.2
    begin = 0.5 * (length + 1.02 * diameter)
    duration = positive("depth", depth) / positive("speed", speed)
    way = BodyPath([0.0, duration], [(0.075, 0.075, begin), (0.075, 0.075, begin - depth)])
    clamp = sheet.edges("all")
    return Simulation(
        sheet,
        force=BondAssociated(TensionField(NeoHookean(mu=MU, bulk=100.0 * MU)), horizon=horizon),
        loads=[Fixed(clamp)],
        contact=RigidBody(Capsule(diameter, length), way, friction=friction, name="needle"),
        damage=TearingEnergy(tearing_energy, damage_length, spared=clamp),
        solver=Explicit(duration, frames=frames, damping=damping, safety=safety),
        measures=[Measure("torn_area_share", "1", lambda built, frame: 1.0 - frame.intact_faces.mean())],
        outcomes=[
            Outcome("largest_needle_force", "N", largest("needle_force_z")),
            Outcome("tear_begins", "s", time_above("torn_area_share", 0.0)),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        section="blunt needle",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    last = history[-1]["time"]
    shown = plots.frames_at(folder, [fraction * last for fraction in (0.25, 0.5, 0.75, 1.0)])
    plots.surfaces(folder / "needle.png", shown, field="damage", limits=(0.0, 1.0))
    plots.curves(folder / "force.png", history, ["needle_force_z"], ylabel="force on the needle (N)")
