"""NN: the neural-network membranes of the same group."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from network_training import determination, relative_errors, sampled_states, training_data
from study import REFERENCES

from papers.rows import Example, Row, Values, run_scene, scene_values, where_passed
from warp_pd import NeoHookean
from warp_pd.papers.neural import networks

SAMPLES, STRETCHES = 10_000, (0.8, 4.0)
ELEMENTS = REFERENCES / "out_of_plane.npz"


def accuracy(_device: str | None) -> Values:
    """The network of the package on states as in Algorithm 1 that it was not trained on."""
    data = training_data(NeoHookean(1e3, 1e5), sampled_states(STRETCHES, SAMPLES, seed=7))
    found = networks.default().evaluate(data.features)
    errors = relative_errors(found, data.forces)
    return {
        "samples": len(errors),
        "largest error": float(errors.max()),
        "accuracy": 1.0 - float(errors.max()),
        "determination": min(determination(found, data.forces)),
    }


def lifted(device: str | None, **settings: Any) -> Values:
    """NN 6.2: how far the sheet is from finite elements at the end."""
    found, result = run_scene("out_of_plane", device, **settings)
    if result is not None and "why" not in found:
        kind = "relaxed_u" if settings.get("wrinkles") == "relaxed" else "u"
        exact = np.load(ELEMENTS)[f"{kind}_t4.5"]
        # Points and nodes of the elements lie on each other, every second one.
        ours = result.frame.displacement.reshape(101, 101, 3)[::2, ::2].transpose(2, 1, 0)
        found["distance"] = float(np.linalg.norm(ours - exact) / np.linalg.norm(exact))
        found["mean"] = float(ours[2].mean() / exact[2].mean() - 1.0)
    return found


def torn(device: str | None, **settings: Any) -> Values:
    """NN 6.3: growth of the slit at the paper's times."""
    found, result = run_scene("precut_tear", device, **settings)
    return found | where_passed(result, "time", (3.0, 4.5, 6.0, 7.5, 9.0, 10.5), ("crack_growth",))


def penetrated(device: str | None, **settings: Any) -> Values:
    """NN 6.4: torn area at the paper's times."""
    found, result = run_scene("ball_penetration", device, **settings)
    return found | where_passed(result, "time", (1.0, 2.0, 3.0, 4.0), ("torn_area_share", "largest_damage"))


EXAMPLES: dict[str, Example] = {
    "nn.4": accuracy,
    "nn.6.1.static": partial(scene_values, "pressure_static"),
    "nn.6.1.static-10": partial(scene_values, "pressure_static", pressure=10.0),
    "nn.6.1.static-shared": partial(scene_values, "pressure_static", areas="shared"),
    "nn.6.1.dynamic": partial(scene_values, "pressure_dynamic"),
    "nn.6.1.dynamic-shared": partial(scene_values, "pressure_dynamic", areas="shared"),
    "nn.6.2": lifted,
    "nn.6.2.relaxed": partial(lifted, force="bond_associated", weights="auto", wrinkles="relaxed"),
    "nn.6.3": torn,
    "nn.6.3.bond-associated": partial(torn, force="bond_associated", weights="auto", wrinkles="relaxed"),
    "nn.6.4": penetrated,
    "nn.6.4.bond-associated": partial(penetrated, force="bond_associated", weights="auto", wrinkles="relaxed"),
}
WHOLE, SHARED = "one area a point", "half areas on edges"
# Ends of the colour bars of figure 8, finite elements (m), by time (s).
BARS = {0.25: 0.06, 0.5: 0.26, 0.75: 0.62, 1.0: 0.44}

ROWS = [
    Row("nn.4", "4.3", "training samples", "about 10 000", "samples", "Algorithm 1", low=9e3, high=11e3),
    Row("nn.4", "4.3", "accuracy of the network (%)", "about 99", "accuracy", "worst of 10 000 other states", low=0.99,
        scale=100.0),
    # The bar of figure 6d counts in ninths: 0.033729 m is one.
    Row("elements", "6.1, figure 6d", "deflection in finite elements at 20 Pa (m)", "9 x 0.033729", "nn.6.1.static",
        "the colour bar ends at nine steps", value=9 * 0.033729),
    Row("nn.6.1.static", "6.1, figure 7", "deflection at 20 Pa against finite elements (%)", "very close",
        "center_deflection, error", WHOLE, low=-0.01, high=0.01, scale=100.0),
    Row("nn.6.1.static-shared", "6.1, figure 7", "deflection at 20 Pa against finite elements (%)", "very close",
        "center_deflection, error", SHARED, low=-0.01, high=0.01, scale=100.0),
    Row("nn.6.1.static-10", "6.1, figure 7", "deflection at 10 Pa (m)", "a curve", "center_deflection", WHOLE),
    *(
        Row("elements", "6.1, figure 8", f"largest deflection in finite elements at {time:g} s (m)", f"{value:g}",
            f"nn.6.1.dynamic at {time:g}", "the colour bar ends there, two digits", value=value,
            within=max(0.025, 0.006 / value))
        for time, value in BARS.items()
    ),
    *(
        Row(f"nn.6.1.{run}", "6.1, figure 8", f"largest deflection at {time:g} s against finite elements (%)",
            "within 5", f"largest_deflection_at_{time:g}_s, error", reading, low=-0.05, high=0.05, scale=100.0)
        for run, reading in (("dynamic", WHOLE), ("dynamic-shared", SHARED))
        for time in BARS
    ),
    Row("nn.6.2", "6.2, figure 11", "displacements at 4.5 s off finite elements (%)", "in agreement", "distance",
        "no limit: elements of 100 and 200 a side differ by 12", high=0.12, scale=100.0),
    Row("nn.6.2", "6.2, figure 11", "mean u3 at 4.5 s off finite elements (%)", "in agreement", "mean", low=-0.05,
        high=0.05, scale=100.0),
    Row("nn.6.2.relaxed", "6.2, figure 11", "displacements at 4.5 s off finite elements (%)", "in agreement",
        "distance", "bond-associated, tension field, in both", high=0.12, scale=100.0),
    *(
        Row(f"nn.6.3{law}", "6.3, figures 13, 14", quantity, printed, name, reading, **bounds)
        for law, reading in (("", "as published"), (".bond-associated", "bond-associated, tension field"))
        for quantity, printed, name, bounds in (
            ("growth of the slit at 3 s (m)", "not yet commenced", "crack_growth at 3", {"high": 0.01}),
            ("growth of the slit at 4.5 s (m)", "propagating", "crack_growth at 4.5", {"low": 0.01}),
            ("pieces at the end", "2", "pieces", {"low": 2.0}),
        )
    ),
    *(
        Row(f"nn.6.4{law}", "6.4, figure 18", quantity, printed, name, reading, **bounds)
        for law, reading in (("", "as published"), (".bond-associated", "bond-associated, tension field"))
        for quantity, printed, name, bounds in (
            ("torn share of the sheet at 1 s (%)", "damage shown", "torn_area_share at 1", {"scale": 100.0}),
            ("torn share of the sheet at 2 s (%)", "damage shown", "torn_area_share at 2", {"scale": 100.0}),
            ("torn share of the sheet at 3 s (%)", "cracks", "torn_area_share at 3", {"low": 1e-3, "scale": 100.0}),
            ("torn share of the sheet at 4 s (%)", "cracks", "torn_area_share at 4", {"low": 1e-3, "scale": 100.0}),
        )
    ),
]  # fmt: skip
