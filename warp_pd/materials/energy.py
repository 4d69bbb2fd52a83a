"""Energy density of a material on the host, and the stretches beyond which it is unstable."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..device.checks import InputError, one_of
from ..device.cores import load_kernel, start_warp
from .protocols import Material, capabilities, check_material, padded_constants

# Strain at which a material of tension field theory is taut, whatever it was at rest.
SMALL_STRAIN = 0.01


def energy_density(material: Material, first: Any, second: Any, device: Any = None) -> np.ndarray:
    """Energy per reference volume of a sheet in plane stress [J/m^3], float64; NaN where it is undefined.

    Args:
        material: Any continuum hyperelastic material.
        first: Principal stretches along one axis [-], any shape.
        second: The same along the other axis; shapes broadcast.
        device: Warp device that evaluates the material; by default Warp's own.

    Raises:
        InputError: for any other material.
    """
    import warp as wp

    from ..kernels.materials import energy_density as kernel_of

    check_material(material, "functions")
    start_warp()
    first, second = np.broadcast_arrays(np.asarray(first, float), np.asarray(second, float))
    functions = material.functions
    given: list[Any] = [wp.array(values.ravel(), dtype=wp.float64, device=device) for values in (first, second)]
    out = wp.empty(first.size, dtype=wp.float64, device=device)
    known = padded_constants(material)
    constants = wp.types.vector(length=len(known), dtype=wp.float64)(*known)
    kernel = kernel_of(functions)
    load_kernel(kernel, wp.get_device(device))
    wp.launch(kernel, first.size, inputs=[*given, constants, out], device=device)
    return np.asarray(out.numpy().reshape(first.shape))


def cauchy_stress(material: Material, gradients: np.ndarray, device: Any = None) -> np.ndarray:
    """Cauchy stress of a sheet in plane stress without its rotation, U S U / J [Pa], shape (n, 2, 2).

    Args:
        material: A continuum hyperelastic material that has a `volume`.
        gradients: Deformation gradients, shape (n, 2, 2) or (n, 3, 2).
        device: Warp device that evaluates the material; by default Warp's own.

    Raises:
        InputError: for any other material.
    """
    import warp as wp

    from ..kernels.materials import stress_and_volume

    check_material(material, "functions")
    volume = capabilities(material).volume
    if volume is None:
        raise InputError(f"Cauchy stress: {type(material).__name__} has no volume: expected another material")
    start_warp()
    C = gradients.swapaxes(1, 2) @ gradients
    known = padded_constants(material)
    constants = wp.types.vector(length=len(known), dtype=wp.float64)(*known)
    kernel: Any = stress_and_volume(material.functions, volume)
    load_kernel(kernel, wp.get_device(device))
    strain: Any = wp.array(C - np.eye(2), dtype=wp.mat22d, device=device)
    found, change = (wp.empty(len(C), dtype=kind, device=device) for kind in (wp.mat22d, wp.float64))
    wp.launch(kernel, len(C), inputs=[strain, constants, found, change], device=device)
    squares, axes = np.linalg.eigh(C)
    U = np.einsum("nab,nb,ncb->nac", axes, np.sqrt(squares), axes)
    return np.asarray(U @ found.numpy() @ U / np.sqrt(1.0 + change.numpy())[:, None, None])


def largest_energy_density(material: Material, first: Any, second: Any, device: Any = None) -> np.ndarray:
    """As `energy_density`; of a ByRegion the largest of its materials."""
    materials = capabilities(material).materials or (material,)
    return np.asarray(np.max([energy_density(each, first, second, device) for each in materials], axis=0))


def modulus_in_tension(material: Material, device: Any = None) -> float:
    """dS11/dC11 at a small stretch [Pa], of a ByRegion the largest: the scale of stress of a sheet that is slack."""
    return float(largest_energy_density(material, 1.0 + SMALL_STRAIN, 1.0, device)) / SMALL_STRAIN**2


def shear_modulus(material: Material) -> float:
    """Shear modulus of a material at rest [Pa], of a ByRegion the largest, for scales."""
    found = []
    for each in capabilities(material).materials or (material,):
        known = capabilities(capabilities(each).resisting or each).shear_modulus
        found.append(0.5 * modulus_in_tension(each, "cpu") if known is None else known)
    return max(found)


def tension_energy_density(material: Material, stretch: Any, device: Any = None) -> np.ndarray:
    """Energy per reference volume of a TensionField sheet in uniaxial tension [J/m^3].

    A wrinkled sheet, narrower than in uniaxial tension, has the same energy.
    """
    return energy_density(material, stretch, 0.5 / np.sqrt(stretch), device)


def stretch_of_density(density: Callable[[np.ndarray], np.ndarray], wanted: float, stretches: np.ndarray) -> float:
    """Stretch [-] at which an increasing energy density equals a value [J/m^3], to round-off; NaN outside the range.

    Searched are increasing stretches up to the first with NaN density.
    """
    values = density(stretches)
    usable = borne(values)
    if usable == 0 or not values[0] <= wanted <= values[usable - 1]:
        return float("nan")
    stretches, values = stretches[:usable], values[:usable]
    for _ in range(8):
        at = min(int(np.searchsorted(values, wanted, side="right")), len(values) - 1)
        stretches = np.linspace(stretches[at - 1], stretches[at], 30)
        values = density(stretches)
    return float(stretches[int(np.argmin(np.abs(values - wanted)))])


def borne(values: np.ndarray) -> int:
    """Number of values before the first NaN or Inf."""
    return int(np.logical_and.accumulate(np.isfinite(values)).sum())


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


def material_doubts(material: Any) -> list[str]:
    """Constants of the materials of a law that cannot be meant, for the note on sizes."""
    materials = capabilities(material).materials or (material,)
    return [doubt for each in materials for doubt in capabilities(capabilities(each).resisting or each).doubts]


def _notes_of(material: Any) -> list[str]:
    known = capabilities(material)
    if known.stable or known.by_point is not None or known.remembers is not None or not hasattr(material, "functions"):
        return []
    ends = {loading: stable_to(material, loading) for loading in POWERS}
    text = ", ".join(f"{loading} {end:.3g}" for loading, end in ends.items() if end < float("inf"))
    name = type(material).__name__
    return [f"{name}: the material is unstable beyond these stretches: {text}"] if text else []
