"""A gripper opens: its two fingers, in two holes of a sheet, pull until the sheet tears.

A strip of rubber (neo-Hookean, mu 0.4 MPa, 1 mm thick) has a hole near each end. Each finger is a capsule on a sliding
joint with a motor that drives it at a constant speed. The physics engine Newton (extra `bodies`) moves the fingers with
its solver XPBD. The sheet tears at a given tearing energy. There is no analytical solution: the force on the fingers
grows until a hole tears out to the edge.
"""

import numpy as np

from warp_pd import (
    BondAssociated,
    Circle,
    Explicit,
    Measure,
    NeoHookean,
    Outcome,
    Polygon,
    Sheet,
    Simulation,
    TearingEnergy,
    TensionField,
    newton_bodies,
)
from warp_pd.contact.newton_world import load_newton
from warp_pd.device.checks import positive
from warp_pd.measures import largest, time_above, worst_balance

LENGTH, WIDTH, RADIUS, MU = 0.12, 0.06, 8e-3, 0.4e6
HOLES = {"left": (0.03, 0.5 * WIDTH), "right": (0.09, 0.5 * WIDTH)}


def build(
    points: int = 41,
    horizon: float = 2.015,
    tearing_energy: float = 2e3,
    damage_length: float | None = None,
    speed: float = 1.0,
    motor: float = 2e3,
    mass: float = 0.2,
    friction: float = 0.3,
    damping: float = 20.0,
    newton_step: float = 5e-4,
    duration: float = 0.12,
    frames: int = 60,
    safety: float = 0.4,
) -> Simulation:
    """Build the scene.

    Args:
        damage_length: Length of the damage field [m]; by default that of TearingEnergy.
        speed: Speed that the motor of each finger tries to reach [m/s].
        motor: Force of a motor divided by the difference from its target speed [N s/m].
        mass: Mass of a finger [kg].
        newton_step: Step of Newton's solver [s].
    """
    newton = load_newton()
    sheet = Sheet.outline(
        Polygon([(0.0, 0.0), (LENGTH, 0.0), (LENGTH, WIDTH), (0.0, WIDTH)]),
        spacing=LENGTH / (positive("points", points) - 1),
        thickness=1e-3,
        density=1000.0,
        holes={f"{name} hole": Circle(centre, RADIUS) for name, centre in HOLES.items()},
    )
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    surface = newton.ModelBuilder.ShapeConfig(density=0.0, mu=friction)
    turn = (1e-4 * np.eye(3) * positive("mass", mass)).ravel().tolist()
    for (name, centre), sign in zip(HOLES.items(), (-1.0, 1.0), strict=True):
        place = (*centre, 0.0, 0.0, 0.0, 0.0, 1.0)
        finger = builder.add_link(xform=place, mass=mass, inertia=turn, label=name)
        builder.add_shape_capsule(finger, radius=0.6 * RADIUS, half_height=0.02, cfg=surface, label=name)
        slide = builder.add_joint_prismatic(
            -1, finger, parent_xform=place, axis=(1.0, 0.0, 0.0), target_qd=sign * speed, target_ke=0.0,
            target_kd=motor, actuator_mode=newton.JointTargetMode.VELOCITY, label=f"{name}_slide",
        )  # fmt: skip
        builder.add_articulation([slide], label=name)
    return Simulation(
        sheet,
        force=BondAssociated(TensionField(NeoHookean(mu=MU, bulk=100.0 * MU)), horizon=horizon),
        contact=newton_bodies(
            builder, lambda model: newton.solvers.SolverXPBD(model, iterations=10), newton_step, collide=False
        ),
        damage=TearingEnergy(tearing_energy, damage_length),
        solver=Explicit(duration, frames=frames, damping=damping, safety=safety),
        measures=[
            Measure("opening", "m", lambda built, frame: float(np.diff([c.pose()[0] for c in built.contacts[:2]])[0])),
            Measure("torn_area_share", "1", lambda built, frame: 1.0 - frame.intact_faces.mean()),
        ],
        outcomes=[
            Outcome("largest_force", "N", largest("left_force_x")),
            Outcome("tear_begins", "s", time_above("torn_area_share", 0.0)),
            Outcome("worst_energy_balance", "1", worst_balance),
        ],
        section="two fingers",
        pictures=pictures,
    )


def pictures(history, folder):
    from warp_pd.viewer import plots

    last = history[-1]["time"]
    shown = plots.frames_at(folder, [fraction * last for fraction in (0.25, 0.5, 0.75, 1.0)])
    plots.surfaces(folder / "gripper.png", shown, field="damage", limits=(0.0, 1.0))
    plots.curves(folder / "force.png", history, ["left_force_x", "right_force_x"], ylabel="force on the fingers (N)")
