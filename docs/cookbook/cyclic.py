"""A strip that is shaken slowly, and the heat of a cycle.

`Implicit` takes steps that no wave limits; `Motion(..., repeat=)` repeats its knots. A strain e of a Maxwell element
of shear modulus G turns 3 pi e^2 G'' into heat in a cycle and a volume, G'' = G w t / (1 + (w t)^2).
"""

import numpy as np

from warp_pd import Fixed, Implicit, Maxwell, MooneyRivlin, Motion, Outcome, Reaction, Sheet, Simulation, Visco
from warp_pd.visco.cycles import loss_per_cycle


def build(points=13, amplitude=0.01, cycles=6):
    """A strip that is shaken, slowly: what it turns into heat in a cycle."""
    length, width, thickness, mu, modulus, tau, period = 0.06, 0.02, 1e-3, 3e5, 2e5, 0.5, 2.0
    sheet = Sheet.rectangle(length, width, thickness=thickness, density=1000.0, points=points)
    left, right = sheet.edges("left"), sheet.edges("right")
    knots = np.linspace(0.0, period, 41)
    shaken = Motion(right, knots, x=lambda t: amplitude * length * np.sin(2.0 * np.pi * t / period), repeat=cycles)
    turn = 2.0 * np.pi * tau / period
    exact = 3.0 * np.pi * amplitude**2 * modulus * turn / (1.0 + turn**2) * length * width * thickness
    return Simulation(
        sheet,
        Visco(MooneyRivlin(0.5 * mu), horizon=2.015, branches=[Maxwell(modulus, tau)]),
        Implicit(cycles * period, 40 * cycles, steps=40 * cycles, inertia=False),
        loads=[
            Fixed(left, "x"), Fixed([sheet.nearest(0.0, 0.0)], "y"), Fixed(np.arange(sheet.size), "z"), shaken,
            Reaction(right, "pull"),
        ],
        outcomes=[
            Outcome("loss", "J", lambda rows: loss_per_cycle(rows, shaken, period, "pull"), exact, "3 pi e^2 G''"),
        ],
    )  # fmt: skip
