"""Constants from a curve. The fit needs no simulation, since tension is uniform."""

import numpy as np

from warp_pd import Yeoh
from warp_pd.fitting import Curve, UniformTests, fit

EXACT = {"c10": 2e5, "c20": 5e3}


def build():
    """Fit a Yeoh rubber to a curve in uniaxial tension, here one without noise."""
    stretch = np.linspace(1.1, 3.0, 12)
    shear = stretch**2 + 2.0 / stretch - 3.0
    stress = 2.0 * (stretch - stretch**-2) * (EXACT["c10"] + 2.0 * EXACT["c20"] * shear)
    tests = UniformTests(Yeoh, [Curve("uniaxial", stretch, "stress", stress, name="tension")])
    return fit(tests, ["c10", "c20"], start={"c10": 1e5, "c20": 1e3})
