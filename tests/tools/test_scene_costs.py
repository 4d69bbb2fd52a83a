"""The table of scene costs shows that features that a scene does not use cost something."""

import scene_costs


def test_a_scene_costs_less_without_features_that_it_does_not_use(tmp_path):
    page = tmp_path / "costs.md"
    scenes = ["double_notch", "pressure", "visco_sheet"]
    options = ["--scenes", *scenes, "--points", "31", "--seconds", "0.05", "--device", "cpu", "--out", str(page)]
    scene_costs.main(options)
    rows = [
        line.split("|") for line in page.read_text().splitlines() if line.startswith(tuple(f"| {s}" for s in scenes))
    ]
    assert len(rows) == 3
    for row in rows:
        for column in (3, 4, 5):
            needs, full = (float(x) for x in row[column].split("/"))
            assert needs < full
