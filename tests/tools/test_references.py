"""The finite elements and the inflated disc are right by themselves, and the stored references are theirs."""

import json
from pathlib import Path

import numpy as np
import pytest
from references import __main__ as run
from references import lifted_sheet, shooting, stretched_sheet, torn_sheets

from warp_pd.scenes import edge_notch, flaw_sensitivity, pressure_dynamic, trousers

STORED = Path(__file__).parents[1] / "references"
DATA = Path(__file__).parents[1] / "papers" / "references" / "data"
SHEET, DISC = (json.loads((STORED / name).read_text()) for name in ("stretch.json", "disc.json"))


# Stretched sheets --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("defect", ["hole", "crack"])
def test_a_uniform_gradient_is_a_patch_without_inner_forces(defect):
    """Curved and graded elements, sheared and stretched: forces arise on the outline alone."""
    membrane = stretched_sheet.Quarter(stretched_sheet.grid(defect, 3), defect, "planar", mu=1.0).membrane
    membrane.displacement = membrane.nodes @ np.array([[0.8, 0.3], [-0.1, 0.4]]).T
    force = membrane.forces()
    x, y = membrane.nodes.T
    inside = (x > 1e-9) & (y > 1e-9) & (np.maximum(x, y) < stretched_sheet.HALF - 1e-9)
    inside &= (np.hypot(x, y) > stretched_sheet.RADIUS + 1e-9) | (defect == "crack")
    assert inside.sum() > 25
    assert np.abs(force[inside]).max() < 1e-13 * np.abs(force).max() * force.size
    assert np.abs(force).max() > 1e-4


@pytest.mark.parametrize("mode", stretched_sheet.MODES)
def test_the_sheet_without_a_defect_is_exact(mode):
    quarter = stretched_sheet.Quarter(stretched_sheet.grid("none", 2), "none", mode)
    quarter.stretch_to(2.0)
    third = {"equibiaxial": 0.25, "planar": 0.5, "uniaxial": 0.5**0.5}[mode]
    area = 2.0 * stretched_sheet.HALF * stretched_sheet.THICKNESS
    assert quarter.quantities()["force_x"] == pytest.approx(
        stretched_sheet.MU * area * (2.0 - third**2 / 2.0), rel=1e-10
    )


def test_a_clamped_sheet_of_yeohs_material_is_exact():
    grid = stretched_sheet.grid("none", 2)
    quarter = stretched_sheet.Quarter(grid, "none", "equibiaxial", "clamp", 2.0 * run.C10, run.C20 / run.C10)
    quarter.stretch_to(2.0)
    first = 2.0 * 2.0**2 + 2.0**-4 - 3.0
    stress = 2.0 * (run.C10 + 2.0 * run.C20 * first) * (2.0 - 2.0**-5)
    assert quarter.quantities()["force_x"] == pytest.approx(stress * 0.5 * 0.01, rel=1e-10)


@pytest.mark.parametrize(("defect", "mode"), [("hole", "planar"), ("crack", "planar"), ("inclusion", "equibiaxial")])
def test_coarse_meshes_find_the_stored_force_within_their_own_estimate(defect, mode):
    solved = stretched_sheet.converged(defect, mode, (2, 4, 8), [1.5], step=0.25)
    values = solved[1.5]["force_x"]
    stored = SHEET[defect][mode]["1.5"]["force_x"]
    value, error, _ = stretched_sheet.richardson(values)
    assert abs(value - stored["value"]) < error < 1e-3 * value
    assert values[-1] == pytest.approx(stored["meshes"][SHEET["meshes"].index(8)], rel=1e-9)


def test_coarse_meshes_of_the_clamped_sheet_find_the_stored_force():
    meshes = run.visco((2, 4, 8))["hole"]["1.5"]["force_x"]["meshes"]
    stored = json.loads((STORED / "visco.json").read_text())
    assert meshes[-1] == pytest.approx(stored["hole"]["1.5"]["force_x"]["meshes"][stored["meshes"].index(8)], rel=1e-9)


def test_stored_forces_and_openings_are_converged():
    quantities = [
        (defect, name, q)
        for defect in stretched_sheet.DEFECTS[1:]
        for mode in ("equibiaxial", "planar")
        for names in SHEET[defect][mode].values()
        for name, q in names.items()
    ]
    assert len(quantities) == 4 * 2 * (4 + 4 + 2)
    for defect, name, q in quantities:
        # The tip of the crack moves by as little as 0.1 mm.
        assert q["error"] < (1e-6 * q["value"] if name.startswith("force") else 1e-6), (defect, name)


def test_stored_forces_of_uniaxial_sheets_are_converged_to_four_digits():
    forces = [q["force_x"] for d in stretched_sheet.DEFECTS[1:] for q in SHEET[d]["uniaxial"].values()]
    assert len(forces) == 3 * 4
    assert all(force["error"] < 2e-4 * force["value"] for force in forces)


def test_the_limit_of_a_known_order_is_found():
    values = [7.0 + 3.0 * h**3.5 for h in (0.4, 0.2, 0.1)]
    limit, error, order = stretched_sheet.richardson(values)
    assert limit == pytest.approx(7.0, rel=1e-12)
    assert order == pytest.approx(3.5)
    assert error == pytest.approx(abs(values[-1] - 7.0), rel=1e-3)
    assert stretched_sheet.richardson([1.0, 2.0, 4.0])[:2] == pytest.approx((4.0, 2.0))


# Moving sheets -----------------------------------------------------------------------------------------------------


