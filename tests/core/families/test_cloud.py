"""Families of clouds: a point without neighbours is named."""

import numpy as np
from helpers import NEO, refused, square

from warp_pd import BondAssociated, Explicit, Sheet, Simulation


def test_a_point_without_neighbours_is_named():
    points = np.vstack([square(5).points, [[0.4, 0.05]]])
    sheet = Sheet.from_points(
        points, thickness=1e-3, density=1.0, areas=np.full(26, 6e-4), triangles=square(5).triangles, spacing=0.025
    )
    with refused(match=r"points\[25\] at \[0\.4, 0\.05\] has no neighbour"):
        Simulation(sheet, BondAssociated(NEO, weights="plain"), Explicit(1.0)).build("cpu")
