"""What the tests of curved sheets share: small ones, and a rough motion of any."""

import numpy as np

from warp_pd import CriticalStretch, Sheet, TearingEnergy
from warp_pd.families import pack

THICKNESS = 0.01


def small_sphere(points=6):
    return Sheet.sphere(1.0, thickness=THICKNESS, density=1000.0, points=points)


def small_tube(points=24, length=2.0):
    return Sheet.tube(1.0, length, thickness=THICKNESS, density=1000.0, points=points)


def saddle(points=13):
    """Part of z = (x^2 - y^2) / 4 on an uneven grid, an open surface of triangles."""
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, points), np.linspace(-0.5, 0.5, points))
    x, y = (u + 0.05 * np.sin(6.0 * v)).ravel(), (v + 0.05 * np.sin(5.0 * u)).ravel()
    row, column = np.mgrid[: points - 1, : points - 1]
    a = (row * points + column).ravel()
    triangles = np.concatenate(
        [np.column_stack([a, a + 1, a + 1 + points]), np.column_stack([a, a + 1 + points, a + points])]
    )
    return Sheet.from_surface(
        np.column_stack([x, y, 0.25 * (x**2 - y**2)]), triangles, thickness=THICKNESS, density=1000.0
    )


SHEETS = {"sphere": small_sphere, "tube": small_tube, "saddle": saddle}
STATES = {
    "plain": {},
    "corrected": {"weights": "corrected"},
    "torn": {"damage": CriticalStretch(1e3)},
    "softened": {"damage": TearingEnergy(300.0)},
}


def rough_motion(sheet, seed=0):
    """A displacement that grows, bends and shakes the sheet [m], shape (N, 3)."""
    smooth = 0.15 * sheet.points + 0.05 * np.sin(3.0 * sheet.points[:, [1, 2, 0]])
    return smooth + 0.03 * sheet.spacing * np.random.default_rng(seed).normal(size=sheet.points.shape)


def rotation():
    """A large rotation, shape (3, 3)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec([1.0, 2.0, -0.5]).as_matrix()


def tear(built):
    """Break the bonds across a plane through half of the sheet, as rupture would."""
    sheet, families = built.simulation.sheet, built.law.families
    members = families.members_of(np.arange(sheet.size))
    height = sheet.points @ (1.0, 0.2, 0.1) - 0.05
    torn_half = sheet.points[:, 1] > 0.0
    across = (height[:, None] > 0.0) != (height[members] > 0.0)
    lost = (members >= 0) & across & torn_half[:, None] & torn_half[members]
    built.law.intact.assign(np.ascontiguousarray(pack((members >= 0) & ~lost).T))
    return lost
