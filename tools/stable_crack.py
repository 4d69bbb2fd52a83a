"""Energy of elastic strips of scene `stable_crack` with cuts of several lengths: finds its numbers STORED.

    python tools/stable_crack.py --points 16 24 32        # some minutes

The end of a cut gives the energies an error of first order, so they are fitted with a term in the spacing. The tool
prints the coefficients without it, and the largest residual.
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

SLOPES = np.linspace(0.03, 0.1, 5)
POWERS = (3, 1)


def energies(points: int, horizon: float = 2.015) -> tuple[np.ndarray, np.ndarray]:
    """Lengths of cuts [m], shape (A,), and energies of the strips [J], shape (A, slopes)."""
    size = stable_crack.LENGTH * stable_crack.HEIGHT / (round(stable_crack.LENGTH * points) - 1)
    wanted = np.arange(1.0, stable_crack.LONGEST + 0.1, 0.25) * stable_crack.HEIGHT
    # Where the end of a cut severs the same bonds on either side: in the middle between a diagonal and a column.
    lengths = ((wanted / size).round() + 0.75) * size
    times = np.linspace(0.0, 1.0, len(SLOPES) + 1)
    force = BondAssociated(NeoHookean(stable_crack.MU, 100.0 * stable_crack.MU), horizon=horizon)
    stored = []
    for length in lengths:
        sheet, loads, _ = stable_crack.wedged_strip(points, length, times, [0.0, *SLOPES])
        result = Simulation(sheet, force, Newton(load_steps=len(SLOPES)), loads=loads).run(device="cpu")
        stored.append([row["strain"] for row in result.history[1:]])
    return lengths, np.array(stored)


def main(arguments: Sequence[str] | None = None) -> int:
    """Solve, fit, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=at_least_one, nargs="+", default=[16, 24, 32], help="rows of points")
    rows, values = [], []
    for points in parser.parse_args(arguments).points:
        lengths, stored = energies(points)
        values.append((stored / stable_crack.pure_shear_energy(lengths[:, None], SLOPES)).ravel())
        a, slopes = np.meshgrid(lengths / stable_crack.HEIGHT - 2.0, SLOPES, indexing="ij")
        terms = polyvander2d(a.ravel(), slopes.ravel(), POWERS)
        rows.append(np.hstack([terms, terms / (points - 1)]))
    matrix, right_side = np.vstack(rows), np.concatenate(values)
    found = np.linalg.lstsq(matrix, right_side, rcond=None)[0]
    print(found[: found.size // 2].reshape(np.array(POWERS) + 1).round(4).tolist())
    print(f"largest residual {np.abs(matrix @ found - right_side).max():.1e}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
