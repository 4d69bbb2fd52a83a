"""Tears of the study: a small run has what its table shows."""

from tears import TEARS, flaws, flaws_table, found, run, scenes_table, strips, strips_table

from warp_pd.scenes import flaw_sensitivity, pure_shear_tear


class Options:
    rows, horizons, energies, grids, materials = [8], [2.015], [2.0], ["45"], ("neo_hookean",)
    set = ("duration=0.2",)


def test_a_strip_has_an_onset_and_a_balance():
    ((scene, settings),) = strips(Options)
    row = run(scene, {**settings, "frames": 10}, "cpu")
    assert row["status"] == "finished"
    assert row["worst_energy_balance"] < 0.05
    assert row["settings"]["turn"] == 45.0
    assert found([row], "pure_shear_tear", row["settings"]) is row
    assert {f"onset_{n}" for n in (1, 3, 6, 10)} < set(row)
    assert strips_table([row])[-1].startswith("| neo_hookean | 2.015 | 8 | 1 | 1 |")


def test_all_strips_are_those_of_every_material_and_none_comes_twice():
    class All:
        rows = horizons = energies = grids = materials = None
        set = ()

    chosen = [settings for _, settings in strips(All)]
    assert len(chosen) == 336 and all(chosen.count(settings) == 1 for settings in chosen)
    assert {settings.get("material", "neo_hookean") for settings in chosen} == set(pure_shear_tear.MATERIALS)


def test_a_strip_that_fails_is_a_row_that_says_why():
    row = run("pure_shear_tear", {"points": 8, "duration": 0.2, "frames": 10, "damage_length": 1e-3}, "cpu")
    assert row["status"] == "failed" and "TearingEnergy.length" in row["notes"][0]
    assert strips_table([{**row, "settings": {"points": 8, "horizon": 2.015}}])[-1].startswith(
        "| neo_hookean | 2.015 | 8 | 1 | 0 |"
    )


def test_the_spread_over_grids_and_the_last_change_are_told_where_there_are_runs():
    tear = TEARS[0]
    runs = [*zip(tear.by_grid(), (1.0, 1.5), strict=False), (tear.by_points()[-1], 3.0)]
    rows = [{"scene": tear.scene, "settings": settings, tear.number: value} for settings, value in runs]
    first, second = scenes_table(rows)[2:4]
    assert first.endswith("| 100.0 % | 1, 1.5, -, -, - | 40.0 % |")
    assert f"{tear.points[-2]}: 1, {tear.points[-1]}: 3" in first and f"{tear.points[0]}: -" in first
    assert second.endswith("| - |")
    assert not found(rows, tear.scene, {})


def test_flaws_from_none_to_a_hundred_lengths_have_a_line_each():
    runs = [settings for _, settings in flaws(Options)]
    ratios = sorted(settings["flaw"] / settings["damage_length"] for settings in runs)
    assert ratios[0] == 0.0 and 0.05 < next(r for r in ratios if r > 0.0) <= 0.1 and ratios[-1] >= 100.0
    numbers = {"stress_at_break": 3.0, "strength_ratio": 0.5, "griffith_ratio": 1.0}
    row = {"scene": "flaw_sensitivity", "settings": runs[1], **numbers}
    assert flaws_table([row, {"scene": "none"}])[2:] == ["| 1 | 10 | of the length | 0.1 | 3 | 0.5 | 1 |"]


def test_the_points_resolve_the_flaws_and_the_lengths():
    for _, settings in flaws(Options):
        spacing = flaw_sensitivity.SIDE / (settings["points"] - 1)
        assert settings["flaw"] == 0.0 or settings["flaw"] > 2.0 * spacing
        assert settings["damage_length"] > 2.0 * spacing
