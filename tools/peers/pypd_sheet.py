"""Time steps of pypd on a square sheet; run by compare.py with the interpreter of the peers.

python pypd_sheet.py FOLDER_OF_PYPD POINTS_ALONG_A_SIDE STEPS    prints seconds a step and bonds a point
"""

import sys
from time import perf_counter

import numpy as np
from numba import njit


@njit
def brittle(stiffness, stretch, damage):
    """Damage of a bond: 1 beyond a stretch that is never reached here."""
    return max(damage, 1.0 if stretch >= 10.0 else 0.0)


def main() -> None:
    """Time the force and the integrator of pypd, as its own simulation calls them."""
    folder, points, steps = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    sys.path.insert(0, folder)
    from pypd.kernels.bonds import build_bond_list
    from pypd.kernels.integrator import euler_cromer
    from pypd.kernels.particles import build_particle_families, compute_nodal_forces_cpu

    spacing = 1e-3
    x = spacing * np.stack(np.meshgrid(np.arange(points), np.arange(points)), axis=-1).reshape(-1, 2).astype(float)
    members, counts = build_particle_families(x, 3.015 * spacing)
    bonds = build_bond_list([row[:n] for row, n in zip(members, counts, strict=True)])
    u = np.random.default_rng(0).uniform(-0.01, 0.01, x.shape) * spacing
    damage, f_x, f_y, ones = np.zeros(len(bonds)), np.zeros(len(bonds)), np.zeros(len(bonds)), np.ones(len(bonds))
    stiff = np.full(len(bonds), 1e12)
    v, a, held = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)

    def run(n: int) -> float:
        begin = perf_counter()
        for _ in range(n):
            force, _ = compute_nodal_forces_cpu(x, u, spacing**3, bonds, damage, stiff, f_x, f_y, brittle, ones)
            euler_cromer(force, u, v, a, 2200.0, held, 0.0, held, 0.0, 1e-12)
        return (perf_counter() - begin) / n

    run(3)
    print(min(run(steps) for _ in range(5)), 2 * len(bonds) / len(x))


if __name__ == "__main__":
    main()
