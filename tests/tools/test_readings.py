"""The published laws with one area a point, as the papers count, and with half areas on edges."""

import pytest
from readings import EXAMPLES, READINGS, page, run

from warp_pd import BondAssociated, Fixed, Gent, NeoHookean, Neural, Relaxation, Sheet, Simulation


@pytest.mark.parametrize(("title", "scene", "name", "_printed", "further"), EXAMPLES[:2], ids=["6.1", "6.2"])
def test_the_error_of_the_published_force_is_that_of_half_areas(title, scene, name, _printed, further):
    rows = {}
    for reading in list(READINGS)[:3]:
        rows[reading] = run(scene, name, {"points": 21, "horizon": 3.15, **further, **READINGS[reading]}, "cpu")
    whole, shared, own = (abs(row["error"]) for row in rows.values())
    assert whole < 0.025 and shared > 3.0 * whole
    assert own != whole
    line = page([*rows.values()], 21)[2 + [example[0] for example in EXAMPLES].index(title)]
    assert line.startswith(f"| {title} |") and "| - |" in line


@pytest.mark.parametrize("law", [
    BondAssociated(Gent(1e3, 1e5, 160.0), 3.15, weights="published"),
    Neural(NeoHookean(1e3, 1e5), 3.15, evaluation="closed_form", weights="published"),
], ids=["bond-associated", "neural"])  # fmt: skip
def test_published_weights_on_half_areas_are_noted(law):
    for areas, noted in (("shared", True), ("whole", False)):
        sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1e3, points=9, areas=areas)
        built = Simulation(sheet, law, Relaxation(), loads=[Fixed(sheet.edges("all"))]).build("cpu")
        said = [note for note in built.law.notes([], None) if "half areas" in note]
        assert bool(said) is noted
