"""A ball is pushed through a clamped silicone sheet with a slit: force and depth when the slit tears open.

A square of 60 mm, 0.3 mm thick, mu 0.4 MPa, Gc 1 kJ/m^2, rho 1000 kg/m^3; a rigid ball of 30 mm in diameter is lowered
onto its middle, which has a slit of 12 mm. There is no closed form. The check is that force and depth at puncture
depend on neither the grid nor the spacing: the slit is a crack, which grows when its energy release rate reaches Gc. So
it must be much longer than the damage length and than Gc / mu, here 2.5 mm. Through a slit of 4 mm in latex, whose Gc /
mu is 12 mm, the ball slips without tearing. A sheet without a crack (`slit` = 0) tears where its energy density reaches
3 Gc / (16 damage_length).

The sheet snaps back when the ball is through. Only then do the energies miss their balance, by an amount that goes
with the squared step, whatever breaks: 0.5 % at the default `safety` of tears, half of it here.
"""

from warp_pd import (
    BondAssociated,
    Explicit,
    Fixed,
    Measure,
    NeoHookean,
    Outcome,
    RigidBall,
    Sheet,
    Simulation,
    TearingEnergy,
)
from warp_pd.device.checks import count, not_negative, positive, resolved
from warp_pd.materials import with_wrinkles
from warp_pd.measures import TearLine, at_peak, time_above, when_above, worst_balance

SIZE, THICKNESS, DENSITY, MU = 0.06, 0.3e-3, 1000.0, 0.4e6
BALL = 0.03


def build(
    points: int = 61,
    horizon: float = 2.015,
    tearing_energy: float = 1e3,
    damage_length: float | None = None,
    slit: float = 12e-3,
    speed: float = 1.0,
    depth: float = 0.04,
    damping: float = 50.0,
    frames: int = 100,
    safety: float = 0.35,
    turn: float = 0.0,
    jitter: float = 0.0,
    seed: int = 0,
) -> Simulation:
    """Build the scene.

    Args:
        damage_length: Length of the damage field [m]; by default that of TearingEnergy.
        slit: Length of the slit [m]; 0: there is none.
        speed: Speed of the ball, slow against waves of 20 to 100 m/s [m/s].
        depth: Distance by which the ball is lowered [m].
    """
    sheet = Sheet.filled(
        SIZE, SIZE, thickness=THICKNESS, density=DENSITY, points=count("points", points, 9), turn=turn, jitter=jitter,
        seed=seed,
    )  # fmt: skip
    middle = 0.5 * SIZE
    if not_negative("slit", slit) > 0.0:
        resolved("slit", slit, sheet.spacing)
        sheet = sheet.cut((middle - 0.5 * slit, middle), (middle + 0.5 * slit, middle))
    clamp = sheet.edges("all")
    line = TearLine(sheet)
    duration = positive("depth", depth) / positive("speed", speed)
    return Simulation(
        sheet,
        force=BondAssociated(with_wrinkles(NeoHookean(MU, 100.0 * MU), "relaxed"), horizon=horizon),
        loads=[Fixed(clamp)],
        contact=RigidBall(diameter=BALL, start=(middle, middle, 0.5 * BALL), velocity=(0.0, 0.0, -speed)),
        damage=TearingEnergy(tearing_energy, damage_length, spared=clamp),
        solver=Explicit(duration=duration, frames=count("frames", frames, 1), damping=damping, safety=safety),
        measures=[
            Measure("depth", "m", lambda built, frame: speed * frame.time),
            Measure("crack_length", "m", lambda built, frame: line.length(frame.intact_faces)),
        ],
        outcomes=[
            Outcome("puncture_force", "N", at_peak("ball_force_z", "ball_force_z")),
            Outcome("puncture_depth", "m", when_above("depth", "crack_length", slit)),
            Outcome("tear_begins", "s", time_above("crack_length", 0.0)),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        section="Silicone puncture",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    duration = history[-1]["time"]
    shown = plots.frames_at(folder, [fraction * duration for fraction in (0.25, 0.5, 0.75, 1.0)])
    plots.surfaces(folder / "damage.png", shown, field="damage", limits=(0.0, 1.0))
    plots.curves(
        folder / "force.png", history, ["ball_force_z"], ylabel="force on the ball (N)", against="depth",
        xlabel="depth (m)",
    )  # fmt: skip
    plots.curves(folder / "energy.png", history, plots.ENERGIES, ylabel="energy (J)")
