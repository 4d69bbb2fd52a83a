"""Stretches beyond which a material is unstable, by its energy."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..device.checks import one_of
from .energy import borne, energy_density
from .protocols import capabilities

# Principal stretches of a loading by stretch l: l^first, l^second.
POWERS = {"uniaxial": (1.0, -0.5), "planar": (1.0, 0.0), "equibiaxial": (1.0, 1.0)}
# Largest stretch and number of stretches at which energies are compared; their step in the logarithmic stretch.
MOST_STRETCH, STRETCHES, STEP = 20.0, 2001, 2e-3
# Fraction of the larger stiffness below which the smaller one may be round-off.
ROUND_OFF = 1e-7


def stable_to(material: Any, loading: str, device: Any = "cpu") -> float:
    """Largest stretch [-] up to which a sheet of a material is stable in tension; inf if it always is.

    Stability means Drucker's condition: more strain takes more work in every direction, that is, the energy is convex
    in the logarithmic stretches. Stretches up to 20 are checked, and only those at which the energy is finite.

    Args:
        material: Any hyperelastic continuum material.
        loading: "uniaxial", "planar" or "equibiaxial".
        device: Warp device that evaluates the material.

    Raises:
        InputError: for any other material or loading.
    """
    first, second = POWERS[one_of("loading", loading, POWERS)]
    stretch = np.geomspace(1.0, MOST_STRETCH, STRETCHES)
    steps = np.array([(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)])
    one, other = (
        stretch**power * np.exp(STEP * steps[:, [k]]) for k, power in enumerate((first, second))
    )  # fmt: skip
    energy = energy_density(material, one, other, device).reshape(3, 3, -1)
    one_way = energy[2, 1] - 2.0 * energy[1, 1] + energy[0, 1]
    other_way = energy[1, 2] - 2.0 * energy[1, 1] + energy[1, 0]
    mixed = 0.25 * (energy[2, 2] - energy[2, 0] - energy[0, 2] + energy[0, 0])
    usable = borne(energy.sum(axis=(0, 1)))
    mean, apart = 0.5 * (one_way + other_way), np.hypot(0.5 * (one_way - other_way), mixed)
    round_off = np.maximum(ROUND_OFF * (np.abs(mean) + apart), 1e-14 * np.abs(energy[1, 1]))
    unstable = (mean - apart < -round_off)[:usable]
    return float(stretch[int(np.argmax(unstable))]) if unstable.any() else float("inf")


def stability_notes(material: Any) -> list[str]:
    """Notes on the stretches beyond which the materials of a law are unstable, one line each."""
    known = capabilities(material)
    materials = known.materials or (known.resisting or material,)
    return list(dict.fromkeys(note for each in materials for note in _notes_of(capabilities(each).resisting or each)))


def _notes_of(material: Any) -> list[str]:
    known = capabilities(material)
    if known.stable or known.by_point is not None or known.remembers is not None or not hasattr(material, "functions"):
        return []
    ends = {loading: stable_to(material, loading) for loading in POWERS}
    text = ", ".join(f"{loading} {end:.3g}" for loading, end in ends.items() if end < float("inf"))
    name = type(material).__name__
    return [f"{name}: the material is unstable beyond these stretches: {text}"] if text else []
