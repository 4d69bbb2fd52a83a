"""A strip of viscoelastic rubber is stretched a thousand times between 1.2 and 1.4 times its length, in 2 s each time.

Incompressible neo-Hookean rubber of mu 0.3 MPa with a Maxwell element of 0.2 MPa and 0.5 s, 60 x 25 x 1 mm, on grips
that let it contract, so that its state is uniaxial tension. Waves pass the strip in 3 ms, a cycle takes 2 s: `Implicit`
steps a tenth of a cycle at a time. Loss per cycle, storage and loss modulus of the last cycle are compared with
quadrature of the steady cycle of one element, M' = (C^-1 - M) / tau.

`--set wave=sine --set steps=60` takes a sine, which is linear between the knots of its motion.
"""

import math
from collections.abc import Callable

import numpy as np

from warp_pd import (
    Fixed,
    Implicit,
    Maxwell,
    Measure,
    MooneyRivlin,
    Motion,
    Outcome,
    Reaction,
    Sheet,
    Simulation,
    Visco,
)
from warp_pd.device.checks import count, one_of
from warp_pd.visco.cycles import dynamic_stiffness, loss_per_cycle

LENGTH, WIDTH, THICKNESS, DENSITY = 0.06, 0.025, 1e-3, 1000.0
MU, MODULUS, TAU, PERIOD = 3e5, 2e5, 0.5, 2.0
LEAST, MOST = 1.2, 1.4


def build(
    columns: int = 25,
    horizon: float = 2.015,
    cycles: int = 1000,
    steps: int = 10,
    wave: str = "triangle",
    inertia: bool = False,
) -> Simulation:
    """Build the scene.

    Args:
        columns: Points along the strip.
        cycles: Number of cycles.
        steps: Steps in a cycle.
        wave: "triangle" or "sine".
        inertia: Whether the strip has inertia.
    """
    one_of("wave", wave, ("triangle", "sine"))
    count("steps", steps, 8)
    spacing = LENGTH / (columns - 1)
    sheet = Sheet.rectangle(
        LENGTH, WIDTH, thickness=THICKNESS, density=DENSITY, points=(columns, round(WIDTH / spacing) + 1)
    )
    left, right = sheet.edges("left"), sheet.edges("right")
    knots = np.linspace(0.0, PERIOD, 3 if wave == "triangle" else steps + 1)
    motion = Motion(right, knots, x=lambda t: LENGTH * (stretch(wave, t) - 1.0), repeat=cycles)
    x, y = sheet.points.T
    start = np.stack([(LEAST - 1.0) * x, (LEAST**-0.5 - 1.0) * y, 0.0 * x], axis=1)
    end = cycles * PERIOD
    last = [end - PERIOD + PERIOD * k / steps for k in range(steps)]
    loss, modulus = steady(lambda t: stretch(wave, t))
    per_area = LENGTH / (WIDTH * THICKNESS)
    stiffness: Callable = lambda rows: dynamic_stiffness(rows, motion, PERIOD, "pull") or math.nan  # noqa: E731
    source = "quadrature of the steady cycle"
    return Simulation(
        sheet,
        Visco(MooneyRivlin(0.5 * MU), horizon=horizon, branches=[Maxwell(MODULUS, TAU)]),
        Implicit(end, [*(t for t in last if t > 0.0), end], steps=steps * cycles, inertia=inertia),
        loads=[
            Fixed(left, "x"),
            Fixed([sheet.nearest(0.0, 0.0)], "y"),
            Fixed(np.arange(sheet.size), "z"),
            motion,
            Reaction(right, "pull"),
        ],
        measures=[Measure("stretch", "1", lambda built, frame: 1.0 + frame.displacement[right[0], 0] / LENGTH)],
        outcomes=[
            Outcome(
                "loss", "J", lambda rows: loss_per_cycle(rows, motion, PERIOD, "pull"),
                loss * LENGTH * WIDTH * THICKNESS, source,
            ),
            Outcome("storage_modulus", "Pa", lambda rows: per_area * stiffness(rows).real, modulus.real, source),
            Outcome("loss_modulus", "Pa", lambda rows: per_area * stiffness(rows).imag, modulus.imag, source),
        ],
        initial_displacement=start,
        section="exact cycle",
        pictures=pictures,
    )  # fmt: skip


def pictures(history, folder):
    from warp_pd.viewer import plots

    plots.curves(folder / "hysteresis.png", history[1:], ["pull_x"], ylabel="force (N)", against="stretch",
                 xlabel="stretch")  # fmt: skip


def stretch(wave: str, t: np.ndarray) -> np.ndarray:
    """Stretch at times of the first cycle [s]."""
    if wave == "sine":
        share = 0.5 - 0.5 * np.cos(2.0 * np.pi * t / PERIOD)
    else:
        share = 1.0 - np.abs(2.0 * t / PERIOD - 1.0)
    return np.asarray(LEAST + (MOST - LEAST) * share)


def steady(path: Callable[[np.ndarray], np.ndarray], number: int = 4000) -> tuple[float, complex]:
    """Loss per volume [J/m^3] and complex modulus [Pa] of a steady cycle of uniaxial tension."""
    t = np.linspace(0.0, PERIOD, number + 1)
    fading = np.exp(t / TAU)
    at = path(t)

    def mean(values: np.ndarray) -> np.ndarray:
        """Mean of the values over the births of the chains."""
        begun = np.concatenate([[0.0], np.cumsum(0.5 * (values * fading)[1:] + 0.5 * (values * fading)[:-1])])
        begun *= PERIOD / number / TAU
        return np.asarray((begun + begun[-1] / np.expm1(PERIOD / TAU)) / fading)

    stress = MU * (at - at**-2) + MODULUS * (mean(at**-2) * at - mean(at) / at**2)
    wave = np.exp(-2j * np.pi * t / PERIOD)
    return float(np.trapezoid(stress, at)), complex(np.trapezoid(stress * wave, t) / np.trapezoid(at * wave, t))
