"""Constants of an acrylic from one relaxation test; forces of strips that are pulled at three rates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

import numpy as np
from scipy.optimize import nnls
from study import whole
from treloar import DATA

from validation.comparison import Comparison, median_deviation
from warp_pd import Explicit, Fixed, Maxwell, Measure, Motion, NeoHookean, Sheet, Simulation, TensionField, Visco
from warp_pd.fitting import read_table
from warp_pd.measures import support_force
from warp_pd.visco.uniform import maxwell_stress

# Times of the branches [s], one a decade of the test; the strips are as long as theirs, their cross-section is unknown.
TIMES, LENGTH, SECTION = (1.0, 10.0, 100.0, 1000.0), 0.08, 1e-5
HELD, RAMP = 2.0, 0.25
RATES = {"slow": 0.01, "middle": 0.03, "fast": 0.05}


def columns(*names: str) -> list[np.ndarray]:
    """Columns of their data without gaps."""
    table = read_table(DATA.with_name("vhb.csv")).columns
    return [table[name][np.isfinite(table[name])] for name in names]


@lru_cache
def moduli() -> tuple[float, ...]:
    """Moduli [Pa] of the network and the branches: least relative squares of the relaxation test, none negative."""
    at, force = columns("time", "relaxation")
    times = np.union1d(np.concatenate([np.linspace(0.0, 8.0, 400), np.geomspace(8.0, at[-1], 800)]), at)
    stretches = np.minimum(1.0 + RAMP * times, HELD)
    bases = [
        stretches - stretches**-2,
        *(maxwell_stress(Maxwell(1.0, time), times, stretches, stretches**-0.5) for time in TIMES),
    ]
    design = np.column_stack([np.interp(at, times, basis) for basis in bases])
    return tuple((nnls(design / force[:, None], np.ones(len(at)))[0] / SECTION).tolist())


def forces(points: int, rate: float, device: str | None) -> np.ndarray:
    """Forces [N] on a strip at the stretches of the tests."""
    stretches = columns("stretch")[0]
    duration = (stretches[-1] - 1.0) / rate
    network, *branches = moduli()
    # Waves cross the strip in a 250th of the time.
    density = 3.0 * sum(moduli()) * (duration / 250.0 / LENGTH) ** 2
    width = LENGTH / 4.0
    sheet = Sheet.rectangle(
        LENGTH, width, thickness=SECTION / width, density=density, points=(points, max(3, (points + 3) // 4))
    )
    left, right = sheet.edges("left"), sheet.edges("right")
    result = whole(
        Simulation(
            sheet,
            Visco(
                TensionField(NeoHookean(network, 1e3 * network)),
                horizon=2.015,
                branches=[
                    Maxwell(modulus, time) for modulus, time in zip(branches, TIMES, strict=True) if modulus > 0.0
                ],
            ),
            Explicit(duration, frames=140, damping=20.0 / duration),
            loads=[
                Fixed(left, "x"),
                Fixed(np.arange(sheet.size), "z"),
                Fixed([sheet.nearest(0.0, 0.5 * width)], "y"),
                Motion(right, times=[0.0, duration], x=[0.0, (stretches[-1] - 1.0) * LENGTH]),
            ],
            initial_velocity=np.column_stack([rate * sheet.points[:, 0], np.zeros((sheet.size, 2))]),
            measures=[Measure("pull", "N", lambda built, frame: abs(support_force(built, left)[0]))],
        ).run(device=device, usd=False, pictures=False)
    )
    at = [1.0 + rate * row["time"] for row in result.history]
    return np.interp(stretches, at, [row["pull"] for row in result.history])


def fast(points: int, device: str | None) -> Sequence[float]:
    """Forces [N] at the largest rate."""
    return list(forces(points, RATES["fast"], device))


def other_rates(points: int, device: str | None) -> Mapping[str, float]:
    """Median deviations at the smaller rates."""
    return {
        f"median deviation at {RATES[name]:g} /s": median_deviation(
            list(forces(points, RATES[name], device)), columns(name)[0]
        )
        for name in ("middle", "slow")
    }


def row() -> Comparison:
    """The comparison with the strips."""
    stretches, force = columns("stretch", "fast")
    return Comparison(
        "rates", tuple(stretches.tolist()), tuple(force.tolist()), LENGTH, (9,), (9, 17), fast, other_rates
    )


ROWS: tuple[Callable[[], Comparison], ...] = (row,)
