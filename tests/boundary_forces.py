"""Small sheets that carry the empirical boundary force, and displacements of them."""

from functools import cache

import numpy as np
from helpers import build, jittered, square

from warp_pd import BoundaryForce, CriticalStretch
from warp_pd.families import build_families

A = 2e12
HORIZON = 2.015
SHEETS = {
    "lattice": lambda: square(9),
    "cloud": lambda: square(9).as_cloud(),
    "jittered": lambda: jittered(9),
    "cut": lambda: square(9).cut((-0.01, 0.0444), (0.0511, 0.0444)),
}


@cache
def built_on(sheet="lattice", form="normal", precision=64, points=None, breakable=False):
    return build(
        SHEETS[sheet](), horizon=HORIZON, precision=precision,
        loads=[BoundaryForce(A, points=None if points is None else list(points), form=form)],
        damage=CriticalStretch(50.0) if breakable else None,
    )  # fmt: skip


def families_of(sheet, horizon):
    return build_families(sheet, horizon, "linear")


def positions(sheet, displacement):
    return np.column_stack([sheet.points, np.zeros(sheet.size)]) + displacement


def rotated(sheet, displacement, rotation):
    """Displacement of the same shape after a rotation."""
    return positions(sheet, displacement) @ rotation.T - positions(sheet, 0.0)


def rotation_of(seed):
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.linalg.det(q)


def lifted(sheet, point, height):
    u = np.zeros((sheet.size, 3))
    u[point, 2] = height
    return u
