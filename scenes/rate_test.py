"""A square of rubber is pulled or compressed at a constant rate, the test of VE sections 2.2 and 2.3 (figures 2 and 3).

A quarter of 60 x 60 x 1 mm on rollers, held in its plane: a uniaxial state. Constants are those of high-damping
rubber (table 1): Yeoh's c10 and c20, and a Prony term whose relaxation time falls with the rate. With `maxwell_1` above
zero there are one to three Maxwell elements instead. The rates of the paper are 0.24 and 0.88 /s for this rubber, and
0.15 and 14 /s for the polyurea of table 2. Nothing in such a test is fast beside waves, so `Implicit` steps from one
equilibrium to the next. It takes no relaxation time that depends on the rate: with `prony_exponent` above zero steps
are explicit, and a density is taken with which waves pass the sheet a hundred times. The reference is the exact stress
of the law along the ramp.

Curves of tests at several rates tell the constants, without a simulation:

    warp-pd fit rate_test slow.csv fast.csv --vary c10,c20,prony_c10,prony_c20,prony_time

with columns "uniaxial [1]" (the stretch), "stress [MPa]" and "rate [1/s]" (docs/fitting.md).
"""

import numpy as np

from warp_pd import (
    Explicit,
    Fixed,
    Implicit,
    Maxwell,
    Measure,
    Motion,
    Outcome,
    Prony,
    Reaction,
    Sheet,
    Simulation,
    Visco,
    Yeoh,
)
from warp_pd.device.checks import InputError, count, positive
from warp_pd.fitting import rate_stress

LENGTH, THICKNESS = 0.03, 1e-3
PASSAGES = 100


def build(
    points: int = 7,
    horizon: float = 2.015,
    stretch: float = 0.5,
    rate: float = 0.24,
    steps: int = 200,
    c10: float = 0.1438e6,
    c20: float = 0.1438e6,
    prony_c10: float = 0.0587e6,
    prony_c20: float = 0.0562e6,
    prony_time: float = 0.8673,
    prony_exponent: float = 0.1,
    maxwell_1: float = 0.0,
    time_1: float = 1.0,
    maxwell_2: float = 0.0,
    time_2: float = 10.0,
    maxwell_3: float = 0.0,
    time_3: float = 100.0,
) -> Simulation:
    """Build the scene.

    Args:
        points: Points along an edge.
        stretch: Stretch at the end; below 1 the strip is compressed.
        rate: |d stretch / dt| [1/s].
        steps: Time steps of `Implicit`.
        c10: First constant of Yeoh's material [Pa].
        c20: Second constant of Yeoh's material [Pa].
        prony_c10: First constant of the Prony term [Pa].
        prony_c20: Second constant of the Prony term [Pa].
        prony_time: Its relaxation time at the rate 1/s [s].
        prony_exponent: Exponent of the rate in its relaxation time.
        maxwell_1: Shear modulus of the first Maxwell element [Pa]; 0: none.
        time_1: Its relaxation time [s].
        maxwell_2: Shear modulus of the second Maxwell element [Pa]; 0: none.
        time_2: Its relaxation time [s].
        maxwell_3: Shear modulus of the third Maxwell element [Pa]; 0: none.
        time_3: Its relaxation time [s].
    """
    if positive("stretch", stretch) == 1.0:
        raise InputError(f"stretch = {stretch!r}: expected a stretch other than 1")
    elements = ((maxwell_1, time_1), (maxwell_2, time_2), (maxwell_3, time_3))
    branches = [Maxwell(modulus, time) for modulus, time in elements if modulus != 0.0]
    prony = [] if branches else [Prony(prony_c10, prony_c20, prony_time, prony_exponent)]
    law = Visco(Yeoh(c10, c20), horizon=horizon, prony=prony, branches=branches)
    duration = abs(stretch - 1.0) / positive("rate", rate)
    young = 6.0 * c10 + sum(6.0 * term.c10 for term in prony)
    density = young * (duration / (PASSAGES * LENGTH)) ** 2
    sheet = Sheet.rectangle(LENGTH, LENGTH, thickness=THICKNESS, density=density, points=points)
    left, right = sheet.edges("left"), sheet.edges("right")
    stepwise = Implicit(duration, frames=20, steps=count("steps", steps, 20), inertia=False)
    in_waves = any(term.exponent != 0.0 for term in prony)
    speed = np.copysign(rate, stretch - 1.0)
    start = speed * np.stack([sheet.points[:, 0], -0.5 * sheet.points[:, 1], np.zeros(sheet.size)], axis=1)
    exact = rate_stress(law, "uniaxial", rate, np.array([stretch]))[0]

    def stress(rows):
        """Nominal stress at the end [Pa]."""
        return rows[-1]["pull_x"] / (LENGTH * THICKNESS)

    return Simulation(
        sheet,
        law,
        Explicit(duration, frames=20, damping=10.0 / duration) if in_waves else stepwise,
        loads=[
            Fixed(left, "x"),
            Fixed(sheet.edges("bottom"), "y"),
            Fixed(np.arange(sheet.size), "z"),
            Motion(right, [0.0, duration], x=[0.0, LENGTH * (stretch - 1.0)]),
            Reaction(right, "pull"),
        ],
        measures=[Measure("stretch", "1", lambda built, frame: 1.0 + frame.displacement[right[0], 0] / LENGTH)],
        outcomes=[Outcome("nominal_stress", "Pa", stress, exact, "exact stress along the ramp")],
        initial_velocity=start if in_waves else None,
        section="VE 2.2 and 2.3",
        pictures=pictures,
    )  # fmt: skip


def pictures(history, folder):
    from warp_pd.viewer import plots

    plots.curves(
        folder / "stress.png", history[1:], ["pull_x"], ylabel="force (N)", against="stretch", xlabel="stretch"
    )
