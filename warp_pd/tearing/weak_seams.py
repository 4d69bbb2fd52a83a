"""Energy of a tear in a weak seam that is narrower than the damaged zone of the tear."""

from __future__ import annotations

import numpy as np

# Excess of a tear over the tearing energy of its seam above which a note says so: tears of even sheets have as much.
MIXED = 0.05


def narrow_seam(energy: np.ndarray, places: np.ndarray, spacing: float, length: float, resolved: float) -> list[str]:
    """Note if the energy is low over a width less than that damaged by a tear (2 lengths to each side); else none.

    Args:
        energy: Tearing energy of each point [J/m^2], shape (N,).
        places: The points [m], shape (N, 2) or (N, 3).
        spacing: Spacing of the sheet [m].
        length: Length of the damage field [m].
        resolved: The length that the spacing resolves [m].
    """
    from scipy.optimize import brentq
    from scipy.spatial import cKDTree

    weak = energy < np.sqrt(energy.min() * energy.max())
    if not weak.any():
        return []
    half = float(cKDTree(places[~weak]).query(places[weak])[0].max()) - 0.5 * spacing
    ratio = float(np.median(energy[~weak]) / np.median(energy[weak]))
    factor = seam_energy(ratio, half / length)
    if factor <= 1.0 + MIXED:
        return []
    needed = half / brentq(lambda width: seam_energy(ratio, width) - 1.0 - MIXED, 0.0, 2.0)
    return [
        f"the tearing energy is low over a width of {2.0 * half:.3g} m, and a tear damages {4.0 * length:.3g} m: it "
        f"takes about {factor:.3g} times the energy there; {1.0 + MIXED:g} times with a length of {needed:.3g} m, "
        f"which a spacing of {spacing * needed / resolved:.3g} m resolves"
    ]


def seam_energy(ratio: float, half: float) -> float:
    """Minimum energy of a tear in the middle of a straight seam, divided by the tearing energy of the seam.

    The energy of the field with d = 1 in the middle is minimal for d'' = 1/2 (in units of the length), with a kink at
    the edge of the seam, and d = d' = 0 at the end of the damage. `ratio` is the tearing energy beside the seam over
    that in it, `half` half the width of the seam over the length.
    """
    if half >= 2.0:
        return 1.0
    beyond = np.sqrt((ratio * half) ** 2 + 4.0 - half**2) - ratio * half
    slope = -0.5 * (ratio * beyond + half)
    damage = half + 0.5 * slope * half**2 + (half**3 + ratio * beyond**3) / 12.0
    return float(0.75 * (0.5 * damage - slope))
