"""IM: Li, Zheng, Zhang, Ye and Zhang, Acta Mech. Sin. 35(6), 2019."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from study import picture

from papers.rows import Example, Row, Values, run_scene, scene_values, where_passed

RATIOS = (1, 5, 10, 20)
TOLERANCES = (0.03, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5)
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


def relaxed(ratio: int, device: str | None) -> Values:
    """IM 6.2, figure 10: end of the beam by dynamic relaxation, at ever smaller unbalanced forces, and by Newton."""
    implicit = scene_values("cantilever", device, ratio=ratio)
    if "why" in implicit:
        return implicit
    found: Values = {"Newton": implicit["end_down"]}
    for tolerance in TOLERANCES:
        explicit = scene_values(
            "cantilever", device, ratio=ratio, solver="relaxation", load_steps=1, tolerance=tolerance
        )  # fmt: skip
        if "why" in explicit:
            return {**found, "why": explicit["why"]}
        found |= {f"steps to {tolerance:g}": explicit["steps"], f"end at {tolerance:g}": explicit["end_down"]}
    found["explicit steps"] = found[f"steps to {TOLERANCES[-1]:g}"]
    found["explicit over implicit"] = found[f"end at {TOLERANCES[-1]:g}"] / implicit["end_down"]
    return found


def relaxation_picture(path: Path, stored: Mapping[str, Any]) -> None:
    """Figure 10: the end of the beam against the steps of dynamic relaxation."""
    with picture(path) as axes:
        for ratio in RATIOS:
            found = stored.get(f"im.6.2.{ratio}.explicit", {}).get("values", {})
            found = {} if "why" in found else found
            steps = [found[f"steps to {tolerance:g}"] for tolerance in TOLERANCES if found]
            (line,) = axes[0, 0].plot(
                steps, [found[f"end at {t:g}"] for t in TOLERANCES if found], "o-", label=f"c+/c- = {ratio}"
            )
            if found:
                axes[0, 0].axhline(found["Newton"], color=line.get_color(), linestyle=":")
        axes[0, 0].set(xlabel="steps of dynamic relaxation", ylabel="end of the beam along y (m); dotted: Newton")
        axes[0, 0].legend()


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
    **{f"im.6.2.{ratio}.explicit": partial(relaxed, ratio) for ratio in RATIOS},
    "im.6.3": partial(scene_values, "square_wrinkles"),
    "im.6.3.wide": partial(scene_values, "square_wrinkles", horizon=3.0),
    **{f"im.6.4.{spacings}": partial(kapton, horizon=float(spacings)) for spacings in (2, 3, 4)},
    # By Newton's method bonds break in equilibrium, which is not found beyond 2.7e-4 m (docs/papers/im.md).
    "im.6.5": partial(notched, solver="explicit"),
    "im.6.5.held": partial(notched, ends="held", solver="explicit"),
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
    *(
        Row(f"im.6.2.{ratio}.explicit", "6.2, figures 8, 9", f"end by relaxation over end by Newton, c+/c- = {ratio}",
            "in good agreement", "explicit over implicit", low=0.99, high=1.01)
        for ratio in RATIOS
    ),
    *(
        Row(f"im.6.2.{ratio}.explicit", "6.2, figure 10", f"steps of relaxation, c+/c- = {ratio}", "9000 to 13 000",
            "explicit steps", "to a residual of 1e-5, at this project's step", low=9000.0, high=13000.0)
        for ratio in RATIOS
    ),
    Row("im.6.2.1", "6.2, figure 9", "end of the beam against finite elements, down (%)", "no elements printed",
        "end_down, error", "c+/c- = 1", scale=100.0),
    Row("im.6.3", "6.3, figure 15", "wrinkled share of the points (%)", "wrinkled at the edges", "wrinkled_share",
        "horizon as printed, one spacing", low=0.1, scale=100.0),
    Row("im.6.3.wide", "6.3, figure 15", "wrinkled share of the points (%)", "wrinkled at the edges", "wrinkled_share",
        "horizon of three spacings", low=0.1, scale=100.0),
    Row("im.6.3", "6.3", "Newton steps", "6", "steps", "horizon as printed, one spacing", value=6.0, within=0.2),
    Row("im.6.3.wide", "6.3", "Newton steps", "6", "steps", "horizon of three spacings", value=6.0, within=0.2),
    Row("im.6.4.3", "6.4", "Newton steps", "16", "steps", "one load step", value=16.0, within=0.2),
    *(
        Row(f"im.6.4.{spacings}", "6.4, figure 18", f"largest stress over tension field theory at {spacings} spacings",
            "above 1, more so at large horizons", "over theory", low=1.0)
        for spacings in (2, 3, 4)
    ),
    *(
        Row(f"im.6.5{run}", "6.5, figure 21", f"crack at Ux = {u * 1e4:g}e-4 m (mm)", "between 0 and 34, growing",
            f"crack_length at {u:g}", reading, low=1e-3, high=33e-3, scale=1e3)
        for run, reading in (
            ("", "free ends, pulled slowly"),
            (".held", "held ends, pulled slowly"),
            (".field", "tension field, not the paper's"),
        )
        for u in SHOWN
    ),
]  # fmt: skip
