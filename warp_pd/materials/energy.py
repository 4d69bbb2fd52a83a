"""Energy density of a material on the host."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..cores import start_warp
from .protocols import Material, check_material, padded_constants


def energy_density(material: Material, first: Any, second: Any, device: Any = None) -> np.ndarray:
    """Energy per reference volume of a sheet in plane stress [J/m^3], float64; NaN where the material has none.

    Args:
        material: Any hyperelastic material of continua.
        first: Principal stretches along one axis [-], any shape.
        second: The same along the other axis; shapes broadcast.
        device: Warp device that evaluates the material; by default Warp's own.

    Raises:
        InputError: for something that is no such material.
    """
    import warp as wp

    from ..kernels.energy_density import energy_density as kernel_of

    check_material(material, "functions")
    start_warp()
    first, second = np.broadcast_arrays(np.asarray(first, float), np.asarray(second, float))
    functions = material.functions
    module = "warp_pd_energy_" + "".join(
        c if c.isalnum() else "_" for c in f"{functions.__module__}_{functions.__name__}"
    )
    given: list[Any] = [wp.array(values.ravel(), dtype=wp.float64, device=device) for values in (first, second)]
    out = wp.empty(first.size, dtype=wp.float64, device=device)
    constants = wp.types.vector(length=4, dtype=wp.float64)(*padded_constants(material))
    wp.launch(kernel_of(functions, module), first.size, inputs=[*given, constants, out], device=device)
    return np.asarray(out.numpy().reshape(first.shape))
