"""Energy of elastic strips of scene `stable_crack` with cuts of several lengths: finds its numbers STORED.

    python tools/stable_crack.py --points 32        # some minutes

It prints their coefficients, and how far the energy release rate from them is from differences of the energies.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import numpy as np
from numpy.polynomial.polynomial import polyvander2d
from study import at_least_one

from warp_pd import BondAssociated, NeoHookean, Newton, Simulation
from warp_pd.scenes import stable_crack

SLOPES = np.linspace(0.03, 0.1, 8)
POWERS = (3, 1)


def energies(points: int, horizon: float = 2.015) -> tuple[np.ndarray, np.ndarray]:
    """Lengths of cuts [m], each half a spacing beyond a point, and energies [J], shape (lengths, slopes)."""
    cells = round(stable_crack.LENGTH * points) - 1
    size = stable_crack.LENGTH * stable_crack.HEIGHT / cells
    wanted = np.arange(1.0, stable_crack.LONGEST + 0.1, 0.25) * stable_crack.HEIGHT
    lengths = ((wanted / size).round() + 0.5) * size
    stored = []
    for length in lengths:
        times = np.linspace(0.0, 1.0, len(SLOPES) + 1)
        sheet, loads, _ = stable_crack.wedged_strip(points, horizon, length, times, [0.0, *SLOPES])
        force = BondAssociated(NeoHookean(stable_crack.MU, 100.0 * stable_crack.MU), horizon=horizon)
        result = Simulation(sheet, force, Newton(load_steps=len(SLOPES)), loads=loads).run(device="cpu")
        stored.append([row["strain"] for row in result.history[1:]])
    return lengths, np.array(stored)


def main(arguments: Sequence[str] | None = None) -> int:
    """Solve, fit, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=at_least_one, default=32, help="rows of points")
    lengths, stored = energies(parser.parse_args(arguments).points)
    over_pure_shear = stored / stable_crack.pure_shear_energy(lengths[:, None], SLOPES)
    a, slopes = np.meshgrid(lengths / stable_crack.HEIGHT - 2.0, SLOPES, indexing="ij")
    found = np.linalg.lstsq(polyvander2d(a.ravel(), slopes.ravel(), POWERS), over_pure_shear.ravel(), rcond=None)[0]
    print(found.reshape(np.array(POWERS) + 1).round(4).tolist())
    differences = -np.diff(stored, axis=0) / np.diff(lengths)[:, None] / stable_crack.THICKNESS
    middles = 0.5 * (lengths[1:] + lengths[:-1])
    off = stable_crack.release_rate(middles[:, None], SLOPES) / differences - 1.0
    print(f"largest difference of G, with the numbers of the scene: {np.abs(off).max():.2%}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
