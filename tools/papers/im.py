"""IM: Li, Zheng, Zhang, Ye and Zhang, Acta Mech. Sin. 35(6), 2019."""

from __future__ import annotations

from functools import partial
from typing import Any

from papers.rows import Example, Row, Values, run_scene, scene_values, where_passed

RATIOS = (1, 5, 10, 20)
SHOWN = (2.1e-4, 2.4e-4, 2.7e-4, 3.0e-4)
# Tension field theory, 6.4: largest stress on the middle line [Pa], tools/finite_elements.py.
TENSION_FIELD = 22.6e6


def cantilever(ratio: int, device: str | None, **settings: Any) -> Values:
    """IM 6.2: the end, Newton steps a load step, and whether all of them converge."""
    found = scene_values("cantilever", device, ratio=ratio, **settings)
    found["converges"] = 0 if "why" in found else 1
    if "steps" in found:
        found["steps a load step"] = found["steps"] / 10.0
    return found


def both_solvers(device: str | None) -> Values:
    """IM 6.2: the end of the beam of ratio 5 by Newton's method and by dynamic relaxation, and steps of that."""
    implicit = scene_values("cantilever", device, ratio=5)
    explicit = scene_values("cantilever", device, ratio=5, solver="relaxation", load_steps=1)
    return {
        "explicit over implicit": explicit["end_down"] / implicit["end_down"],
        "explicit steps": explicit["steps"],
        "why": explicit.get("why", ""),
    }


def kapton(device: str | None, **settings: Any) -> Values:
    """IM 6.4: stresses of the middle line over those of tension field theory."""
    found = scene_values("kapton_shear", device, **settings)
    if "middle_largest_stress" in found:
        found["over theory"] = found["middle_largest_stress"] / TENSION_FIELD
    return found


def notched(device: str | None, **settings: Any) -> Values:
    """IM 6.5: the crack at the paper's displacements."""
    found, result = run_scene("notched_strip", device, **settings)
    return found | where_passed(result, "end_displacement", SHOWN, ("crack_length", "mean_wrinkle_level"))


EXAMPLES: dict[str, Example] = {
    **{f"im.6.1.{ratio}": partial(scene_values, "bimodular_bar", ratio=ratio) for ratio in (1, 5, 10)},
    **{f"im.6.2.{ratio}": partial(cantilever, ratio) for ratio in RATIOS},
    **{f"im.6.2.{ratio}.constant": partial(cantilever, ratio, stiffness="constant") for ratio in RATIOS},
    "im.6.2.explicit": both_solvers,
    "im.6.3": partial(scene_values, "square_wrinkles"),
    "im.6.3.wide": partial(scene_values, "square_wrinkles", horizon=3.0),
    **{f"im.6.4.{spacings}": partial(kapton, horizon=float(spacings)) for spacings in (2, 3, 4)},
    "im.6.5": notched,
    "im.6.5.held": partial(notched, ends="held"),
    "im.6.5.field": partial(notched, law="tension_field", solver="auto"),
}

ROWS = [
    *(
        Row(f"im.6.1.{ratio}", "6.1, figures 5, 6", f"L2 error at c-/c+ = {ratio} (%)", "fits well",
            "displacement_error", high=0.01, scale=100.0)
        for ratio in (1, 5, 10)
    ),
    *(
        Row(f"im.6.2.{ratio}", "6.2, table 2", f"Newton steps a load step, c+/c- = {ratio}, tangent", "about 20 in all",
            "steps a load step", "ratios of the tables, c+/c-", high=20.0)
        for ratio in RATIOS
    ),
    *(
        Row(f"im.6.2.{ratio}.constant", "6.2, table 1", f"all load steps converge, c+/c- = {ratio}, constant stiffness",
            "yes" if ratio == 1 else "no, errors oscillate", "converges", "directions of now, no geometric part",
            low=1.0 if ratio == 1 else 0.0, high=1.0 if ratio == 1 else 0.0)
        for ratio in RATIOS
    ),
    Row("im.6.2.explicit", "6.2, figures 8, 9", "end by relaxation over end by Newton", "in good agreement",
        "explicit over implicit", "c+/c- = 5", low=0.999, high=1.001),
    Row("im.6.2.explicit", "6.2, figure 10", "steps of relaxation", "9000 to 13 000", "explicit steps",
        "c+/c- = 5, all loads at once, this project's step", low=9000.0, high=13000.0),
    Row("im.6.2.1", "6.2, figure 9", "end of the beam against finite elements, down (%)", "no elements printed",
        "end_down, error", "c+/c- = 1", low=-0.01, high=0.01, scale=100.0),
    Row("im.6.3", "6.3, figure 15", "wrinkled share of the points (%)", "wrinkled at the edges", "wrinkled_share",
        "horizon as printed, one spacing", low=0.1, scale=100.0),
    Row("im.6.3.wide", "6.3, figure 15", "wrinkled share of the points (%)", "wrinkled at the edges", "wrinkled_share",
        "horizon of three spacings", low=0.1, scale=100.0),
    Row("im.6.3", "6.3", "Newton steps", "6", "steps", "horizon as printed, one spacing", value=6.0, within=0.2),
    Row("im.6.3.wide", "6.3", "Newton steps", "6", "steps", "horizon of three spacings", value=6.0, within=0.2),
    Row("im.6.4.3", "6.4", "Newton steps", "16", "steps", "one load step", value=16.0, within=0.2),
    *(
        Row(f"im.6.4.{spacings}", "6.4, figure 18", f"largest stress over tension field theory, {spacings} spacings",
            "above 1, more so at large horizons", "over theory", low=1.0)
        for spacings in (2, 3, 4)
    ),
    *(
        Row(f"im.6.5{run}", "6.5, figure 21", f"crack at Ux = {u * 1e4:g}e-4 m (mm)", "between 0 and 34, growing",
            f"crack_length at {u:g}", reading, low=1e-3, high=33e-3, scale=1e3)
        for run, reading in (("", "free ends"), (".held", "held ends"), (".field", "tension field, not the paper's"))
        for u in SHOWN
    ),
]  # fmt: skip