def test_coarse_elements_come_near_the_stored_field_of_the_lifted_sheet():
    """The relaxed energy, to the end of the first snapshot; 5.0 % from 50 to 200 elements."""
    exact = np.load(DATA / "out_of_plane.npz")["relaxed_u_t1.5"]
    found = lifted_sheet.snapshots(lifted_sheet.lifted(50, relaxed=True), (1.5,))[0]
    assert np.linalg.norm(found - exact) < 0.055 * np.linalg.norm(exact)
    coarse = lifted_sheet.snapshots(lifted_sheet.lifted(10, relaxed=True), (1.5,))[0]
    kept = exact[:, ::5, ::5]
    assert np.linalg.norm(coarse - kept) > 0.1 * np.linalg.norm(kept)


def test_elements_under_sudden_pressure_give_the_reference_of_the_scene():
    """Largest deflections of NN 6.1 with 50 elements along a side; the scene has those of 100."""
    found = lifted_sheet.snapshots(lifted_sheet.under_pressure(50), list(pressure_dynamic.LARGEST))
    largest = [np.abs(displacement[2]).max() for displacement in found]
    assert largest == pytest.approx(list(pressure_dynamic.LARGEST.values()), rel=0.011)


# The inflated disc -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", run.MATERIALS)
def test_the_disc_finds_its_stored_curve(name):
    for stored in DISC[name]["curve"][::3]:
        disc = shooting.at_stretch(stored["stretch"], run.MATERIALS[name])
        assert stored["error"] < 1e-8
        for quantity in ("pressure", "deflection", "volume", "energy"):
            assert getattr(disc, quantity) == pytest.approx(stored[quantity], rel=1e-9), quantity


def test_the_disc_under_a_pressure_is_found_again_on_both_branches():
    for place, bracket in ((5, (1.0001, 2.0)), (9, (2.3, 5.0))):
        stored = DISC["neo-Hookean"]["curve"][place]
        disc = shooting.inflated_disc(stored["pressure"], bracket=bracket)
        assert disc.stretch == pytest.approx(stored["stretch"], rel=1e-9)
        assert disc.deflection == pytest.approx(stored["deflection"], rel=1e-9)


def test_the_pressure_of_the_disc_has_its_maximum():
    stored = DISC["neo-Hookean"]["maximum"]
    assert shooting.maximum().pressure == pytest.approx(stored["pressure"], rel=1e-9)
    for stretch in (0.98, 1.02):
        assert shooting.at_stretch(stretch * stored["stretch"]).pressure < stored["pressure"]
    with pytest.raises(ValueError, match="no maximum"):
        shooting.maximum(run.MATERIALS["Mooney-Rivlin"])


@pytest.mark.parametrize("name", run.MATERIALS)
def test_the_pressure_is_the_derivative_of_the_energy_by_the_volume(name):
    """Energy plays no part in the equations that are integrated: an error of theirs would show here."""
    for stretch in (1.1, 1.5, 2.0, 3.0):
        low, high = (shooting.at_stretch(stretch + d * (stretch - 1.0), run.MATERIALS[name]) for d in (-3e-4, 3e-4))
        middle = shooting.at_stretch(stretch, run.MATERIALS[name]).pressure
        assert (high.energy - low.energy) / (high.volume - low.volume) == pytest.approx(middle, rel=2e-7)


def test_the_profile_runs_from_the_top_to_the_rim():
    disc = shooting.inflated_disc(1.0)
    r = np.linspace(0.0, 1.0, 201)
    radius, height = disc.profile(r)
    assert height[0] == pytest.approx(disc.deflection, rel=1e-9)
    assert (radius[0], radius[-1], height[-1]) == pytest.approx((0.0, 1.0, 0.0), abs=1e-9)
    assert np.pi * np.trapezoid(radius**2, -height) == pytest.approx(disc.volume, rel=1e-4)
    with pytest.raises(ValueError, match="expected a stretch above 1"):
        shooting.at_stretch(1.0)


# Torn sheets -------------------------------------------------------------------------------------------------------


def test_the_release_rate_is_the_change_of_the_energy_by_the_length_of_the_crack():
    """Two cracks of almost the same length; the energy density at the points of integration is summed."""

    def energy(ratio):
        ((quarter, _),) = torn_sheets.stretched_squares(ratio, (1.3,), 12)
        C = quarter._stressed()[2]
        return float((quarter.material.energy(C[0] + C[1], C[0] * C[1] - C[2] ** 2) * quarter.weights).sum())

    (factor,) = torn_sheets.flawed(0.3, (1.3,), cells=12)
    density = 0.5 * (2.0 * 1.3**2 + 1.3**-4.0 - 3.0)
    # A quarter of the sheet has half of each crack face: G of the half is twice what it loses.
    lost = 2.0 * (energy(0.29) - energy(0.31)) / 0.02
    assert factor * 2.0 * np.pi * 0.3 * density == pytest.approx(lost, rel=0.01)


def test_scenes_hold_the_stored_release_rates():
    torn = json.loads((STORED / "torn.json").read_text())
    for scene, stored in ((edge_notch, torn["tension_field"]), (flaw_sensitivity, torn["squares"])):
        assert [float(ratio) for ratio in stored] == list(scene.RATIOS)
        np.testing.assert_allclose(scene.FACTORS, list(stored.values()), atol=0.006)
    assert list(edge_notch.STRETCHES) == torn["stretches"]
    assert list(flaw_sensitivity.STRETCHES) == torn["square_stretches"]
    assert torn["trousers"][-1]["over_formula"] == pytest.approx(trousers.MORE, abs=1e-3)
    assert torn_sheets.flawed(0.2, (1.2,))[0] == pytest.approx(torn["squares"]["0.2"][2], abs=1e-3)
    assert torn_sheets.notched(0.3, (1.3,), cells=8)[0] == pytest.approx(
        (torn["full_energy"]["0.3"][3], torn["tension_field"]["0.3"][3]), rel=0.02
    )
