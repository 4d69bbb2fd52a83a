"""What the five papers print for their examples, as arguments of the scenes: `warp-pd run SCENE --as-published`.

Law, weights, criterion, horizon, sizes and rates are the papers'. What a paper leaves open keeps the scene's default;
the docstring of the scene says what that is. docs/papers/ says what comes of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..device.checks import InputError

# The forces of BA and of NN: their own weights; one volume a point follows from these (`point_areas`).
BA: dict[str, Any] = {"horizon": 3.15, "weights": "published"}
NN: dict[str, Any] = {**BA, "force": "neural"}
VE: dict[str, Any] = {"points": 100, "horizon": 3.015, "law": "published"}

PRINTED: dict[str, dict[str, Any]] = {
    # 200 and 400 points "along the width and height" are read as two square grids; this is the coarser.
    "tension": {**BA, "points": 200, "extension": 0.1},
    "pressure": {**BA, "points": 101, "pressure": 5.0, "follower": True},
    "double_notch": {
        **BA, "points": 60, "critical_stretch": 2.0, "speed": 1.2e-3, "wrinkles": "resolved", "roughness": 0.0,
    },
    # A has no value in the paper; the scene's docstring says why it is this.
    "off_plane_load": {**BA, "points": 81, "speed": 1e-3, "travel": 0.05, "boundary_force": 1e16},
    "off_plane_tear": {
        **BA, "points": 80, "critical_stretch": 2.0, "speed": 0.4e-3, "cut": 0.03, "wrinkles": "resolved",
    },
    "pressure_static": {**NN, "points": 101, "pressure": 20.0},
    "pressure_dynamic": {**NN, "points": 101, "pressure": 20.0, "damping": 0.1, "duration": 1.0},
    "out_of_plane": {**NN, "points": 101, "wrinkles": "resolved", "duration": 4.5, "patch": 0.04},
    "precut_tear": {
        **NN, "points": 120, "critical_stretch": 1.3, "wrinkles": "resolved", "pull": 0.0125, "lift": 0.025,
        "duration": 10.5,
    },
    "ball_penetration": {
        **NN, "points": 100, "critical_stretch": 1.3, "wrinkles": "resolved", "ball_diameter": 0.15,
        "ball_speed": 0.1, "duration": 4.0,
    },
    "bimodular_bar": {"points": 200, "horizon": 3.0, "solver": "newton", "tolerance": 1e-5},
    "cantilever": {
        "points": 200, "horizon": 3.0, "load": 1000.0, "load_steps": 10, "stiffness": "tangent",
        "micromoduli": "published", "solver": "newton", "tolerance": 1e-5,
    },
    "square_wrinkles": {"points": 100, "horizon": 1.0, "pull": 5.0, "solver": "newton", "tolerance": 1e-5},
    "kapton_shear": {
        "points": 380, "horizon": 3.0, "law": "bonds", "shear": 1.6e-3, "load_steps": 1, "solver": "newton",
        "tolerance": 1e-5,
    },
    "notched_strip": {
        "points": 200, "horizon": 3.0, "law": "bonds", "compression": 0.0, "critical_strain": 6e-3,
        "solver": "newton", "increment": 1e-6, "tolerance": 1e-5,
    },
    # At its default, None, the horizon is that of the mode, 3.015 and 9.015 spacings.
    "stretch": {"points": 100, "force": "bond_based", "law": "auto"},
    "rate_test": {"rate": 0.24},
    "visco_sheet": {**VE, "rate": 0.15},
    "visco_hole": {**VE, "rate": 0.15},
    "visco_crack": {**VE, "energy": 6.69},
    "metamaterial": {**VE, "points": 120, "energy": 6.69},
}  # fmt: skip


def as_published(scene: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of a scene's `build` as its paper prints them, under those that are given.

    Args:
        scene: Name of a scene of the package, or its Python file.
        given: Arguments that the user gives; they stay.

    Raises:
        InputError: if no paper printed the scene.
    """
    if scene not in PRINTED:
        raise InputError(f"--as-published: no paper printed scene {scene!r}; expected one of {', '.join(PRINTED)}")
    printed = dict(PRINTED[scene])
    mode = given.get("mode", "equibiaxial")
    if scene == "stretch" and mode == "uniaxial":
        printed["points"] = 50
    failing = str(given.get("failure", "false")).lower() in ("true", "yes", "1")
    if scene == "metamaterial" and failing:
        # VE 6.4 and 6.8: 1 per microsecond to 190 microseconds.
        printed |= {"crack": True, "rate": 1e6, "stretch": 191.0}
    return printed | dict(given)
